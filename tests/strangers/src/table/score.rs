//! What the program said of a case, against its truth.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use hidden_effects::score::{Outcome, Verdict, outcome};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::judge::{Answer, share};
use crate::table::case::{KINDS, Kind, Truth};

/// A name with how sure it was said to be and whether it is there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Name {
    /// The effect.
    pub effect: String,
    /// 0 to 1.
    pub confidence: f64,
    /// Whether it was hidden.
    pub is_there: bool,
    /// Error without it over error with it, as printed.
    pub gain: Option<f64>,
}

/// An estimate of a parameter that was hidden and named.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// `effect.parameter`.
    pub parameter: String,
    /// Estimate over truth, less one.
    pub relative: f64,
    /// Whether its 95 % interval holds the truth.
    pub is_held: bool,
    /// Whether the rig's law is the catalogue's, so that the parameter means the same.
    pub means_the_same: bool,
}

/// A case that was judged.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Judged {
    /// Its truth.
    pub truth: Truth,
    /// The verdict's word, `limit` where the program was stopped or `refused`.
    pub verdict: String,
    /// Right, wrong or silent.
    pub outcome: Outcome,
    /// Names that were said.
    pub names: Vec<Name>,
    /// Whether the first of the ranked candidates is the truth.
    pub leads: Option<bool>,
    /// Estimates of what was named rightly.
    pub estimates: Vec<Estimate>,
    /// Seconds of a core.
    pub seconds: f64,
    /// The first sentence, or the complaint.
    pub sentence: String,
    /// Error without what is hidden over error with it, by hand.
    #[serde(default)]
    pub by_hand: Option<f64>,
}

/// Friction, yielding, play and droop have laws that differ from the catalogue's.
const OF_OTHER_LAW: [&str; 5] = [
    "coulomb_friction",
    "stribeck_friction",
    "specimen_yielding",
    "valve_hysteresis",
    "supply_pressure_droop",
];

fn canonical(name: &str) -> &str {
    if name == "stribeck_friction" {
        "coulomb_friction"
    } else {
        name
    }
}

impl Judged {
    /// Scores an answer.
    pub fn of(truth: Truth, answer: &Answer) -> Self {
        let json = answer.json.clone().unwrap_or_default();
        let mut verdict: Verdict = serde_json::from_value(json.clone()).unwrap_or_default();
        let hidden: BTreeSet<&str> = truth.effects.iter().map(|e| canonical(&e.effect)).collect();
        let relative = |name: &str| truth.also_true.iter().any(|also| also == name);
        let is_there = |name: &str| hidden.contains(canonical(name)) || relative(name);
        let confirmed = matches!(
            verdict.verdict.as_str(),
            "named" | "ambiguous" | "too_small"
        );
        let names: Vec<Name> = verdict
            .effects
            .iter()
            .filter(|_| confirmed)
            .map(|e| Name {
                effect: e.effect.clone(),
                confidence: e.confidence,
                is_there: is_there(&e.effect),
                gain: gain(&json, &e.effect),
            })
            .collect();
        let came_close = truth.kind == Kind::Outside
            && !names.is_empty()
            && names.iter().all(|name| name.is_there);
        verdict
            .effects
            .retain(|e| !relative(&e.effect) || hidden.contains(canonical(&e.effect)));
        if verdict.effects.is_empty() && verdict.verdict == "named" && !names.is_empty() {
            verdict.verdict = "adequate".into();
        }
        let outcome = if came_close {
            Outcome::Right
        } else {
            outcome(&truth.as_scored(), &verdict)
        };
        let word = match (answer.status, verdict.verdict.as_str()) {
            (None, _) => "limit",
            (_, "") => "refused",
            (_, word) => word,
        };
        let sentence = json["sentence"]
            .as_str()
            .unwrap_or(&answer.complaint)
            .to_string();
        Self {
            verdict: word.into(),
            outcome,
            leads: leads(&json, &hidden),
            estimates: estimates(&truth, &json),
            names,
            truth,
            seconds: answer.seconds,
            sentence,
            by_hand: None,
        }
    }
}

