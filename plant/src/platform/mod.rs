//! Kinematics of a rigid platform that any number of actuators, up to eight, hold: strokes of a pose, the pose of
//! strokes, and how the actuators share a load.
//!
//! A pose is a translation and a rotation vector (axis times angle). The inverse problem, strokes of a pose, is in
//! closed form. The forward problem is solved by Gauss and Newton's method on the group of rigid motions (J.-P. Merlet,
//! Parallel Robots, 2nd edition, 2006, chapter 4). With more actuators than free axes the pose is the one of least
//! squares, and what the strokes contradict each other by is reported.

mod forward;
mod text;

pub use forward::Found;

use nalgebra::{Matrix6, Rotation3, SymmetricEigen, Vector3, Vector6};

use crate::ModelError;

/// Largest number of actuators.
pub const MOST: usize = 8;

/// Names of the axes of a pose, in its order.
pub const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// Ratio of the smallest to the largest singular value of the scaled Jacobian below which a geometry is singular.
const SINGULAR: f64 = 1e-3;

/// Translation (m) and rotation vector (rad) of the platform from its zero position.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Pose(pub [f64; 6]);

impl Pose {
    fn translation(&self) -> Vector3<f64> {
        Vector3::new(self.0[0], self.0[1], self.0[2])
    }

    fn rotation(&self) -> Rotation3<f64> {
        Rotation3::new(Vector3::new(self.0[3], self.0[4], self.0[5]))
    }

    fn of(translation: Vector3<f64>, rotation: &Rotation3<f64>) -> Self {
        let turned = rotation.scaled_axis();
        Self([
            translation.x,
            translation.y,
            translation.z,
            turned.x,
            turned.y,
            turned.z,
        ])
    }
}

/// Where an actuator's line of action is.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Line {
    /// The line keeps its direction, a unit vector from the actuator to the platform, as if the actuator were long.
    Fixed([f64; 3]),
    /// The line passes through a pin at this place, m: a stroke is a change of the pins' distance.
    Pinned([f64; 3]),
}

/// An actuator: its pin on the platform in the zero position, m, and its line of action.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Actuator {
    /// Pin on the platform.
    pub point: [f64; 3],
    /// Line of action.
    pub line: Line,
}

impl Actuator {
    /// The stroke, m, and the direction of the line at a pose.
    fn at(&self, translation: &Vector3<f64>, rotation: &Rotation3<f64>) -> (f64, Vector3<f64>) {
        let start = Vector3::from(self.point);
        let place = rotation * start + translation;
        match self.line {
            Line::Fixed(direction) => {
                let direction = Vector3::from(direction);
                (direction.dot(&(place - start)), direction)
            }
            Line::Pinned(base) => {
                let base = Vector3::from(base);
                let leg = place - base;
                let length = leg.norm();
                (length - (start - base).norm(), leg / length)
            }
        }
    }
}

/// A platform with its actuators and the axes along which it can move.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Platform {
    actuators: Vec<Actuator>,
    free: [bool; 6],
    /// Lever arm that makes rotations comparable with translations, m.
    size: f64,
}

impl Platform {
    /// A platform that moves along the axes that are `free`.
    ///
    /// # Errors
    /// More than eight actuators or fewer than free axes; places or directions that are not finite; actuators that leave
    /// a motion of the platform undetermined.
    pub fn new(actuators: Vec<Actuator>, free: [bool; 6]) -> Result<Self, ModelError> {
        let count = free.iter().filter(|free| **free).count();
        if actuators.len() < count || actuators.len() > MOST || count == 0 {
            return Err(refused(format!(
                "{} actuators hold {count} free axes; expected one axis or more, at least as many actuators, and at \
                 most {MOST}",
                actuators.len()
            )));
        }
        for (i, actuator) in actuators.iter().enumerate() {
            check(i, actuator)?;
        }
        let squares = actuators
            .iter()
            .map(|a| Vector3::from(a.point).norm_squared());
        let size = (squares.sum::<f64>() / actuators.len() as f64).sqrt();
        let platform = Self {
            actuators,
            free,
            size: if size > 0.0 { size } else { 1.0 },
        };
        platform.determined(&Pose::default())?;
        Ok(platform)
    }

