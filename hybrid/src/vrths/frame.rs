//! The frame as a whole: the structure that the benchmark cuts in two.

use nalgebra::{DMatrix, DVector};

use plant::ModelError;

/// Mass, damping and stiffness of a structure under ground acceleration `a_g`:
/// `M x'' + C x' + K x = -M 1 a_g`, displacements relative to the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Mass, n x n, kg.
    pub mass: DMatrix<f64>,
    /// Damping, n x n, N s/m.
    pub damping: DMatrix<f64>,
    /// Stiffness, n x n, N/m.
    pub stiffness: DMatrix<f64>,
}

/// One of the benchmark's four partitioning cases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct BenchmarkCase(u8);

/// Stiffness of the frame in all cases, N/m.
const STIFFNESS: [f64; 9] = [
    26_054_883.879_603_837,
    -23_133_938.877_108_198,
    5_937_035.463_339_146,
    -23_133_938.877_108_198,
    32_560_774.186_380_334,
    -14_419_970.777_236_981,
    5_937_035.463_339_146,
    -14_419_970.777_236_985,
    9_267_275.506_224_312,
];

impl BenchmarkCase {
    /// The four cases.
    pub const ALL: [Self; 4] = [Self(1), Self(2), Self(3), Self(4)];

    /// The case of a number from 1 to 4.
    ///
    /// # Errors
    /// Refuses other numbers.
    pub fn new(number: u8) -> Result<Self, ModelError> {
        if (1..=4).contains(&number) {
            return Ok(Self(number));
        }
        Err(ModelError::Parameter {
            name: "case",
            value: f64::from(number),
            expected: "1, 2, 3 or 4",
        })
    }

    /// 1 to 4.
    pub fn number(self) -> u8 {
        self.0
    }

    /// Mass of each floor (kg) and damping ratio of all modes.
    pub fn floor_mass_and_damping(self) -> (f64, f64) {
        match self.0 {
            1 => (1000.0, 0.05),
            2 => (1100.0, 0.04),
            3 => (1300.0, 0.03),
            _ => (1000.0, 0.03),
        }
    }

    /// The structure of the case.
    pub fn frame(self) -> Frame {
        let (mass, ratio) = self.floor_mass_and_damping();
        let stiffness = DMatrix::from_row_slice(3, 3, &STIFFNESS);
        // With equal masses, M^-1/2 K M^-1/2 = K / m, and C = m Phi diag(2 zeta omega) Phi'.
        let modes = (&stiffness / mass).symmetric_eigen();
        let rates = modes.eigenvalues.map(|square| 2.0 * ratio * square.sqrt());
        let damping =
            &modes.eigenvectors * DMatrix::from_diagonal(&rates) * modes.eigenvectors.transpose();
        Frame {
            mass: DMatrix::identity(3, 3) * mass,
            damping: damping * mass,
            stiffness,
        }
    }
}

impl Frame {
    /// Refuses matrices whose shapes do not fit and masses that cannot be inverted.
    ///
    /// # Errors
    /// Names the matrix and the shape that was expected.
    pub fn validate(&self) -> Result<(), ModelError> {
        let n = self.mass.nrows();
        for (what, matrix) in [
            ("mass", &self.mass),
            ("damping", &self.damping),
            ("stiffness", &self.stiffness),
        ] {
            if matrix.shape() != (n, n) || n == 0 {
                return Err(ModelError::Shape {
                    what,
                    expected: format!("{0} x {0}", n.max(1)),
                    got: format!("{} x {}", matrix.nrows(), matrix.ncols()),
                });
            }
            if let Some(value) = matrix.iter().find(|value| !value.is_finite()) {
                ModelError::require_finite(what, *value)?;
            }
        }
        if self.mass.clone().cholesky().is_none() {
            return Err(ModelError::NotForSimulation {
                model: "frame",
                reason: "its mass matrix is not positive definite".to_string(),
            });
        }
        Ok(())
    }

    /// Number of degrees of freedom.
    pub fn order(&self) -> usize {
        self.mass.nrows()
    }
}

/// The whole frame under a ground acceleration that is linear between samples, exactly.
#[derive(Debug, Clone)]
pub struct ReferenceFrame {
    transition: DMatrix<f64>,
    from_start: DVector<f64>,
    from_end: DVector<f64>,
    state: DVector<f64>,
}

