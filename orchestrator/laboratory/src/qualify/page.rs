//! The report of a qualification and its files.

use std::path::PathBuf;

use motion::{Motion, Record};
use pages::report::identity::{entry, version};
use pages::report::{
    self, Abscissa, Axis, Cell, Fact, Panel, Report, Section, Series, Style, Table, Units,
};
use qualification::resonance::{Found, Resonance};
use qualification::{Rule, Verdict, grid};
use units::STANDARD_GRAVITY;

use super::{Plan, Qualification, Round};
use crate::error::Error;
use crate::iteration::drive_text;
use crate::results::{Out, Results};
use crate::run::identity::tuning;

/// File with everything that was found.
const JSON: &str = "qualification.json";
/// The picture of the spectra.
const PICTURE: &str = "spectra.svg";
/// Points of the spectra.
const POINTS: &str = "spectra.csv";
/// The best drive and what the table measured with it.
const DRIVE: &str = "drive.csv";
const MEASURED: &str = "measured.csv";
/// What was run.
const MANIFEST: &str = "manifest.json";
/// Curves of a spectrum have so many points per octave.
const FINE: usize = 48;

/// Name of the file of an axis' motion.
pub(super) fn motion_name(axis: usize, ending: &str) -> String {
    match axis {
        0 => format!("motion.{ending}"),
        n => format!("motion-{}.{ending}", n + 1),
    }
}

/// A motion's acceleration in PEER's format, g.
#[must_use]
pub fn motion_at2(motion: &Motion) -> String {
    let mut text = format!(
        "SHAKEBENCH MATCHED MOTION\n{}\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= {:6}, DT= {:.4} SEC\n",
        motion.name,
        motion.len(),
        motion.dt
    );
    for row in motion.acceleration.chunks(5) {
        for value in row {
            text += &format!(" {:15.7e}", value / STANDARD_GRAVITY);
        }
        text.push('\n');
    }
    text
}

fn record_text(acceleration: &[f64], dt: f64) -> String {
    let mut text = String::from("t_s,a_g\n");
    for (n, value) in acceleration.iter().enumerate() {
        let time = (n as f64 * dt * 1e9).round() / 1e9;
        text += &format!("{time},{}\n", value / STANDARD_GRAVITY);
    }
    text
}

/// Writes report, figures, motions and drive; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(plan: &Plan, found: &Qualification, folder: &Out) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    for (n, motion) in found.motions.iter().enumerate() {
        results.write_text(&motion_name(n, "csv"), &drive_text(motion))?;
        results.write_text(&motion_name(n, "AT2"), &motion_at2(motion))?;
    }
    results.write_page(report::FILE, &page(plan, found))?;
    results.write_text(JSON, &(serde_json::json!(found).to_string() + "\n"))?;
    let rule = plan.rule.at_level(found.level);
    if let Some(best) = &found.best {
        let acceleration = shown(found);
        results.write_picture(
            PICTURE,
            &spectrum_panel(&rule, acceleration, found.motions[0].dt),
        )?;
        results.write_text(POINTS, &points_text(best))?;
    }
    if let Some(drive) = &found.drive {
        results.write_text(DRIVE, &drive_text(drive))?;
        results.write_text(MEASURED, &record_text(&found.measured, drive.dt))?;
    }
    if let Some(manifest) = &found.manifest {
        results.write_text(MANIFEST, &(serde_json::json!(manifest).to_string() + "\n"))?;
    }
    Ok(results.finish()?)
}

/// What the spectrum is of: what the table measured, or the motion.
fn shown(found: &Qualification) -> &[f64] {
    match found.measured.as_slice() {
        [] => &found.motions[0].acceleration,
        measured => measured,
    }
}

fn points_text(verdict: &Verdict) -> String {
    let mut text = String::from(
        "frequency [Hz],required [g],test [g],ratio,pseudo-acceleration [g],absolute acceleration [g]\n",
    );
    for own in &verdict.points {
        text += &format!(
            "{},{},{},{},{},{}\n",
            own.frequency_hz,
            own.rrs_g,
            own.trs_g,
            own.ratio(),
            own.pseudo_g,
            own.absolute_g
        );
    }
    text
}

