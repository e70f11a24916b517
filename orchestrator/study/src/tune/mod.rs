//! Tuning of a controller over a study: the parameters for which the worst runs are best, within
//! stability margins, and what that gains on motions that were not used.

mod asked;
mod margins;
mod page;

use pack::Installation;
use std::cell::RefCell;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use cobyla::{Func, RhoBeg, StopTols, SuccessStatus, minimize};
use rayon::prelude::*;
use serde::Serialize;

use self::asked::Asked;
pub use margins::{Held, held};

use crate::campaign::analysis::percentile;
use crate::campaign::{Bench, Key, Runs, Study, Values, identity, with_unit};
use laboratory::error::Error;
use laboratory::results::{Out, Results};
use pages::report::{self, Cell};

/// A parameter that is searched.
#[derive(Debug, Clone, Serialize)]
pub struct Parameter {
    /// Instance and variable.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Its smallest value, in that unit.
    pub low: f64,
    /// Its largest value.
    pub high: f64,
    /// Before the search.
    pub before: f64,
    /// The best that was found.
    pub after: f64,
}

/// How good a set of parameters is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Score {
    /// The quantile of the objective over the runs; a run that was stopped or failed counts as
    /// [`STOPPED`].
    pub quantile: f64,
    /// The median over the runs that were played to their end.
    pub median: f64,
    /// Runs that were stopped or failed.
    pub stopped: usize,
    /// All runs.
    pub runs: usize,
}

/// What counts for a run that was stopped, % of the objective.
pub const STOPPED: f64 = 1000.0;

/// A set of parameters that was tried.
#[derive(Debug, Clone, Serialize)]
pub struct Trial {
    /// The values, in the order and units of the parameters.
    pub values: Vec<f64>,
    /// Over the runs that the search sees.
    pub score: Score,
    /// What its loop bears; absent where no margin is asked for.
    pub held: Option<Held>,
    /// Whether it keeps all margins.
    pub keeps_margins: bool,
}

/// Parameters with what they give.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Side {
    /// Over the runs that the search saw.
    pub training: Score,
    /// Over the runs that it did not see.
    pub held_out: Option<Score>,
    /// What the loop bears.
    pub held: Option<Held>,
}

/// What came of it: what `--json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct Tuned {
    /// The column that was made small.
    pub objective: String,
    /// Which part of the runs may be above it.
    pub quantile: f64,
    /// Least gain margin, dB.
    pub gain_margin_db: Option<f64>,
    /// Least phase margin, degrees.
    pub phase_margin_deg: Option<f64>,
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// What was held out: the factor and its values.
    pub held_out: Option<(String, Vec<String>)>,
    /// With the parameters as they were.
    pub before: Side,
    /// With those that were found.
    pub after: Side,
    /// Every set that was tried.
    pub trials: Vec<Trial>,
    /// Why the search ended.
    pub ended: String,
    /// Time that it took.
    pub wall_s: f64,
    /// Options of `shakebench run` that set the parameters found.
    pub set: Vec<String>,
    /// The study, for the page.
    #[serde(skip)]
    identity: Vec<(String, Cell)>,
}

/// The search of a study.
struct Search<'a> {
    bench: Bench<'a>,
    asked: Asked,
    training: Vec<u64>,
    held_out: Vec<u64>,
    place: usize,
    interrupt: &'a AtomicBool,
}

