//! The reference structure and the part of it that is computed.

use nalgebra::{DMatrix, DVector};
use plant::ModelError;

use super::frame::{Direction, Joint, Member};

/// Freedoms of the structure that others speak of, by their place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Freedom {
    /// Third storey: rotation of a joint.
    Rotation3 = 2,
    /// Third storey: translation.
    Storey3 = 12,
    /// Rotation of the joint that the coupler holds.
    InterfaceRotation = 20,
    /// Second storey: rotation of a joint.
    Rotation2 = 21,
    /// Second storey: translation.
    Storey2 = 25,
    /// Translation of the first storey, which the coupler holds.
    Interface = 26,
    /// Rotation of the specimen's other upper joint.
    OtherRotation = 28,
}

impl Freedom {
    /// Motion that the criteria compare, with the sign that turns it to the coupler's axes: the interface's translation
    /// and rotation, then translation and rotation of storeys 2 and 3.
    pub const COMPARED: [(Self, f64); 6] = [
        (Self::Interface, 1.0),
        (Self::InterfaceRotation, -1.0),
        (Self::Storey2, 1.0),
        (Self::Rotation2, 1.0),
        (Self::Storey3, 1.0),
        (Self::Rotation3, 1.0),
    ];
}

/// Number of freedoms.
const FREEDOMS: usize = 29;

/// Storeys' translations, which the ground's acceleration acts on.
const STOREYS: [Freedom; 3] = [Freedom::Interface, Freedom::Storey2, Freedom::Storey3];

/// Freedoms of the sixteen joints: horizontal, vertical, rotation, from one; zero where fixed. Joints
/// go from left to right, storey by storey from the ground.
const JOINTS: [[usize; 3]; 16] = [
    [0, 0, 0],
    [0, 0, 19],
    [0, 0, 18],
    [0, 0, 0],
    [27, 1, 2],
    [27, 28, 29],
    [27, 20, 21],
    [27, 16, 17],
    [26, 12, 11],
    [26, 6, 5],
    [26, 25, 24],
    [26, 23, 22],
    [13, 8, 7],
    [13, 15, 14],
    [13, 9, 10],
    [13, 4, 3],
];

/// Height of a storey, m.
const HEIGHT: f64 = 0.635;

/// Width of a bay, m.
const BAY: f64 = 0.762;

/// Columns outside of the specimen.
const COLUMN: Member = Member {
    length: HEIGHT,
    near: 7_260_320.053_046_22,
    carry: 1_650_848.876_296_5,
    far: 7_260_320.053_046_22,
    axial: 956_823_067.560_474,
};

/// Beams outside of the specimen; a storey does not stretch.
const BEAM: Member = Member {
    length: BAY,
    near: 117_193.912_269_579,
    carry: 56_931.653_684_357_6,
    far: 117_193.912_269_579,
    axial: 0.0,
};

/// The specimen's column below the joint that the coupler holds.
const HELD_COLUMN: Member = Member {
    length: HEIGHT,
    near: 1_117_375.200_624_34,
    carry: 462_063.135_584_34,
    far: 1_117_375.200_624_34,
    axial: 337_224_256.337_347,
};

/// The specimen's other column, which has a hinge just below its top.
const OTHER_COLUMN: Member = Member {
    near: 964_583.963_790_092,
    carry: 45_451.600_388_014_8,
    far: 2_141.698_447_623_29,
    ..HELD_COLUMN
};

/// The specimen's beam.
const HELD_BEAM: Member = Member {
    near: 468_013.283_560_454,
    carry: 226_110.978_301_546,
    far: 468_013.283_560_454,
    ..BEAM
};

/// Masses of the joints of each storey, outer and inner, kg; their rotations have none.
const JOINT_MASSES: [[f64; 2]; 3] = [
    [1_921.049_719_488_77, 1_919.401_739_173_39],
    [1_921.049_719_488_77, 3_826.954_098_867_02],
    [1_913.477_049_433_51, 3_819.381_428_811_77],
];

/// Damping ratio of the reference structure.
const DAMPING_RATIO: f64 = 0.05;

/// Angular frequencies at which it holds, rad/s.
const DAMPED: [f64; 2] = [13.493, 165.125];

/// A structure under ground motion: `M U'' + C U' + K U = -M l a_g`.
#[derive(Debug, Clone)]
pub struct Structure {
    /// Masses, kg; zero for freedoms without.
    pub mass: DVector<f64>,
    /// Damping, N s/m and N m s.
    pub damping: DMatrix<f64>,
    /// Stiffness, N/m and N m.
    pub stiffness: DMatrix<f64>,
    /// `l`: one for the translations of storeys.
    pub influence: DVector<f64>,
}

/// Rayleigh damping `a M + b K` with one ratio at two angular frequencies: `[a, b]`.
fn rayleigh(ratio: f64, [first, second]: [f64; 2]) -> [f64; 2] {
    let b = 2.0 * ratio / (first + second);
    [b * first * second, b]
}

impl Structure {
    /// The whole frame.
    #[must_use]
    pub fn reference() -> Self {
        let joints = JOINTS.map(|joint| joint.map(|freedom| freedom.checked_sub(1)));
        let mut stiffness = DMatrix::zeros(FREEDOMS, FREEDOMS);
        for storey in 0..3 {
            let (below, above) = (4 * storey, 4 * storey + 4);
            for line in 0..4 {
                let column = match (storey, line) {
                    (0, 1) => OTHER_COLUMN,
                    (0, 2) => HELD_COLUMN,
                    _ => COLUMN,
                };
                let ends = [joints[below + line], joints[above + line]];
                column.add(&mut stiffness, Direction::Column, ends);
            }
            for bay in 0..3 {
                let beam = if (storey, bay) == (0, 1) {
                    HELD_BEAM
                } else {
                    BEAM
                };
                let ends = [joints[above + bay], joints[above + bay + 1]];
                beam.add(&mut stiffness, Direction::Beam, ends);
            }
        }
        let mass = masses(&joints);
        let [a, b] = rayleigh(DAMPING_RATIO, DAMPED);
        let mut influence = DVector::zeros(FREEDOMS);
        for storey in STOREYS {
            influence[storey as usize] = 1.0;
        }
        Self {
            damping: DMatrix::from_diagonal(&mass) * a + &stiffness * b,
            mass,
            stiffness,
            influence,
        }
    }