/// Test over required response spectrum with the tolerance.
#[must_use]
pub fn spectrum_panel(rule: &Rule, acceleration: &[f64], dt: f64) -> Panel {
    let [low, high] = rule.band_hz;
    let from = rule.points[0].frequency.max(0.3 * low).min(low);
    let frequencies = grid([from, (1.5 * high).min(0.45 / dt)], FINE, 0.0);
    let test = qualification::ratios(rule, acceleration, dt, &frequencies);
    let required = |frequencies: &[f64], factor: f64| {
        let of = |f: &f64| factor * STANDARD_GRAVITY * rule.required(*f);
        frequencies.iter().map(of).collect::<Vec<f64>>()
    };
    let at = |frequencies: &[f64]| Abscissa::At(frequencies.into());
    let band = grid(rule.band_hz, FINE, 0.0);
    let mut series = vec![
        Series::line("required", at(&frequencies), required(&frequencies, 1.0)).coloured(0),
        Series::line(
            &format!("{} of it", rule.highest_ratio),
            at(&band),
            required(&band, rule.highest_ratio),
        )
        .styled(Style::Dashed)
        .coloured(2),
    ];
    if rule.lowest_ratio < 1.0 {
        let name = format!("{} of it", rule.lowest_ratio);
        let values = required(&band, rule.lowest_ratio);
        series.push(
            Series::line(&name, at(&band), values)
                .styled(Style::Dashed)
                .coloured(6),
        );
    }
    let values = test
        .iter()
        .map(|own| own.trs_g * STANDARD_GRAVITY)
        .collect();
    series.push(Series::line("test", at(&frequencies), values).coloured(1));
    Panel {
        title: format!("Response spectra, {} % damping", percent(rule.damping)),
        x: Axis::logarithmic("frequency", Units::FREQUENCY),
        y: Axis::logarithmic(measure(rule), Units::ACCELERATION),
        series,
    }
}

fn percent(part: f64) -> f64 {
    (1e6 * part).round() / 1e4
}

fn measure(rule: &Rule) -> &'static str {
    match rule.measure {
        motion::metrics::Measure::AbsoluteAcceleration => "absolute acceleration",
        _ => "pseudo-acceleration",
    }
}

/// The rule as entries.
fn rule_entries(rule: &Rule) -> Vec<(String, Cell)> {
    let [low, high] = rule.band_hz;
    vec![
        entry("Rule", rule.name.as_str()),
        entry("Source", rule.source.as_str()),
        entry(
            "Spectrum",
            format!("{}, {} % damping", measure(rule), percent(rule.damping)),
        ),
        entry(
            "Grid",
            format!(
                "{low} to {high} Hz, {} points per octave{}",
                rule.points_per_octave,
                match rule.grids {
                    1 => String::new(),
                    n => format!(", the best of {n} grids"),
                }
            ),
        ),
        entry(
            "Tolerance",
            format!(
                "not below {}{}; above {} is reported",
                rule.lowest_ratio,
                if rule.single_points_below_1 {
                    ", below 1 only singly"
                } else {
                    ""
                },
                rule.highest_ratio
            ),
        ),
    ]
}

/// Sentence, picture and points of a spectrum.
fn spectrum_section(rule: &Rule, verdict: &Verdict, acceleration: &[f64], dt: f64) -> Section {
    let row = |own: &qualification::Ratio| {
        let remark = match own.ratio() {
            r if r < 1.0 => "below",
            r if r > rule.highest_ratio => "above",
            _ => "",
        };
        [
            Cell::Number(own.frequency_hz, 4),
            Cell::Number(own.rrs_g, 4),
            Cell::Number(own.trs_g, 4),
            Cell::Number(own.ratio(), 4),
            remark.into(),
        ]
    };
    let heads = [
        "frequency (Hz)",
        "required (g)",
        "test (g)",
        "test over required",
        "remark",
    ];
    Section {
        heading: "Test and required response spectrum".into(),
        text: vec![sentence(rule, verdict)],
        notes: verdict.warnings.clone(),
        panels: vec![spectrum_panel(rule, acceleration, dt)],
        tables: vec![Table::of(
            "Points of the grid",
            heads,
            verdict.points.iter().map(row),
        )],
        ..Section::default()
    }
}

