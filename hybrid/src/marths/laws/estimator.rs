//! The plant's parameters, estimated during the test from commands and measured strokes.
//!
//! The plant has no noise of its own, so its states follow from the parameters: what is estimated is
//! the output error's minimum, by recursive Gauss-Newton steps from a prior (L. Ljung, System
//! Identification, 1999, chapter 11). States move with the parameters along their sensitivities.

use crate::marths::{ColumnDynamics, NOISE, Pair, PlantParameters};

/// Number of parameters.
const COUNT: usize = 14;

/// Those of a column's dynamics: first pole, second pole, pair, delay.
const OF_COLUMN: [[usize; 4]; 2] = [[2, 3, 4, DELAY], [6, 7, 4, DELAY]];

/// Place of the delay of both commands, samples.
const DELAY: usize = 13;

/// Relative standard deviations at the start: the nine values that the benchmark perturbs, the four
/// static gains, and the delay in samples.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Prior(pub [f64; COUNT]);

impl Default for Prior {
    fn default() -> Self {
        Self([
            0.055, 0.055, 0.06, 0.06, 0.05, 0.03, 0.03, 0.03, 0.03, 0.02, 0.02, 0.02, 0.02, 0.3,
        ])
    }
}

/// Step of differences by a parameter.
const STEP: f64 = 1e-5;

/// A plant whose parameters follow the measurement.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Estimator {
    nominal: PlantParameters,
    /// Relative deviations from the nominal values; the last is the delay in samples.
    by: [f64; COUNT],
    covariance: [[f64; COUNT]; COUNT],
    /// Variances at the start.
    prior: [f64; COUNT],
    /// Growth of each variance a sample.
    drift: [f64; COUNT],
    plant: PlantParameters,
    states: [[f64; 4]; 2],
    /// Change of each column's states by each of its parameters.
    sensitivities: [[[f64; 4]; 4]; 2],
    last: Pair,
    /// Mean square of the latest errors over what was expected.
    surprise: f64,
}

/// Samples over which the surprise is averaged.
const MEMORY: f64 = 64.0;

/// Part of the prior's variance that comes back in a sample for each unit of surprise, and the largest
/// surprise that counts.
const RETURNED: f64 = 1e-3;
const LARGEST_SURPRISE: f64 = 50.0;

/// Surprise from which it counts: two sensors' noise over the memory stays below.
const SURPRISING: f64 = 1.8;

impl Estimator {
    /// At rest, with a prior and a random walk whose standard deviation after a second is `walk` times
    /// the prior's.
    #[must_use]
    pub fn new(nominal: PlantParameters, prior: &Prior, walk: f64) -> Self {
        let mut covariance = [[0.0; COUNT]; COUNT];
        let mut drift = [0.0; COUNT];
        for i in 0..COUNT {
            covariance[i][i] = prior.0[i].powi(2);
            drift[i] = (walk * prior.0[i]).powi(2) * crate::marths::PERIOD;
        }
        Self {
            nominal,
            by: [0.0; COUNT],
            covariance,
            drift,
            plant: nominal,
            states: [[0.0; 4]; 2],
            sensitivities: [[[0.0; 4]; 4]; 2],
            last: [0.0; 2],
            surprise: 1.0,
            prior: prior.0.map(|deviation| deviation * deviation),
        }
    }

    /// The plant as it is estimated now.
    #[must_use]
    pub fn plant(&self) -> &PlantParameters {
        &self.plant
    }

    /// States of the columns.
    #[must_use]
    pub fn states(&self) -> &[[f64; 4]; 2] {
        &self.states
    }

    /// Delay of the commands, samples, and the last commands, m.
    #[must_use]
    pub fn pending(&self) -> (f64, Pair) {
        (self.by[DELAY], self.last)
    }

    /// Estimated strokes, m.
    #[must_use]
    pub fn strokes(&self) -> Pair {
        self.plant.strokes(&self.states)
    }

    /// Takes measured strokes (m).
    pub fn correct(&mut self, measured: Pair) {
        let slopes = self.slopes();
        let predicted = self.strokes();
        let mut moved = [0.0; COUNT];
        for i in 0..2 {
            let slope = &slopes[i];
            let along: [f64; COUNT] = std::array::from_fn(|a| dot(&self.covariance[a], slope));
            let variance = dot(slope, &along) + NOISE * NOISE;
            let error = measured[i] - predicted[i] - dot(slope, &moved);
            self.surprise += (error * error / variance - self.surprise) / MEMORY;
            for a in 0..COUNT {
                moved[a] += along[a] * error / variance;
                for b in 0..COUNT {
                    self.covariance[a][b] -= along[a] * along[b] / variance;
                }
            }
        }
        // Errors beyond what is expected say that the parameters are further off than believed.
        let beyond = (self.surprise - SURPRISING).clamp(0.0, LARGEST_SURPRISE);
        let returned = RETURNED * beyond;
        for a in 0..COUNT {
            self.by[a] += moved[a];
            self.covariance[a][a] += self.drift[a] + returned * self.prior[a];
        }
        // No parameter may leave the range in which the plant can be inverted.
        for by in &mut self.by[..DELAY] {
            *by = by.clamp(-0.5, 1.0);
        }
        self.by[DELAY] = self.by[DELAY].clamp(-0.5, 3.0);
        for (column, places) in OF_COLUMN.iter().enumerate() {
            for (own, place) in places.iter().enumerate() {
                for state in 0..4 {
                    self.states[column][state] +=
                        self.sensitivities[column][own][state] * moved[*place];
                }
            }
        }
        self.plant = varied(&self.nominal, &self.by);
    }