impl Truth {
    fn as_scored(&self) -> hidden_effects::Truth {
        hidden_effects::Truth {
            case: self.case.clone(),
            effects: self.effects.clone(),
            mismatch: 0.0,
            noise: 1.0,
            excitation: Vec::new(),
            strength: self.strength,
            outside: None,
            usual_form: true,
        }
    }
}

fn leads(json: &Value, hidden: &BTreeSet<&str>) -> Option<bool> {
    let first = json["candidates"].as_array()?.first()?;
    let effects = first["effects"]
        .as_array()?
        .iter()
        .filter_map(Value::as_str);
    let said: BTreeSet<&str> = effects.map(canonical).collect();
    Some(said == *hidden)
}

fn estimates(truth: &Truth, json: &Value) -> Vec<Estimate> {
    let foreign = truth.world.as_ref().is_some_and(|world| world.foreign_laws);
    let mut estimates = Vec::new();
    let said = json["effects"].as_array().map_or(&[][..], Vec::as_slice);
    for effect in &truth.effects {
        let Some(named) = said.iter().find(|e| e["effect"] == effect.effect.as_str()) else {
            continue;
        };
        for (name, wanted) in &effect.parameters {
            let got = &named["parameters"][name];
            let unit = got["unit"].as_str().unwrap_or_default();
            let number = |value: &Value| units::convert(value.as_f64()?, unit, &wanted.unit).ok();
            let (Some(value), Some(error)) =
                (number(&got["value"]), number(&got["standard_error"]))
            else {
                continue;
            };
            let [low, high] = [0, 1].map(|i| number(&got["interval_95"][i]));
            let low = low.unwrap_or(value - 1.96 * error);
            let high = high.unwrap_or(value + 1.96 * error);
            estimates.push(Estimate {
                parameter: format!("{}.{name}", effect.effect),
                relative: value / wanted.value - 1.0,
                is_held: (low.min(high)..=high.max(low)).contains(&wanted.value),
                means_the_same: !(foreign && OF_OTHER_LAW.contains(&effect.effect.as_str())),
            });
        }
    }
    estimates
}

impl Judged {
    /// The only name, where it is that of the only effect that is hidden.
    pub fn only_name(&self) -> Option<&Name> {
        let [name] = &self.names[..] else {
            return None;
        };
        (self.truth.kind == Kind::One && name.is_there).then_some(name)
    }

    /// Its printed gain over that by hand.
    fn printed_by_hand(&self) -> Option<f64> {
        Some(self.only_name()?.gain? / self.by_hand?)
    }
}

fn gain(json: &Value, name: &str) -> Option<f64> {
    let mut effects = json["effects"].as_array()?.iter();
    let of = &effects.find(|effect| effect["effect"] == name)?["gain"];
    Some(of["without_nrmse"].as_f64()? / of["with_nrmse"].as_f64()?)
}