fn sentence(rule: &Rule, verdict: &Verdict) -> String {
    let outside = match (verdict.below_1, verdict.above) {
        (0, 0) => "all points are between 1 and the reported ratio".to_string(),
        (below, above) => {
            format!(
                "{below} points are below 1 and {above} above {}",
                rule.highest_ratio
            )
        }
    };
    let verb = if verdict.envelops() {
        "envelops"
    } else {
        "falls short of"
    };
    format!(
        "The test response spectrum {verb} the required one by the bounds of this rule, computed as listed: \
         ratios of {:.3} to {:.3} at {} points, {outside}. On 1/12 octaves over the band: {:.3} to {:.3}. The \
         peak acceleration is {:.2} times the required level at {} Hz. This is a computation, not a \
         certificate.",
        verdict.lowest_ratio,
        verdict.highest_ratio,
        verdict.points.len(),
        verdict.twelfth_octaves[0],
        verdict.twelfth_octaves[1],
        verdict.peak_over_rigid,
        rule.band_hz[1]
    )
}

fn facts(verdict: &Verdict) -> Vec<Fact> {
    let fact = |label: &str, value: Cell| Fact {
        label: label.into(),
        value,
        note: String::new(),
    };
    vec![
        fact("Test spectrum", verdict.verdict.into()),
        fact("Lowest ratio", Cell::Number(verdict.lowest_ratio, 4)),
        fact("Highest ratio", Cell::Number(verdict.highest_ratio, 4)),
    ]
}

/// The page of a record under a rule.
#[must_use]
pub fn trs_page(rule: &Rule, record: &Record, verdict: &Verdict) -> Report {
    let mut identity = rule_entries(rule);
    identity.push(entry(
        "Record",
        format!(
            "{}, {} samples at {} s",
            record.origin,
            record.acceleration.len(),
            (record.dt * 1e9).round() / 1e9
        ),
    ));
    identity.push(version());
    Report {
        title: format!("Test response spectrum of {}", record.name),
        summary: sentence(rule, verdict),
        identity,
        facts: facts(verdict),
        sections: vec![
            spectrum_section(rule, verdict, &record.acceleration, record.dt),
            Section {
                heading: "Record".into(),
                panels: vec![history(
                    "Acceleration",
                    Units::ACCELERATION,
                    record.dt,
                    &[("record", &record.acceleration)],
                )],
                ..Section::default()
            },
        ],
        footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
    }
}

fn history(title: &str, units: Units, dt: f64, all: &[(&str, &[f64])]) -> Panel {
    let series = all
        .iter()
        .map(|(name, values)| Series::history(name, dt, values));
    Panel {
        title: title.into(),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear(&title.to_lowercase(), units),
        series: series.collect(),
    }
}

fn page(plan: &Plan, found: &Qualification) -> Report {
    let rule = plan.rule.at_level(found.level);
    let mut identity = rule_entries(&plan.rule);
    if let Some(request) = &plan.request {
        identity.extend([
            entry("System", request.system.as_str()),
            entry("Plant", request.plant.as_str()),
            entry("Specimen", request.specimen.as_str()),
            entry("Tuning", tuning(request)),
        ]);
        if !request.set.is_empty() {
            identity.push(entry("Set", request.set.join(", ")));
        }
    }
    identity.push(entry("Motion", found.motions[0].name.as_str()));
    identity.push(entry("Level", level_words(found)));
    identity.push(version());
    let mut sections = Vec::new();
    if let Some(best) = &found.best {
        sections.push(spectrum_section(
            &rule,
            best,
            shown(found),
            found.motions[0].dt,
        ));
    }
    sections.push(motion_section(found));
    if !found.approach.is_empty() {
        sections.push(rounds_section(found));
    }
    if found.searches[0].is_some() {
        sections.push(search_section(plan, found));
    }
    let summary = found
        .best
        .as_ref()
        .map_or_else(String::new, |best| sentence(&rule, best));
    Report {
        title: format!("Seismic qualification: {}", plan.rule.name),
        summary,
        identity,
        facts: found.best.as_ref().map_or_else(Vec::new, facts),
        sections,
        footer: format!(
            "shakebench {}; figures in {JSON}, what was run in {MANIFEST}",
            env!("CARGO_PKG_VERSION")
        ),
    }
}

