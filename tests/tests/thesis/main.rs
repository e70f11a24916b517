//! The thesis: its tables, its records, its couplings and its rig from first principles.

mod compare;
mod coupling;
mod design;
mod faults;
mod hierarchy;
mod mpc_records;
mod native;
mod run;
mod servo_hydraulic_radau;
mod servo_hydraulic_records;
