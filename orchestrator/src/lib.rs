//! Hydraulic shake tables as FMI components, co-simulated

pub mod component_library;
pub mod pack;
