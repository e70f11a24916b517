#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Displacement PID control as an FMU
