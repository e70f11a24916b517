//! The identified hydraulic actuator: `F = G1(s) u + G2(s) dx/dt` (Eq 2-4, with G2 carrying the
//! plus sign of Eq 3-3 to 3-5).

use nalgebra::{DMatrix, Matrix3, SMatrix, dmatrix};

use crate::ModelError;
use crate::linear::{StateSpace, TransferFunction};
use crate::linear::{characteristic_polynomial, numerator_polynomial};
use units::Parameters;
use units::constants::{INCH, LBF};

/// Both transfer paths of the actuator over their common denominator
/// `s³ + a2 s² + a1 s + a0`, in SI units.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
#[parameters(prefix = "actuator_")]
pub struct IdentifiedActuator {
    /// `[a2, a1, a0]` in 1/s, 1/s², 1/s³.
    #[parameter(0, name = "a2", about = "Actuator, denominator, s^2", "1/s", finite)]
    #[parameter(1, name = "a1", about = "Actuator, denominator, s", "1/s2", finite)]
    #[parameter(
        2,
        name = "a0",
        about = "Actuator, denominator, constant",
        "1/s3",
        finite
    )]
    pub denominator: [f64; 3],
    /// Numerator of G1 `[b2, b1, b0]`, from valve command to force: N/(V s), N/(V s²), N/(V s³).
    #[parameter(0, name = "b2", about = "Valve command to force, s^2", "N/(V.s)" => "lbf/(V.s)", finite)]
    #[parameter(1, name = "b1", about = "Valve command to force, s", "N/(V.s2)" => "lbf/(V.s2)", finite)]
    #[parameter(2, name = "b0", about = "Valve command to force, constant", "N/(V.s3)" => "lbf/(V.s3)", finite)]
    pub voltage_to_force: [f64; 3],
    /// Numerator of G2 `[e2, e1, e0]`, from velocity to force: N/m, N/(m s), N/(m s²).
    #[parameter(0, name = "e2", about = "Velocity to force, s^2", "N/m" => "lbf/in", finite)]
    #[parameter(1, name = "e1", about = "Velocity to force, s", "N/(m.s)" => "lbf/(in.s)", finite)]
    #[parameter(2, name = "e0", about = "Velocity to force, constant", "N/(m.s2)" => "lbf/(in.s2)", finite)]
    pub velocity_to_force: [f64; 3],
}

impl IdentifiedActuator {
    /// Takes the coefficients in thesis units (lbf, V, in, s).
    pub fn from_thesis_units(
        denominator: [f64; 3],
        voltage_to_force: [f64; 3],
        velocity_to_force: [f64; 3],
    ) -> Self {
        Self {
            denominator,
            voltage_to_force: voltage_to_force.map(|b| b * LBF),
            velocity_to_force: velocity_to_force.map(|e| e * LBF / INCH),
        }
    }

    /// Checks the coefficients.
    ///
    /// # Errors
    /// A coefficient that is not finite, or a zero of G1 in the right half plane: a valve that
    /// answers in the wrong direction at first or for good.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        let zeros = TransferFunction::new(&self.voltage_to_force, &[1.0])?.zeros();
        if let Some(zero) = zeros.iter().find(|zero| zero.re > 0.0) {
            return Err(ModelError::NotForSimulation {
                model: "the actuator",
                reason: format!(
                    "its path from valve command to force has a zero in the right half plane \
                     (+{:.4} 1/s)",
                    zero.re
                ),
            });
        }
        Ok(())
    }

    /// Observer canonical form, states `z` with `F = z1`: `(A, B)`, inputs valve command (V) and
    /// velocity (m/s).
    pub fn dynamics(&self) -> (Matrix3<f64>, SMatrix<f64, 3, 2>) {
        let [a2, a1, a0] = self.denominator;
        let a = Matrix3::new(-a2, 1.0, 0.0, -a1, 0.0, 1.0, -a0, 0.0, 0.0);
        let b = SMatrix::<f64, 3, 2>::from_fn(|i, j| {
            if j == 0 {
                self.voltage_to_force[i]
            } else {
                self.velocity_to_force[i]
            }
        });
        (a, b)
    }

    /// The actuator as a linear system: inputs valve command (V) and velocity (m/s), output force
    /// (N).
    pub fn state_space(&self) -> StateSpace {
        let (a, b) = self.dynamics();
        StateSpace {
            a: DMatrix::from_fn(3, 3, |i, j| a[(i, j)]),
            b: DMatrix::from_fn(3, 2, |i, j| b[(i, j)]),
            c: dmatrix![1.0, 0.0, 0.0],
            d: DMatrix::zeros(1, 2),
        }
    }

    /// G1 of Eq 2-13, valve command to force, N/V.
    pub fn g1(&self) -> TransferFunction {
        self.path(&self.voltage_to_force)
    }

    /// G2 of Eq 2-14, velocity to force, N s/m.
    pub fn g2(&self) -> TransferFunction {
        self.path(&self.velocity_to_force)
    }

    fn path(&self, numerator: &[f64; 3]) -> TransferFunction {
        let [a2, a1, a0] = self.denominator;
        TransferFunction {
            numerator: numerator.to_vec(),
            denominator: vec![1.0, a2, a1, a0],
        }
    }
}

