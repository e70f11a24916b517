#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Linear specimen on the table as an FMU
