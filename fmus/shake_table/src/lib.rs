#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Shake table with its hydraulic actuator as an FMU
