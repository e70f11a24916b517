//! Kinematics of the coupler between two parallel actuators and the joint that they hold.

use plant::ModelError;

use super::Pair;

/// Motion of the joint.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct JointMotion {
    /// Translation along the actuators, m.
    pub translation: f64,
    /// Rotation in the coupler's axes, rad.
    pub rotation: f64,
}

/// A rigid coupler: where its pins are, seen from the joint.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Coupler {
    /// Distance of each pin from the joint, m.
    distance: Pair,
    /// Direction of each pin, rad.
    direction: Pair,
}

/// Smallest difference of the pins' lever arms over their distance.
const SINGULAR: f64 = 1e-3;

impl Default for Coupler {
    /// The benchmark's: 0.2667 m along, 0.127 m to either side.
    fn default() -> Self {
        let angle = 25.4633f64.to_radians();
        let distance = 0.2667f64.hypot(0.127);
        Self {
            distance: [distance; 2],
            direction: [-angle, angle],
        }
    }
}

impl Coupler {
    /// From the places of the pins: along the actuators and across, m, seen from the joint.
    ///
    /// # Errors
    /// Pins whose lever arms are alike: no stroke turns the joint then.
    pub fn of_pins(along: Pair, across: Pair) -> Result<Self, ModelError> {
        let coupler = Self {
            distance: [0, 1].map(|i| along[i].hypot(across[i])),
            direction: [0, 1].map(|i| across[i].atan2(along[i])),
        };
        coupler.validate()?;
        Ok(coupler)
    }

    /// Checks that two strokes determine the motion.
    ///
    /// # Errors
    /// Pins whose lever arms are alike.
    pub fn validate(&self) -> Result<(), ModelError> {
        let [lower, upper] = self.levers();
        let size = self.distance[0].max(self.distance[1]);
        if (upper - lower).abs() > SINGULAR * size && size.is_finite() {
            return Ok(());
        }
        Err(ModelError::Parameter {
            name: "coupler",
            value: upper - lower,
            expected: "lever arms of the two actuators that differ: with the same one no stroke \
                       turns the joint",
        })
    }

    /// Lever arms, m: rates of the strokes over that of the rotation, sign turned.
    fn levers(&self) -> Pair {
        [0, 1].map(|i| self.distance[i] * self.direction[i].sin())
    }

    /// Strokes (m) that give a motion.
    #[must_use]
    pub fn strokes(&self, motion: JointMotion) -> Pair {
        [0, 1].map(|i| {
            let turned = (motion.rotation + self.direction[i]).cos() - self.direction[i].cos();
            motion.translation + self.distance[i] * turned
        })
    }

    /// The motion that strokes (m) give, worked back as the published program does: the rotation from
    /// the strokes' difference, the translation from the first stroke. Exact to 4e-8 m over the
    /// benchmark's range where the pins are symmetric.
    ///
    /// # Errors
    /// Strokes whose difference is larger than that of the lever arms: no rotation gives them.
    pub fn motion(&self, strokes: Pair) -> Result<JointMotion, ModelError> {
        let [lower, upper] = self.levers();
        let sine = (strokes[0] - strokes[1]) / (upper - lower);
        // Not a number is refused, too.
        if sine.is_nan() || sine.abs() > 1.0 {
            return Err(ModelError::Parameter {
                name: "stroke difference",
                value: strokes[0] - strokes[1],
                expected: "at most the difference of the lever arms, m: no rotation of the coupler \
                           gives a larger one",
            });
        }
        let turned = (self.direction[0] + sine).cos() - self.direction[0].cos();
        Ok(JointMotion {
            translation: strokes[0] - self.distance[0] * turned,
            rotation: sine.asin(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strokes_and_motion_belong_together() {
        let coupler = Coupler::default();
        for (translation, rotation) in [(0.004, -0.01), (-0.003, 0.008), (0.0, 0.0)] {
            let motion = JointMotion {
                translation,
                rotation,
            };
            let back = coupler.motion(coupler.strokes(motion)).unwrap();
            assert!((back.translation - translation).abs() < 4e-8);
            assert!((back.rotation - rotation).abs() < 1e-12);
        }
    }

    /// The pins of a rigid body that translates and turns, by rotating their places.
    #[test]
    fn strokes_are_the_pins_travel_along_the_actuators() {
        let coupler = Coupler::of_pins([0.3, 0.2], [-0.1, 0.15]).unwrap();
        let (translation, rotation) = (0.002, 0.03f64);
        let strokes = coupler.strokes(JointMotion {
            translation,
            rotation,
        });
        for (stroke, (along, across)) in strokes.iter().zip([(0.3, -0.1), (0.2, 0.15)]) {
            let moved = along * rotation.cos() - across * rotation.sin() + translation;
            assert!((stroke - (moved - along)).abs() < 1e-15);
        }
    }

    #[test]
    fn strokes_that_no_rotation_gives_are_refused() {
        let coupler = Coupler::default();
        for strokes in [[0.2, -0.1], [f64::NAN, 0.0]] {
            let error = coupler.motion(strokes).unwrap_err().to_string();
            assert!(error.contains("stroke difference"), "{error}");
        }
    }

    #[test]
    fn a_singular_coupler_is_refused() {
        let error = Coupler::of_pins([0.3, 0.3], [0.1, 0.1]).unwrap_err();
        assert!(error.to_string().contains("lever arms"), "{error}");
    }
}