/// Searches the parameters of `[tune]` in a study; `tell` hears of every set that was tried.
///
/// # Errors
/// Whatever is wrong with the study, before its first run.
pub fn tune(
    study: &Study,
    installation: &Installation,
    interrupt: &AtomicBool,
    tell: &dyn Fn(&Trial),
) -> Result<Tuned, Error> {
    let begun = Instant::now();
    let bench = Bench::new(study, installation);
    bench.check()?;
    let asked = Asked::read(study, &bench)?;
    let columns = bench.columns()?;
    let place = columns
        .iter()
        .position(|column| column.name == asked.objective);
    let place = place.ok_or_else(|| {
        study.fault(&format!(
            "[tune] objective: `{}` is not a column",
            asked.objective
        ))
    })?;
    let (training, held_out, which) = parts(study, asked.share);
    let search = Search {
        bench,
        asked,
        training,
        held_out,
        // Behind the columns that say which run it is.
        place: place - crate::campaign::IDENTITY,
        interrupt,
    };
    let parameters = &search.asked.parameters;
    let before: Vec<f64> = parameters.iter().map(|own| own.before).collect();
    let (trials, ended) = search.search(&before, tell)?;
    let feasible = trials.iter().filter(|trial| trial.keeps_margins);
    let best = feasible.min_by(|a, b| a.score.quantile.total_cmp(&b.score.quantile));
    let Some(best) = best else {
        return Err(study.fault(
            "no set of parameters within the bounds keeps the margins; expected wider bounds in \
             [tune.parameters], or smaller margins",
        ));
    };
    let first = &trials[0];
    let mut parameters = parameters.clone();
    for (parameter, value) in parameters.iter_mut().zip(&best.values) {
        parameter.after = *value;
    }
    let side = |trial: &Trial| -> Result<Side, Error> {
        let held_out = match search.held_out.is_empty() {
            true => None,
            false => Some(search.score(&search.held_out, &trial.values)?),
        };
        Ok(Side {
            training: trial.score,
            held_out,
            held: trial.held,
        })
    };
    Ok(Tuned {
        objective: search.asked.objective.clone(),
        quantile: search.asked.quantile,
        gain_margin_db: search.asked.gain_margin,
        phase_margin_deg: search.asked.phase_margin,
        held_out: which,
        before: side(first)?,
        after: side(best)?,
        set: search.set(&best.values),
        identity: identity(study),
        parameters,
        ended,
        wall_s: begun.elapsed().as_secs_f64(),
        trials,
    })
}

