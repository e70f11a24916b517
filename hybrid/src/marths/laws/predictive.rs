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

    /// Strokes over the horizon without commands.
    fn free(&self) -> [Pair; LONGEST] {
        let plant = self.estimator.plant();
        let (delay, mut last) = self.estimator.pending();
        let mut states = *self.estimator.states();
        let mut strokes = [[0.0; 2]; LONGEST];
        for stroke in &mut strokes[..self.design.horizon] {
            for i in 0..2 {
                states[i] = plant.columns[i].after(states[i], delay * last[i]);
            }
            last = [0.0; 2];
            *stroke = plant.strokes(&states);
        }
        strokes
    }

    /// Strokes over the horizon under each term of a command alone, from rest: the term's convolution with the
    /// strokes that one sample of the command makes.
    fn forced(&self) -> [[Pair; LONGEST]; 2 * TERMS] {
        let plant = self.estimator.plant();
        let (delay, _) = self.estimator.pending();
        let horizon = self.design.horizon;
        let mut forced = [[[0.0; 2]; LONGEST]; 2 * TERMS];
        for (i, column) in plant.columns.iter().enumerate() {
            let mut states = [[0.0; 4]; 2];
            let mut pulse = [[0.0; 2]; LONGEST];
            for (k, stroke) in pulse[..horizon].iter_mut().enumerate() {
                let arrives = match k {
                    0 => 1.0 - delay,
                    1 => delay,
                    _ => 0.0,
                };
                states[i] = column.after(states[i], arrives);
                *stroke = plant.strokes(&states);
            }
            for from in 0..horizon {
                let ahead = from as f64 / horizon as f64;
                let mut size = 1.0;
                for term in &mut forced[i * TERMS..(i + 1) * TERMS] {
                    for (sum, [one, other]) in term[from..horizon].iter_mut().zip(&pulse) {
                        sum[0] += size * one;
                        sum[1] += size * other;
                    }
                    size *= ahead;
                }
            }
        }
        forced
    }

    fn command(&self, wanted: &[Pair; LONGEST]) -> Pair {
        let horizon = self.design.horizon;
        let (_, last) = self.estimator.pending();
        let free = self.free();
        let forced = self.forced();
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
