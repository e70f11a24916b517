//! Structures of rigs: what identifies them, what they may lack, and what a diagnosis says of them.
//!
//! [`Subject::read`] takes a case of the shake table or the description of a rig, [`diagnose`] gives
//! one [`DiagnosisReport`] for both.

pub mod case;
pub mod closed_loop;
pub mod identify;
pub mod kinds;
pub mod one_input;
mod report;
mod subject;

pub use report::{
    CandidateReport, DiagnosisReport, EffectGain, EffectReport, Evidence, GainAgainstNoise,
    GainReport, LeftReport, ParameterReport, RigEvidence, ShakeTableEvidence,
};
pub use subject::{Diagnosis, DiagnosisError, Subject, called, diagnose};
