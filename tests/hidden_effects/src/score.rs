//! One outcome a case: right, wrong or silent; parameter errors and interval coverage.

use std::collections::{BTreeMap, BTreeSet};

use crate::excitation::Excitation;

/// What was hidden, as the truth file says it.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Truth {
    /// Name of the case.
    pub case: String,
    /// Hidden effects; `outside_catalogue` stands for anything that is none of the catalogue's.
    pub effects: Vec<TruthEffect>,
    /// Relative standard deviation of the plant's parameters.
    pub mismatch: f64,
    /// Factor on the sensors' noise.
    pub noise: f64,
    /// Excitation of identification and validation record.
    #[serde(default)]
    pub excitation: Vec<Excitation>,
    /// The weakest effect's place between weak (0) and strong (1).
    #[serde(default)]
    pub strength: Option<f64>,
    /// Which effect outside the catalogue.
    #[serde(default)]
    pub outside: Option<String>,
    /// False where details of the effects' forms are not the usual ones.
    #[serde(default)]
    pub usual_form: bool,
}

/// A hidden effect.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TruthEffect {
    /// Name in the catalogue.
    pub effect: String,
    /// Values by parameter.
    pub parameters: BTreeMap<String, TruthValue>,
}

/// A value with its unit.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TruthValue {
    /// The number.
    pub value: f64,
    /// The unit it is in.
    pub unit: String,
}

/// What `diagnose --json` says, as far as it is scored.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Verdict {
    /// `adequate`, `named`, `ambiguous` or `unexplained`.
    pub verdict: String,
    /// Named effects.
    #[serde(default)]
    pub effects: Vec<NamedEffect>,
    /// Sets of effects that can't be told apart.
    #[serde(default)]
    pub alternatives: Vec<Vec<String>>,
}

/// A named effect with its estimates.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NamedEffect {
    /// Name in the catalogue.
    pub effect: String,
    /// How sure it is said to be, 0 to 1.
    #[serde(default)]
    pub confidence: f64,
    /// Estimates by parameter.
    #[serde(default)]
    pub parameters: BTreeMap<String, Estimate>,
}

/// An estimate in the unit it is given in.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// One standard error.
    pub standard_error: f64,
}

/// Outcome of a case.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
pub enum Outcome {
    /// Exactly what was hidden.
    Right,
    /// A name that is not there.
    Wrong,
    /// Anything else.
    Silent,
}

/// Classes that one record often can't separate.
const INSEPARABLE: [&[&str]; 4] = [
    &["coulomb_friction", "stribeck_friction"],
    &["valve_flow_gain", "supply_pressure_droop"],
    &[
        "accelerometer_scale",
        "displacement_scale",
        "load_cell_scale",
        "valve_flow_gain",
    ],
    &["specimen_stiffness", "p_delta"],
];

/// Coulomb and Stribeck count as one.
fn canonical(name: &str) -> &str {
    if name == "stribeck_friction" {
        "coulomb_friction"
    } else {
        name
    }
}

/// The outcome of `verdict` on `truth`.
pub fn outcome(truth: &Truth, verdict: &Verdict) -> Outcome {
    let hidden: BTreeSet<&str> = truth.effects.iter().map(|e| canonical(&e.effect)).collect();
    let named: BTreeSet<&str> = verdict
        .effects
        .iter()
        .map(|e| canonical(&e.effect))
        .collect();
    let confirmed = matches!(verdict.verdict.as_str(), "named" | "ambiguous");
    match verdict.verdict.as_str() {
        "named" if !named.is_subset(&hidden) => Outcome::Wrong,
        "named" if named == hidden && !named.is_empty() => Outcome::Right,
        "ambiguous" if truth_in_a_class(&hidden, verdict) => Outcome::Right,
        "adequate" if hidden.is_empty() => Outcome::Right,
        "unexplained" if hidden.iter().all(|e| *e == "outside_catalogue") && !hidden.is_empty() => {
            Outcome::Right
        }
        _ if confirmed && hidden.is_empty() && !named.is_empty() => Outcome::Wrong,
        _ => Outcome::Silent,
    }
}

/// One alternative is the truth, and the alternatives differ only within inseparable classes.
fn truth_in_a_class(hidden: &BTreeSet<&str>, verdict: &Verdict) -> bool {
    let sets: Vec<BTreeSet<&str>> = verdict
        .alternatives
        .iter()
        .map(|set| set.iter().map(|name| canonical(name)).collect())
        .collect();
    if !sets.iter().any(|set| set == hidden) {
        return false;
    }
    sets.iter().all(|set| {
        let differing: Vec<&str> = set.symmetric_difference(hidden).copied().collect();
        differing.is_empty()
            || INSEPARABLE.iter().any(|class| {
                differing
                    .iter()
                    .all(|name| class.iter().any(|c| canonical(c) == *name))
            })
    })
}

/// How far an estimate is off.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ParameterError {
    /// Against the truth.
    pub relative: f64,
    /// In its standard error.
    pub deviate: f64,
}

