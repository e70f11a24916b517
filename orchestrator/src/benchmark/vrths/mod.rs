//! The single-axis benchmark of virtual real-time hybrid simulation (see [`plant::hybrid`]).

pub mod criteria;
pub mod simulation;