fn level_words(found: &Qualification) -> String {
    match &found.limited_by {
        Some(name) => format!(
            "{:.3} of the required spectrum; at 1 the motion exceeds the rig's limit of {name}",
            found.level
        ),
        None => format!("{:.3} of the required spectrum", found.level),
    }
}

fn motion_section(found: &Qualification) -> Section {
    let motion = &found.motions[0];
    let mut tables = Vec::new();
    let heads = [
        "file",
        "seed",
        "peak",
        "velocity",
        "displacement",
        "lowest ratio",
        "highest ratio",
    ];
    let all = std::iter::once(&found.motion).chain(&found.further_axes);
    let rows = all.map(|own| {
        [
            own.file.display().to_string().into(),
            own.seed
                .map_or("-".to_string(), |seed| seed.to_string())
                .into(),
            Cell::Quantity(own.pga_g * STANDARD_GRAVITY, Units::ACCELERATION, 3),
            Cell::Quantity(own.peak_velocity_m_s, Units::VELOCITY, 3),
            Cell::Quantity(own.peak_displacement_m, Units::DISPLACEMENT, 3),
            Cell::Number(own.lowest_ratio, 4),
            Cell::Number(own.highest_ratio, 4),
        ]
    });
    tables.push(Table::of("Motions; ratios on 1/12 octaves", heads, rows));
    if !found.limits.is_empty() {
        let rows = found.limits.iter().map(|own| {
            [
                own.limit.as_str().into(),
                Cell::Quantity(100.0 * own.share, Units::PERCENT, 3),
                Cell::Quantity(own.time_s, Units::TIME, 4),
            ]
        });
        tables.push(Table::of(
            "Limits of the rig, as far as the motion uses them",
            ["limit", "used", "at"],
            rows,
        ));
    }
    if !found.high_pass.is_empty() {
        let rows = found.high_pass.iter().map(|own| {
            [
                Cell::Quantity(own.from_hz, Units::FREQUENCY, 3),
                Cell::Number(own.level, 3),
            ]
        });
        tables.push(Table::of(
            "Levels that fit if the motion's band begins later; nothing is enveloped below it",
            ["from", "level"],
            rows,
        ));
    }
    let mut notes = motion.notes.clone();
    if let (Some(r), Some(c)) = (found.correlation, found.coherence) {
        notes.push(format!(
            "two axes have a correlation of at most {r:.3} and a coherence of at most {c:.3}"
        ));
    }
    notes.extend(found.warnings.iter().cloned());
    let panel = |title, units, values| history(title, units, motion.dt, &[("motion", values)]);
    Section {
        heading: "Motion".into(),
        notes,
        tables,
        panels: vec![
            panel("Acceleration", Units::ACCELERATION, &motion.acceleration),
            panel("Velocity", Units::VELOCITY, &motion.velocity),
            panel("Displacement", Units::DISPLACEMENT, &motion.displacement),
        ],
        ..Section::default()
    }
}

fn rounds_section(found: &Qualification) -> Section {
    let row = |own: &Round| {
        [
            Cell::Number(own.level, 3),
            Cell::Number(own.lowest_ratio, 4),
            Cell::Number(own.highest_ratio, 4),
            own.verdict.into(),
            Cell::Number(own.exposure, 3),
            own.ended_because
                .as_deref()
                .unwrap_or(own.ended.word())
                .into(),
        ]
    };
    let heads = [
        "level",
        "lowest ratio",
        "highest ratio",
        "test spectrum",
        "exposure",
        "ended",
    ];
    let rows = found.approach.iter().chain(&found.rounds).map(row);
    let measured = found.drive.as_ref().map(|drive| {
        history(
            "Acceleration",
            Units::ACCELERATION,
            drive.dt,
            &[
                ("motion", &found.motions[0].acceleration),
                ("table, best run", &found.measured),
            ],
        )
    });
    Section {
        heading: "Runs".into(),
        text: vec![
            "Ratios are those of the measured acceleration of the table on 1/12 octaves over the band, at the \
             level of the run. Below the level the drive is corrected on the waveform; at the level on the \
             spectrum: wavelets that would bring the measured spectrum to its aim pass the inverse of the \
             measured transfer function. Exposure is the energy of all runs over that of the motion played once. \
             The interlock was on in all runs."
                .into(),
        ],
        tables: vec![Table::of("", heads, rows)],
        panels: measured.into_iter().collect(),
        ..Section::default()
    }
}

