//! Hydraulic shake tables as FMI components, co-simulated

pub mod fmu;
pub mod motion;
pub mod units;
