//! Hydraulic shake tables as FMI components, co-simulated

pub mod benchmark;
pub mod cli;
pub mod commands;
pub mod component_library;
pub mod error;
pub mod experiment;
pub mod extended_model;
pub mod fmu;
pub mod library;
pub mod manifest;
pub mod master;
pub mod metrics;
pub mod motion;
pub mod pack;
pub mod report;
pub mod results;
pub mod system;
pub use units;
