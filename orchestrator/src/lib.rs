//! Hydraulic shake tables as FMI components, co-simulated

pub mod units;
