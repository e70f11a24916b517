//! The error of the coupling, estimated from runs with different steps, and steps halved until it is
//! small enough.
//!
//! With a method of order p the error of the run with half the step is the difference of both runs
//! over 2^p - 1 (Richardson; Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I*,
//! II.4).

use serde::{Deserialize, Serialize};

use super::experiment::Prepared;
use fmi_import::{Causality, Kind, Variability};
use fmi_master::{Algorithm, MasterError, Record};

/// A step is halved so often at most.
const MOST_HALVINGS: usize = 7;

/// How large the error of the coupling is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CouplingError {
    /// Of the signal that is most in error: its largest error over its peak, per cent.
    pub percent: f64,
    /// That signal, as `component.variable`.
    pub signal: String,
    /// What was asked for, per cent.
    pub wanted_percent: f64,
    /// Coupling steps that were tried, s; the last is that of the run.
    pub steps_s: Vec<f64>,
}

impl CouplingError {
    /// Whether the error is as small as it was asked to be.
    pub fn is_reached(&self) -> bool {
        self.percent <= self.wanted_percent
    }
}

/// Halves the coupling step of a run until the error of its coupling is estimated to be at most so
/// many per cent of the peak of each continuous output of its continuous components.
///
/// # Errors
/// As [`Prepared::simulation`]; nothing that is continuous and coupled; a run that ends early whatever
/// its step.
pub fn refine(prepared: &mut Prepared, wanted_percent: f64) -> Result<CouplingError, MasterError> {
    let order = match prepared.algorithm {
        Algorithm::Jacobi => 1,
        Algorithm::GaussSeidel | Algorithm::Iterative => 2,
    };
    let signals = continuous(prepared);
    let mut steps = vec![prepared.step];
    let run = |prepared: &Prepared| -> Result<(Record, bool), MasterError> {
        let outcome = prepared.run(prepared.algorithm)?;
        Ok((outcome.record, outcome.ended.is_regular()))
    };
    let (mut coarse, mut came_to_its_end) = run(prepared)?;
    loop {
        prepared.step *= 0.5;
        steps.push(prepared.step);
        let (fine, is_whole) = run(prepared)?;
        let both = came_to_its_end && is_whole && coarse.len() == fine.len();
        came_to_its_end = is_whole;
        // A run that ended early says nothing of the rest.
        if !both {
            if steps.len() > MOST_HALVINGS {
                return Err(MasterError::Step(format!(
                    "--coupling-error: the run ends early with every coupling step down to {} ms",
                    1e3 * prepared.step
                )));
            }
            coarse = fine;
            continue;
        }
        let Some((percent, signal)) = estimate(&signals, &coarse, &fine, order) else {
            return Err(MasterError::Step(
                "--coupling-error: the system has no continuous component with continuous \
                 outputs, so there is no coupling error"
                    .to_string(),
            ));
        };
        let error = CouplingError {
            percent,
            signal,
            wanted_percent,
            steps_s: steps.clone(),
        };
        if error.is_reached() || steps.len() > MOST_HALVINGS {
            return Ok(error);
        }
        coarse = fine;
    }
}

/// Names of the continuous outputs of continuous components.
fn continuous(prepared: &Prepared) -> Vec<String> {
    let parts = prepared.system.components.iter();
    let parts = parts.filter(|part| part.period.is_none());
    let names = parts.flat_map(|part| {
        let description = &part.fmu.description;
        let outputs = description.of(Causality::Output);
        let variables = outputs.map(|output| &description.variables[output]);
        let real = variables.filter(|variable| {
            matches!(variable.kind, Kind::Float64 | Kind::Float32)
                && variable.variability == Variability::Continuous
        });
        real.map(|variable| format!("{}.{}", part.name, variable.name))
    });
    names.collect()
}

/// The signal that differs most, over its peak, and its error in the finer record, per cent.
fn estimate(
    signals: &[String],
    coarse: &Record,
    fine: &Record,
    order: i32,
) -> Option<(f64, String)> {
    let errors = signals.iter().filter_map(|name| {
        let (coarse, fine) = (coarse.column(name)?, fine.column(name)?);
        let peak = fine
            .iter()
            .fold(0.0_f64, |peak, value| peak.max(value.abs()));
        let pairs = coarse.iter().zip(&fine);
        let worst = pairs.fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
        let error = match peak > 0.0 {
            true => 100.0 * worst / (2_f64.powi(order) - 1.0) / peak,
            false => 0.0,
        };
        Some((error, name.clone()))
    });
    errors.max_by(|one, other| one.0.total_cmp(&other.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(columns: &[&str], rows: &[&[f64]]) -> Record {
        let columns = columns.iter().map(ToString::to_string).collect();
        Record::of(columns, rows.concat(), Vec::new(), Vec::new()).unwrap()
    }

    /// The difference over the peak, and over 2^p - 1 of it with order p.
    #[test]
    fn the_error_of_the_coupling_is_that_of_the_signal_with_the_largest() {
        let columns = ["time", "a.x", "b.y", "c.rest"];
        let coarse = record(&columns, &[&[0.0, 1.0, 9.0, 0.0], &[0.1, -2.2, 10.0, 0.5]]);
        let fine = record(&columns, &[&[0.0, 1.1, 9.0, 0.0], &[0.1, -2.0, 9.5, 0.0]]);
        let names = ["a.x", "b.y", "c.rest", "not.there"].map(String::from);
        for (order, part) in [(1, 1.0), (2, 3.0)] {
            let (percent, signal) = estimate(&names, &coarse, &fine, order).unwrap();
            assert_eq!(signal, "a.x");
            assert!((percent - 10.0 / part).abs() < 1e-9, "{percent}");
        }
        let (percent, _) = estimate(&names[1..], &coarse, &fine, 1).unwrap();
        assert!((percent - 100.0 * 0.5 / 9.5).abs() < 1e-9, "{percent}");
        // A signal that rests in the finer record has no error.
        assert_eq!(estimate(&names[2..], &coarse, &fine, 1).unwrap().0, 0.0);
        assert!(estimate(&names[3..], &coarse, &fine, 1).is_none());
    }

    #[test]
    fn an_error_is_reached_at_what_was_asked_for() {
        let own = |percent| CouplingError {
            percent,
            signal: "a.x".into(),
            wanted_percent: 0.5,
            steps_s: vec![0.002, 0.001],
        };
        assert_eq!(
            [0.4, 0.5, 0.51].map(|percent| own(percent).is_reached()),
            [true, true, false]
        );
    }
}
