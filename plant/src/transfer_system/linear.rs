//! The transfer system: servo valve, actuator, its own displacement loop, control-structure
//! interaction, and the specimen that it moves.

use crate::ModelError;
use units::vocabulary;

use crate::linear::matrix_of;

/// Parameters of the transfer system with its specimen:
///
/// ```text
/// Q'' + beta1 Q' + beta2 Q = a1b0 (gain u - x)     servo valve
/// F' + a3 F = Q - a2 x'                            actuator, with interaction
/// m_e x'' + c_e x' + k_e x = F                     specimen
/// ```
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TransferSystemParameters {
    /// `a1b0`, N/(m s³).
    pub valve_gain: f64,
    /// `beta1`, 1/s.
    pub valve_beta1: f64,
    /// `beta2`, 1/s².
    pub valve_beta2: f64,
    /// `a2`, velocity feedback of the specimen, N/m.
    pub actuator_a2: f64,
    /// `a3`, 1/s.
    pub actuator_a3: f64,
    /// Gain on the command, before the displacement loop.
    pub command_gain: f64,
    /// `m_e`, kg.
    pub specimen_mass: f64,
    /// `k_e`, N/m.
    pub specimen_stiffness: f64,
    /// Damping ratio of the specimen; its coefficient follows the stiffness.
    pub specimen_damping_ratio: f64,
}

impl Default for TransferSystemParameters {
    /// The nominal plant of the benchmark's program.
    fn default() -> Self {
        Self {
            valve_gain: 2.1283e13,
            valve_beta1: 425.0,
            valve_beta2: 9.9976e4,
            actuator_a2: 4.2297e6,
            actuator_a3: 3.3,
            command_gain: 1.0261,
            specimen_mass: 29.13,
            specimen_stiffness: 1.19e6,
            specimen_damping_ratio: 0.0097,
        }
    }
}

impl TransferSystemParameters {
    /// `c_e = 2 zeta sqrt(m_e k_e)`, N s/m.
    pub fn specimen_damping(&self) -> f64 {
        2.0 * self.specimen_damping_ratio * (self.specimen_mass * self.specimen_stiffness).sqrt()
    }

    /// Coefficients `A0..A5` of the denominator in ascending powers of s; the transfer function
    /// from command to displacement is `gain a1b0 / (A5 s^5 + ... + A0)`.
    pub fn denominator(&self) -> [f64; 6] {
        let (m, c, k) = (
            self.specimen_mass,
            self.specimen_damping(),
            self.specimen_stiffness,
        );
        let (b1, b2, a3) = (self.valve_beta1, self.valve_beta2, self.actuator_a3);
        let t1 = k * a3;
        let t2 = k + c * a3 + self.actuator_a2;
        let t3 = c + m * a3;
        [
            t1 * b2 + self.valve_gain,
            t1 * b1 + t2 * b2,
            t1 + t2 * b1 + t3 * b2,
            t2 + t3 * b1 + m * b2,
            t3 + m * b1,
            m,
        ]
    }

    /// Coefficients of the inverse from displacement to command in ascending order of the
    /// derivative: the denominator over `gain a1b0`; s^i.
    pub fn inverse(&self) -> [f64; 6] {
        let numerator = self.command_gain * self.valve_gain;
        self.denominator()
            .map(|coefficient| coefficient / numerator)
    }

    /// Refuses parameters that make no plant.
    ///
    /// # Errors
    /// Names the first parameter that is not a positive (or not a finite) number.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_positive("valve_gain", self.valve_gain)?;
        ModelError::require_positive(vocabulary::VALVE_BETA1, self.valve_beta1)?;
        ModelError::require_positive(vocabulary::VALVE_BETA2, self.valve_beta2)?;
        ModelError::require_non_negative(vocabulary::ACTUATOR_A2, self.actuator_a2)?;
        // Three standard deviations below the nominal value it is negative.
        ModelError::require_finite(vocabulary::ACTUATOR_A3, self.actuator_a3)?;
        ModelError::require_positive("command_gain", self.command_gain)?;
        ModelError::require_positive(vocabulary::SPECIMEN_MASS, self.specimen_mass)?;
        ModelError::require_positive(vocabulary::SPECIMEN_STIFFNESS, self.specimen_stiffness)?;
        ModelError::require_non_negative("specimen_damping_ratio", self.specimen_damping_ratio)
    }
}

