//! The two actuators with everything that hangs on them: commands to strokes.

use std::f64::consts::TAU;

use plant::ModelError;

use super::{PERIOD, Pair};

/// The lag behind one command, with unit static gain: two real poles, then a complex pair. Its states
/// are those after the first pole, after the second, and the pair's place and rate.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ColumnDynamics {
    /// Real poles, rad/s, positive.
    pub poles: [f64; 2],
    /// The pair's decay, rad/s, positive.
    pub decay: f64,
    /// The pair's frequency, rad/s.
    pub frequency: f64,
}

impl ColumnDynamics {
    /// Square of the pair's distance from zero, (rad/s)^2.
    #[inline]
    #[must_use]
    pub fn square(&self) -> f64 {
        self.decay * self.decay + self.frequency * self.frequency
    }

    /// Rates of the states under a command.
    #[inline]
    #[must_use]
    pub fn rates(&self, [first, second, place, rate]: [f64; 4], command: f64) -> [f64; 4] {
        [
            self.poles[0] * (command - first),
            self.poles[1] * (first - second),
            rate,
            self.square() * (second - place) - 2.0 * self.decay * rate,
        ]
    }

    /// Acceleration of the pair.
    #[inline]
    #[must_use]
    pub fn acceleration(&self, state: [f64; 4]) -> f64 {
        self.rates(state, 0.0)[3]
    }

    /// One step of the classical method of Runge and Kutta of fourth order under a held command.
    #[inline]
    #[must_use]
    pub fn after(&self, state: [f64; 4], command: f64) -> [f64; 4] {
        let moved = |by: f64, rate: [f64; 4]| -> [f64; 4] {
            std::array::from_fn(|i| state[i] + by * rate[i])
        };
        let k1 = self.rates(state, command);
        let k2 = self.rates(moved(0.5 * PERIOD, k1), command);
        let k3 = self.rates(moved(0.5 * PERIOD, k2), command);
        let k4 = self.rates(moved(PERIOD, k3), command);
        std::array::from_fn(|i| state[i] + PERIOD / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
    }
}

/// The plant's parameters. Entries of a column share their poles; rows are strokes, columns commands.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PlantParameters {
    /// Behind each command.
    pub columns: [ColumnDynamics; 2],
    /// Zeros of the first column, rad/s, positive.
    pub first_zeros: [f64; 2],
    /// Zeros of the second column, one an entry, rad/s, positive.
    pub second_zeros: Pair,
    /// Static gain of each entry, by row.
    pub static_gain: [Pair; 2],
    /// Delay of each command, whole samples.
    pub delay: [usize; 2],
}

impl Default for PlantParameters {
    /// The nominal plant.
    fn default() -> Self {
        let column = |first: f64, second: f64| ColumnDynamics {
            poles: [first * TAU, second * TAU],
            decay: 50.0 * TAU,
            frequency: 63.0 * TAU,
        };
        let columns = [column(2.65, 40.0), column(3.5, 18.5)];
        let first_zeros = [120.0 * TAU, 90.0 * TAU];
        let second_zeros = [3.0 * TAU, 5.0 * TAU];
        // The published gains are those of the leading coefficients.
        let scale = columns.map(|c| 1.0 / (c.poles[0] * c.poles[1] * c.square()));
        let first = first_zeros[0] * first_zeros[1] * scale[0];
        Self {
            columns,
            first_zeros,
            second_zeros,
            static_gain: [
                [2165.2 * first, 4.5394e6 * second_zeros[0] * scale[1]],
                [349.95 * first, 1.9238e7 * second_zeros[1] * scale[1]],
            ],
            delay: [0; 2],
        }
    }
}

impl PlantParameters {
    /// Checks that the plant is stable and can be inverted.
    ///
    /// # Errors
    /// A pole or zero that is not in the left half plane, gains whose matrix is nearly singular.
    pub fn validate(&self) -> Result<(), ModelError> {
        let columns = &self.columns;
        let positive = columns
            .iter()
            .flat_map(|c| [c.poles[0], c.poles[1], c.decay])
            .map(|value| ("pole", value))
            .chain(
                self.first_zeros
                    .into_iter()
                    .chain(self.second_zeros)
                    .map(|value| ("zero", value)),
            );
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ModelError::Parameter {
                    name,
                    value,
                    expected: "a positive distance from zero, rad/s: stable and minimum phase",
                });
            }
        }
        let [[a, b], [c, d]] = self.static_gain;
        let determinant = a * d - b * c;
        let size = (a.abs() + b.abs()) * (c.abs() + d.abs());
        if determinant.abs() > 1e-3 * size && size.is_finite() {
            return Ok(());
        }
        Err(ModelError::Parameter {
            name: "static_gain",
            value: determinant,
            expected: "a matrix that can be inverted: both commands move the strokes alike",
        })
    }

    /// Strokes of states that [`ColumnDynamics`] describes.
    #[inline]
    #[must_use]
    pub fn strokes(&self, states: &[[f64; 4]; 2]) -> Pair {
        let [_, _, place, rate] = states[0];
        let [a, b] = self.first_zeros.map(|zero| 1.0 / zero);
        let first = place + (a + b) * rate + a * b * self.columns[0].acceleration(states[0]);
        let [_, _, place, rate] = states[1];
        let second = self.second_zeros.map(|zero| place + rate / zero);
        [0, 1].map(|i| self.static_gain[i][0] * first + self.static_gain[i][1] * second[i])
    }
}