impl ReferenceFrame {
    /// The frame at rest.
    ///
    /// # Errors
    /// What [`Frame::validate`] refuses.
    pub fn new(frame: &Frame, period: f64) -> Result<Self, ModelError> {
        frame.validate()?;
        ModelError::require_positive("period", period)?;
        let n = frame.order();
        let Some(inverse) = frame.mass.clone().try_inverse() else {
            return Err(ModelError::NotForSimulation {
                model: "frame",
                reason: "its mass matrix is singular".to_string(),
            });
        };
        // The exponential of [A B 0; 0 0 1; 0 0 0] h, the input being linear over the step.
        let mut block = DMatrix::zeros(2 * n + 2, 2 * n + 2);
        block.view_mut((0, n), (n, n)).fill_with_identity();
        block
            .view_mut((n, 0), (n, n))
            .copy_from(&(-&inverse * &frame.stiffness));
        block
            .view_mut((n, n), (n, n))
            .copy_from(&(-&inverse * &frame.damping));
        for i in 0..n {
            block[(n + i, 2 * n)] = -1.0;
        }
        block *= period;
        block[(2 * n, 2 * n + 1)] = 1.0;
        let exponential = block.exp();
        let held = exponential
            .view((0, 2 * n), (2 * n, 1))
            .column(0)
            .into_owned();
        let ramp = exponential
            .view((0, 2 * n + 1), (2 * n, 1))
            .column(0)
            .into_owned();
        Ok(Self {
            transition: exponential.view((0, 0), (2 * n, 2 * n)).into_owned(),
            from_start: held - &ramp,
            from_end: ramp,
            state: DVector::zeros(2 * n),
        })
    }

    /// Displacement of floor `i` from 0, m.
    pub fn displacement(&self, i: usize) -> f64 {
        self.state[i]
    }

    /// Advances one period over which the ground acceleration (m/s²) goes from `start` to `end`.
    pub fn step(&mut self, start: f64, end: f64) {
        self.state =
            &self.transition * &self.state + &self.from_start * start + &self.from_end * end;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_are_the_published_ones() {
        for (case, wanted) in [
            (1, [3.6124, 15.9966, 38.0862]),
            (2, [3.4443, 15.2521, 36.3137]),
            (3, [3.1683, 14.0299, 33.4038]),
            (4, [3.6124, 15.9966, 38.0862]),
        ] {
            let frame = BenchmarkCase::new(case).unwrap().frame();
            let mut squares = (&frame.stiffness / frame.mass[(0, 0)])
                .symmetric_eigenvalues()
                .as_slice()
                .to_vec();
            squares.sort_by(f64::total_cmp);
            for (square, hertz) in squares.iter().zip(wanted) {
                let got = square.sqrt() / std::f64::consts::TAU;
                assert!((got - hertz).abs() < 1e-3, "case {case}: {got} {hertz}");
            }
        }
        assert!(BenchmarkCase::new(5).is_err());
    }

    #[test]
    fn a_single_floor_under_a_ramp_of_the_ground_follows_its_closed_form() {
        let (m, c, k) = (3.0, 2.0, 700.0);
        let one = |v: f64| DMatrix::from_element(1, 1, v);
        let frame = Frame {
            mass: one(m),
            damping: one(c),
            stiffness: one(k),
        };
        let h = 0.01;
        let mut reference = ReferenceFrame::new(&frame, h).unwrap();
        for step in 0..500 {
            let t = step as f64 * h;
            reference.step(t, t + h);
        }
        // Particular solution -m/k (t - c/k), free vibration long decayed? Not wholly: compare
        // with a Runge-Kutta run in steps a hundred times smaller.
        let (mut x, fine) = ([0.0, 0.0, 0.0], h / 100.0);
        for _ in 0..50_000 {
            x = plant::integration::runge_kutta_4(&x, fine, |x: &[f64; 3]| {
                [x[1], -x[2] - (c * x[1] + k * x[0]) / m, 1.0]
            });
        }
        assert!((reference.displacement(0) - x[0]).abs() < 1e-9);
    }
}
