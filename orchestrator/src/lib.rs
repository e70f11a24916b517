//! Hydraulic shake tables as FMI components, co-simulated

pub mod metrics;
pub mod motion;
pub mod report;
pub mod units;
