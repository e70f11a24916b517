//! From measured data to a model, and what a model gets wrong: the crates of this folder by one name.

pub use recordings as data;
pub use recordings::IdentificationError;
pub use rigs::{closed_loop, identify, one_input};
pub use sysid as estimation;

/// What a model gets wrong, the name of the cause, and what it brings to know it.
pub mod diagnosis {
    pub use ::diagnosis as engine;
    pub use ::rigs::kinds as rigs;
    pub use ::rigs::{
        Diagnosis, DiagnosisError, DiagnosisReport, EffectReport, Evidence, GainAgainstNoise,
        GainReport, ParameterReport, RigEvidence, ShakeTableEvidence, Subject, called, case,
        diagnose,
    };
}
