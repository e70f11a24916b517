//! The best law of the single-axis benchmark, once for each actuator.

use controllers::Controller;
use nalgebra::{Complex, DMatrix, DVector};
use plant::ModelError;

use super::Law;
use crate::laws::TrackingInput;
use crate::laws::adaptive_inverse::{AdaptiveInverse, AdaptiveInverseMemory};
use crate::laws::extrapolation::{DERIVATIVES, Extrapolation};
use crate::marths::{PERIOD, Pair, PlantParameters, Volts};

/// Highest frequency of the motions, rad/s.
const HIGHEST: f64 = 60.0;
/// Frequencies at which the inverse is fitted.
const LINES: usize = 60;

/// An [`AdaptiveInverse`] for each actuator, which leaves the other one out.
#[derive(Debug, Clone, Copy)]
pub struct SingleAxis {
    laws: [AdaptiveInverse; 2],
    range: [Pair; 2],
}

impl SingleAxis {
    /// At rest. Each coefficient may be off by a `spread`, one standard deviation; `order`, `window` and
    /// `lead` (samples) are those of the targets' polynomials.
    ///
    /// # Errors
    /// A plant that cannot be inverted, a window out of range.
    pub fn new(
        plant: &PlantParameters,
        spread: f64,
        order: usize,
        window: usize,
        lead: f64,
    ) -> Result<Self, ModelError> {
        plant.validate()?;
        let desired = Extrapolation::new(order, window, lead)?;
        let law = |i: usize| {
            let nominal = inverse(plant, i, order);
            let mut covariance = [[0.0; DERIVATIVES]; DERIVATIVES];
            for (k, coefficient) in nominal.iter().enumerate() {
                covariance[k][k] = (spread * coefficient).powi(2);
            }
            AdaptiveInverse {
                nominal,
                covariance,
                error_variance: AdaptiveInverse::ERROR_VARIANCE,
                corner: AdaptiveInverse::CORNER,
                desired,
                memory: AdaptiveInverseMemory::default(),
            }
        };
        Ok(Self {
            laws: [law(0), law(1)],
            range: Volts::default().range(),
        })
    }
}

/// Coefficients of the inverse of an actuator's own entry, s^i, by least squares of its relative error up to
/// the motions' highest frequency: its zero lies among the motions, so that a series in s does not serve.
fn inverse(plant: &PlantParameters, i: usize, order: usize) -> [f64; DERIVATIVES] {
    let column = &plant.columns[i];
    let response = |s: Complex<f64>| {
        let lag = (s / column.poles[0] + 1.0) * (s / column.poles[1] + 1.0);
        let pair = (s * s + s * 2.0 * column.decay) / column.square() + 1.0;
        let zeros = match i {
            0 => (s / plant.first_zeros[0] + 1.0) * (s / plant.first_zeros[1] + 1.0),
            _ => s / plant.second_zeros[1] + 1.0,
        };
        zeros * plant.static_gain[i][i] / (lag * pair)
    };
    let mut matrix = DMatrix::zeros(2 * LINES, order + 1);
    let mut right = DVector::zeros(2 * LINES);
    for line in 0..LINES {
        let s = Complex::new(0.0, HIGHEST * (line + 1) as f64 / LINES as f64);
        let response = response(s);
        for power in 0..=order {
            // Per power of the highest frequency, so that the columns are alike in size.
            let entry = response * (s / HIGHEST).powi(power as i32);
            matrix[(2 * line, power)] = entry.re;
            matrix[(2 * line + 1, power)] = entry.im;
        }
        right[2 * line] = 1.0;
    }
    let found = matrix.svd(true, true).solve(&right, 1e-12);
    let found = found.unwrap_or_else(|_| DVector::zeros(order + 1));
    std::array::from_fn(|k| {
        let scale = HIGHEST.powi(k as i32);
        found.get(k).map_or(0.0, |value| value / scale)
    })
}

impl Law for SingleAxis {
    fn step(&mut self, target: Pair, measured: Pair) -> Pair {
        [0, 1].map(|i| {
            let input = TrackingInput {
                desired: target[i],
                measured: measured[i],
                force: 0.0,
            };
            let command = self.laws[i].step(&input, PERIOD);
            command.clamp(self.range[i][0], self.range[i][1])
        })
    }
}
