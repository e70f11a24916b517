//! The rig as preview control knows it, sampled.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, SMatrix, SVector};
use plant::identified::shake_table::ShakeTable;
use plant::linear::{DiscreteStateSpace, StateSpace};
use plant::servo_hydraulic::ServoHydraulicTable;
use plant::specimens::linear::LinearSpecimen;
use units::Parameters;

use crate::ModelError;

/// States of the rig: three of the actuator, displacement, velocity.
pub const STATES: usize = 5;
/// What is measured: displacement (m), velocity (m/s), acceleration (m/s²).
pub const OUTPUTS: usize = 3;

/// Valve and oil of an actuator, as recordings give them: `y + l dy/dt + j d²y/dt² = u`,
/// `dP/dt = g y - K v - p P`, `F = P - c v` less dry friction, with `l`, `j`, `g`, `K`, `p` and `c`
/// in this order.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct Hydraulics {
    /// 2 D/w of the spool, s.
    #[parameter("s", positive)]
    pub spool_lag: f64,
    /// 1/w^2 of the spool, s2.
    #[parameter("s2", positive)]
    pub spool_inertia: f64,
    /// Rate of the force under a valve open by one volt, N/(V.s).
    #[parameter("N/(V.s)" => "lbf/(V.s)", positive)]
    pub force_rate: f64,
    /// Stiffness of the oil column, N/m.
    #[parameter("N/m" => "lbf/in", positive)]
    pub oil_stiffness: f64,
    /// Rate at which leakage empties it, 1/s.
    #[parameter("1/s", non_negative)]
    pub leakage_rate: f64,
    /// Viscous damping of the seals, N.s/m.
    #[parameter("N.s/m" => "lbf.s/in", non_negative)]
    pub seal_damping: f64,
}

impl Default for Hydraulics {
    /// The physical rig's, each number to the three digits to which recordings tell it.
    fn default() -> Self {
        let digits = |value: f64| format!("{value:.2e}").parse().unwrap_or(value);
        let exact = Self::linearised(&ServoHydraulicTable::default());
        Self {
            spool_lag: digits(exact.spool_lag),
            spool_inertia: digits(exact.spool_inertia),
            force_rate: digits(exact.force_rate),
            oil_stiffness: digits(exact.oil_stiffness),
            leakage_rate: digits(exact.leakage_rate),
            seal_damping: digits(exact.seal_damping),
        }
    }
}

impl Hydraulics {
    /// Those of the physical rig near the middle position at rest (Merritt, Hydraulic Control Systems, 1967,
    /// chapter 6): `V_t/(4 β) dP_L/dt = k_q y - A v - C P_L`, `k_q = k_v sqrt(P_s/2)`, for the force `A P_L`.
    pub fn linearised(rig: &ServoHydraulicTable) -> Self {
        let (valve, cylinder) = (&rig.valve, &rig.cylinder);
        let spool = TAU * valve.frequency;
        let flow_gain = valve.flow_coefficient * (0.5 * rig.rest().supply_pressure).sqrt();
        let compliance = cylinder.volume / (4.0 * cylinder.bulk_modulus);
        Self {
            spool_lag: 2.0 * valve.damping_ratio / spool,
            spool_inertia: 1.0 / (spool * spool),
            force_rate: cylinder.area * flow_gain / compliance,
            oil_stiffness: cylinder.area * cylinder.area / compliance,
            leakage_rate: (cylinder.leakage + valve.null_leakage) / compliance,
            seal_damping: rig.friction.viscous,
        }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }
}

/// Actuator and table: the form of Eq 2-4, or valve and oil in place of its actuator.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct RigModel {
    /// The table, and the actuator unless `hydraulics` stand for it.
    pub shake_table: ShakeTable,
    /// Valve and oil, where they were identified.
    pub hydraulics: Option<Hydraulics>,
}

