#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Three-variable control as an FMU
