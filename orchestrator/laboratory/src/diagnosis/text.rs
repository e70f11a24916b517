//! A diagnosis on the terminal, and the tables that it shares with the report.

use identification::diagnosis::engine::Verdict;
use identification::diagnosis::rigs::foreign::KIND;
use identification::diagnosis::rigs::shake_table::{change, laboratory_unit, with_interval};
use identification::diagnosis::rigs::{
    INTERVAL_95, PartReport, RigDiagnosis, ends, is_undetermined,
};
use identification::diagnosis::{
    DiagnosisReport, Evidence, GainReport, ParameterReport, ShakeTableEvidence,
};

use pages::report::UnitSystem;
use pages::report::columns::aligned;
use pages::report::number::significant;

fn in_unit(parameter: &ParameterReport, unit: &str) -> String {
    let (value, error) = (parameter.value, parameter.standard_error);
    if is_undetermined(value, error) {
        let factor = units::convert(1.0, &parameter.unit, unit).unwrap_or(1.0);
        let unit = if unit == "1" { "" } else { unit };
        let text = format!("about {} {unit}", significant(factor * value, 3));
        return text.trim_end().to_owned();
    }
    with_interval(value, INTERVAL_95 * error, &parameter.unit, unit)
}

/// A confidence in words: nothing is certain.
pub(super) fn confidence(share: f64) -> String {
    if share > 0.999 {
        "above 99.9 %".into()
    } else {
        format!("{:.1} %", 100.0 * share)
    }
}

/// What a parameter is with a confidence of 95 %; a dash where its error is not known.
fn interval(parameter: &ParameterReport, unit: &str, is_only: bool) -> String {
    let Ok(factor) = units::convert(1.0, &parameter.unit, unit) else {
        return "-".into();
    };
    if is_undetermined(parameter.value, parameter.standard_error) {
        return "not determined".into();
    }
    let half = INTERVAL_95 * parameter.standard_error;
    if !half.is_finite() {
        return "-".into();
    }
    let ends = ends(parameter.value, parameter.standard_error, is_only);
    // As many digits as tell the ends apart.
    let size = ends[0].abs().max(ends[1].abs());
    let digits = (size / half.max(1e-300)).log10().ceil().clamp(0.0, 6.0) as usize + 2;
    let [low, high] = ends.map(|end| match end {
        0.0 => "0".to_owned(),
        end => significant(factor * end, digits),
    });
    let unit = if unit == "1" { "" } else { unit };
    format!("{low} to {high} {unit}").trim_end().to_string()
}

/// Estimates with a line of headings. For the shake table the units of its laboratory are shown
/// next to SI.
pub(super) fn parameters(report: &DiagnosisReport, units: UnitSystem) -> Vec<Vec<String>> {
    let is_case = matches!(report.evidence, Evidence::ShakeTable(_));
    let mut heading = vec!["effect", "parameter"];
    heading.extend(is_case.then_some("laboratory"));
    let is_foreign = matches!(&report.evidence, Evidence::Rig(own) if own.rig.kind == KIND);
    let value = if is_foreign { "value" } else { "SI" };
    heading.extend([value, "95 % interval", "confidence"]);
    heading.extend((!is_case).then_some("on every part"));
    let mut rows = vec![heading.into_iter().map(String::from).collect()];
    for effect in &report.effects {
        let row = |name: &str, of: Option<&ParameterReport>| {
            let cell = |unit: &dyn Fn(&str) -> String| {
                of.map_or("-".to_string(), |p| in_unit(p, &unit(&p.unit)))
            };
            let mut row = vec![effect.effect.clone(), name.to_string()];
            row.extend(is_case.then(|| cell(&|si| laboratory_unit(si).to_string())));
            row.push(cell(&str::to_string));
            let laboratory = |si: &str| match is_case && units == UnitSystem::Us {
                true => laboratory_unit(si).to_string(),
                false => si.to_string(),
            };
            let is_only = effect.parameters.len() == 1;
            row.push(of.map_or("-".into(), |p| interval(p, &laboratory(&p.unit), is_only)));
            row.push(confidence(effect.confidence));
            let word = |all| if all { "yes" } else { "no" }.to_string();
            row.extend(effect.on_every_part.map(word));
            row
        };
        if effect.parameters.is_empty() {
            rows.push(row("-", None));
        }
        let all = effect.parameters.iter();
        rows.extend(all.map(|(name, p)| row(name, Some(p))));
    }
    rows
}

/// Columns of [`channels`].
const GAIN: [&str; 6] = [
    "channel",
    "before",
    "after",
    "noise floor",
    "before/floor",
    "after/floor",
];

