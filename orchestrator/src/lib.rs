//! Hydraulic shake tables as FMI components, co-simulated

pub mod component_library;
pub mod fmu;
pub mod master;
pub mod metrics;
pub mod motion;
pub mod pack;
pub mod report;
pub mod system;
pub mod units;