/// The table of what must be shown, and a line for every case that is not right.
pub fn table(judged: &[Judged]) -> String {
    let mut text = String::new();
    let mut row = |name: &str, aim: &str, value: String| {
        let _ = writeln!(text, "{name:<44}{aim:>14}   {value}");
    };
    row("what", "aim", "came out (95 % interval)".into());
    for (kind, name, aim) in [
        (Kind::Nothing, "nothing hidden: adequate", "98 %"),
        (Kind::One, "one effect: right", "85 %"),
        (Kind::Two, "two effects: right", "70 %"),
        (Kind::Outside, "outside the catalogue: right", ""),
    ] {
        let of: Vec<&Judged> = judged.iter().filter(|j| j.truth.kind == kind).collect();
        let right = of.iter().filter(|j| j.outcome == Outcome::Right).count();
        row(name, aim, share(right, of.len()));
    }
    let wrong =
        |j: &&Judged| j.outcome == Outcome::Wrong || j.names.iter().any(|name| !name.is_there);
    row(
        "wrong names, of all cases",
        "1 %",
        share(judged.iter().filter(wrong).count(), judged.len()),
    );
    for kind in KINDS {
        let of: Vec<&Judged> = judged.iter().filter(|j| j.truth.kind == kind).collect();
        let hits = of.iter().copied().filter(wrong).count();
        row(&format!("    {kind:?}"), "", share(hits, of.len()));
    }
    let sure: Vec<&Name> = judged
        .iter()
        .flat_map(|j| &j.names)
        .filter(|name| name.confidence >= 0.99)
        .collect();
    let true_ones = sure.iter().filter(|name| name.is_there).count();
    row(
        "names at 0.99 that are right",
        "98 %",
        share(true_ones, sure.len()),
    );
    for same in [true, false] {
        let of: Vec<&Estimate> = judged
            .iter()
            .flat_map(|j| &j.estimates)
            .filter(|e| e.means_the_same == same)
            .collect();
        let held = of.iter().filter(|e| e.is_held).count();
        let (name, aim) = if same {
            ("95 % intervals that hold", "90 to 97 %")
        } else {
            ("    of effects with another law", "")
        };
        row(name, aim, share(held, of.len()));
    }
    for is_there in [true, false] {
        let names = judged.iter().flat_map(|j| &j.names);
        let of = names.filter(|name| name.is_there == is_there);
        let mut gains: Vec<f64> = of.filter_map(|name| name.gain).collect();
        gains.sort_by(f64::total_cmp);
        let median = gains.get(gains.len() / 2);
        row(
            &format!(
                "printed gain of names {}there",
                if is_there { "" } else { "not " }
            ),
            if is_there { "" } else { "near 1" },
            median.map_or("none".into(), |median| {
                format!("{median:.2} in the median of {}", gains.len())
            }),
        );
    }
    let both: Vec<f64> = judged.iter().filter_map(Judged::printed_by_hand).collect();
    if !both.is_empty() {
        let near = both.iter().filter(|ratio| (*ratio - 1.0).abs() <= 0.1);
        row(
            "printed gain within 10 % of that by hand",
            "100 %",
            share(near.count(), both.len()),
        );
    }
    let ranked: Vec<bool> = judged
        .iter()
        .filter(|j| j.outcome == Outcome::Silent && matches!(j.truth.kind, Kind::One | Kind::Two))
        .filter_map(|j| j.leads)
        .collect();
    let leading = ranked.iter().filter(|leads| **leads).count();
    row(
        "silent, but the first candidate is the truth",
        "",
        share(leading, ranked.len()),
    );
    let mut seconds: Vec<f64> = judged.iter().map(|j| j.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    if let (Some(median), Some(longest)) = (seconds.get(seconds.len() / 2), seconds.last()) {
        row(
            "seconds of a core: median, longest",
            "3, 20",
            format!("{median:.1}, {longest:.1}"),
        );
    }
    let stopped = judged.iter().filter(|j| j.verdict == "limit").count();
    row("stopped at the limit", "0", stopped.to_string());

    for j in judged.iter().filter(|j| j.outcome != Outcome::Right) {
        let hidden: Vec<&str> = j.truth.effects.iter().map(|e| e.effect.as_str()).collect();
        let said: Vec<String> = j
            .names
            .iter()
            .map(|name| format!("{} {:.2}", name.effect, name.confidence))
            .collect();
        let outside = j
            .truth
            .outside
            .map_or(String::new(), |outside| format!(" {outside:?}"));
        let _ = write!(
            text,
            "\n{:?} {}: hidden {:?}{outside}, said {} {said:?}, {:.0} s: {}",
            j.outcome, j.truth.case, hidden, j.verdict, j.seconds, j.sentence
        );
    }
    text
}
