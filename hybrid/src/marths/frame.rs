//! A plane frame of straight members between joints, assembled member by member.

use nalgebra::DMatrix;

/// A member's stiffness, N and m. Its ends resist rotation and, by equilibrium, deflection.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member {
    /// Distance between the joints, m.
    pub length: f64,
    /// Moment at the first end for a unit rotation there, N m.
    pub near: f64,
    /// Moment at one end for a unit rotation of the other, N m.
    pub carry: f64,
    /// Moment at the second end for a unit rotation there, N m.
    pub far: f64,
    /// Force along the member for a unit of extension, N/m; zero where both joints share the freedom.
    pub axial: f64,
}

/// Freedoms of a joint: along, across and rotation; none where it is fixed.
pub(super) type Joint = [Option<usize>; 3];

/// Direction of a member.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    /// From the lower joint to the upper one.
    Column,
    /// From the left joint to the right one.
    Beam,
}

impl Member {
    /// Adds the member between two joints to the stiffness of a frame.
    pub fn add(&self, to: &mut DMatrix<f64>, direction: Direction, joints: [Joint; 2]) {
        // A column bends by the horizontal freedom, a beam by the vertical one, which turns the sign
        // of the moment.
        let (across, along, sign) = match direction {
            Direction::Column => (0, 1, 1.0),
            Direction::Beam => (1, 0, -1.0),
        };
        let [near, far] = [self.near, self.far].map(|own| sign * (own + self.carry) / self.length);
        let shear = (near + far) * sign / self.length;
        let bending = [
            [shear, near, -shear, far],
            [near, self.near, -near, self.carry],
            [-shear, -near, shear, -far],
            [far, self.carry, -far, self.far],
        ];
        let freedoms = [
            joints[0][across],
            joints[0][2],
            joints[1][across],
            joints[1][2],
        ];
        add(to, &freedoms, |i, j| bending[i][j]);
        let along = [joints[0][along], joints[1][along]];
        add(
            to,
            &along,
            |i, j| {
                if i == j { self.axial } else { -self.axial }
            },
        );
    }
}

fn add(to: &mut DMatrix<f64>, freedoms: &[Option<usize>], value: impl Fn(usize, usize) -> f64) {
    for (i, row) in freedoms.iter().enumerate() {
        for (j, column) in freedoms.iter().enumerate() {
            if let (Some(row), Some(column)) = (row, column) {
                to[(*row, *column)] += value(i, j);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    /// A cantilever under a force at its tip: F L^3 / 3 E I and F L^2 / 2 E I.
    #[test]
    fn a_cantilever_deflects_as_the_closed_form() {
        let (flexural, length) = (3.0e5, 2.0);
        let member = Member {
            length,
            near: 4.0 * flexural / length,
            carry: 2.0 * flexural / length,
            far: 4.0 * flexural / length,
            axial: 1.0e8,
        };
        for (direction, place) in [(Direction::Column, 0), (Direction::Beam, 1)] {
            let mut stiffness = DMatrix::zeros(3, 3);
            let tip = [Some(0), Some(1), Some(2)];
            member.add(&mut stiffness, direction, [[None; 3], tip]);
            let mut force = DVector::zeros(3);
            force[place] = 12.0;
            let moved = stiffness.lu().solve(&force).unwrap();
            let closed = 12.0 * length.powi(3) / (3.0 * flexural);
            assert!((moved[place] - closed).abs() < 1e-12, "{moved}");
            let rotation = 12.0 * length.powi(2) / (2.0 * flexural);
            assert!((moved[2].abs() - rotation).abs() < 1e-12, "{moved}");
        }
    }
}
