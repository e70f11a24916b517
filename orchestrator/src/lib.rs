//! Hydraulic shake tables as FMI components, co-simulated

pub mod benchmark;
pub mod cli;
pub mod comparison;
pub mod component_library;
pub mod design;
pub mod diagnosis;
pub mod doctor;
pub mod error;
pub mod extended_model;
pub mod figures;
pub mod fmu;
pub mod identify;
pub mod library;
pub mod live;
pub mod master;
pub mod metrics;
pub mod motion;
pub mod pack;
pub mod report;
pub mod results;
pub mod run;
pub mod run_comparison;
pub mod ssp;
pub mod system;
pub mod validate;
pub use units;
