//! What the benchmark gives: the one result that is printed, drawn and handed on.

use std::fmt::Write;

use hybrid::vrths::{BenchmarkCase, InteractionForm};
use plant::ModelError;
use serde::Serialize;

use pages::report::columns::aligned;

use super::motions::Motion;
use super::published::{PublishedTable, largest_difference};
use super::study::{Plants, Scores, Study, sample_table};

/// Result of the benchmark.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// `J1..J9` of cases 1 to 4 with the sample controller, the published noise and the derivative
    /// blocks; none without the record of El Centro.
    pub table3: Option<PublishedTable>,
    /// The published scores; none without the benchmark's data.
    pub published_table3: Option<PublishedTable>,
    /// Largest difference between the two.
    pub table3_largest_difference: Option<f64>,
    /// The scores.
    pub controllers: Scores,
    /// Cases that were run.
    pub cases: Vec<u8>,
    /// Motions that were run.
    pub motions: Vec<String>,
    /// Plants that were run.
    pub plants: Plants,
    /// How the plant's derivatives were formed.
    pub plant: InteractionForm,
    /// Seed of plants and noise.
    pub seed: u64,
    /// What the reader should know.
    pub notes: Vec<String>,
    /// Time on the clock, s.
    pub wall_s: f64,
}

impl Outcome {
    /// Runs a study, and the published table where `el_centro` is given; `done` is called after
    /// each plant.
    ///
    /// # Errors
    /// A plant, frame or controller that cannot be simulated.
    pub fn of(
        study: &Study,
        el_centro: Option<&Motion>,
        published: Option<PublishedTable>,
        done: impl Fn() + Sync,
    ) -> Result<Self, ModelError> {
        let start = std::time::Instant::now();
        let table3 = el_centro.map(sample_table).transpose()?;
        let controllers = study.run(done)?;
        let difference = table3.as_ref().zip(published.as_ref());
        Ok(Self {
            table3_largest_difference: difference.map(|(a, b)| largest_difference(a, b)),
            table3,
            published_table3: published,
            controllers,
            cases: study.cases.iter().map(|case| case.number()).collect(),
            motions: study
                .motions
                .iter()
                .map(|motion| motion.name.clone())
                .collect(),
            plants: study.plants,
            plant: study.form,
            seed: study.seed,
            notes: Vec::new(),
            wall_s: start.elapsed().as_secs_f64(),
        })
    }

    /// The scores, one row per controller: mean and largest.
    #[must_use]
    pub fn score_rows(&self) -> Vec<Vec<String>> {
        let mut rows = vec![
            std::iter::once("controller".to_string())
                .chain(["runs", "unstable"].map(String::from))
                .chain((1..=9).map(|i| format!("J{i}")))
                .chain(["true tracking".to_string()])
                .collect::<Vec<_>>(),
        ];
        let mut names: Vec<_> = self.controllers.iter().collect();
        // By J4, which says how good the experiment is as a whole.
        let rank = |mean: f64| if mean.is_nan() { f64::INFINITY } else { mean };
        names.sort_by(|a, b| rank(a.1.mean[3]).total_cmp(&rank(b.1.mean[3])));
        for (name, score) in names {
            let cell = |mean: f64, max: f64, digits: usize| {
                if mean.is_nan() {
                    return "-".to_string();
                }
                format!("{mean:.digits$}/{max:.digits$}")
            };
            let mut row = vec![
                (*name).to_string(),
                score.runs.to_string(),
                score.unstable.to_string(),
            ];
            for i in 0..9 {
                row.push(cell(
                    score.mean[i],
                    score.max[i],
                    if i == 0 { 1 } else { 2 },
                ));
            }
            let tracking = score.true_tracking_percent;
            row.push(cell(tracking.mean, tracking.max, 2));
            rows.push(row);
        }
        rows
    }

    /// The published table and ours, one row per case.
    #[must_use]
    pub fn table3_rows(&self) -> Vec<Vec<String>> {
        let heads = std::iter::once("case".to_string()).chain((1..=9).map(|i| format!("J{i}")));
        let mut rows = vec![heads.collect::<Vec<_>>()];
        for case in BenchmarkCase::ALL {
            let place = usize::from(case.number()) - 1;
            for (whose, table, digits) in [
                ("ours", &self.table3, 2),
                ("published", &self.published_table3, 1),
            ] {
                if let Some(table) = table {
                    let scores = table[place].iter().map(|score| format!("{score:.digits$}"));
                    let head = std::iter::once(format!("{} {whose}", case.number()));
                    rows.push(head.chain(scores).collect());
                }
            }
        }
        rows
    }

    /// The result for people.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        for note in &self.notes {
            let _ = writeln!(text, "note: {note}");
        }
        if self.table3.is_some() {
            text += "\nSample controller, El Centro, published noise: J1 in ms, J2 to J9 in %\n";
            text += &aligned(&self.table3_rows());
            if let Some(difference) = self.table3_largest_difference {
                let _ = writeln!(text, "largest difference {difference:.2}");
            }
        }
        text += "\nMean/largest over the runs: J1 in ms, the others in %\n";
        text += &aligned(&self.score_rows());
        for (name, score) in &self.controllers {
            if score.beyond_force_limit + score.beyond_stroke > 0 {
                let _ = writeln!(
                    text,
                    "{name}: {} runs exceed 8900 N, {} the stroke of 7 mm",
                    score.beyond_force_limit, score.beyond_stroke
                );
            }
        }
        text
    }
}
