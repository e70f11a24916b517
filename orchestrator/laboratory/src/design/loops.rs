//! The loops of the thesis, by name.

use std::fmt;
use std::str::FromStr;

use controllers::ModelError;
use controllers::allocation::ControlAllocation;
use controllers::hierarchy;
use controllers::loop_shaping::{LoopShaping, LoopShapingCoefficients};
use controllers::loops::{Controlled, LinearLaw, Loop};
use controllers::pid::Pid;
use controllers::sliding_mode::SlidingMode;
use controllers::three_variable::ThreeVariableGains;
use plant::identified::coupled::Rig;
use serde::Serialize;
use units::constants::SAMPLING_PERIOD;

/// A loop that can be analysed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LoopName {
    /// Displacement PID, Eq 3-6.
    DisplacementPid,
    /// Force PID, Eq 3-7, with the whole valve.
    ForcePid,
    /// Loop shaping, Eq 3-10.
    LoopShaping,
    /// Loop shaping, synthesised for the target crossover.
    LoopShapingSynthesis,
    /// Three-variable control, Table 3-2, opened at the valve.
    ThreeVariable,
    /// Sliding mode over displacement and force loop, Fig 4-3, opened at the valve.
    SlidingMode,
}

/// A loop with its name.
#[derive(Debug, Clone)]
pub(super) struct NamedLoop {
    pub(super) name: LoopName,
    pub(super) rig_loop: Loop,
}

impl LoopName {
    /// All loops.
    pub const ALL: [Self; 6] = [
        Self::DisplacementPid,
        Self::ForcePid,
        Self::LoopShaping,
        Self::LoopShapingSynthesis,
        Self::ThreeVariable,
        Self::SlidingMode,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::DisplacementPid => "displacement-pid",
            Self::ForcePid => "force-pid",
            Self::LoopShaping => "loop-shaping",
            Self::LoopShapingSynthesis => "loop-shaping-synthesis",
            Self::ThreeVariable => "three-variable",
            Self::SlidingMode => "sliding-mode",
        }
    }

    /// What it is.
    pub fn about(self) -> &'static str {
        match self {
            Self::DisplacementPid => "displacement PID, Eq 3-6",
            Self::ForcePid => "force PID, Eq 3-7, with the whole valve",
            Self::LoopShaping => "loop shaping, Eq 3-10",
            Self::LoopShapingSynthesis => "loop shaping, synthesised for the target crossover",
            Self::ThreeVariable => "three-variable control, Table 3-2, opened at the valve",
            Self::SlidingMode => {
                "sliding mode over displacement and force loop, Fig 4-3, opened at the valve"
            }
        }
    }

    /// The thesis's figure of its frequency response.
    pub(super) fn figure(self) -> Option<&'static str> {
        match self {
            Self::DisplacementPid => Some("Fig 3-3"),
            Self::ForcePid => Some("Fig 3-4"),
            Self::LoopShaping => Some("Fig 3-9"),
            _ => None,
        }
    }

    /// The loop's law, sampled every `period` seconds.
    fn law(self, synthesised: &LoopShaping, period: f64) -> Result<LinearLaw, ModelError> {
        match self {
            Self::DisplacementPid => {
                LinearLaw::pid(&Pid::equation_3_6(), Controlled::Displacement, period)
            }
            Self::ForcePid => LinearLaw::pid(&Pid::equation_3_7(), Controlled::Force, period),
            Self::LoopShaping => {
                LinearLaw::loop_shaping(&LoopShapingCoefficients::equation_3_10(), period)
            }
            Self::LoopShapingSynthesis => LinearLaw::shaped(synthesised, period),
            Self::ThreeVariable => {
                LinearLaw::three_variable(&ThreeVariableGains::table_3_2(), period)
            }
            Self::SlidingMode => {
                let allocation = ControlAllocation::default();
                LinearLaw::hierarchy(
                    &SlidingMode::default(),
                    &hierarchy::displacement_loop(&allocation),
                    &hierarchy::force_loop(&allocation),
                    &allocation,
                    period,
                )
            }
        }
    }
}

impl fmt::Display for LoopName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that no loop has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a loop; expected one of {known}", known = LoopName::ALL.map(LoopName::name).join(", "))]
pub struct UnknownLoop(pub String);

impl FromStr for LoopName {
    type Err = UnknownLoop;

    fn from_str(text: &str) -> Result<Self, UnknownLoop> {
        let found = Self::ALL.into_iter().find(|name| name.name() == text);
        found.ok_or_else(|| UnknownLoop(text.to_string()))
    }
}

impl NamedLoop {
    /// Around `rig`, with the controller that was synthesised.
    pub(super) fn new(
        name: LoopName,
        rig: &Rig,
        synthesised: &LoopShaping,
    ) -> Result<Self, ModelError> {
        let law = name.law(synthesised, SAMPLING_PERIOD)?;
        Ok(Self {
            name,
            rig_loop: Loop::new(rig, law),
        })
    }
}