impl RigModel {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        let Some(own) = &self.hydraulics else {
            return self.shake_table.validate();
        };
        own.validate()?;
        self.shake_table.table.validate()
    }

    /// `(A, B)` of `dx/dt = A x + B [u, f]`: valve command (V) and force on the table (N). The last
    /// two states are displacement and velocity.
    pub fn dynamics(&self) -> (SMatrix<f64, STATES, STATES>, SMatrix<f64, STATES, 2>) {
        let Some(own) = &self.hydraulics else {
            return self.shake_table.dynamics();
        };
        let table = &self.shake_table.table;
        let mut a = SMatrix::<f64, STATES, STATES>::zeros();
        let mut b = SMatrix::<f64, STATES, 2>::zeros();
        a[(0, 1)] = 1.0;
        a[(1, 0)] = -1.0 / own.spool_inertia;
        a[(1, 1)] = -own.spool_lag / own.spool_inertia;
        b[(1, 0)] = 1.0 / own.spool_inertia;
        a[(2, 0)] = own.force_rate;
        a[(2, 2)] = -own.leakage_rate;
        a[(2, 4)] = -own.oil_stiffness;
        a[(3, 4)] = 1.0;
        a[(4, 2)] = 1.0 / table.mass;
        a[(4, 3)] = -table.stiffness / table.mass;
        a[(4, 4)] = -(table.damping + own.seal_damping) / table.mass;
        b[(4, 1)] = 1.0 / table.mass;
        (a, b)
    }

    /// The rig with a specimen on it, sampled with `period` (s): from the valve command (V) to
    /// displacement, velocity and acceleration (SI). States beyond the rig's: drift and its rate.
    pub fn under(&self, specimen: &LinearSpecimen, period: f64) -> DiscreteStateSpace {
        const ALL: usize = STATES + 2;
        const DRIFT: usize = STATES;
        let (rig, input) = self.dynamics();
        let mut a = DMatrix::zeros(ALL, ALL);
        a.view_mut((0, 0), (STATES, STATES)).copy_from(&rig);
        for (state, coefficient) in [specimen.stiffness, specimen.damping]
            .into_iter()
            .enumerate()
        {
            a[(STATES - 1, DRIFT + state)] = input[(STATES - 1, 1)] * coefficient;
        }
        // The table's acceleration drives the drift.
        let shaken = -a.row(STATES - 1);
        a.row_mut(DRIFT + 1).copy_from(&shaken);
        a[(DRIFT + 1, DRIFT)] -= specimen.stiffness / specimen.mass;
        a[(DRIFT + 1, DRIFT + 1)] -= specimen.damping / specimen.mass;
        a[(DRIFT, DRIFT + 1)] = 1.0;
        let mut b = DMatrix::zeros(ALL, 1);
        b.view_mut((0, 0), (STATES, 1)).copy_from(&input.column(0));
        let mut c = DMatrix::zeros(OUTPUTS, ALL);
        (c[(0, 3)], c[(1, 4)]) = (1.0, 1.0);
        let acceleration = a.row(STATES - 1).into_owned();
        c.row_mut(2).copy_from(&acceleration);
        let d = DMatrix::zeros(OUTPUTS, 1);
        StateSpace { a, b, c, d }.sample(period)
    }

    /// The rig sampled with `period` (s).
    pub fn sample(&self, period: f64) -> SampledRig {
        // The command is held, the force goes evenly from one sample's to the next's.
        let (a, b) = self.dynamics();
        const ALL: usize = STATES + 3;
        let mut block = DMatrix::zeros(ALL, ALL);
        block
            .view_mut((0, 0), (STATES, STATES))
            .copy_from(&(a * period));
        block
            .view_mut((0, STATES), (STATES, 2))
            .copy_from(&(b * period));
        block[(STATES + 1, STATES + 2)] = 1.0;
        let block = block.exp();
        let column = |j: usize| SVector::from_fn(|i, _| block[(i, j)]);
        let change: SVector<f64, STATES> = column(STATES + 2);
        let mut c = SMatrix::<f64, OUTPUTS, STATES>::zeros();
        c[(0, 3)] = 1.0;
        c[(1, 4)] = 1.0;
        c.row_mut(2).copy_from(&a.row(4));
        SampledRig {
            a: SMatrix::from_fn(|i, j| block[(i, j)]),
            b: column(STATES),
            from: column(STATES + 1) - change,
            to: change,
            c,
            d: SVector::from([0.0, 0.0, b[(4, 1)]]),
        }
    }
}

/// `x[k+1] = A x[k] + B u[k] + E0 f[k] + E1 f[k+1]`, `y[k] = C x[k] + D f[k]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampledRig {
    /// Transition.
    pub a: SMatrix<f64, STATES, STATES>,
    /// Valve command, held.
    pub b: SVector<f64, STATES>,
    /// `E0`, force at the beginning of the step.
    pub from: SVector<f64, STATES>,
    /// `E1`, force at its end.
    pub to: SVector<f64, STATES>,
    /// Measured motion.
    pub c: SMatrix<f64, OUTPUTS, STATES>,
    /// Direct effect of the force.
    pub d: SVector<f64, OUTPUTS>,
}