/// The actuator models that the thesis prints, and the one that agrees with all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PublishedActuator {
    /// State space of Eq 2-11, four digits: readable, refused for simulation.
    Equation2_11,
    /// Transfer functions of Eq 2-13 and 2-14.
    #[default]
    Equation2_13,
    /// One state space inside the rounding interval of every digit of Eq 2-11, 2-13, 2-14, 2-28
    /// and 5-5 at once.
    Derounded,
}

impl PublishedActuator {
    /// The actuator in thesis units and the basis of Eq 2-11, where the model is given in it:
    /// inputs V and in/s, output lbf.
    pub fn state_space_in_thesis_units(self) -> Option<StateSpace> {
        let (a, b, c) = match self {
            Self::Equation2_11 => (
                dmatrix![-0.04231, -2.193, -0.1573; 1.876, -29.21, 125.1; -1.674, -100.2, -26.93],
                dmatrix![1.895, 0.3166; 22.12, 5.854; 87.13, 13.63],
                dmatrix![1881.0, -3.858, -0.5678],
            ),
            Self::Equation2_13 => return None,
            Self::Derounded => (
                dmatrix![
                    -0.04230513369935159, -2.1925133699351584, -0.15727423497870996;
                    1.8762203300239486, -29.210934119776734, 125.06105832354581;
                    -1.6735133699351592, -100.22335388719702, -26.925133699351584
                ],
                dmatrix![
                    1.8953734058659606, 0.31664013250625855;
                    22.115133699351585, 5.854091986087591;
                    87.1255887583863, 13.625133699351586
                ],
                dmatrix![1880.5793095562099, -3.8575133699351585, -0.5677728252404506],
            ),
        };
        Some(StateSpace {
            a,
            b,
            c,
            d: DMatrix::zeros(1, 2),
        })
    }

    /// Coefficients of the transfer functions, converted from the state space where that is what
    /// is given (Eq 2-12). For reading: [`Self::for_simulation`] is the one to simulate.
    pub fn transfer_functions(self) -> IdentifiedActuator {
        let Some(system) = self.state_space_in_thesis_units() else {
            return IdentifiedActuator::from_thesis_units(
                [56.18, 1.333e4, 178.2],
                [3430.0, 3.86e4, 403.3],
                [565.1, -1818.0, 3.12e5],
            );
        };
        let denominator = characteristic_polynomial(&system.a);
        let c = system.c.row(0).transpose();
        let path = |input: usize| {
            let n = numerator_polynomial(&system.a, &system.b.column(input).into_owned(), &c);
            [n[0], n[1], n[2]]
        };
        IdentifiedActuator::from_thesis_units(
            [denominator[1], denominator[2], denominator[3]],
            path(0),
            path(1),
        )
    }

    /// The actuator to simulate.
    ///
    /// # Errors
    /// Eq 2-11 as printed, with the reason.
    pub fn for_simulation(self) -> Result<IdentifiedActuator, ModelError> {
        let actuator = self.transfer_functions();
        actuator.validate().map_err(|error| match (self, error) {
            (Self::Equation2_11, ModelError::NotForSimulation { reason, .. }) => {
                ModelError::NotForSimulation {
                    model: "Eq 2-11 as printed",
                    reason: format!(
                        "four digits are too few: {reason}, the constant term of G1 is {:.0} \
                         where Eq 2-13 has 403.3 (lbf/V/s³). Take Eq 2-13 and 2-14, or the \
                         de-rounded set",
                        actuator.voltage_to_force[2] / LBF
                    ),
                }
            }
            (_, error) => error,
        })?;
        Ok(actuator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_state_space_is_readable_but_refused() {
        let g1 = PublishedActuator::Equation2_11
            .transfer_functions()
            .voltage_to_force;
        assert!((g1[2] / LBF + 32852.0).abs() < 5.0, "{}", g1[2] / LBF);
        let error = PublishedActuator::Equation2_11
            .for_simulation()
            .unwrap_err()
            .to_string();
        assert!(error.contains("four digits are too few"), "{error}");
        assert!(error.contains("-3285"), "{error}");
    }

    #[test]
    fn derounded_set_rounds_to_the_printed_transfer_functions() {
        let derounded = PublishedActuator::Derounded.for_simulation().unwrap();
        let printed = PublishedActuator::Equation2_13.for_simulation().unwrap();
        // Half a unit of the last printed digit.
        let half_units = [
            (
                [0.005, 5.0, 0.05],
                derounded.denominator,
                printed.denominator,
                1.0,
            ),
            (
                [0.5, 50.0, 0.05],
                derounded.voltage_to_force,
                printed.voltage_to_force,
                LBF,
            ),
            (
                [0.05, 0.5, 500.0],
                derounded.velocity_to_force,
                printed.velocity_to_force,
                LBF / INCH,
            ),
        ];
        for (half, got, want, unit) in half_units {
            for i in 0..3 {
                let error = (got[i] - want[i]).abs() / unit;
                assert!(error <= half[i] * 1.0001, "{error} against {}", half[i]);
            }
        }
    }
}
