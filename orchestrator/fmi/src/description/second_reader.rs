//! `fmi-rs` reads every description too, independently: what it refuses or finds wrong is a remark.

use std::sync::{Mutex, PoisonError};

use fmi_rs::model_description::{fmi2, fmi3};

use super::FmiVersion;

/// `fmi-rs` checks variable names with a parser that keeps its state in globals: one at a time.
static PARSER: Mutex<()> = Mutex::new(());

/// What `fmi-rs` remarks of a description.
pub(super) fn remarks(version: FmiVersion, text: &str) -> Vec<String> {
    let _alone = PARSER.lock().unwrap_or_else(PoisonError::into_inner);
    let problems = match version {
        FmiVersion::V2 => fmi2::ModelDescription::from_string(text).map(|file| file.validate()),
        FmiVersion::V3 => fmi3::ModelDescription::from_string(text).map(|file| file.validate()),
    };
    match problems {
        Ok(problems) => problems.into_iter().map(|own| own.message).collect(),
        Err(refusal) => vec![format!("fmi-rs cannot read it: {refusal}")],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_and_what_is_refused_are_remarks() {
        let text = |name: &str, variable: &str| {
            format!(
                r#"<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t"
                variableNamingConvention="structured"><ModelExchange modelIdentifier="m"/>
                <ModelVariables><Float64 name="{name}" valueReference="1" {variable}/></ModelVariables>
                <ModelStructure/></fmiModelDescription>"#
            )
        };
        let remarks = |text: &str| super::remarks(FmiVersion::V3, text);
        assert_eq!(remarks(&text("x", "")), [""; 0]);
        let named = remarks(&text("x y", ""));
        assert!(named[0].contains("does not conform"), "{named:?}");
        let refused = remarks(&text("x", r#"nominal="one""#));
        assert!(
            refused[0].starts_with("fmi-rs cannot read it: Illegal value 'one'"),
            "{refused:?}"
        );
        let other = super::remarks(FmiVersion::V2, &text("x", ""));
        assert!(other[0].contains("Expected FMI version 2.0"), "{other:?}");
    }

    #[test]
    fn platforms_are_named_alike() {
        let names = FmiVersion::ALL.map(FmiVersion::platform);
        assert_eq!(
            names,
            [fmi_rs::fmi2::PLATFORM, fmi_rs::fmi3::native::PLATFORM_TUPLE]
        );
        assert_eq!(
            std::env::consts::DLL_SUFFIX,
            fmi_rs::SHARED_LIBRARY_EXTENSION
        );
    }
}
