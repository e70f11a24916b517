//! Whether an answer names every fault of a laboratory, or ranks candidates with values.

use serde_json::Value;

use super::{Fault, Truth};
use crate::judge::Answer;

/// What an answer is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Worth {
    /// Every fault is named with its value, and nothing else.
    Named,
    /// Candidates are ranked, and every fault is among them with its value.
    Ranked,
    /// A fault is named that is not there.
    False,
    /// An answer without all of them.
    Partial,
    /// No answer.
    Refused,
}

/// Whether an effect of that name is `fault`. A sensor's scale is not the table's.
fn is_of(name: &str, fault: &Fault) -> bool {
    let is_sensor = name.contains("accel");
    let mut words = fault.words.iter();
    words.any(|word| name.contains(word.as_str()) && (!is_sensor || word == "accel"))
}

/// Whether `effect` says `fault` with its size: within its interval or a tenth.
fn says(effect: &Value, fault: &Fault) -> bool {
    let name = effect["effect"].as_str().unwrap_or_default();
    if !is_of(name, fault) {
        return false;
    }
    let Some(parameters) = effect["parameters"].as_object() else {
        return false;
    };
    parameters.values().any(|parameter| {
        let unit = parameter["unit"].as_str().unwrap_or_default();
        let value = parameter["value"].as_f64().unwrap_or(f64::NAN);
        let error = parameter["standard_error"].as_f64().unwrap_or(0.0);
        fault.sizes.iter().any(|(size, in_unit)| {
            let said = |value: f64| units::convert(value, unit, in_unit).ok();
            let (Some(value), Some(error)) = (said(value), said(error)) else {
                return false;
            };
            (value - size).abs() <= (1.96 * error).max(0.1 * size.abs())
        })
    })
}

/// Whether `effect` has the size of an orifice's flow that falls with speed, and is told from none.
fn says_orifice(effect: &Value, flow_falls: f64) -> bool {
    let own = &effect["parameters"]["compression"];
    let value = own["value"].as_f64().unwrap_or(f64::NAN);
    let half = 1.96 * own["standard_error"].as_f64().unwrap_or(0.0);
    let is_size = (value - flow_falls).abs() <= half.max(0.1 * flow_falls);
    flow_falls > 0.0 && is_size && value > half
}

/// What the answer is worth.
pub fn worth(truth: &Truth, answer: &Answer) -> Worth {
    let Some(json) = &answer.json else {
        return Worth::Refused;
    };
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let named = list(&json["effects"]);
    let all_named = truth
        .faults
        .iter()
        .all(|fault| named.iter().any(|effect| says(effect, fault)));
    // Every table has some friction, a valve's flow falls with speed, and a table may be at its rail or on a spring;
    // what records cannot tell from these is said with them.
    let alternatives = json["alternatives"].to_string();
    let is_foreign = |effect: &Value| {
        let name = effect["effect"].as_str().unwrap_or_default();
        let is_hedged = name == "reduced_null_gain" && alternatives.contains("friction")
            || name == "scale" && truth.gives_way && alternatives.contains("spring");
        let is_rail = name == "speed_limit" && truth.is_railed;
        let is_orifice = name == "flow_saturation" && says_orifice(effect, truth.flow_falls);
        !name.contains("friction")
            && !is_hedged
            && !is_rail
            && !is_orifice
            && !truth.faults.iter().any(|fault| is_of(name, fault))
    };
    if json["verdict"] == "named" && named.iter().any(is_foreign) {
        return Worth::False;
    }
    if all_named && !named.is_empty() {
        return Worth::Named;
    }
    // A candidate has its effects' names, and parameters by effect or by `effect.parameter`.
    let candidates = list(&json["candidates"]);
    let ranked = candidates.iter().take(3).any(|candidate| {
        let text = candidate["effects"].to_string();
        let sized = candidate["parameters"]
            .as_object()
            .is_some_and(|p| !p.is_empty());
        sized
            && truth
                .faults
                .iter()
                .all(|fault| fault.words.iter().any(|word| text.contains(word.as_str())))
    });
    if ranked {
        Worth::Ranked
    } else {
        Worth::Partial
    }
}
