//! What the identified rig lacks against a real one: every effect of the hidden-effects
//! catalogue, a parameter each, off by default (zero is off).
//!
//! Valve and oil act between the command and G1, friction, masses and springs on the table's
//! equation, sensors on the channels.

pub mod foundation;
pub mod friction;
pub mod hydraulics;
pub mod sensors;
pub mod specimen;
pub mod table;
pub mod valve;

pub use foundation::FoundationEffects;
pub use friction::FrictionEffects;
pub use hydraulics::HydraulicEffects;
pub use sensors::SensorEffects;
pub use specimen::SpecimenEffects;
pub use table::TableEffects;
pub use valve::ValveEffects;

use crate::ModelError;

/// All effects on the rig itself; those on its sensors are [`SensorEffects`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Effects {
    /// Between the command and the flow.
    pub valve: ValveEffects,
    /// Between the flow and the force.
    pub hydraulics: HydraulicEffects,
    /// Dry friction of the table.
    pub friction: FrictionEffects,
    /// Mass, damping and spring of the table.
    pub table: TableEffects,
    /// What the reaction wall stands on.
    pub foundation: FoundationEffects,
    /// The specimen.
    pub specimen: SpecimenEffects,
}

impl Effects {
    /// Refuses values that have no meaning, naming the parameter.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.valve.validate()?;
        self.hydraulics.validate()?;
        self.friction.validate()?;
        self.table.validate()?;
        self.foundation.validate()?;
        self.specimen.validate()
    }
}