/// Errors by channel with a line of headings; the overall ratios are those of the gain itself. None
/// where the noise is not known.
pub(super) fn channels(gain: &GainReport) -> Option<Vec<Vec<String>>> {
    let noise = gain.against_noise.as_ref()?;
    let row = |name: &str, [before, after, floor]: [f64; 3], ratios: [f64; 2]| {
        let mut row = vec![name.to_string()];
        row.extend([before, after, floor].map(|error| significant(error, 3)));
        row.extend(ratios.map(|ratio| significant(ratio, 3)));
        row
    };
    let mut rows = vec![GAIN.map(String::from).to_vec()];
    let channels = noise.channels.iter();
    rows.extend(
        channels.map(|(name, e)| row(&name.replace('_', " "), *e, [e[0] / e[2], e[1] / e[2]])),
    );
    let floor = gain.noise_floor_nrmse.unwrap_or(f64::NAN);
    rows.push(row(
        "all",
        [gain.before_nrmse, gain.after_nrmse, floor],
        [noise.before_ratio, noise.after_ratio],
    ));
    Some(rows)
}

/// How much of the error is gone, with its interval.
pub(super) fn share(gain: &GainReport) -> String {
    let (low, high) = gain.interval_95;
    let change = change([100.0 * low, 100.0 * high]);
    format!("The error {change} (95 %, block bootstrap)")
}

/// What else the reader should know, a line each.
pub(super) fn remarks(report: &DiagnosisReport) -> Vec<String> {
    let mut lines: Vec<String> = match &report.evidence {
        Evidence::ShakeTable(_) => report
            .alternatives
            .iter()
            .map(|set| format!("as likely: {}", set.join(" and ")))
            .collect(),
        Evidence::Rig(evidence) => {
            let rig = &evidence.rig;
            let rivals = rig.as_described.rivals.iter();
            rivals
                .map(|(rival, against)| {
                    format!(
                        "{rival} explains the records nearly as well as \
                    {against}"
                    )
                })
                .collect()
        }
    };
    if let Some(experiment) = &report.separating_experiment {
        let what = match report.verdict {
            Verdict::Unexplained => "what to measure next",
            _ => "experiment that separates them",
        };
        lines.push(format!("{what}: {experiment}"));
        if let Some(motion) = &report.separating_motion {
            let motion = motion.display();
            lines.push(format!(
                "it is in {motion}; play it with `shakebench run three-variable --reference \
                 {motion}`"
            ));
        }
    }
    lines.extend(report.notes.iter().cloned());
    if let Evidence::ShakeTable(evidence) = &report.evidence {
        // The strongest traces tell enough; diagnosis.json has them all.
        for (what, deviate) in evidence.remaining.iter().take(5) {
            lines.push(format!(
                "unexplained: {what} ({deviate:.1} standard deviations)"
            ));
        }
    }
    lines
}

/// Columns of [`relations`].
const RELATIONS: [&str; 5] = [
    "relation",
    "nominal",
    "re-estimated",
    "healthy rig",
    "state",
];

/// The relations with a word each and a line of headings: how they are with the nominal parameters,
/// and with re-estimated ones, against a healthy rig.
pub(super) fn relations(evidence: &ShakeTableEvidence) -> Vec<Vec<String>> {
    let holds = |ratio: f64, healthy: f64| ratio < 1.3 * healthy;
    let mut rows = vec![RELATIONS.map(String::from).to_vec()];
    rows.extend(evidence.relations.iter().map(|(name, relation)| {
        let healthy = relation.healthy;
        let word = healthy.map_or("", |healthy| {
            match (
                holds(relation.nominal, healthy),
                holds(relation.estimated, healthy),
            ) {
                (_, false) => "broken",
                (false, true) => "within the parameters' uncertainty",
                (true, true) => "holds",
            }
        });
        vec![
            name.clone(),
            significant(relation.nominal, 3),
            significant(relation.estimated, 3),
            healthy.map_or("-".into(), |healthy| significant(healthy, 3)),
            word.to_string(),
        ]
    }));
    rows
}

