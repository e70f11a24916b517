//! What the benchmark gives: the one result that is printed, drawn and handed on.

use std::fmt::Write;

use hybrid::marths::laws::Class;
use pages::report::columns::aligned;
use plant::ModelError;
use serde::Serialize;

use super::roster;
use super::study::{ControllerScore, Nominal, Scores, Study};

/// Result of the benchmark.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// Criteria on the nominal plant with the published noise, by controller and motion.
    pub nominal: Nominal,
    /// The scores.
    pub controllers: Scores,
    /// Motions that were run.
    pub motions: Vec<String>,
    /// Plants that were run, in words.
    pub plants: String,
    /// Seed of plants and noise.
    pub seed: u64,
    /// What the reader should know.
    pub notes: Vec<String>,
    /// Time on the clock, s.
    pub wall_s: f64,
}

/// Controllers whose strokes left the set that the coupler reaches.
fn out_of_reach(scores: &Scores) -> Vec<String> {
    let of = scores.iter().filter(|(_, score)| score.out_of_reach > 0);
    of.map(|(name, score)| {
        format!(
            "{name}: {} of {} runs ended with strokes that no rotation of the coupler gives",
            score.out_of_reach, score.runs
        )
    })
    .collect()
}

/// What the tables show.
const SHOWN: [&str; 9] = [
    "J1_1",
    "J1_2",
    "J2_1",
    "J2_2",
    "J3_1",
    "J3_2",
    "true_J2_1",
    "true_J2_2",
    "H8",
];

impl Outcome {
    /// Runs a study; `done` is called after each plant.
    ///
    /// # Errors
    /// A plant, structure or controller that cannot be simulated.
    pub fn of(study: &Study, done: impl Fn() + Sync) -> Result<Self, ModelError> {
        let start = std::time::Instant::now();
        let (nominal, controllers) = study.run(done)?;
        let names = study.motions.iter().map(|motion| motion.name.clone());
        Ok(Self {
            notes: out_of_reach(&controllers),
            nominal,
            controllers,
            motions: names.collect(),
            plants: study.plants.to_string(),
            seed: study.seed,
            wall_s: start.elapsed().as_secs_f64(),
        })
    }

    /// The scores of a class, a row a controller, the smallest true tracking error first: mean and
    /// largest.
    #[must_use]
    pub fn rows(&self, class: Class) -> Vec<Vec<String>> {
        let mut of: Vec<_> = self
            .controllers
            .iter()
            .filter(|(_, score)| score.class == class)
            .collect();
        let rank = |score: &ControllerScore| {
            let error = score.mean["true_J2_1"];
            if error.is_nan() { f64::INFINITY } else { error }
        };
        of.sort_by(|a, b| rank(a.1).total_cmp(&rank(b.1)));
        let heads = ["controller", "runs", "unstable"];
        let mut rows: Vec<Vec<String>> = vec![
            heads
                .into_iter()
                .chain(SHOWN)
                .chain(["volts"])
                .map(String::from)
                .collect(),
        ];
        for (name, score) in of {
            let mut row = vec![
                (*name).to_string(),
                score.runs.to_string(),
                score.unstable.to_string(),
            ];
            for column in SHOWN {
                let (mean, max) = (score.mean[column], score.max[column]);
                row.push(match mean.is_nan() {
                    true => "-".into(),
                    false => format!("{mean:.2}/{max:.2}"),
                });
            }
            row.push(format!("{:.2}", score.peak_volts));
            rows.push(row);
        }
        rows
    }

    /// What coupling costs: each law that leaves it out against the same law with it, mean and largest; none where no such
    /// pair was run.
    #[must_use]
    pub fn coupling(&self) -> Vec<Vec<String>> {
        const MEASURES: [&str; 5] = ["J2_1", "J2_2", "true_J2_1", "true_J2_2", "H8"];
        let pairs = roster::ALL.iter().filter_map(|entry| {
            let full = entry.full?;
            Some((
                full,
                self.controllers.get(entry.name)?,
                self.controllers.get(full)?,
            ))
        });
        let mut rows = Vec::new();
        for (name, decoupled, full) in pairs {
            if rows.is_empty() {
                let heads = ["law", "coupling", "runs", "unstable"]
                    .into_iter()
                    .chain(MEASURES);
                rows.push(heads.map(String::from).collect());
            }
            for (label, score) in [("left out", decoupled), ("in the model", full)] {
                let mut row = vec![
                    name.to_string(),
                    label.to_string(),
                    score.runs.to_string(),
                    score.unstable.to_string(),
                ];
                row.extend(MEASURES.map(|measure| match score.mean[measure] {
                    mean if mean.is_nan() => "-".into(),
                    mean => format!("{mean:.2}/{:.2}", score.max[measure]),
                }));
                rows.push(row);
            }
        }
        rows
    }

    /// The classes that were run, with what they are.
    #[must_use]
    pub fn classes(&self) -> Vec<(Class, &'static str)> {
        let mut classes = vec![
            (Class::Raw, "Measured strokes make the force"),
            (Class::Estimate, "Estimated strokes make the force"),
        ];
        classes.retain(|(class, _)| self.controllers.values().any(|s| s.class == *class));
        classes
    }

    /// The result for people.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        for note in &self.notes {
            let _ = writeln!(text, "note: {note}");
        }
        let _ = writeln!(
            text,
            "Motions {}; {} (seed {}). Mean/largest: J1 in ms, the others in %.",
            self.motions.join(", "),
            self.plants,
            self.seed
        );
        for (class, title) in self.classes() {
            let _ = writeln!(text, "\n{title}");
            text += &aligned(&self.rows(class));
        }
        let coupling = self.coupling();
        if !coupling.is_empty() {
            let _ = writeln!(text, "\nWhat coupling costs");
            text += &aligned(&coupling);
        }
        text
    }
}