/// The error of every parameter of every effect named rightly. `convert` turns a value from one unit
/// into another.
pub fn parameter_errors(
    truth: &Truth,
    verdict: &Verdict,
    convert: impl Fn(f64, &str, &str) -> Option<f64>,
) -> Vec<ParameterError> {
    let mut errors = Vec::new();
    for hidden in &truth.effects {
        let Some(named) = verdict.effects.iter().find(|e| e.effect == hidden.effect) else {
            continue;
        };
        for (name, wanted) in &hidden.parameters {
            let Some(got) = named.parameters.get(name) else {
                continue;
            };
            let (Some(value), Some(error)) = (
                convert(got.value, &got.unit, &wanted.unit),
                convert(got.standard_error, &got.unit, &wanted.unit),
            ) else {
                continue;
            };
            let difference = (value - wanted.value).abs();
            errors.push(ParameterError {
                relative: difference / wanted.value.abs(),
                deviate: difference / error,
            });
        }
    }
    errors
}

/// Of every effect that is named: how sure it is said to be, and whether it is there.
pub fn names(truth: &Truth, verdict: &Verdict) -> Vec<(f64, bool)> {
    if verdict.verdict != "named" {
        return Vec::new();
    }
    let is_there = |name: &str| {
        let mut hidden = truth.effects.iter();
        hidden.any(|e| canonical(&e.effect) == canonical(name))
    };
    let all = verdict.effects.iter();
    all.map(|e| (e.confidence, is_there(&e.effect))).collect()
}

/// Wilson's 95 % interval of a share, as fractions.
pub fn wilson(hits: usize, of: usize) -> (f64, f64) {
    if of == 0 {
        return (0.0, 1.0);
    }
    let (n, z) = (of as f64, 1.959_963_984_540_054);
    let p = hits as f64 / n;
    let centre = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    ((centre - half).max(0.0), (centre + half).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(effects: &[&str]) -> Truth {
        Truth {
            case: "test".into(),
            effects: effects
                .iter()
                .map(|e| TruthEffect {
                    effect: (*e).into(),
                    parameters: BTreeMap::new(),
                })
                .collect(),
            mismatch: 0.01,
            noise: 1.0,
            excitation: vec![],
            strength: None,
            outside: None,
            usual_form: true,
        }
    }

    fn verdict(kind: &str, effects: &[&str], alternatives: &[&[&str]]) -> Verdict {
        Verdict {
            verdict: kind.into(),
            effects: effects
                .iter()
                .map(|e| NamedEffect {
                    effect: (*e).into(),
                    confidence: 1.0,
                    parameters: BTreeMap::new(),
                })
                .collect(),
            alternatives: alternatives
                .iter()
                .map(|set| set.iter().map(|e| (*e).into()).collect())
                .collect(),
        }
    }

    #[test]
    fn outcomes_follow_the_rules() {
        use Outcome::{Right, Silent, Wrong};
        let cases = [
            (truth(&[]), verdict("adequate", &[], &[]), Right),
            (truth(&[]), verdict("unexplained", &[], &[]), Silent),
            (truth(&[]), verdict("named", &["mains_hum"], &[]), Wrong),
            (
                truth(&["mains_hum"]),
                verdict("named", &["mains_hum"], &[]),
                Right,
            ),
            (truth(&["mains_hum"]), verdict("adequate", &[], &[]), Silent),
            (
                truth(&["stribeck_friction"]),
                verdict("named", &["coulomb_friction"], &[]),
                Right,
            ),
            (
                truth(&["mains_hum", "command_delay"]),
                verdict("named", &["mains_hum"], &[]),
                Silent,
            ),
            (
                truth(&["mains_hum", "command_delay"]),
                verdict("named", &["mains_hum", "valve_spool_lag"], &[]),
                Wrong,
            ),
            (
                truth(&["outside_catalogue"]),
                verdict("unexplained", &[], &[]),
                Right,
            ),
            (
                truth(&["outside_catalogue"]),
                verdict("named", &["mains_hum"], &[]),
                Wrong,
            ),
            (
                truth(&["valve_flow_gain"]),
                verdict(
                    "ambiguous",
                    &[],
                    &[&["valve_flow_gain"], &["supply_pressure_droop"]],
                ),
                Right,
            ),
            (
                truth(&["mains_hum"]),
                verdict(
                    "ambiguous",
                    &[],
                    &[&["mains_hum"], &["supply_pressure_droop"]],
                ),
                Silent,
            ),
        ];
        for (truth, verdict, expected) in cases {
            assert_eq!(outcome(&truth, &verdict), expected, "{truth:?} {verdict:?}");
        }
    }

    #[test]
    fn wilson_interval_of_a_known_share() {
        // Newcombe 1998, Table I, method 3: 81 of 263.
        let (low, high) = wilson(81, 263);
        assert!(
            (low - 0.2553).abs() < 5e-5 && (high - 0.3662).abs() < 5e-5,
            "{low} {high}"
        );
    }
}