impl SampledRig {
    /// From the valve command alone to what is measured.
    pub fn driven(&self, period: f64) -> DiscreteStateSpace {
        DiscreteStateSpace {
            a: DMatrix::from_fn(STATES, STATES, |i, j| self.a[(i, j)]),
            b: DMatrix::from_fn(STATES, 1, |i, _| self.b[i]),
            c: DMatrix::from_fn(OUTPUTS, STATES, |i, j| self.c[(i, j)]),
            d: DMatrix::zeros(OUTPUTS, 1),
            period,
        }
    }

    /// The state a sample later under `command` (V) and `forces` (N) at both ends.
    pub fn advance(
        &self,
        x: &SVector<f64, STATES>,
        command: f64,
        [from, to]: [f64; 2],
    ) -> SVector<f64, STATES> {
        self.a * x + self.b * command + self.from * from + self.to * to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A force that rises evenly, integrated in small steps that hold it.
    #[test]
    fn an_even_force_is_sampled_exactly() {
        let rig = RigModel {
            shake_table: ShakeTable::default(),
            hydraulics: Some(Hydraulics {
                spool_lag: 0.005,
                spool_inertia: 8e-6,
                force_rate: 2e4,
                oil_stiffness: 2e5,
                leakage_rate: 3.0,
                seal_damping: 900.0,
            }),
        };
        let (coarse, fine) = (rig.sample(0.002), rig.sample(0.002 / 500.0));
        let start = SVector::from([0.5, 10.0, 20.0, 0.01, -0.1]);
        let expected = (0..500).fold(start, |x, i| {
            let at = |i: usize| 5.0 + 3.0 * i as f64 / 500.0;
            let held = 0.5 * (at(i) + at(i + 1));
            fine.advance(&x, 1.5, [held, held])
        });
        let got = coarse.advance(&start, 1.5, [5.0, 8.0]);
        for (got, expected) in got.iter().zip(&expected) {
            assert!(
                (got - expected).abs() < 1e-5 * expected.abs().max(0.1),
                "{got} {expected}"
            );
        }
    }

    /// Beside the rig differentiated by numbers; without the supply's own dynamics, which the valve at null
    /// does not draw on.
    #[test]
    fn the_linearised_hydraulics_move_the_table_as_the_physical_rig_does() {
        use nalgebra::{Complex, DMatrix};
        let physical = ServoHydraulicTable::default();
        let rig = RigModel {
            shake_table: ShakeTable {
                table: physical.table,
                ..ShakeTable::default()
            },
            hydraulics: Some(Hydraulics::linearised(&physical)),
        };
        let (a, b) = rig.dynamics();
        let rig = StateSpace {
            a: DMatrix::from_fn(STATES, STATES, |i, k| a[(i, k)]),
            b: DMatrix::from_fn(STATES, 2, |i, k| b[(i, k)]),
            c: DMatrix::from_fn(1, STATES, |_, k| if k == 3 { 1.0 } else { 0.0 }),
            d: DMatrix::zeros(1, 2),
        };
        let physical = physical.linearised();
        for frequency in [0.1, 1.0, 5.0, 20.0, 80.0] {
            let s = Complex::new(0.0, TAU * frequency);
            let [own, other] = [&rig, &physical].map(|rig| rig.evaluate(s).unwrap());
            for input in 0..2 {
                let (own, other) = (own[(0, input)], other[(0, input)]);
                assert!(
                    (own - other).norm() < 1e-4 * other.norm(),
                    "{frequency} Hz, input {input}: {own} {other}"
                );
            }
        }
    }

    #[test]
    fn the_default_hydraulics_are_the_linearised_ones_to_three_digits() {
        let own = Hydraulics::default();
        let exact = Hydraulics::linearised(&ServoHydraulicTable::default());
        for (own, exact) in [
            (own.spool_lag, exact.spool_lag),
            (own.spool_inertia, exact.spool_inertia),
            (own.force_rate, exact.force_rate),
            (own.oil_stiffness, exact.oil_stiffness),
            (own.leakage_rate, exact.leakage_rate),
            (own.seal_damping, exact.seal_damping),
        ] {
            assert!((own / exact - 1.0).abs() <= 0.005, "{own} {exact}");
        }
        // The start values of four components.
        assert_eq!((own.spool_lag, own.oil_stiffness), (0.00477, 1.87e5));
    }
}