    /// A sample with commands (m) held.
    pub fn advance(&mut self, commands: Pair) {
        let delay = self.by[DELAY];
        for (i, command) in commands.into_iter().enumerate() {
            let column = self.plant.columns[i];
            let arrives = (1.0 - delay) * command + delay * self.last[i];
            let state = self.states[i];
            let next = column.after(state, arrives);
            for (own, sensitivity) in self.sensitivities[i].iter_mut().enumerate() {
                let input = if own == 3 {
                    self.last[i] - command
                } else {
                    0.0
                };
                *sensitivity = column.after(*sensitivity, input);
                if own < 3 {
                    let changed = nudged(&self.nominal.columns[i], &column, own);
                    let other = changed.after(state, arrives);
                    for s in 0..4 {
                        sensitivity[s] += (other[s] - next[s]) / STEP;
                    }
                }
            }
            self.states[i] = next;
        }
        self.last = commands;
    }

    /// Change of each stroke by each parameter.
    fn slopes(&self) -> [[f64; COUNT]; 2] {
        let mut slopes = [[0.0; COUNT]; 2];
        let here = self.strokes();
        for place in 0..DELAY {
            let mut by = self.by;
            by[place] += STEP;
            let there = varied(&self.nominal, &by).strokes(&self.states);
            for i in 0..2 {
                slopes[i][place] = (there[i] - here[i]) / STEP;
            }
        }
        for (column, places) in OF_COLUMN.iter().enumerate() {
            for (own, place) in places.iter().enumerate() {
                let mut states = [[0.0; 4]; 2];
                states[column] = self.sensitivities[column][own];
                let by = self.plant.strokes(&states);
                for i in 0..2 {
                    slopes[i][*place] += by[i];
                }
            }
        }
        slopes
    }
}

fn dot(a: &[f64; COUNT], b: &[f64; COUNT]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A column with one of its parameters moved by [`STEP`] of its nominal value.
fn nudged(nominal: &ColumnDynamics, column: &ColumnDynamics, own: usize) -> ColumnDynamics {
    let mut changed = *column;
    match own {
        0 | 1 => changed.poles[own] += STEP * nominal.poles[own],
        _ => {
            changed.decay += STEP * nominal.decay;
            changed.frequency += STEP * nominal.frequency;
        }
    }
    changed
}

fn varied(nominal: &PlantParameters, by: &[f64; COUNT]) -> PlantParameters {
    let mut plant = *nominal;
    let factor = |i: usize| 1.0 + by[i];
    plant.first_zeros[0] *= factor(0);
    plant.first_zeros[1] *= factor(1);
    plant.columns[0].poles[0] *= factor(2);
    plant.columns[0].poles[1] *= factor(3);
    for column in &mut plant.columns {
        column.decay *= factor(4);
        column.frequency *= factor(4);
    }
    plant.second_zeros[0] *= factor(5);
    plant.columns[1].poles[0] *= factor(6);
    plant.columns[1].poles[1] *= factor(7);
    plant.second_zeros[1] *= factor(8);
    for (i, row) in plant.static_gain.iter_mut().enumerate() {
        for (j, gain) in row.iter_mut().enumerate() {
            *gain *= factor(9 + 2 * i + j);
        }
    }
    plant
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::marths::{Deviation, Plant, independent_noise};

    #[test]
    fn a_perturbed_plant_is_found_and_its_strokes_are_better_than_the_sensors() {
        let nominal = PlantParameters::default();
        let truth = Deviation::default().draw(&nominal, 11, 4);
        let mut plant = Plant::new(truth).unwrap();
        let mut estimator = Estimator::new(nominal, &Prior::default(), 0.0);
        let noise = independent_noise(11, 1, 4096);
        let mut square = 0.0;
        for (k, noise) in noise.iter().enumerate() {
            let t = k as f64 * crate::marths::PERIOD;
            let strokes = plant.strokes();
            estimator.correct([0, 1].map(|i| strokes[i] + noise[i]));
            if k >= 2048 {
                square += (estimator.strokes()[0] - strokes[0]).powi(2) / 2048.0;
            }
            let command = [
                2e-3 * (14.0 * t).sin() + 4e-4 * (90.0 * t).sin(),
                2e-3 * (17.0 * t).cos() + 4e-4 * (75.0 * t).sin(),
            ];
            plant.step(command);
            estimator.advance(command);
        }
        assert!(square.sqrt() < 0.1 * NOISE, "{}", square.sqrt());
        let pole = estimator.plant().columns[0].poles[0] / truth.columns[0].poles[0];
        assert!((pole - 1.0).abs() < 0.01, "{pole}");
    }
}
