//! What a model gets wrong, the name of the cause, and what it brings to know it.
//!
//! [`Subject::read`] takes a case of the shake table or the description of a rig, [`diagnose`] gives
//! one [`DiagnosisReport`] for both.

pub mod case;
pub mod engine;
mod report;
pub mod rigs;
mod subject;

pub use report::{
    DiagnosisReport, EffectReport, Evidence, GainAgainstNoise, GainReport, ParameterReport,
    RigEvidence, ShakeTableEvidence,
};
pub use subject::{Diagnosis, DiagnosisError, Subject, called, diagnose};