impl Search<'_> {
    /// Sets of parameters that were tried, the one before the search first, and why it ended.
    fn search(&self, before: &[f64], tell: &dyn Fn(&Trial)) -> Result<(Vec<Trial>, String), Error> {
        let trials: RefCell<Vec<Trial>> = RefCell::default();
        let failed: RefCell<Option<Error>> = RefCell::default();
        // One evaluation gives objective and margins.
        let evaluate = |at: &[f64]| -> Option<Trial> {
            let values = self.values(at);
            let is_known = |own: &&Trial| are_same(&own.values, &values);
            let known = trials.borrow().iter().find(is_known).cloned();
            if known.is_some() {
                return known;
            }
            if failed.borrow().is_some() || self.interrupt.load(Ordering::Relaxed) {
                return None;
            }
            match self.trial(&values) {
                Ok(trial) => {
                    tell(&trial);
                    trials.borrow_mut().push(trial.clone());
                    Some(trial)
                }
                Err(error) => {
                    *failed.borrow_mut() = Some(error);
                    None
                }
            }
        };
        let objective =
            |at: &[f64], _: &mut ()| evaluate(at).map_or(STOPPED.ln(), |t| t.score.quantile.ln());
        // Not negative where it is kept; in units of 10 dB and 50 degrees.
        let gain = |at: &[f64], _: &mut ()| {
            let asked = self.asked.gain_margin.unwrap_or(0.0);
            margin(evaluate(at), |held| held.margins.gain_margin_db, asked) / 10.0
        };
        let phase = |at: &[f64], _: &mut ()| {
            let asked = self.asked.phase_margin.unwrap_or(0.0);
            margin(evaluate(at), |held| held.margins.phase_margin_deg, asked) / 50.0
        };
        let mut constraints: Vec<&dyn Func<()>> = Vec::new();
        if self.asked.gain_margin.is_some() || self.asked.phase_margin.is_some() {
            // Both see an unstable loop.
            constraints.extend([&gain as &dyn Func<()>, &phase]);
        }
        let first = self.trial(before)?;
        tell(&first);
        trials.borrow_mut().push(first);
        let mut start = self.coordinates(before);
        let bounds = vec![(0.0, 1.0); start.len()];
        let mut ended = String::new();
        // Twice: the second simplex is a small one about the best point.
        for size in [0.2, 0.07] {
            let left = self.asked.evaluations.saturating_sub(trials.borrow().len());
            if left == 0 || failed.borrow().is_some() {
                break;
            }
            let part = if size > 0.1 { 2 * left / 3 } else { left };
            let tolerances = StopTols {
                ftol_rel: 0.0,
                ftol_abs: 1e-4,
                xtol_rel: 0.0,
                xtol_abs: vec![2e-3; start.len()],
            };
            let found = minimize(
                objective,
                &start,
                &bounds,
                &constraints,
                (),
                part.max(1),
                RhoBeg::All(size),
                Some(tolerances),
            );
            ended = match found {
                Ok((SuccessStatus::MaxEvalReached, ..)) => "all evaluations were used".to_string(),
                Ok(_) => "the search has converged".to_string(),
                Err(_) => "rounding ended the search".to_string(),
            };
            let trials = trials.borrow();
            let feasible = trials.iter().filter(|trial| trial.keeps_margins);
            if let Some(best) =
                feasible.min_by(|a, b| a.score.quantile.total_cmp(&b.score.quantile))
            {
                start = self.coordinates(&best.values);
            }
        }
        if let Some(error) = failed.into_inner() {
            return Err(error);
        }
        if self.interrupt.load(Ordering::Relaxed) {
            ended = "it was interrupted".to_string();
        }
        Ok((trials.into_inner(), ended))
    }

    fn trial(&self, values: &[f64]) -> Result<Trial, Error> {
        let score = self.score(&self.training, values)?;
        let wants = self.asked.gain_margin.is_some() || self.asked.phase_margin.is_some();
        let held = match wants {
            true => Some(held(&self.bench, self.training[0], &self.set(values))?),
            false => None,
        };
        let keeps = |own: Option<f64>, asked: Option<f64>| {
            asked.is_none_or(|asked| own.is_none_or(|own| own >= asked))
        };
        let keeps_margins = held.is_none_or(|held| {
            held.is_stable
                && keeps(held.margins.gain_margin_db, self.asked.gain_margin)
                && keeps(held.margins.phase_margin_deg, self.asked.phase_margin)
        });
        Ok(Trial {
            values: values.to_vec(),
            score,
            held,
            keeps_margins,
        })
    }

    /// The score of these values over the runs of these numbers.
    fn score(&self, numbers: &[u64], values: &[f64]) -> Result<Score, Error> {
        let set = self.set(values);
        let rows: Vec<Option<f64>> = numbers
            .par_iter()
            .with_max_len(1)
            .map(|&number| {
                let row = self.bench.run_with(number, &set);
                let ended = row.cells[row.cells.len() - 3].text() == Some("complete");
                row.cells[self.place].number().filter(|_| ended)
            })
            .collect();
        let mut all: Vec<f64> = rows.iter().map(|own| own.unwrap_or(STOPPED)).collect();
        let mut complete: Vec<f64> = rows.iter().copied().flatten().collect();
        all.sort_by(f64::total_cmp);
        complete.sort_by(f64::total_cmp);
        let stopped = all.len() - complete.len();
        Ok(Score {
            quantile: percentile(&all, self.asked.quantile),
            median: percentile(&complete, 0.5),
            stopped,
            runs: rows.len(),
        })
    }

    /// Options that set these values.
    fn set(&self, values: &[f64]) -> Vec<String> {
        let parameters = self.asked.parameters.iter().zip(values);
        parameters
            .map(|(own, value)| format!("{}={}", own.name, with_unit(*value, &own.unit)))
            .collect()
    }

    /// Values at coordinates from 0 to 1.
    fn values(&self, at: &[f64]) -> Vec<f64> {
        let parameters = self.asked.parameters.iter().zip(at);
        parameters.map(|(own, at)| own.value(*at)).collect()
    }

    fn coordinates(&self, values: &[f64]) -> Vec<f64> {
        let parameters = self.asked.parameters.iter().zip(values);
        parameters.map(|(own, value)| own.place(*value)).collect()
    }
}

impl Parameter {
    fn is_logarithmic(&self) -> bool {
        self.low > 0.0 && self.high / self.low >= 5.0
    }

    /// The value at a place from 0 to 1: even, or even in the logarithm where the bounds span a factor of five.
    fn value(&self, at: f64) -> f64 {
        let at = at.clamp(0.0, 1.0);
        match self.is_logarithmic() {
            true => self.low * (self.high / self.low).powf(at),
            false => self.low + (self.high - self.low) * at,
        }
    }