/// How the velocity in the interaction, and velocity and acceleration in the force, are formed.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum InteractionForm {
    /// By the equations: the plant is its transfer function, the force is the actuator's.
    #[default]
    TransferFunction,
    /// By the published program's derivative blocks: differences to the value at the latest whole
    /// step. The velocity comes late by a third of a step on the whole, which all but undamps the
    /// 67 Hz mode.
    DerivativeBlocks,
}

/// Number of states: `Q, Q', F, x, x'` and the displacements of the two samples before.
const STATES: usize = 7;
/// States and the held command.
const WIDTH: usize = STATES + 1;
/// States that a step computes; the others are shifted.
const MOVED: usize = 5;

/// What the transfer system remembers.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct TransferSystemState {
    /// Flow of the valve, in N/s of actuator force.
    pub flow: f64,
    /// Its rate, N/s².
    pub flow_rate: f64,
    /// Force of the actuator, N.
    pub actuator_force: f64,
    /// Displacement of the specimen, m.
    pub displacement: f64,
    /// Its velocity, m/s.
    pub velocity: f64,
    /// Displacements one and two samples ago, m.
    pub earlier: [f64; 2],
}

impl TransferSystemState {
    fn to_array(self) -> [f64; STATES] {
        let [one, two] = self.earlier;
        [
            self.flow,
            self.flow_rate,
            self.actuator_force,
            self.displacement,
            self.velocity,
            one,
            two,
        ]
    }
}

/// The transfer system, integrated by the classical Runge-Kutta method of order 4 with the
/// command held over each step.
///
/// Being linear, a step is one matrix, computed when the system is made.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TransferSystem {
    parameters: TransferSystemParameters,
    form: InteractionForm,
    period: f64,
    step: [[f64; WIDTH]; MOVED],
    /// What it remembers.
    pub state: TransferSystemState,
}

impl Default for TransferSystem {
    /// The nominal plant at rest, at the benchmark's rate.
    fn default() -> Self {
        Self::unchecked(
            TransferSystemParameters::default(),
            InteractionForm::default(),
            super::PERIOD,
        )
    }
}

impl TransferSystem {
    /// A plant at rest that is stepped by `period` (s).
    ///
    /// # Errors
    /// Refuses parameters that make no plant, and periods that are not positive.
    pub fn new(
        parameters: TransferSystemParameters,
        form: InteractionForm,
        period: f64,
    ) -> Result<Self, ModelError> {
        parameters.validate()?;
        ModelError::require_positive("period", period)?;
        Ok(Self::unchecked(parameters, form, period))
    }

    fn unchecked(parameters: TransferSystemParameters, form: InteractionForm, period: f64) -> Self {
        let flat = matrix_of(WIDTH, MOVED, |from, to| {
            to.copy_from_slice(&runge_kutta(&parameters, form, period, from));
        });
        let mut step = [[0.0; WIDTH]; MOVED];
        for (row, values) in step.iter_mut().zip(flat.chunks_exact(WIDTH)) {
            row.copy_from_slice(values);
        }
        Self {
            parameters,
            form,
            period,
            step,
            state: TransferSystemState::default(),
        }
    }

    /// The parameters it was made of.
    pub fn parameters(&self) -> &TransferSystemParameters {
        &self.parameters
    }

    /// Force of the specimen as the load cell sees it, N: that of the actuator, or with derivative
    /// blocks `k_e x + c_e d + m_e d'` of backward differences.
    pub fn force(&self) -> f64 {
        let s = &self.state;
        match self.form {
            InteractionForm::TransferFunction => s.actuator_force,
            InteractionForm::DerivativeBlocks => {
                let p = &self.parameters;
                let [one, two] = s.earlier;
                let velocity = (s.displacement - one) / self.period;
                let before = (one - two) / self.period;
                p.specimen_stiffness * s.displacement
                    + p.specimen_damping() * velocity
                    + p.specimen_mass * (velocity - before) / self.period
            }
        }
    }

    /// Advances one period with `command` (m) held.
    #[inline]
    pub fn step(&mut self, command: f64) {
        let x = self.state.to_array();
        let moved = |row: &[f64; WIDTH]| {
            let mut sum = row[STATES] * command;
            for i in 0..STATES {
                sum += row[i] * x[i];
            }
            sum
        };
        self.state = TransferSystemState {
            flow: moved(&self.step[0]),
            flow_rate: moved(&self.step[1]),
            actuator_force: moved(&self.step[2]),
            displacement: moved(&self.step[3]),
            velocity: moved(&self.step[4]),
            earlier: [x[3], x[5]],
        };
    }
}