/// The plant in motion.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Plant {
    parameters: PlantParameters,
    states: [[f64; 4]; 2],
    /// Commands that are on their way, the oldest first.
    waiting: [Vec<f64>; 2],
}

impl Plant {
    /// At rest.
    ///
    /// # Errors
    /// As [`PlantParameters::validate`].
    pub fn new(parameters: PlantParameters) -> Result<Self, ModelError> {
        parameters.validate()?;
        Ok(Self {
            parameters,
            states: [[0.0; 4]; 2],
            waiting: parameters.delay.map(|samples| vec![0.0; samples]),
        })
    }

    /// Strokes, m.
    #[must_use]
    pub fn strokes(&self) -> Pair {
        self.parameters.strokes(&self.states)
    }

    /// A sample with the commands (m) held.
    pub fn step(&mut self, commands: Pair) {
        for (i, command) in commands.into_iter().enumerate() {
            let waiting = &mut self.waiting[i];
            let arrives = match waiting.first().copied() {
                None => command,
                Some(oldest) => {
                    waiting.rotate_left(1);
                    if let Some(last) = waiting.last_mut() {
                        *last = command;
                    }
                    oldest
                }
            };
            self.states[i] = self.parameters.columns[i].after(self.states[i], arrives);
        }
    }
}

/// What a command is in volt.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Volts {
    /// Correction of each command.
    pub correction: Pair,
    /// Offset, m.
    pub offset: Pair,
    /// Stroke of a volt, m/V.
    pub scale: Pair,
    /// Largest magnitude, V.
    pub limit: f64,
}

impl Default for Volts {
    /// The benchmark's.
    fn default() -> Self {
        Self {
            correction: [1.053, 1.055],
            offset: [0.0092e-3, -0.0059e-3],
            scale: [7.4921e-3, 7.3907e-3],
            limit: 3.8,
        }
    }
}

impl Volts {
    /// Volts of commands, m.
    #[must_use]
    pub fn of(&self, commands: Pair) -> Pair {
        [0, 1].map(|i| (commands[i] / self.correction[i] - self.offset[i]) / self.scale[i])
    }

    /// Lowest and highest command of each actuator, m.
    #[must_use]
    pub fn range(&self) -> [Pair; 2] {
        [0, 1].map(|i| {
            [-1.0, 1.0].map(|sign| {
                self.correction[i] * (sign * self.limit * self.scale[i] + self.offset[i])
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn static_gains_are_those_of_a_long_push() {
        let nominal = PlantParameters::default();
        let mut plant = Plant::new(nominal).unwrap();
        for _ in 0..4096 {
            plant.step([1e-3, 2e-3]);
        }
        for (stroke, [first, second]) in plant.strokes().into_iter().zip(nominal.static_gain) {
            assert!((stroke - first * 1e-3 - second * 2e-3).abs() < 1e-12);
        }
        assert!((nominal.static_gain[0][0] - 0.863_811_578).abs() < 1e-9);
        assert!((nominal.static_gain[1][1] - 0.925_791_941).abs() < 1e-9);
    }

    /// Against the partial fractions of the step response of the second column's own entry.
    #[test]
    fn the_step_response_is_that_of_the_transfer_function() {
        use nalgebra::Complex;
        let p = PlantParameters::default();
        let c = p.columns[1];
        let poles = [
            Complex::from(-c.poles[0]),
            Complex::from(-c.poles[1]),
            Complex::new(-c.decay, c.frequency),
            Complex::new(-c.decay, -c.frequency),
        ];
        let gain = p.static_gain[1][1] * c.poles[0] * c.poles[1] * c.square() / p.second_zeros[1];
        let mut plant = Plant::new(p).unwrap();
        for k in 0..600 {
            let t = f64::from(k) * PERIOD;
            let mut exact = Complex::from(p.static_gain[1][1]);
            for (i, pole) in poles.iter().enumerate() {
                let mut others = *pole;
                for (j, other) in poles.iter().enumerate() {
                    if i != j {
                        others *= pole - other;
                    }
                }
                exact += (pole * t).exp() * gain * (pole + p.second_zeros[1]) / others;
            }
            // What the method leaves out of a step: (|pole| h)^5 / 120.
            let left_out = (c.square().sqrt() * PERIOD).powi(5) / 120.0;
            let off = (plant.strokes()[1] - exact.re).abs();
            assert!(off < left_out, "{k}: {off} {left_out}");
            plant.step([0.0, 1.0]);
        }
    }

    #[test]
    fn a_delay_shifts_and_what_cannot_be_inverted_is_refused() {
        let nominal = PlantParameters::default();
        let late = PlantParameters {
            delay: [1, 2],
            ..nominal
        };
        let (mut on_time, mut late) = (Plant::new(nominal).unwrap(), Plant::new(late).unwrap());
        let mut history = vec![0.0];
        for k in 0..50 {
            let command = f64::from(k).sin();
            on_time.step([0.0, command]);
            late.step([0.0, command]);
            history.push(on_time.strokes()[1]);
            let before = history.len().saturating_sub(3);
            assert_eq!(late.strokes()[1], if k < 2 { 0.0 } else { history[before] });
        }
        let alike = PlantParameters {
            static_gain: [[1.0, 0.5], [2.0, 1.0]],
            ..nominal
        };
        assert!(
            alike
                .validate()
                .unwrap_err()
                .to_string()
                .contains("inverted")
        );
    }
}