    /// The place of a value.
    fn place(&self, value: f64) -> f64 {
        let at = match self.is_logarithmic() {
            true => (value / self.low).ln() / (self.high / self.low).ln(),
            false => (value - self.low) / (self.high - self.low),
        };
        at.clamp(0.0, 1.0)
    }
}

/// Whether two sets of values are one but for the rounding of coordinates and back.
fn are_same(one: &[f64], other: &[f64]) -> bool {
    let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
    one.iter().zip(other).all(is_near)
}

/// By how much a margin is kept.
fn margin(trial: Option<Trial>, own: impl Fn(&Held) -> Option<f64>, asked: f64) -> f64 {
    /// A loop that is not crossed has this much to spare; an unstable one lacks it.
    const MUCH: f64 = 20.0;
    match trial.and_then(|trial| trial.held) {
        Some(held) if held.is_stable => own(&held).map_or(MUCH, |own| own - asked),
        _ => -MUCH,
    }
}

/// Runs that the search sees, runs that it does not, and by what they are told apart: the last values of the
/// record or seed where there are several, otherwise the last runs.
type Parts = (Vec<u64>, Vec<u64>, Option<(String, Vec<String>)>);

fn parts(study: &Study, share: f64) -> Parts {
    let all: Vec<u64> = (0..study.runs()).collect();
    let motions = study
        .factors
        .iter()
        .enumerate()
        .find_map(|(place, factor)| {
            let is_motion = matches!(factor.key, Key::Record | Key::Reference | Key::Seed);
            match &factor.values {
                Values::List(list) if is_motion && list.len() > 1 => Some((place, factor, list)),
                _ => None,
            }
        });
    let held = |count: usize| ((share * count as f64).round() as usize).clamp(1, count - 1);
    if share <= 0.0 || all.len() < 2 {
        return (all, Vec::new(), None);
    }
    let Some((place, factor, list)) = motions else {
        let (training, held_out) = all.split_at(all.len() - held(all.len()));
        return (training.to_vec(), held_out.to_vec(), None);
    };
    let out: Vec<String> = list[list.len() - held(list.len())..]
        .iter()
        .map(ToString::to_string)
        .collect();
    let is_out = |number: &u64| out.contains(&study.settings(*number)[place].to_string());
    let (held_out, training): (Vec<u64>, Vec<u64>) = all.into_iter().partition(is_out);
    match training.is_empty() {
        true => (held_out, Vec::new(), None),
        false => (training, held_out, Some((factor.name.clone(), out))),
    }
}