    /// Reads a platform from text: places as `"0.27 -0.13 0; 0.27 0.13 0"`, one actuator behind each semicolon, and axes as
    /// `"x rz"`. Give either `bases` or `directions`.
    ///
    /// # Errors
    /// Words that are not understood, and as [`Platform::new`].
    pub fn read(
        points: &str,
        bases: &str,
        directions: &str,
        free: &str,
    ) -> Result<Self, ModelError> {
        let wrong = |error: text::TextError| refused(error.to_string());
        let actuators = text::actuators(points, bases, directions).map_err(wrong)?;
        let free = text::axes(free).map_err(wrong)?;
        Self::new(actuators, free)
    }

    /// Places of the pins, along and across, m, if the platform is a coupler of two actuators along x that moves along x
    /// and turns about z.
    #[must_use]
    pub fn parallel_pins(&self) -> Option<[[f64; 2]; 2]> {
        let [first, second] = self.actuators.as_slice() else {
            return None;
        };
        let pin = |actuator: &Actuator| match actuator.line {
            Line::Fixed([1.0, 0.0, 0.0]) => Some([actuator.point[0], actuator.point[1]]),
            _ => None,
        };
        let planar = self.free == [true, false, false, false, false, true];
        planar.then_some([pin(first)?, pin(second)?])
    }

    /// Number of actuators.
    #[must_use]
    pub fn actuators(&self) -> usize {
        self.actuators.len()
    }

    /// Number of actuators beyond the free axes.
    #[must_use]
    pub fn redundancy(&self) -> usize {
        self.actuators.len() - self.free.iter().filter(|free| **free).count()
    }

    /// Strokes at a pose, m; the rest of the array is zero.
    #[must_use]
    pub fn strokes(&self, pose: &Pose) -> [f64; MOST] {
        let (translation, rotation) = (pose.translation(), pose.rotation());
        let mut strokes = [0.0; MOST];
        for (stroke, actuator) in strokes.iter_mut().zip(&self.actuators) {
            *stroke = actuator.at(&translation, &rotation).0;
        }
        strokes
    }

    /// Rate of an actuator's stroke by the rates of translation and rotation at a pose, 1 and m; axes that are not free
    /// have zeros.
    fn row(
        &self,
        actuator: usize,
        translation: &Vector3<f64>,
        rotation: &Rotation3<f64>,
    ) -> (f64, Vector6<f64>) {
        let own = &self.actuators[actuator];
        let (stroke, direction) = own.at(translation, rotation);
        let turn = (rotation * Vector3::from(own.point)).cross(&direction);
        let mut row = Vector6::new(
            direction.x,
            direction.y,
            direction.z,
            turn.x,
            turn.y,
            turn.z,
        );
        for (value, free) in row.iter_mut().zip(self.free) {
            if !free {
                *value = 0.0;
            }
        }
        (stroke, row)
    }

    /// Sum of the rows' squares at a pose, rotations scaled, with ones for the axes that are not free.
    fn normal(&self, translation: &Vector3<f64>, rotation: &Rotation3<f64>) -> Matrix6<f64> {
        let scale = self.scale();
        let mut normal = Matrix6::zeros();
        for i in 0..self.actuators.len() {
            let row = self.row(i, translation, rotation).1.component_mul(&scale);
            normal += row * row.transpose();
        }
        for (i, free) in self.free.iter().enumerate() {
            if !free {
                normal[(i, i)] = 1.0;
            }
        }
        normal
    }

    /// What makes rotations comparable with translations: one, and the inverse of the size.
    fn scale(&self) -> Vector6<f64> {
        let turn = 1.0 / self.size;
        Vector6::new(1.0, 1.0, 1.0, turn, turn, turn)
    }