fn search_section(plan: &Plan, found: &Qualification) -> Section {
    let row = |when: &str, own: &Resonance| {
        let interval =
            |[low, high]: [f64; 2], digits: usize| format!("{low:.digits$} to {high:.digits$}");
        [
            when.into(),
            Cell::Quantity(own.frequency_hz, Units::FREQUENCY, 5),
            interval(own.interval_95, 4).into(),
            Cell::Quantity(100.0 * own.damping, Units::PERCENT, 3),
            interval(own.damping_interval_95.map(|d| 100.0 * d), 2).into(),
            Cell::Number(own.gain, 3),
            Cell::Number(own.coherence, 3),
        ]
    };
    let before = found.resonances_before.iter().map(|own| row("before", own));
    let after = found.resonances_after.iter().map(|own| row("after", own));
    let heads = [
        "when",
        "frequency",
        "95 % interval (Hz)",
        "damping",
        "95 % interval (%)",
        "gain",
        "coherence",
    ];
    let mut tables = vec![Table::of(
        "Resonances of the specimen over the table",
        heads,
        before.chain(after),
    )];
    if !found.shifts.is_empty() {
        let rows = found.shifts.iter().map(|own| {
            [
                Cell::Quantity(own.before_hz, Units::FREQUENCY, 5),
                Cell::Quantity(own.after_hz, Units::FREQUENCY, 5),
                Cell::Quantity(own.shift_percent, Units::PERCENT, 3),
                format!("{:.3} to {:.3}", own.interval_95[0], own.interval_95[1]).into(),
                if own.changed {
                    "changed"
                } else {
                    "no change shown"
                }
                .into(),
            ]
        });
        let heads = ["before", "after", "shift", "95 % interval (%)", "finding"];
        tables.push(Table::of("Shifts of the frequencies", heads, rows));
    }
    let curve = |name: &str, of: fn(&Found) -> &Vec<f64>, own: &Found| {
        Series::line(
            name,
            Abscissa::At(own.transfer.frequency_hz.clone().into()),
            of(own).clone(),
        )
    };
    let both = |of: fn(&Found) -> &Vec<f64>| -> Vec<Series> {
        let names = ["before", "after"].into_iter().zip(&found.searches);
        names
            .filter_map(|(name, own)| Some(curve(name, of, own.as_ref()?)))
            .collect()
    };
    let panel = |title: &str, y: Axis, series| Panel {
        title: title.into(),
        x: Axis::logarithmic("frequency", Units::FREQUENCY),
        y,
        series,
    };
    let own = &plan.rule.search;
    Section {
        heading: "Resonance search".into(),
        text: vec![format!(
            "Acceleration of the specimen over that of the table, {} g, {} to {} Hz. Intervals are those of least \
             squares on the transforms of the whole records.",
            own.level_g, own.band_hz[0], own.band_hz[1]
        )],
        tables,
        panels: vec![
            panel(
                "Transfer function",
                Axis::logarithmic("gain", Units::NONE),
                both(|own| &own.transfer.gain),
            ),
            panel(
                "Coherence",
                Axis::linear("coherence", Units::NONE).between(0.0, 1.05),
                both(|own| &own.transfer.coherence),
            ),
        ],
        ..Section::default()
    }
}

#[cfg(test)]
mod tests {
    use super::percent;

    #[test]
    fn damping_is_in_percent_to_four_decimals() {
        for (part, shown) in [
            (0.05, 5.0),
            (0.02, 2.0),
            (0.123_456_78, 12.3457),
            (0.0, 0.0),
        ] {
            assert_eq!(percent(part), shown);
        }
    }
}
