//! The plant's inverse, both actuators at once.

use plant::ModelError;

use super::Law;
use crate::laws::extrapolation::{DERIVATIVES, Extrapolation};
use crate::marths::{ColumnDynamics, PERIOD, Pair, PlantParameters, Volts};

/// Order of a column's dynamics, and of its inverse.
const ORDER: usize = 4;

/// Commands whose strokes under a plant without noise are the targets.
///
/// With `w_j` behind the lag of command `j`, the strokes are `x_i = k_i1 N_1 w_1 + k_i2 (1 + s / z_i) w_2`.
/// Without `w_1` a first-order equation is left, `k_21 x_1 - k_11 x_2 = (a + b s) w_2`, which the law
/// integrates; its pole is the plant's transmission zero. Everything else follows from derivatives. The
/// zeros of `N_1` lie far above the motions and become a series.
#[derive(Debug, Clone, Copy)]
pub struct Inverse {
    plant: PlantParameters,
    targets: [Extrapolation; 2],
    /// `a` and `b`.
    inner: Pair,
    /// Coefficients of the derivatives of `v_1 = N_1 w_1` and of `w_2`, s^i.
    lag: [[f64; ORDER + 1]; 2],
    second: f64,
    range: [Pair; 2],
}

impl Inverse {
    /// At rest. The targets are polynomials of `order` through `window` samples, led by half a sample,
    /// since commands are held.
    ///
    /// # Errors
    /// A plant that has no stable inverse; an order or window out of range.
    pub fn new(plant: PlantParameters, order: usize, window: usize) -> Result<Self, ModelError> {
        plant.validate()?;
        let [[k11, k12], [k21, k22]] = plant.static_gain;
        let zeros = plant.second_zeros;
        let a = k21 * k12 - k11 * k22;
        let b = k21 * k12 / zeros[0] - k11 * k22 / zeros[1];
        if !(a / b > 0.0 && k11 != 0.0) {
            return Err(ModelError::Parameter {
                name: "static_gain",
                value: a / b,
                expected: "a plant whose inverse is stable: a transmission zero in the left half plane",
            });
        }
        let [first, second] = plant.columns.map(|column| polynomial(&column));
        let [one, other] = plant.first_zeros.map(|zero| 1.0 / zero);
        Ok(Self {
            targets: [Extrapolation::new(order, window, 0.5)?; 2],
            inner: [a, b],
            lag: [divided(first, [one + other, one * other]), second],
            second: 0.0,
            range: Volts::default().range(),
            plant,
        })
    }
}

/// Coefficients of a column's denominator with unit static gain, s^i.
fn polynomial(column: &ColumnDynamics) -> [f64; ORDER + 1] {
    let mut product = [1.0, 0.0, 0.0, 0.0, 0.0];
    let [first, second] = column.poles;
    let square = column.square();
    let factors = [
        [1.0 / first, 0.0],
        [1.0 / second, 0.0],
        [2.0 * column.decay / square, 1.0 / square],
    ];
    for [one, two] in factors {
        for i in (1..=ORDER).rev() {
            let before = if i > 1 { product[i - 2] } else { 0.0 };
            product[i] += one * product[i - 1] + two * before;
        }
    }
    product
}

/// The series of a polynomial over `1 + one s + two s^2`.
fn divided(polynomial: [f64; ORDER + 1], [one, two]: Pair) -> [f64; ORDER + 1] {
    let mut series = polynomial;
    for i in 1..=ORDER {
        let before = if i > 1 { series[i - 2] } else { 0.0 };
        series[i] -= one * series[i - 1] + two * before;
    }
    series
}

impl Law for Inverse {
    fn step(&mut self, target: Pair, _measured: Pair) -> Pair {
        let [x, y]: [[f64; DERIVATIVES]; 2] =
            [0, 1].map(|i| self.targets[i].step(target[i], PERIOD));
        let [[k11, k12], [k21, _]] = self.plant.static_gain;
        let [a, b] = self.inner;
        let mut second = [self.second; ORDER + 2];
        for n in 0..=ORDER {
            second[n + 1] = (k21 * x[n] - k11 * y[n] - a * second[n]) / b;
        }
        let mut command = [0.0; 2];
        for n in 0..=ORDER {
            let push = k12 * (second[n] + second[n + 1] / self.plant.second_zeros[0]);
            command[0] += self.lag[0][n] * (x[n] - push) / k11;
            command[1] += self.lag[1][n] * second[n];
        }
        let step = PERIOD;
        self.second += step * (second[1] + step / 2.0 * (second[2] + step / 3.0 * second[3]));
        [0, 1].map(|i| command[i].clamp(self.range[i][0], self.range[i][1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::marths::{Plant, RATE};

    /// Sines of 2 and 3 Hz on both targets at once: what is left is the series of the far zeros and the hold.
    #[test]
    fn strokes_are_the_targets_where_the_plant_is_the_one_that_is_inverted() {
        let nominal = PlantParameters::default();
        let mut law = Inverse::new(nominal, 5, 6).unwrap();
        let mut plant = Plant::new(nominal).unwrap();
        let mut worst = 0.0_f64;
        for k in 0..4096 {
            let t = f64::from(k) / RATE;
            let target = [12.6, 18.9].map(|omega: f64| 1e-3 * (omega * t).sin());
            let strokes = plant.strokes();
            if k > 1024 {
                worst = worst.max((strokes[0] - target[0]).abs());
                worst = worst.max((strokes[1] - target[1]).abs());
            }
            plant.step(law.step(target, strokes));
        }
        assert!(worst < 1e-6, "{worst}");
    }

    #[test]
    fn a_plant_without_a_stable_inverse_is_refused() {
        // The cross entries dominate at high frequency only.
        let plant = PlantParameters {
            static_gain: [[1.0, 0.9], [0.9, 1.0]],
            second_zeros: [2.0, 200.0],
            ..PlantParameters::default()
        };
        let said = Inverse::new(plant, 2, 12).unwrap_err().to_string();
        assert!(said.contains("inverse is stable"), "{said}");
    }
}
