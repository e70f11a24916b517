//! Control allocation: how much of the valve each low-level loop gets (Fig 4-3).

use units::{Parameters, vocabulary};

use crate::pid::VALVE_LIMIT;
use crate::{Controller, ModelError};

/// `u = alpha u_d + beta u_f` from the commands of the displacement and the force loop.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct ControlAllocation {
    /// Share alpha of the displacement loop.
    #[parameter("1", non_negative)]
    pub displacement_share: f64,
    /// Share beta of the force loop.
    #[parameter("1", non_negative)]
    pub force_share: f64,
    /// Largest magnitude of the valve command, V.
    #[parameter("V", name = vocabulary::VALVE_LIMIT, positive)]
    pub limit: f64,
}

/// Commands of the two low-level loops, V.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LoopCommands {
    /// Of the displacement loop.
    pub displacement_loop: f64,
    /// Of the force loop.
    pub force_loop: f64,
}

impl Default for ControlAllocation {
    /// Both shares one half (Section 4.3).
    fn default() -> Self {
        Self {
            displacement_share: 0.5,
            force_share: 0.5,
            limit: VALVE_LIMIT,
        }
    }
}

impl Controller for ControlAllocation {
    type Input = LoopCommands;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        if self.displacement_share + self.force_share == 0.0 {
            return Err(ModelError::Parameter {
                name: Self::FORCE_SHARE,
                value: 0.0,
                expected: "a positive number if displacement_share is 0, or no loop reaches the \
                    valve",
            });
        }
        Ok(())
    }

    fn step(&mut self, input: &LoopCommands, _period: f64) -> f64 {
        (self.displacement_share * input.displacement_loop + self.force_share * input.force_loop)
            .clamp(-self.limit, self.limit)
    }

    fn reset(&mut self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_weighed_and_limited() {
        let mut allocation = ControlAllocation {
            displacement_share: 0.25,
            force_share: 0.75,
            limit: 5.0,
        };
        let mut step = |displacement_loop, force_loop| {
            allocation.step(
                &LoopCommands {
                    displacement_loop,
                    force_loop,
                },
                0.002,
            )
        };
        assert_eq!(step(4.0, -2.0), -0.5);
        assert_eq!(step(10.0, 10.0), 5.0);
        assert_eq!(step(-10.0, -10.0), -5.0);
    }

    #[test]
    fn shares_that_reach_nothing_are_refused_by_name() {
        let with = |displacement_share, force_share| ControlAllocation {
            displacement_share,
            force_share,
            ..ControlAllocation::default()
        };
        let refusal =
            |allocation: ControlAllocation| allocation.validate().unwrap_err().to_string();
        assert!(refusal(with(0.0, 0.0)).contains("`force_share`"));
        assert!(refusal(with(-0.1, 0.5)).contains("`displacement_share`"));
        assert!(refusal(with(0.1, f64::NAN)).contains("`force_share`"));
        assert!(with(0.0, 0.5).validate().is_ok());
    }
}
