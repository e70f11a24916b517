//! What a search found, as tables for people and as a page.

use super::{Held, Score, Tuned};
use pages::report::number::significant;
use pages::report::{Abscissa, Axis, Panel, Report, Section, Series, Style, Table, Units};

/// A number with three digits.
fn short(number: f64) -> String {
    match number.is_finite() {
        true => significant(number, 3),
        false => "-".to_string(),
    }
}

/// What is made small.
fn percentile(tuned: &Tuned) -> String {
    format!(
        "{} % quantile of {}",
        100.0 * tuned.quantile,
        tuned.objective
    )
}

fn score(score: &Score) -> String {
    let stopped = match score.stopped {
        0 => String::new(),
        stopped => format!(", {stopped} stopped"),
    };
    format!(
        "{} (median {}{stopped}; {} runs)",
        short(score.quantile),
        short(score.median),
        score.runs
    )
}

fn held(held: &Held) -> String {
    if !held.is_stable {
        return "unstable".to_string();
    }
    let of = |own: Option<f64>, unit| {
        own.map_or("none".to_string(), |own| format!("{} {unit}", short(own)))
    };
    format!(
        "{}, {}",
        of(held.margins.gain_margin_db, "dB"),
        of(held.margins.phase_margin_deg, "deg")
    )
}

impl Tuned {
    /// What the search did, in a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        let percentile = percentile(self);
        match (&self.before.held_out, &self.after.held_out) {
            (Some(before), Some(after)) => format!(
                "On the held-out motions, the {percentile} is {} instead of {}.",
                short(after.quantile),
                short(before.quantile)
            ),
            _ => format!(
                "The {percentile} is {} instead of {}; nothing was held out.",
                short(self.after.training.quantile),
                short(self.before.training.quantile)
            ),
        }
    }

    /// Figures before and after: a row of heads, then one each.
    #[must_use]
    pub fn gains(&self) -> Vec<Vec<String>> {
        let mut rows = vec![["", "before", "after"].map(String::from).to_vec()];
        let mut row =
            |name: String, before: String, after: String| rows.push(vec![name, before, after]);
        let quantile = percentile(self);
        row(
            format!("{quantile}, searched"),
            score(&self.before.training),
            score(&self.after.training),
        );
        if let (Some(before), Some(after)) = (&self.before.held_out, &self.after.held_out) {
            row(format!("{quantile}, held out"), score(before), score(after));
        }
        if let (Some(before), Some(after)) = (&self.before.held, &self.after.held) {
            row(
                "gain and phase margin".to_string(),
                held(before),
                held(after),
            );
        }
        rows
    }

    /// The parameters: a row of heads, then one each.
    #[must_use]
    pub fn values(&self) -> Vec<Vec<String>> {
        let heads = ["parameter", "unit", "from", "to", "before", "after"];
        let mut rows = vec![heads.map(String::from).to_vec()];
        rows.extend(self.parameters.iter().map(|own| {
            let mut row = vec![own.name.clone(), own.unit.clone()];
            row.extend(
                [own.low, own.high, own.before, own.after].map(|value| significant(value, 4)),
            );
            row
        }));
        rows
    }
}

/// The page.
pub(super) fn page(tuned: &Tuned) -> Report {
    let numbers: Vec<f64> = (0..tuned.trials.len()).map(|n| n as f64).collect();
    let of = |keeps: bool| -> Vec<f64> {
        let trials = tuned.trials.iter();
        trials
            .map(|trial| match trial.keeps_margins == keeps {
                true => trial.score.quantile,
                false => f64::NAN,
            })
            .collect()
    };
    let series = |name: &str, values: Vec<f64>, colour| {
        Series::line(name, Abscissa::At(numbers.clone().into()), values)
            .styled(Style::Points)
            .coloured(colour)
    };
    let mut best = f64::INFINITY;
    let lowest = tuned.trials.iter().map(|trial| {
        if trial.keeps_margins {
            best = best.min(trial.score.quantile);
        }
        if best.is_finite() { best } else { f64::NAN }
    });
    let lowest: Vec<f64> = lowest.collect();
    let plain = |label: &str| Axis::linear(label, Units::of(""));
    let panel = Panel {
        title: format!("The search: {}", percentile(tuned)),
        x: plain("set of parameters"),
        y: Axis::logarithmic(&tuned.objective, Units::of("")),
        series: vec![
            Series::line("best so far", Abscissa::At(numbers.clone().into()), lowest).coloured(0),
            series("keeps the margins", of(true), 1),
            series("does not", of(false), 2),
        ],
    };
    let held_out = match &tuned.held_out {
        Some((factor, values)) => format!("Held out: {factor} {}.", values.join(", ")),
        None if tuned.after.held_out.is_some() => {
            "Held out: the last runs of the design.".to_string()
        }
        None => "Nothing was held out.".to_string(),
    };
    let margins = match (tuned.gain_margin_db, tuned.phase_margin_deg) {
        (None, None) => "No margin was required.".to_string(),
        (gain, phase) => format!(
            "Required: gain margin {} dB, phase margin {} degrees, measured on the running \
             components by a step at the valve.",
            gain.map_or("-".to_string(), short),
            phase.map_or("-".to_string(), short)
        ),
    };
    Report {
        title: "Tuning over a study".into(),
        summary: tuned.sentence(),
        identity: tuned.identity.clone(),
        sections: vec![Section {
            heading: "What was found".into(),
            text: vec![
                held_out,
                margins,
                format!(
                    "{} sets of parameters were tried; {}.",
                    tuned.trials.len(),
                    tuned.ended
                ),
            ],
            panels: vec![panel],
            tables: vec![
                Table::headed("Before and after", tuned.gains()),
                Table::headed("Parameters", tuned.values()),
            ],
            ..Section::default()
        }],
        footer: format!(
            "in a run: {}",
            tuned
                .set
                .iter()
                .map(|set| format!("--set '{set}'"))
                .collect::<Vec<_>>()
                .join(" ")
        ),
        ..Report::default()
    }
}
