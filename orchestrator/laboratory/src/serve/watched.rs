//! The live page of a service: trial, commit, force and round trip, step by step.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bridges::Step;
use pages::live::{Plot, Scene, Server, Tap};
use pages::report::{UnitSystem, Units};

use crate::error::Error;

/// Least time between two rows: a page shows no more, and a service has no known length.
const EVERY: Duration = Duration::from_millis(20);
/// Rows that are kept: five hours of them.
const ROWS: usize = 1_000_000;
/// Columns before those of the degrees of freedom: time, step, trials and round trip.
const HEAD: usize = 4;

/// A service that is shown.
pub struct Watched {
    tap: Arc<Tap>,
    server: Server,
    shown: Option<Instant>,
    /// Longest answer since the last row.
    longest: Duration,
    row: Vec<f64>,
}

impl Watched {
    /// Serves the page of `system`, an element with so many degrees of freedom, at a port of 127.0.0.1,
    /// any free one for 0, in these units.
    ///
    /// # Errors
    /// A port that is taken.
    pub fn start(
        system: &str,
        degrees_of_freedom: usize,
        port: u16,
        units: UnitSystem,
    ) -> Result<Self, Error> {
        let scene = scene(system, degrees_of_freedom, units);
        let signals = HEAD - 1 + 3 * degrees_of_freedom;
        let tap = Arc::new(Tap::new((0..signals).collect(), ROWS));
        let server =
            Server::start(&scene, Arc::clone(&tap), None, port).map_err(|error| Error::Option {
                option: "--watch",
                reason: error.to_string(),
            })?;
        Ok(Self {
            tap,
            server,
            shown: None,
            longest: Duration::ZERO,
            row: Vec::with_capacity(signals),
        })
    }

    /// Address of the page.
    #[must_use]
    pub fn url(&self) -> String {
        self.server.url()
    }

    /// Shows a committed step, unless one was shown less than 20 ms ago.
    pub fn step(&mut self, step: &Step<'_>) {
        self.longest = self.longest.max(step.answer);
        if self.shown.is_some_and(|at| at.elapsed() < EVERY) {
            return;
        }
        self.row.clear();
        self.row.extend([
            step.number as f64,
            step.trials as f64,
            self.longest.as_secs_f64(),
        ]);
        let n = step.measured.force.len();
        let trial = &step.trial.displacement;
        // A client may ask for forces without sending displacements.
        self.row
            .extend((0..n).map(|i| trial.get(i).copied().unwrap_or(f64::NAN)));
        self.row.extend(&step.measured.displacement);
        self.row.extend(&step.measured.force);
        self.tap.push(step.measured.time, &self.row);
        self.shown = Some(Instant::now());
        self.longest = Duration::ZERO;
    }

    /// Says how the service ended and waits until the page knows, not long.
    pub fn finish(&self, words: &str) {
        self.tap.finish(words);
        self.server.farewell();
    }
}

/// The plots of an element with so many degrees of freedom.
fn scene(system: &str, degrees_of_freedom: usize, reader: UnitSystem) -> Scene {
    let names = |what: &str, group: usize| -> Vec<(String, usize)> {
        let own = (0..degrees_of_freedom).map(|i| {
            let number = match degrees_of_freedom {
                1 => String::new(),
                _ => format!(" {}", i + 1),
            };
            let column = HEAD + group * degrees_of_freedom + i;
            (format!("{what}{number}"), column)
        });
        own.collect()
    };
    let units = |units: Units| {
        let (factor, unit) = units.unit(reader);
        (unit.to_string(), factor)
    };
    let plot = |title: &str, unit: (String, f64), signals: Vec<(String, usize)>| Plot {
        title: title.to_string(),
        unit,
        signals,
        limit: None,
    };
    let mut displacements = names("reference: trial", 0);
    displacements.extend(names("measured", 1));
    Scene {
        title: format!("{system}, served"),
        duration: None,
        plots: vec![
            plot("Displacement", units(Units::DISPLACEMENT), displacements),
            plot("Force", units(Units::FORCE), names("force", 2)),
            plot(
                "From a trial to its force",
                ("ms".to_string(), 1e-3),
                vec![("round trip".to_string(), 3)],
            ),
            plot(
                "Trials per committed step",
                (String::new(), 1.0),
                vec![("trials".to_string(), 2)],
            ),
        ],
        step: Some(1),
        tripped: None,
        cause: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bridges::element::{Measured, Trial};

    #[test]
    fn a_row_holds_step_trials_round_trip_and_every_degree_of_freedom() {
        let mut watched = Watched::start("frame", 2, 0, UnitSystem::Us).unwrap();
        let trial = Trial {
            displacement: vec![0.5, -0.25],
            ..Trial::default()
        };
        let measured = Measured {
            displacement: vec![0.375, -0.125],
            force: vec![8.0, 16.0],
            time: 0.75,
            ..Measured::zeros(2)
        };
        let mut step = Step {
            number: 3,
            trial: &trial,
            measured: &measured,
            trials: 5,
            answer: Duration::from_millis(250),
        };
        watched.step(&step);
        let row = [0.75, 3.0, 5.0, 0.25, 0.5, -0.25, 0.375, -0.125, 8.0, 16.0];
        assert_eq!(watched.tap.rows(0, 9), [row]);
        // What follows at once is left out, but not its round trip.
        step.answer = Duration::from_millis(500);
        watched.shown = Some(Instant::now() + Duration::from_secs(60));
        watched.step(&step);
        assert_eq!(watched.tap.len(), 1);
        watched.shown = None;
        step.answer = Duration::ZERO;
        watched.step(&step);
        assert_eq!(watched.tap.rows(1, 9)[0][3], 0.5);
        // The scene names the columns of that row.
        let scene = scene("frame", 2, UnitSystem::Us);
        let column = |plot: usize, n: usize| {
            let (name, column) = &scene.plots[plot].signals[n];
            (name.as_str(), row[*column])
        };
        assert_eq!(column(0, 1), ("reference: trial 2", -0.25));
        assert_eq!(column(0, 2), ("measured 1", 0.375));
        assert_eq!(column(1, 1), ("force 2", 16.0));
        assert_eq!(column(2, 0).1, 0.25);
        assert_eq!(column(3, 0).1, 5.0);
    }
}