impl Tuned {
    /// Writes `report.html`, `tuned.json` and `tuned.toml`, the part of a study that fixes what was found.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, folder: &Out) -> Result<Vec<PathBuf>, Error> {
        let mut results = Results::begin(folder)?;
        results.write_page(report::FILE, &page::page(self))?;
        results.write_json("tuned.json", self)?;
        let mut text = String::from("# Found by `shakebench tune`; for [fixed] of a study.\n");
        for own in &self.parameters {
            let value = match own.unit.as_str() {
                "" => format!("{:?}", own.after),
                unit => format!("\"{:?} {unit}\"", own.after),
            };
            text += &format!("\"{}\" = {value}\n", own.name);
        }
        results.write_text("tuned.toml", &text)?;
        Ok(results.finish()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(low: f64, high: f64) -> Parameter {
        Parameter {
            name: "control.gain".to_string(),
            unit: String::new(),
            low,
            high,
            before: low,
            after: low,
        }
    }

    #[test]
    fn wide_bounds_are_searched_in_the_logarithm() {
        // Middle of the bounds: the geometric mean from a factor of five on, otherwise the arithmetic one.
        for (low, high, middle) in [
            (0.1, 10.0, 1.0),
            (2.0, 10.0, 20_f64.sqrt()),
            (2.0, 9.0, 5.5),
            (-1.0, 9.0, 4.0),
            (0.0, 9.0, 4.5),
        ] {
            let own = parameter(low, high);
            assert!((own.value(0.5) - middle).abs() < 1e-12, "{low} to {high}");
            for (place, value) in [(0.0, low), (0.5, middle), (1.0, high)] {
                assert!((own.value(place) - value).abs() < 1e-12, "{low} to {high}");
                assert!((own.place(value) - place).abs() < 1e-12, "{low} to {high}");
            }
            // Outside of the bounds are the bounds.
            assert_eq!(own.value(1.5), own.value(1.0));
            assert_eq!(own.place(2.0 * high), 1.0);
        }
    }

    #[test]
    fn values_are_known_through_coordinates_and_back_and_others_are_not() {
        for (low, high) in [(0.1, 10.0), (-3.0, 5.0), (2e5, 9e5)] {
            let own = parameter(low, high);
            for place in 0..=20 {
                let value = own.value(f64::from(place) / 20.0);
                let back = own.value(own.place(value));
                assert!(are_same(&[value, 1.0], &[back, 1.0]), "{value} {back}");
            }
        }
        // Each value counts, whichever sign it has and whichever is the larger.
        for other in [1.0 + 2e-9, 1.0 - 2e-9, -1.0, 0.0] {
            assert!(!are_same(&[1.0], &[other]), "{other}");
            assert!(!are_same(&[other], &[1.0]), "{other}");
            assert!(!are_same(&[2.0, 1.0], &[2.0, other]), "{other}");
        }
        assert!(!are_same(&[-3.0], &[3.0]) && are_same(&[-3.0], &[-3.0]));
        assert!(are_same(&[0.0], &[0.0]));
        // Relative to the values: 1e-3 of 1e7 is as good as nothing, 1e-12 of 1e-6 is not.
        assert!(are_same(&[1e7], &[1e7 + 1e-3]) && !are_same(&[1e-6], &[1e-6 + 1e-12]));
    }

    fn study(factors: &str) -> Study {
        let text = format!("[study]\ndesign = \"full\"\n[factors]\n{factors}");
        Study::parse(std::path::Path::new("some.toml"), text).unwrap()
    }

    #[test]
    fn motions_are_held_out_whole() {
        let own = study("controller = [\"mpc\", \"lqg\"]\nseed = [1, 2, 3, 4, 5]\n");
        assert_eq!(own.runs(), 10);
        // Two fifths of the seeds: the last two of them, under each controller.
        let (training, held_out, named) = parts(&own, 0.4);
        let (factor, values) = named.unwrap();
        assert_eq!(
            (&*factor, &values[..]),
            ("seed", &["4".to_string(), "5".to_string()][..])
        );
        let seed = |number: &u64| own.settings(*number)[1].to_string();
        assert_eq!((training.len(), held_out.len()), (6, 4));
        assert!(held_out.iter().all(|run| ["4", "5"].contains(&&*seed(run))));
        assert!(
            training
                .iter()
                .all(|run| !["4", "5"].contains(&&*seed(run)))
        );
    }

    #[test]
    fn without_several_motions_the_last_runs_are_held_out() {
        let own =
            study("controller = [\"mpc\", \"lqg\", \"preview\", \"dual-loop\"]\nseed = [7]\n");
        assert_eq!(parts(&own, 0.25), (vec![0, 1, 2], vec![3], None));
        // One at least, and not all.
        assert_eq!(parts(&own, 0.01).1, [3]);
        assert_eq!(parts(&own, 1.0).0, [0]);
        assert_eq!(parts(&own, 0.0), (vec![0, 1, 2, 3], vec![], None));
    }

    /// What the optimiser calls a constraint that is kept: one that is not negative.
    #[test]
    fn the_optimiser_keeps_constraints_not_negative() {
        let objective = |x: &[f64], _: &mut ()| (x[0] + 1.0).powi(2) + x[1].powi(2);
        let kept = |x: &[f64], _: &mut ()| x[0] - 0.25;
        let constraints: Vec<&dyn Func<()>> = vec![&kept];
        let bounds = [(-2.0, 2.0); 2];
        let found = minimize(
            objective,
            &[1.0, 1.0],
            &bounds,
            &constraints,
            (),
            300,
            RhoBeg::All(0.5),
            None,
        );
        let (_, at, _) = found.unwrap();
        assert!((at[0] - 0.25).abs() < 1e-3 && at[1].abs() < 1e-3, "{at:?}");
    }

    fn tuned() -> Tuned {
        use plant::linear::margins::Margins;
        let score = |quantile, median, stopped| Score {
            quantile,
            median,
            stopped,
            runs: 20,
        };
        let held = |is_stable, gain: Option<f64>| Held {
            is_stable,
            margins: Margins {
                crossover: None,
                phase_margin_deg: Some(45.25),
                phase_crossover: None,
                gain_margin_db: gain,
            },
            peak_sensitivity: 1.5,
        };
        let trial = |value: f64, quantile, keeps_margins| Trial {
            values: vec![value, 0.5],
            score: score(quantile, 2.0, 0),
            held: None,
            keeps_margins,
        };
        let parameter = |name: &str, unit: &str, after| Parameter {
            name: name.into(),
            unit: unit.into(),
            low: 1.0,
            high: 12.5,
            before: 2.0,
            after,
        };
        Tuned {
            objective: "time_domain_percent".into(),
            quantile: 0.95,
            gain_margin_db: Some(6.0),
            phase_margin_deg: None,
            parameters: vec![
                parameter("control.gain", "V/m", 4.5),
                parameter("control.share", "", 0.25),
            ],
            held_out: Some(("seed".into(), vec!["4".into(), "5".into()])),
            before: Side {
                training: score(12.345, 8.0, 2),
                held_out: Some(score(14.0, f64::NAN, 20)),
                held: Some(held(false, None)),
            },
            after: Side {
                training: score(3.25, 2.0, 0),
                held_out: Some(score(4.5, 3.0, 0)),
                held: Some(held(true, None)),
            },
            trials: vec![
                trial(2.0, 12.345, false),
                trial(3.0, 6.0, true),
                trial(6.0, 9.0, true),
                trial(4.5, 3.25, true),
                trial(9.0, 1.0, false),
            ],
            ended: "the search has converged".into(),
            wall_s: 1.0,
            set: vec!["control.gain=4.5 V/m".into(), "control.share=0.25".into()],
            identity: vec![("Runs".into(), "20".into())],
        }
    }

    #[test]
    fn the_page_of_a_search_compares_before_and_after() {
        use pages::report::UnitSystem;
        let found = tuned();
        let text = expected::text_of(&page::page(&found), UnitSystem::Us);
        let alone = Tuned {
            held_out: None,
            gain_margin_db: None,
            before: Side {
                held_out: None,
                held: None,
                ..found.before
            },
            after: Side {
                held_out: None,
                ..found.after
            },
            ..found.clone()
        };
        let alone = expected::text_of(&page::page(&alone), UnitSystem::Us);
        let last = Tuned {
            held_out: None,
            ..found
        };
        let last = expected::text_of(&page::page(&last), UnitSystem::Us);
        let text = [text, alone, last].join("\n======\n");
        expected::compare(env!("CARGO_MANIFEST_DIR"), "tuned.txt", &text);
    }

    #[test]
    fn what_was_found_is_written_as_fixed_values_of_a_study() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let written = tuned().write(&Out::new(&out)).unwrap();
        assert_eq!(written.len(), 3);
        assert_eq!(
            std::fs::read_to_string(out.join("tuned.toml")).unwrap(),
            "# Found by `shakebench tune`; for [fixed] of a study.\n\
             \"control.gain\" = \"4.5 V/m\"\n\"control.share\" = 0.25\n"
        );
        let json = std::fs::read_to_string(out.join("tuned.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["trials"][1]["keeps_margins"], true);
    }

    #[test]
    fn a_margin_is_kept_by_what_it_exceeds_the_one_that_is_asked_for() {
        let found = tuned();
        let trial = |held| {
            Some(Trial {
                held,
                ..found.trials[0].clone()
            })
        };
        let phase = |held: &Held| held.margins.phase_margin_deg;
        let gain = |held: &Held| held.margins.gain_margin_db;
        let stable = found.after.held;
        assert_eq!(margin(trial(stable), phase, 40.0), 5.25);
        assert_eq!(margin(trial(stable), gain, 6.0), 20.0);
        assert_eq!(margin(trial(found.before.held), phase, 40.0), -20.0);
        assert_eq!(margin(trial(None), phase, 40.0), -20.0);
        assert_eq!(margin(None, phase, 40.0), -20.0);
    }
}
