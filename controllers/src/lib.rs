//! Control laws of a hydraulic shake table: what the computer does.
//!
//! One law, one file; every law meets [`Controller`]. Laws are sampled: they are called once a
//! period with what the sensors gave, and the command they return is held until the next call.

pub mod acceleration_tracking;
pub mod adaptive_inverse;
pub mod aids;
pub mod allocation;
pub mod clipped_optimal;
pub mod hierarchy;
pub mod interlock;
pub mod loop_shaping;
pub mod loops;
pub mod minimal_control_synthesis;
pub mod mpc;
pub mod pid;
pub mod prediction_over_delay;
pub mod preview;
pub mod robustness;
pub mod sensor_vote;
pub mod sliding_mode;
pub mod surface_control;
pub mod synthesis;
pub mod three_variable;
pub mod tuning;

pub use plant::ModelError;

/// A sampled control law: plain parameters and plain memory.
pub trait Controller {
    /// What the law is told at a sample, SI.
    type Input;
    /// What it commands until the next sample, SI.
    type Output;

    /// Checks the parameters.
    ///
    /// # Errors
    /// A parameter with which the law cannot run, by name.
    fn validate(&self) -> Result<(), ModelError>;

    /// Computes the command of this sample and advances the memory by `period` seconds.
    fn step(&mut self, input: &Self::Input, period: f64) -> Self::Output;

    /// Forgets everything but the parameters.
    fn reset(&mut self);
}

/// Motion of the table: displacement (m), velocity (m/s), acceleration (m/s²).
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Motion {
    /// Displacement in m.
    pub displacement: f64,
    /// Velocity in m/s.
    pub velocity: f64,
    /// Acceleration in m/s².
    pub acceleration: f64,
}

impl Motion {
    /// This motion and behind it those of the samples ahead, of which there are one fewer than come out:
    /// displacements, velocities and accelerations, SI.
    pub fn with_ahead<const COUNT: usize>(self, ahead: [&[f64]; 3]) -> [Self; COUNT] {
        std::array::from_fn(|i| match i.checked_sub(1) {
            None => self,
            Some(i) => Self {
                displacement: ahead[0][i],
                velocity: ahead[1][i],
                acceleration: ahead[2][i],
            },
        })
    }
}
