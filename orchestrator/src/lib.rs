//! Hydraulic shake tables as FMI components, co-simulated

pub mod metrics;
pub mod motion;
pub mod units;