    /// The part that is computed: the whole without an ideal portal frame at the interface. Of its
    /// mass only that of the translation goes.
    ///
    /// # Errors
    /// None with the benchmark's numbers.
    pub fn numerical() -> Result<Self, ModelError> {
        let mut structure = Self::reference();
        let ideal = IdealFrame::new()?;
        let places = [
            Freedom::Interface,
            Freedom::OtherRotation,
            Freedom::InterfaceRotation,
        ];
        for (i, row) in places.iter().enumerate() {
            for (j, column) in places.iter().enumerate() {
                let place = (*row as usize, *column as usize);
                structure.stiffness[place] -= ideal.stiffness[(i, j)];
                structure.damping[place] -= ideal.damping[(i, j)];
            }
        }
        structure.mass[Freedom::Interface as usize] -= ideal.mass[0];
        Ok(structure)
    }
}

fn masses(joints: &[Joint; 16]) -> DVector<f64> {
    let mut mass = DVector::zeros(FREEDOMS);
    for (place, joint) in joints.iter().enumerate().skip(4) {
        let outer_or_inner = usize::from(matches!(place % 4, 1 | 2));
        let own = JOINT_MASSES[place / 4 - 1][outer_or_inner];
        for freedom in joint[..2].iter().flatten() {
            mass[*freedom] += own;
        }
    }
    mass
}

/// What is cut out: two columns and the beam between them, as the published program has them. Its
/// density is a hundred times that of steel, and the beam's carry-over has the sign of a joint that
/// is let go.
struct IdealFrame {
    mass: DVector<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
}

const INCH: f64 = 0.0254;
const YOUNGS_MODULUS: f64 = 200e9;

impl IdealFrame {
    fn new() -> Result<Self, ModelError> {
        let (column, beam) = (HEIGHT, BAY);
        let column_bending = YOUNGS_MODULUS * 2.52 * INCH.powi(4);
        let beam_bending = YOUNGS_MODULUS * 0.6132 * INCH.powi(4);
        let density = 785e3;
        let beam_mass = density * 0.947 * INCH.powi(2) * beam;
        let column_mass = density * 1.67 * INCH.powi(2) * column;
        let shear = 6.0 * column_bending / column.powi(3);
        let sway = -3.0 * column_bending / column.powi(2);
        let own = 3.0 * column_bending / column + 4.0 * beam_bending / beam;
        let carry = -2.0 * beam_bending / beam;
        let stiffness = DMatrix::from_row_slice(
            3,
            3,
            &[shear, sway, sway, sway, own, carry, sway, carry, own],
        );
        let rotary = (0.5 * beam_mass * beam.powi(2) + 0.5 * column_mass * column.powi(2)) / 12.0;
        let mass = DVector::from_vec(vec![beam_mass + column_mass, rotary, rotary]);
        let squares = squared_frequencies(&mass, &stiffness);
        let frequency = |square: f64| {
            if square > 0.0 {
                return Ok(square.sqrt());
            }
            Err(ModelError::NotForSimulation {
                model: "ideal frame",
                reason: "it has a mode without a frequency".into(),
            })
        };
        let ends = [frequency(squares.min())?, frequency(squares.max())?];
        let [a, b] = rayleigh(DAMPING_RATIO, ends);
        Ok(Self {
            damping: DMatrix::from_diagonal(&mass) * a + &stiffness * b,
            mass,
            stiffness,
        })
    }
}

/// Squares of the angular frequencies, (rad/s)^2, of a structure all of whose freedoms have mass.
fn squared_frequencies(mass: &DVector<f64>, stiffness: &DMatrix<f64>) -> DVector<f64> {
    let scale = DMatrix::from_diagonal(&mass.map(|m| 1.0 / m.sqrt()));
    (&scale * stiffness * &scale).symmetric_eigenvalues()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_is_symmetric_stiff_and_as_heavy_as_its_joints() {
        let frame = Structure::reference();
        assert_eq!(frame.stiffness, frame.stiffness.transpose());
        assert!(frame.stiffness.clone().cholesky().is_some());
        let storeys: f64 = STOREYS.iter().map(|s| frame.mass[*s as usize]).sum();
        assert!((frame.mass.sum() - 2.0 * storeys).abs() < 1e-9);
        // A rigid translation of all joints strains the lowest storey alone.
        let force = &frame.stiffness * &frame.influence;
        assert!(force[Freedom::Storey2 as usize].abs() < 1e-6);
        assert!(force[Freedom::Interface as usize] > 9e7);
    }

    #[test]
    fn taking_the_ideal_frame_out_softens_the_first_storey_and_leaves_the_others() {
        let (whole, part) = (Structure::reference(), Structure::numerical().unwrap());
        let taken = &whole.stiffness - &part.stiffness;
        assert!(taken[(26, 26)] > 4.9e6);
        assert_eq!(taken.iter().filter(|k| **k != 0.0).count(), 9);
        assert!((whole.mass.sum() - part.mass.sum() - 902.527_382_038_4).abs() < 1e-6);
    }
}