/// Errors on the data that each part was not fitted to, in percent, with a line of headings.
pub(super) fn parts(rig: &RigDiagnosis) -> Vec<Vec<String>> {
    let heading = [
        "fitted",
        "nominal",
        "refitted",
        "extended",
        "on the fitted data",
        "squared error gone",
        "95 %",
    ];
    let row = |name: &str, part: &PartReport| {
        let mut row = vec![name.to_string()];
        let errors = [
            part.nominal_error,
            part.refitted_error,
            part.extended_error,
            part.fitted_error,
        ];
        row.extend(errors.map(|error| format!("{:.2} %", 100.0 * error)));
        let gone = 1.0 - (part.extended_error / part.refitted_error).powi(2);
        let (low, high) = part.gain_interval;
        row.push(format!("{:.0} %", 100.0 * gone));
        row.push(format!("{:.0} to {:.0} %", 100.0 * low, 100.0 * high));
        row
    };
    let confirmed = |name: &str, part: &PartReport, error: f64, fitted: &str| {
        let mut row = vec![name.to_string()];
        row.extend(
            [part.nominal_error, part.refitted_error, error]
                .map(|error| format!("{:.2} %", 100.0 * error)),
        );
        row.push(fitted.to_string());
        let gone = 1.0 - (error / part.refitted_error).powi(2);
        row.extend([format!("{:.0} %", 100.0 * gone), String::new()]);
        row
    };
    let own = &rig.confirmed;
    let mut last = confirmed("named effects only", &rig.as_described, own.error, "");
    let (low, high) = own.gain_interval;
    last[6] = format!("{:.0} to {:.0} %", 100.0 * low, 100.0 * high);
    vec![
        heading.map(String::from).to_vec(),
        last,
        confirmed(
            "the same, parts swapped",
            &rig.swapped,
            own.swapped_error,
            "",
        ),
        row("all effects of this part", &rig.as_described),
        row("the same, parts swapped", &rig.swapped),
    ]
}

/// What is printed without `--json`.
pub fn text(report: &DiagnosisReport, units: UnitSystem) -> String {
    let mut text = format!("{}\n", report.sentence);
    if !report.effects.is_empty() {
        text += &format!("\n{}", aligned(&parameters(report, units)));
    }
    match &report.evidence {
        Evidence::ShakeTable(evidence) => {
            let gain = |gain: &GainReport| {
                let rows = channels(gain).unwrap_or_default();
                format!("{}{}\n", aligned(&rows), share(gain))
            };
            text += &format!(
                "\nerror one step ahead on the validation record, which was not fitted (NRMSE)\n{}",
                gain(&report.gain)
            );
            if let Some(closed) = &evidence.co_simulation {
                text += &format!(
                    "\nthe same record co-simulated in closed loop by the FMUs (NRMSE)\n{}",
                    gain(closed)
                );
            }
            text += &format!(
                "\nrelations on the identification record, errors in units of the noise\n{}",
                aligned(&relations(evidence))
            );
        }
        Evidence::Rig(evidence) => {
            text += &format!(
                "\nerror of {} on the held-out data\n{}unexplained: {:.0} % of the nominal \
                 model's squared error on the held-out data\n",
                evidence.rig.output,
                aligned(&parts(&evidence.rig)),
                100.0 * evidence.unexplained_share
            );
        }
    }
    let remarks = remarks(report);
    if !remarks.is_empty() {
        text += &format!("\nnotes\n  {}\n", remarks.join("\n  "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{GainReport, ParameterReport, in_unit, interval, share};

    #[test]
    fn a_value_that_is_not_determined_has_no_interval() {
        let found = |value, standard_error, unit: &str| ParameterReport {
            value,
            unit: unit.into(),
            standard_error,
        };
        let force = found(50.6981, 1.8e7, "N");
        assert_eq!(in_unit(&force, "N"), "about 50.7 N");
        assert_eq!(interval(&force, "N", true), "not determined");
        assert_eq!(in_unit(&found(0.25, 1e4, "1"), "1"), "about 0.250");
        let known = found(50.0, 3.0, "N");
        assert_eq!(in_unit(&known, "N"), "50 ± 6 N");
        assert_eq!(interval(&known, "N", true), "44.1 to 55.9 N");
        let there = found(50.0, 30.0, "N");
        assert_eq!(interval(&there, "N", true), "0 to 109 N");
        assert_eq!(interval(&there, "N", false), "-8.80 to 109 N");
    }

    #[test]
    fn the_share_of_an_error_is_said_in_percent_with_its_interval() {
        let mut gain = GainReport {
            before_nrmse: 0.4,
            after_nrmse: 0.1,
            noise_floor_nrmse: None,
            interval_95: (0.62, 0.91),
            interval_of: None,
            record: "validation".to_string(),
            against_noise: None,
        };
        let end = "(95 %, block bootstrap)";
        assert_eq!(share(&gain), format!("The error falls by 62 to 91 % {end}"));
        gain.interval_95 = (-0.1, 0.25);
        assert_eq!(
            share(&gain),
            format!("The error may rise by 10 % or fall by 25 % {end}")
        );
    }
}
