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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Bench;
    use pack::Installation;

    const STUDY: &str = "[study]\n[fixed]\nsystem = \"own.toml\"\n[factors]\nseed = [1, 2]\n";

    fn asked(tune: &str) -> Result<Asked, String> {
        let folder = tempfile::tempdir().unwrap();
        let own = crate::campaign::made_study(folder.path(), &format!("{STUDY}{tune}"));
        let bench = Bench::new(&own, &Installation::default());
        Asked::read(&own, &bench).map_err(|error| error.to_string())
    }

    #[test]
    fn a_search_has_its_parameters_in_their_units_and_usual_settings() {
        let own = asked("[tune.parameters]\n\"own.gain\" = [\"0.001 V/mm\", \"9 V/m\"]\n\"own.share\" = [-1, 2.5]\n").unwrap();
        assert_eq!(
            (&*own.objective, own.quantile, own.evaluations),
            ("time_domain_percent", 0.95, 60)
        );
        assert_eq!(
            (own.share, own.gain_margin, own.phase_margin),
            (0.3, None, None)
        );
        let shown = |own: &Parameter| {
            (
                own.name.clone(),
                own.unit.clone(),
                [own.low, own.high, own.before, own.after],
            )
        };
        let all: Vec<_> = own.parameters.iter().map(shown).collect();
        assert_eq!(
            all[0],
            ("own.gain".into(), "V/m".into(), [1.0, 9.0, 4.0, 4.0])
        );
        assert_eq!(
            all[1],
            ("own.share".into(), String::new(), [-1.0, 2.5, 0.0, 0.0])
        );
        let own = asked(
            "[tune]\nobjective = \"delay_s\"\nquantile = 0.5\nevaluations = 3\nhold_out = 0.0\n\
             gain_margin = \"6 dB\"\nphase_margin = 45\n[tune.parameters]\n\"own.share\" = [0, 1]\n",
        )
        .unwrap();
        assert_eq!(
            (&*own.objective, own.quantile, own.evaluations, own.share),
            ("delay_s", 0.5, 3, 0.0)
        );
        assert_eq!((own.gain_margin, own.phase_margin), (Some(6.0), Some(45.0)));
    }

    #[test]
    fn a_search_at_fault_is_refused_with_what_is_expected() {
        let share = "[tune.parameters]\n\"own.share\" = [0, 1]\n";
        for (tune, expected) in [
            (String::new(), "[tune] is missing; expected for example"),
            (
                format!("[tune]\nquantile = 1.5\n{share}"),
                "quantile = 1.5; expected 0 to 1",
            ),
            (
                format!("[tune]\nhold_out = 1.0\n{share}"),
                "hold_out = 1; expected 0 to 1",
            ),
            (
                format!("[tune]\nevaluations = 2\n{share}"),
                "evaluations = 2; expected at least 3, two more",
            ),
            (
                format!("[tune]\ngain_margin = \"six\"\n{share}"),
                "gain_margin: expected a number of dB",
            ),
            (
                format!("[tune]\nphase_margin = true\n{share}"),
                "phase_margin: expected a number of deg",
            ),
            ("[tune.parameters]\n".into(), "parameters: there is none"),
            (
                "[tune.parameters]\nseed = [0, 1]\n".into(),
                "parameters.seed: the study already fixes or varies it",
            ),
            (
                "[tune.parameters]\nsystem = [0, 1]\n".into(),
                "parameters.system: the study already fixes",
            ),
            (
                "[tune.parameters]\n\"own.gain\" = [0, 1]\n".into(),
                "`0` has no unit; expected for example \"1 V/m\"",
            ),
            (
                "[tune.parameters]\n\"own.share\" = [1, 1]\n".into(),
                "the range from 1 to 1 is empty",
            ),
            (
                "[tune.parameters]\n\"own.none\" = [0, 1]\n".into(),
                "`own.none` is not a variable of own",
            ),
            ("[tune]\nother = 1\n[tune.parameters]\n".into(), "other"),
        ] {
            let told = asked(&tune).err().unwrap_or_default();
            assert!(told.contains(expected), "{tune}: {told}");
        }
    }
}
