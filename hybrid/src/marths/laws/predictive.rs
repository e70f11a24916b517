//! Model predictive tracking for both actuators at once.
//!
//! Targets are continued by polynomials through their last samples. The commands over the horizon are
//! polynomials of second order whose predicted strokes come nearest to them; the first is given out
//! within the volt limit. The model is the nominal plant or follows the measurement.

use nalgebra::{SMatrix, SVector};
use plant::ModelError;

use super::estimator::{Estimator, Prior};
use super::{Class, Law};
use crate::laws::extrapolation::Extrapolation;
use crate::marths::{Pair, PlantParameters, Volts};

/// Terms of a command over the horizon.
const TERMS: usize = 3;

/// Longest horizon, samples.
pub const LONGEST: usize = 24;

/// What a predictive law is made of.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PredictiveDesign {
    /// The plant that is believed at the start.
    pub plant: PlantParameters,
    /// Whether the model follows the measurement.
    pub adaptive: bool,
    /// What is fed to the force; an estimate needs a model that follows.
    pub class: Class,
    /// Samples of the horizon; with fewer than ten the loop is unstable where the commands come late.
    pub horizon: usize,
    /// Order of the targets' polynomials.
    pub order: usize,
    /// Samples that they are fitted to.
    pub window: usize,
    /// Weight of the commands' terms against the strokes' errors.
    pub effort: f64,
}

impl Default for PredictiveDesign {
    fn default() -> Self {
        Self {
            plant: PlantParameters::default(),
            adaptive: true,
            class: Class::Raw,
            horizon: 10,
            order: 2,
            window: 12,
            effort: 1e-7,
        }
    }
}

impl PredictiveDesign {
    /// The estimator of the law, at rest.
    #[must_use]
    pub fn estimator(&self) -> Estimator {
        Estimator::new(self.plant, &Prior::default(), 0.01)
    }
}

/// A predictive law in motion.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Predictive {
    design: PredictiveDesign,
    estimator: Estimator,
    targets: [Extrapolation; 2],
    range: [Pair; 2],
}

impl Predictive {
    /// At rest.
    ///
    /// # Errors
    /// A plant that cannot be inverted, a horizon or window out of range.
    pub fn new(design: PredictiveDesign) -> Result<Self, ModelError> {
        design.plant.validate()?;
        if !(2..=LONGEST).contains(&design.horizon) {
            return Err(ModelError::Parameter {
                name: "horizon",
                value: design.horizon as f64,
                expected: "2 to 24 samples",
            });
        }
        Ok(Self {
            targets: [Extrapolation::new(design.order, design.window, 0.0)?; 2],
            estimator: design.estimator(),
            range: Volts::default().range(),
            design,
        })
    }

    /// Strokes over the horizon under commands of both actuators by the sample.
    fn predict(
        &self,
        states: [[f64; 4]; 2],
        before: Pair,
        command: impl Fn(usize) -> Pair,
    ) -> [Pair; LONGEST] {
        let plant = self.estimator.plant();
        let (delay, _) = self.estimator.pending();
        let (mut states, mut last) = (states, before);
        let mut strokes = [[0.0; 2]; LONGEST];
        for (k, stroke) in strokes[..self.design.horizon].iter_mut().enumerate() {
            let now = command(k);
            for i in 0..2 {
                let arrives = (1.0 - delay) * now[i] + delay * last[i];
                states[i] = plant.columns[i].after(states[i], arrives);
            }
            last = now;
            *stroke = plant.strokes(&states);
        }
        strokes
    }

    fn command(&self, wanted: &[Pair; LONGEST]) -> Pair {
        let horizon = self.design.horizon;
        let (_, last) = self.estimator.pending();
        let free = self.predict(*self.estimator.states(), last, |_| [0.0; 2]);
        let rest = [[0.0; 4]; 2];
        let mut forced = [[[0.0; 2]; LONGEST]; 2 * TERMS];
        for (place, forced) in forced.iter_mut().enumerate() {
            *forced = self.predict(rest, [0.0; 2], |k| {
                let mut command = [0.0; 2];
                let ahead = k as f64 / horizon as f64;
                command[place / TERMS] = ahead.powi((place % TERMS) as i32);
                command
            });
        }
        let mut matrix = SMatrix::<f64, 6, 6>::identity() * self.design.effort;
        let mut right = SVector::<f64, 6>::zeros();
        for k in 0..horizon {
            for i in 0..2 {
                let row = SVector::<f64, 6>::from_fn(|term, _| forced[term][k][i]);
                matrix += row * row.transpose();
                right += row * (wanted[k][i] - free[k][i]);
            }
        }
        let Some(factor) = matrix.cholesky() else {
            return last;
        };
        let terms = factor.solve(&right);
        [0, 1].map(|i| terms[i * TERMS].clamp(self.range[i][0], self.range[i][1]))
    }
}

impl Law for Predictive {
    fn class(&self) -> Class {
        self.design.class
    }

    fn feedback(&mut self, measured: Pair) -> Pair {
        if self.design.adaptive {
            self.estimator.correct(measured);
        }
        match self.design.class {
            Class::Raw => measured,
            Class::Estimate => self.estimator.strokes(),
        }
    }

    fn step(&mut self, target: Pair, _measured: Pair) -> Pair {
        let mut wanted = [[0.0; 2]; LONGEST];
        for i in 0..2 {
            // Per sample, so that the polynomial goes on by its Taylor series.
            let derivatives = self.targets[i].step(target[i], 1.0);
            for (k, wanted) in wanted[..self.design.horizon].iter_mut().enumerate() {
                let ahead = (k + 1) as f64;
                let series = derivatives.iter().enumerate().rev();
                wanted[i] = series.fold(0.0, |sum, (order, derivative)| {
                    derivative + sum * ahead / (order + 1) as f64
                });
            }
        }
        let command = self.command(&wanted);
        self.estimator.advance(command);
        command
    }
}
