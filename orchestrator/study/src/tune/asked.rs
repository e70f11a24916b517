//! What a study's `[tune]` asks for.

use serde::Deserialize;

use super::Parameter;
use crate::campaign::{Bench, Study};
use fmi_system::Setting;
use laboratory::error::Error;
use units::value_in;

/// `[tune]` of a study.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    #[serde(default = "usual_objective")]
    objective: String,
    #[serde(default = "usual_quantile")]
    quantile: f64,
    #[serde(default = "usual_evaluations")]
    evaluations: usize,
    #[serde(default = "usual_share")]
    hold_out: f64,
    gain_margin: Option<Setting>,
    phase_margin: Option<Setting>,
    parameters: std::collections::BTreeMap<String, [Setting; 2]>,
}

fn usual_objective() -> String {
    "time_domain_percent".to_string()
}

fn usual_quantile() -> f64 {
    0.95
}

fn usual_evaluations() -> usize {
    60
}

fn usual_share() -> f64 {
    0.3
}

/// What `[tune]` asks for, checked.
pub(super) struct Asked {
    pub(super) objective: String,
    pub(super) quantile: f64,
    pub(super) evaluations: usize,
    pub(super) share: f64,
    pub(super) gain_margin: Option<f64>,
    pub(super) phase_margin: Option<f64>,
    pub(super) parameters: Vec<Parameter>,
}

impl Asked {
    /// Reads `[tune]` of a study.
    ///
    /// # Errors
    /// A table that is missing or at fault; a parameter that the study sets itself.
    pub(super) fn read(study: &Study, bench: &Bench) -> Result<Self, Error> {
        let fault = |reason: String| study.fault(&format!("[tune] {reason}"));
        let table = study.tune.clone().ok_or_else(|| {
            fault(
                "is missing; expected for \
                 example\n[tune.parameters]\n\"control.displacement_gain\" = \
                 [\"10 V/in\", \"50 V/in\"]"
                    .to_string(),
            )
        })?;
        let written: Written = table
            .try_into()
            .map_err(|error: toml::de::Error| fault(error.message().to_string()))?;
        if !(0.0..=1.0).contains(&written.quantile) {
            return Err(fault(format!(
                "quantile = {}; expected 0 to 1",
                written.quantile
            )));
        }
        if !(0.0..1.0).contains(&written.hold_out) {
            return Err(fault(format!(
                "hold_out = {}; expected 0 to 1",
                written.hold_out
            )));
        }
        if written.parameters.is_empty() {
            return Err(fault("parameters: there is none".to_string()));
        }
        if written.evaluations < written.parameters.len() + 2 {
            return Err(fault(format!(
                "evaluations = {}; expected at least {}, two more than parameters",
                written.evaluations,
                written.parameters.len() + 2
            )));
        }
        let margin = |name: &str, given: &Option<Setting>, unit: &str| {
            let given = given.as_ref().map(|setting| match setting {
                Setting::Integer(number) => Ok(*number as f64),
                Setting::Number(number) => Ok(*number),
                Setting::Text(text) => {
                    let number = text.trim().strip_suffix(unit).unwrap_or(text);
                    number.trim().parse::<f64>().map_err(|_| ())
                }
                _ => Err(()),
            });
            given.transpose().map_err(|()| {
                fault(format!(
                    "{name}: expected a number of {unit}, such as \"6 {unit}\""
                ))
            })
        };
        let gain_margin = margin("gain_margin", &written.gain_margin, "dB")?;
        let phase_margin = margin("phase_margin", &written.phase_margin, "deg")?;
        let mut parameters = Vec::new();
        for (name, [low, high]) in &written.parameters {
            let at = |reason: String| fault(format!("parameters.{name}: {reason}"));
            if study.factors.iter().any(|factor| factor.name == *name)
                || study.fixed.iter().any(|(own, ..)| own == name)
            {
                return Err(at("the study already fixes or varies it".to_string()));
            }
            let (before, unit) = bench.nominal(name).map_err(|error| at(error.to_string()))?;
            let bound = |setting: &Setting| match setting {
                Setting::Text(text) => value_in(text, &unit).map_err(|error| at(error.to_string())),
                Setting::Integer(number) if unit.is_empty() => Ok(*number as f64),
                Setting::Number(number) if unit.is_empty() => Ok(*number),
                other => Err(at(format!(
                    "`{other}` has no unit; expected for example \"1 {unit}\""
                ))),
            };
            let (low, high) = (bound(low)?, bound(high)?);
            if low >= high {
                return Err(at(format!("the range from {low} to {high} is empty")));
            }
            parameters.push(Parameter {
                name: name.clone(),
                unit,
                low,
                high,
                before,
                after: before,
            });
        }
        Ok(Self {
            objective: written.objective,
            quantile: written.quantile,
            evaluations: written.evaluations,
            share: written.hold_out,
            gain_margin,
            phase_margin,
            parameters,
        })
    }
}