/// The stages of one step from states and command.
fn runge_kutta(
    p: &TransferSystemParameters,
    form: InteractionForm,
    h: f64,
    from: &[f64],
) -> [f64; MOVED] {
    let (start, one, command) = (&from[..MOVED], from[MOVED], from[STATES]);
    let damping = p.specimen_damping();
    // `since` is the time since the latest whole step.
    let slope = |x: &[f64; MOVED], since: f64| {
        let [flow, flow_rate, force, displacement, velocity] = *x;
        let fed_back = match form {
            InteractionForm::TransferFunction => velocity,
            InteractionForm::DerivativeBlocks if since == 0.0 => (displacement - one) / h,
            InteractionForm::DerivativeBlocks => (displacement - start[3]) / since,
        };
        [
            flow_rate,
            p.valve_gain * (p.command_gain * command - displacement)
                - p.valve_beta1 * flow_rate
                - p.valve_beta2 * flow,
            flow - p.actuator_a2 * fed_back - p.actuator_a3 * force,
            velocity,
            (force - damping * velocity - p.specimen_stiffness * displacement) / p.specimen_mass,
        ]
    };
    let along = |k: &[f64; MOVED], h: f64| std::array::from_fn(|i| start[i] + h * k[i]);
    let k1 = slope(&along(&[0.0; MOVED], 0.0), 0.0);
    let k2 = slope(&along(&k1, 0.5 * h), 0.5 * h);
    let k3 = slope(&along(&k2, 0.5 * h), 0.5 * h);
    let k4 = slope(&along(&k3, h), h);
    std::array::from_fn(|i| start[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Complex, DMatrix};

    /// Continuous equivalents, 1/s, of the poles of one step.
    fn poles(form: InteractionForm, parameters: TransferSystemParameters) -> Vec<Complex<f64>> {
        let h = super::super::PERIOD;
        let system = TransferSystem::new(parameters, form, h).unwrap();
        let mut a = DMatrix::zeros(STATES, STATES);
        for i in 0..MOVED {
            for j in 0..STATES {
                a[(i, j)] = system.step[i][j];
            }
        }
        (a[(5, 3)], a[(6, 5)]) = (1.0, 1.0);
        let poles = a.complex_eigenvalues();
        poles
            .iter()
            .filter(|z| z.norm() > 0.5)
            .map(|z| z.ln() / h)
            .collect()
    }

    fn nearest(poles: &[Complex<f64>], re: f64, im: f64) -> f64 {
        let distance = |p: &Complex<f64>| (p - Complex::new(re, im)).norm();
        poles.iter().map(distance).fold(f64::MAX, f64::min)
    }

    #[test]
    fn the_denominator_is_the_published_one() {
        let published = [
            21_675_605_752_000.0,
            543_546_586_565.0,
            2_328_489_794.4,
            8_421_777.184,
            12_590.601_46,
            29.13,
        ];
        for (got, wanted) in TransferSystemParameters::default()
            .denominator()
            .iter()
            .zip(published)
        {
            assert!((got / wanted - 1.0).abs() < 1e-4, "{got} {wanted}");
        }
    }

    #[test]
    fn both_forms_have_the_published_poles() {
        let nominal = TransferSystemParameters::default();
        let smooth = poles(InteractionForm::TransferFunction, nominal);
        for (re, im) in [(-48.21, 0.0), (-184.0, 229.91), (-8.004, 421.81)] {
            assert!(nearest(&smooth, re, im) < 0.05, "{smooth:?}");
        }
        let blocks = poles(InteractionForm::DerivativeBlocks, nominal);
        assert!(nearest(&blocks, -1.64, 421.7) < 0.1, "{blocks:?}");
    }

    #[test]
    fn a_constant_command_is_reached_within_the_rest_gain() {
        for form in [
            InteractionForm::TransferFunction,
            InteractionForm::DerivativeBlocks,
        ] {
            let mut system =
                TransferSystem::new(TransferSystemParameters::default(), form, 1.0 / 4096.0)
                    .unwrap();
            for _ in 0..30_000 {
                system.step(1e-3);
            }
            let expected = 1e-3 * 1.00752;
            assert!((system.state.displacement - expected).abs() < 1e-8);
            assert!((system.force() - 1.19e6 * expected).abs() < 0.05);
        }
    }
}
