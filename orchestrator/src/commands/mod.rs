//! One file a command.

pub mod build;
pub mod compare;
mod compare_errors;
mod compare_tables;
pub mod design;
mod design_report;
pub mod diagnose;
pub mod diagnose_rig;
pub mod identify;
pub mod info;
pub mod report;
pub mod run;
mod summary;
mod table;

use clap::ValueEnum;

use crate::fmu::FmiVersion;

/// `--fmi` where one version is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum OneVersion {
    /// FMI 2.0
    #[value(name = "2")]
    Two,
    /// FMI 3.0
    #[default]
    #[value(name = "3")]
    Three,
}

impl From<OneVersion> for FmiVersion {
    fn from(version: OneVersion) -> Self {
        match version {
            OneVersion::Two => Self::V2,
            OneVersion::Three => Self::V3,
        }
    }
}