    /// Smallest over largest singular value of the scaled Jacobian: 0 where some motion has no strokes.
    #[must_use]
    pub fn conditioning(&self, pose: &Pose) -> f64 {
        let normal = self.normal(&pose.translation(), &pose.rotation());
        // Of the free axes alone: those that are not have a one on the diagonal and nothing beside it.
        let eigen = SymmetricEigen::new(normal);
        let own = (0..6).filter(|i| {
            let vector = eigen.eigenvectors.column(*i);
            self.free
                .iter()
                .zip(vector.iter())
                .any(|(free, part)| *free && part.abs() > 1e-9)
        });
        let (least, most) = own.fold((f64::INFINITY, 0.0f64), |(least, most), i| {
            let value = eigen.eigenvalues[i].max(0.0).sqrt();
            (least.min(value), most.max(value))
        });
        if most > 0.0 { least / most } else { 0.0 }
    }

    fn determined(&self, pose: &Pose) -> Result<(), ModelError> {
        let conditioning = self.conditioning(pose);
        if conditioning > SINGULAR {
            return Ok(());
        }
        let eigen = SymmetricEigen::new(self.normal(&pose.translation(), &pose.rotation()));
        let motion = eigen.eigenvectors.column(eigen.eigenvalues.imin());
        let axis = AXES[motion.iamax()];
        Err(refused(format!(
            "its geometry is singular: a motion mostly along `{axis}` moves no actuator (ratio of singular values \
             {conditioning:.1e}, expected above {SINGULAR}); move a pin or turn a line of action"
        )))
    }

    /// Force (N) and moment (N m) about the zero position's origin, moved with the platform, of actuator forces, N.
    #[must_use]
    pub fn wrench(&self, pose: &Pose, forces: &[f64; MOST]) -> [f64; 6] {
        let (translation, rotation) = (pose.translation(), pose.rotation());
        let mut sum = Vector6::zeros();
        for (i, force) in forces.iter().enumerate().take(self.actuators.len()) {
            sum += self.row(i, &translation, &rotation).1 * *force;
        }
        sum.into()
    }

    /// Actuator forces (N) that hold a wrench with the least sum of squares: with redundant actuators none of them works
    /// against another.
    ///
    /// # Errors
    /// A pose in which the actuators cannot hold every wrench.
    pub fn forces(&self, pose: &Pose, wrench: &[f64; 6]) -> Result<[f64; MOST], ModelError> {
        self.determined(pose)?;
        let (translation, rotation) = (pose.translation(), pose.rotation());
        let scale = self.scale();
        let mut wanted = Vector6::from(*wrench).component_mul(&scale);
        for (value, free) in wanted.iter_mut().zip(self.free) {
            if !free {
                *value = 0.0;
            }
        }
        let Some(factor) = self.normal(&translation, &rotation).cholesky() else {
            return Err(refused("its geometry is singular".into()));
        };
        let multipliers = factor.solve(&wanted);
        let mut forces = [0.0; MOST];
        for (i, force) in forces.iter_mut().enumerate().take(self.actuators.len()) {
            *force = self
                .row(i, &translation, &rotation)
                .1
                .component_mul(&scale)
                .dot(&multipliers);
        }
        Ok(forces)
    }
}

fn refused(reason: String) -> ModelError {
    ModelError::NotForSimulation {
        model: "platform",
        reason,
    }
}

fn check(place: usize, actuator: &Actuator) -> Result<(), ModelError> {
    let name = place + 1;
    let (line, what) = match actuator.line {
        Line::Fixed(direction) => (direction, "direction"),
        Line::Pinned(base) => (base, "base"),
    };
    if !actuator
        .point
        .iter()
        .chain(&line)
        .all(|value| value.is_finite())
    {
        return Err(refused(format!(
            "actuator {name}: its point or {what} is not finite"
        )));
    }
    let length = match actuator.line {
        Line::Fixed(direction) => Vector3::from(direction).norm(),
        Line::Pinned(base) => (Vector3::from(actuator.point) - Vector3::from(base)).norm(),
    };
    match actuator.line {
        Line::Fixed(_) if (length - 1.0).abs() > 1e-9 => Err(refused(format!(
            "actuator {name}: its direction has the length {length}, expected 1"
        ))),
        Line::Pinned(_) if length <= 0.0 => Err(refused(format!(
            "actuator {name}: its base is its point on the platform; move one of them"
        ))),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
