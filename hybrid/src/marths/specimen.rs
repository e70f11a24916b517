//! The specimen: two columns and the beam between them, pinned below, held at one upper joint.

use nalgebra::{DMatrix, DVector, Matrix3x2, SMatrix, SVector};
use plant::ModelError;

use super::{Freedom, JointMotion, PERIOD};

/// Translation, then rotations of the held joint, the beam's other end and the two feet.
type Square = SMatrix<f64, 5, 5>;

/// Forces on the numerical substructure.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct InterfaceForce {
    /// On the interface's translation, N.
    pub force: f64,
    /// On its rotation, N m.
    pub moment: f64,
    /// On the rotation of the specimen's other upper joint, N m.
    pub other_moment: f64,
}

impl InterfaceForce {
    /// By freedom.
    #[must_use]
    pub fn by_freedom(self) -> [(Freedom, f64); 3] {
        [
            (Freedom::Interface, self.force),
            (Freedom::InterfaceRotation, self.moment),
            (Freedom::OtherRotation, self.other_moment),
        ]
    }
}

/// The specimen's force model: stiffness, damping and mass act on the joint's motion and its
/// differences over whole samples. What is not held follows statically.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Specimen {
    /// Force and both upper joints' moments, with the signs of the interface, by translation and
    /// rotation.
    stiffness: Matrix3x2<f64>,
    damping: Matrix3x2<f64>,
    mass: Matrix3x2<f64>,
    /// Motion, rate and whether there was a sample before.
    last: Option<[[f64; 2]; 2]>,
}

const INCH: f64 = 0.0254;
const YOUNGS_MODULUS: f64 = 200e9;
const DENSITY: f64 = 7850.0;
const COLUMN_LENGTH: f64 = 0.641_35;
const COLUMN_INERTIA: f64 = 0.7 * 2.52 * INCH * INCH * INCH * INCH;
const COLUMN_AREA: f64 = 1.67 * INCH * INCH;
const BEAM_LENGTH: f64 = 0.762;
const BEAM_INERTIA: f64 = 4.213_72e-7;
const BEAM_AREA: f64 = 0.000_756;
const MASS_FACTOR: f64 = 1.1;
const DAMPING_RATIO: f64 = 0.05;

/// Frequencies of the damping are rounded to this, rad/s.
const ROUNDING: f64 = 0.01;

impl Specimen {
    /// The benchmark's.
    ///
    /// # Errors
    /// None with the benchmark's numbers.
    pub fn new() -> Result<Self, ModelError> {
        let (stiffness, mass) = (stiffness(), mass());
        let damping = damping(&stiffness, &mass);
        let follows = condensation(&stiffness)?;
        // The interface's rotation is counted the other way round.
        let signs = [1.0, -1.0, -1.0];
        let upper = |matrix: &Square| {
            let forces = matrix * follows;
            Matrix3x2::from_fn(|i, j| signs[i] * forces[(i, j)])
        };
        Ok(Self {
            stiffness: upper(&stiffness),
            damping: upper(&damping),
            mass: upper(&mass),
            last: None,
        })
    }

    /// The force of this sample, after which the next can come.
    pub fn step(&mut self, motion: JointMotion) -> InterfaceForce {
        let now = [motion.translation, motion.rotation];
        let (rate, acceleration) = match self.last {
            None => ([0.0; 2], [0.0; 2]),
            Some([place, rate]) => {
                let new = [0, 1].map(|i| (now[i] - place[i]) / PERIOD);
                (new, [0, 1].map(|i| (new[i] - rate[i]) / PERIOD))
            }
        };
        self.last = Some([now, rate]);
        self.force(now, rate, acceleration)
    }

    /// The force of this sample as an affine map of the motion: its value at no motion, and by how
    /// much a unit of each motion changes it.
    #[must_use]
    pub fn affine(&self) -> (InterfaceForce, Matrix3x2<f64>) {
        let Some([place, rate]) = self.last else {
            return (InterfaceForce::default(), self.stiffness);
        };
        let from = place.map(|x| -x / PERIOD);
        let change = [0, 1].map(|i| (from[i] - rate[i]) / PERIOD);
        let slope = self.stiffness + self.damping / PERIOD + self.mass / (PERIOD * PERIOD);
        (self.force([0.0; 2], from, change), slope)
    }

    fn force(&self, place: [f64; 2], rate: [f64; 2], acceleration: [f64; 2]) -> InterfaceForce {
        let force = self.stiffness * nalgebra::Vector2::from(place)
            + self.damping * nalgebra::Vector2::from(rate)
            + self.mass * nalgebra::Vector2::from(acceleration);
        InterfaceForce {
            force: force[0],
            moment: force[1],
            other_moment: force[2],
        }
    }
}

