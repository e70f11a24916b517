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
    use super::*;
    use crate::made;
    use crate::qualify::{HighPass, MotionEntry, Qualification, Use};
    use crate::run::experiment::Request;
    use fmi_master::Ending;
    use pages::report::UnitSystem;
    use qualification::matching;
    use qualification::resonance::{Shift, Transfer};

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

    fn round(level: f64, ended: Ending) -> Round {
        Round {
            level,
            lowest_ratio: 0.95,
            highest_ratio: 1.25,
            verdict: "falls short",
            exposure: 2.0 * level,
            drive_peak_displacement_m: 0.05,
            ended,
            ended_because: (ended != Ending::Complete)
                .then(|| "the table left its reference".into()),
        }
    }

    fn qualification(rule: &Rule) -> Qualification {
        let motion = made::wave("matched", 1500);
        let entry = |n: usize, seed| MotionEntry {
            file: motion_name(n, "csv").into(),
            seed,
            pga_g: 0.4,
            peak_velocity_m_s: 0.2,
            peak_displacement_m: 0.01,
            lowest_ratio: 1.01,
            highest_ratio: 1.29,
            strong_motion_s: 2.5,
        };
        let resonance = |frequency_hz: f64| Resonance {
            frequency_hz,
            interval_95: [frequency_hz - 0.01, frequency_hz + 0.01],
            damping: 0.05,
            damping_interval_95: [0.045, 0.055],
            gain: 9.5,
            coherence: 0.99,
        };
        let found = |gain: f64| {
            Some(Found {
                resonances: Vec::new(),
                transfer: Transfer {
                    frequency_hz: vec![1.0, 2.0],
                    gain: vec![1.0, gain],
                    coherence: vec![0.9, 1.0],
                },
            })
        };
        let best = Verdict::new(
            rule,
            &motion.acceleration,
            motion.dt,
            vec!["a short record".into()],
        );
        Qualification {
            rule: rule.clone(),
            system: Some("mpc".into()),
            motion: entry(0, Some(7)),
            further_axes: vec![entry(1, None)],
            correlation: Some(0.123),
            coherence: Some(0.25),
            level: 0.5,
            limited_by: Some("stroke".into()),
            limits: vec![Use {
                limit: "stroke".into(),
                share: 0.85,
                time_s: 1.25,
            }],
            high_pass: vec![HighPass {
                from_hz: 1.95,
                level: 0.8,
            }],
            rounds: vec![round(0.5, Ending::Complete), round(0.5, Ending::Interlock)],
            approach: vec![round(0.125, Ending::Complete)],
            verdict: "falls short",
            resonances_before: vec![resonance(1.0)],
            resonances_after: vec![resonance(0.95)],
            shifts: vec![Shift {
                before_hz: 1.0,
                after_hz: 0.95,
                shift_percent: -5.0,
                interval_95: [-6.0, -4.0],
                changed: true,
            }],
            warnings: vec!["the motion is short".into()],
            wall_s: 1.0,
            drive: Some(motion.clone()),
            measured: motion.acceleration.iter().map(|a| 0.9 * a).collect(),
            searches: [found(9.5), found(8.0)],
            manifest: None,
            best: Some(best),
            motions: vec![motion],
        }
    }

    fn plan(rule: &Rule) -> Plan {
        Plan {
            rule: rule.clone(),
            record: None,
            seed: 7,
            request: Some(Request {
                set: vec!["table.mass=600 kg".into()],
                ..Request::built_in("mpc")
            }),
            motion_only: false,
            rounds: 2,
            search: None,
            set_after: Vec::new(),
        }
    }

    fn shown(report: &Report) -> String {
        expected::text_of(report, UnitSystem::Si).replace(env!("CARGO_PKG_VERSION"), "VERSION")
    }

    #[test]
    fn a_qualification_is_reported_with_spectra_runs_and_resonances() {
        let rule = qualification::load("ac156", &[]).unwrap();
        let own = qualification(&rule);
        assert_eq!(own.ended_early(), Some("the table left its reference"));
        let mut all = vec![shown(&page(&plan(&rule), &own))];
        // Only the motion, which no limit of a rig bounds.
        let bare = Qualification {
            limited_by: None,
            level: 1.0,
            limits: Vec::new(),
            high_pass: Vec::new(),
            rounds: Vec::new(),
            approach: Vec::new(),
            searches: [None, None],
            measured: Vec::new(),
            drive: None,
            correlation: None,
            ..own
        };
        assert_eq!(bare.ended_early(), None);
        let without = Plan {
            request: None,
            ..plan(&rule)
        };
        all.push(shown(&page(&without, &bare)));
        let rule = qualification::load("ieee693", &["damping_percent=5".into()]).unwrap();
        let motion = made::wave("record", 1000);
        let record = Record {
            name: "record".into(),
            origin: "a sine".into(),
            dt: motion.dt,
            acceleration: motion.acceleration.clone(),
            seed: None,
        };
        let verdict = Verdict::new(&rule, &record.acceleration, record.dt, Vec::new());
        all.push(shown(&trs_page(&rule, &record, &verdict)));
        expected::compare(
            env!("CARGO_MANIFEST_DIR"),
            "qualification.txt",
            &all.join("\n======\n"),
        );
    }

    #[test]
    fn motions_and_spectra_are_written_as_files() {
        let rule = qualification::load("ac156", &[]).unwrap();
        let own = qualification(&rule);
        let folder = tempfile::tempdir().unwrap();
        let out = Out::new(folder.path().join("out"));
        let written = write(&plan(&rule), &own, &out).unwrap();
        let mut names: Vec<_> = written
            .iter()
            .filter_map(|path| path.file_name()?.to_str())
            .collect();
        names.sort_unstable();
        assert_eq!(
            names,
            [
                "drive.csv",
                "measured.csv",
                "motion.AT2",
                "motion.csv",
                "qualification.json",
                "report.html",
                "spectra.csv",
                "spectra.svg",
            ]
        );
        let text = motion_at2(&Motion {
            acceleration: vec![
                STANDARD_GRAVITY,
                -0.5 * STANDARD_GRAVITY,
                0.0,
                0.0,
                0.0,
                2.0 * STANDARD_GRAVITY,
            ],
            displacement: vec![0.0; 6],
            ..made::wave("step", 0)
        });
        assert_eq!(
            text,
            "SHAKEBENCH MATCHED MOTION\nstep\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS=      6, DT= 0.0020 SEC\n\
             \u{20}    1.0000000e0   -5.0000000e-1     0.0000000e0     0.0000000e0     0.0000000e0\n\
             \u{20}    2.0000000e0\n"
        );
        assert_eq!(
            record_text(&[0.0, STANDARD_GRAVITY], 0.1),
            "t_s,a_g\n0,0\n0.1,1\n"
        );
        assert_eq!(
            [0, 1].map(|n| motion_name(n, "csv")),
            ["motion.csv", "motion-2.csv"]
        );
        let points = std::fs::read_to_string(out.join(POINTS)).unwrap();
        assert_eq!(points.lines().count(), own.best.unwrap().points.len() + 1);
    }

    #[test]
    fn a_motion_that_was_matched_envelops_its_spectrum() {
        let rule = qualification::load("ac156", &["s_ds=0.5".into()]).unwrap();
        let matched = matching::from_noise(&rule, 3, 0.005);
        let verdict = Verdict::new(&rule, &matched.motion.acceleration, 0.005, Vec::new());
        let told = sentence(&rule, &verdict);
        assert_eq!(
            told.contains("envelops the required one"),
            verdict.envelops(),
            "{told}"
        );
    }
}