fn stiffness() -> Square {
    let bending = YOUNGS_MODULUS * COLUMN_INERTIA;
    let shear = 12.0 * bending / COLUMN_LENGTH.powi(3);
    let sway = 6.0 * bending / COLUMN_LENGTH.powi(2);
    let (own, carry) = (4.0 * bending / COLUMN_LENGTH, 2.0 * bending / COLUMN_LENGTH);
    let beam = YOUNGS_MODULUS * BEAM_INERTIA / BEAM_LENGTH;
    let (joint, across) = (own + 4.0 * beam, 2.0 * beam);
    #[rustfmt::skip]
    let rows = [
        2.0 * shear, sway,   sway,   sway,  sway,
        sway,        joint,  across, 0.0,   carry,
        sway,        across, joint,  carry, 0.0,
        sway,        0.0,    carry,  own,   0.0,
        sway,        carry,  0.0,    0.0,   own,
    ];
    Square::from_row_slice(&rows)
}

fn mass() -> Square {
    let beam = DENSITY * BEAM_AREA * BEAM_LENGTH;
    let column = DENSITY * COLUMN_AREA * COLUMN_LENGTH;
    let below = 0.5 * column * COLUMN_LENGTH.powi(2) / 3.0;
    let joint = 0.5 * beam * BEAM_LENGTH.powi(2) / 3.0 + below;
    let masses = [0.5 * (beam + 2.0 * column), joint, joint, below, below];
    Square::from_diagonal(&(SVector::from(masses) * MASS_FACTOR))
}

/// Modal damping, the frequencies rounded.
fn damping(stiffness: &Square, mass: &Square) -> Square {
    let root = mass.diagonal().map(f64::sqrt);
    let scaled = DMatrix::from_fn(5, 5, |i, j| stiffness[(i, j)] / (root[i] * root[j]));
    let modes = scaled.symmetric_eigen();
    let rates = DVector::from_iterator(
        5,
        modes.eigenvalues.iter().map(|square| {
            let frequency = (square.max(0.0).sqrt() / ROUNDING).round() * ROUNDING;
            2.0 * DAMPING_RATIO * frequency
        }),
    );
    let full =
        &modes.eigenvectors * DMatrix::from_diagonal(&rates) * modes.eigenvectors.transpose();
    Square::from_fn(|i, j| root[i] * full[(i, j)] * root[j])
}

/// All five freedoms over the two that are held.
fn condensation(stiffness: &Square) -> Result<SMatrix<f64, 5, 2>, ModelError> {
    let free = stiffness.fixed_view::<3, 3>(2, 2).into_owned();
    let held = stiffness.fixed_view::<3, 2>(2, 0).into_owned();
    let follows =
        free.try_inverse()
            .map(|inverse| -inverse * held)
            .ok_or(ModelError::NotForSimulation {
                model: "specimen",
                reason: "what is not held can move freely".into(),
            })?;
    let mut all = SMatrix::<f64, 5, 2>::identity();
    all.fixed_view_mut::<3, 2>(2, 0).copy_from(&follows);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_rest_it_pushes_back_as_its_stiffness_and_lets_the_other_joint_go() {
        let mut specimen = Specimen::new().unwrap();
        let motion = JointMotion {
            translation: 1e-3,
            rotation: 2e-3,
        };
        for _ in 0..3 {
            specimen.step(motion);
        }
        let force = specimen.step(motion);
        assert!(force.other_moment.abs() < 1e-9, "{force:?}");
        // The work of the held motion is positive; the interface's rotation is the other way round.
        let work = force.force * motion.translation - force.moment * motion.rotation;
        assert!(work > 0.0);
    }

    #[test]
    fn the_affine_map_is_the_step() {
        let mut specimen = Specimen::new().unwrap();
        for k in 0..5 {
            let x = f64::from(k * k) * 1e-4;
            let motion = JointMotion {
                translation: x,
                rotation: -2.0 * x,
            };
            let (at_rest, slope) = specimen.affine();
            let force = specimen.step(motion);
            let by = slope * nalgebra::Vector2::new(motion.translation, motion.rotation);
            let off = [
                at_rest.force + by[0] - force.force,
                at_rest.moment + by[1] - force.moment,
                at_rest.other_moment + by[2] - force.other_moment,
            ];
            assert!(off.iter().all(|off| off.abs() < 1e-6), "{off:?}");
        }
    }
}
