//! Rates, errors, confidence and confusions as text.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use hidden_effects::score::wilson;
use hidden_effects::{Outcome, Truth};

use super::calibration::by_confidence;
use super::{Plan, Scored, hidden};

/// Rates with Wilson intervals by kind, strength and excitation, parameter errors, coverage, time
/// and every case that is not right.
pub fn table(results: &[Scored]) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{:<34}{:>6}{:>7}{:>7}{:>8}   right, 95 % interval",
        "cases", "all", "right", "wrong", "silent"
    );
    let mut row = |name: &str, filter: &dyn Fn(&Scored) -> bool| {
        let chosen: Vec<&Scored> = results.iter().filter(|r| filter(r)).collect();
        if chosen.is_empty() {
            return;
        }
        let count = |o: Outcome| chosen.iter().filter(|r| r.outcome == o).count();
        let (right, wrong) = (count(Outcome::Right), count(Outcome::Wrong));
        let (low, high) = wilson(right, chosen.len());
        let _ = writeln!(
            text,
            "{name:<34}{:>6}{right:>7}{wrong:>7}{:>8}   {:.1} to {:.1} %",
            chosen.len(),
            count(Outcome::Silent),
            100.0 * low,
            100.0 * high
        );
    };
    row("all", &|_| true);
    for (_, kind) in Plan::KINDS {
        row(kind, &|r| r.kind == kind);
    }
    for (name, low, high) in [
        ("weak (lower third)", 0.0, 0.33),
        ("middling", 0.33, 0.67),
        ("strong", 0.67, 1.01),
    ] {
        row(&format!("strength: {name}"), &|r| {
            r.truth.strength.is_some_and(|s| (low..high).contains(&s))
        });
    }
    for excitation in hidden_effects::excitation::EXCITATIONS {
        row(&format!("identified on: {excitation:?}"), &|r| {
            r.truth.excitation.first() == Some(&excitation)
        });
    }
    for usual in [true, false] {
        let name = if usual { "the usual" } else { "others" };
        row(&format!("forms of the effects: {name}"), &|r| {
            r.truth.usual_form == usual && matches!(r.kind.as_str(), "one" | "two")
        });
    }
    let distinct = |value: fn(&Truth) -> f64| {
        let mut values: Vec<f64> = results.iter().map(|r| value(&r.truth)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    };
    for noise in distinct(|truth| truth.noise) {
        row(&format!("noise: {noise} times"), &|r| {
            r.truth.noise == noise
        });
    }
    for mismatch in distinct(|truth| truth.mismatch) {
        row(&format!("mismatch: {} %", 100.0 * mismatch), &|r| {
            r.truth.mismatch == mismatch
        });
    }
    let outside: BTreeSet<&str> = results
        .iter()
        .filter_map(|r| r.truth.outside.as_deref())
        .collect();
    for kind in outside {
        row(&format!("outside: {kind}"), &|r| {
            r.truth.outside.as_deref() == Some(kind)
        });
    }
    let mut by_effect: BTreeMap<&str, Vec<&Scored>> = BTreeMap::new();
    for scored in results.iter().filter(|r| r.kind == "one") {
        for effect in &scored.truth.effects {
            by_effect.entry(&effect.effect).or_default().push(scored);
        }
    }
    for effect in by_effect.keys() {
        row(effect, &|r| {
            r.kind == "one" && r.truth.effects[0].effect == *effect
        });
    }

    let errors = sorted(results, |r| r.errors.iter().map(|e| e.relative).collect());
    let seconds = sorted(results, |r| vec![r.seconds]);
    if !errors.is_empty() {
        let held = held(results, DEVIATE_95);
        let (low, high) = wilson(held, errors.len());
        let _ = writeln!(
            text,
            "\nparameter error: median {:.2} %, 90th percentile {:.1} % ({} parameters)\n\
             95 % intervals that hold the truth: {:.1} % ({:.1} to {:.1})",
            100.0 * quantile(&errors, 0.5),
            100.0 * quantile(&errors, 0.9),
            errors.len(),
            100.0 * held as f64 / errors.len() as f64,
            100.0 * low,
            100.0 * high
        );
    }
    if !seconds.is_empty() {
        let _ = writeln!(
            text,
            "seconds of one core a case: median {:.1}, longest {:.1}",
            quantile(&seconds, 0.5),
            quantile(&seconds, 1.0)
        );
    }
    text.push_str(&reliability(results));
    text.push_str(&confusions(results));
    for scored in results.iter().filter(|r| r.outcome != Outcome::Right) {
        let _ = writeln!(text, "{}", line(scored));
    }
    text
}

/// Of the effects named with a confidence, how many are there.
fn reliability(results: &[Scored]) -> String {
    let mut text = String::from("\nconfidence -> named, there, 95 % interval\n");
    for names in by_confidence(results) {
        let (low, high) = wilson(names.there, names.named);
        let _ = writeln!(
            text,
            "{} to {} (mean {:.4}) -> {}, {}, {:.1} to {:.1} %",
            names.bounds[0],
            names.bounds[1],
            names.stated,
            names.named,
            names.there,
            100.0 * low,
            100.0 * high
        );
    }
    text
}

/// The confusion matrix without its zeros: what was hidden, what was said, how often.
fn confusions(results: &[Scored]) -> String {
    let mut counts: BTreeMap<(String, String), usize> = BTreeMap::new();
    for scored in results {
        let mut said: Vec<&str> = scored
            .verdict
            .effects
            .iter()
            .map(|e| e.effect.as_str())
            .collect();
        said.sort_unstable();
        let said = match scored.verdict.verdict.as_str() {
            "named" => said.join(" + "),
            "ambiguous" => format!("one of several, such as {}", said.join(" + ")),
            "" => "refused".into(),
            other => other.to_string(),
        };
        *counts.entry((hidden(&scored.truth), said)).or_default() += 1;
    }
    let mut text = String::from("\nhidden -> said: cases\n");
    for ((hidden, said), count) in counts {
        let _ = writeln!(text, "{hidden} -> {said}: {count}");
    }
    text
}

/// One case in one line: what was hidden and what was said.
pub fn line(scored: &Scored) -> String {
    let named: Vec<&str> = scored
        .verdict
        .effects
        .iter()
        .map(|e| e.effect.as_str())
        .collect();
    format!(
        "seed {} {:?}: hidden {} {}(strength {:.2}, {:?}{}), said {} {named:?} {:?}",
        scored.seed,
        scored.outcome,
        hidden(&scored.truth),
        scored
            .truth
            .outside
            .as_ref()
            .map(|o| format!("[{o}] "))
            .unwrap_or_default(),
        scored.truth.strength.unwrap_or(0.0),
        scored.truth.excitation,
        if scored.truth.usual_form {
            ""
        } else {
            ", another form"
        },
        if scored.verdict.verdict.is_empty() {
            &scored.sentence
        } else {
            &scored.verdict.verdict
        },
        scored.verdict.alternatives,
    )
}

/// The outcome rates of a kind: right and wrong as fractions.
pub fn rates(results: &[Scored], kind: &str) -> (f64, f64) {
    let chosen: Vec<&Scored> = results.iter().filter(|r| r.kind == kind).collect();
    let share = |o: Outcome| {
        chosen.iter().filter(|r| r.outcome == o).count() as f64 / chosen.len().max(1) as f64
    };
    (share(Outcome::Right), share(Outcome::Wrong))
}

/// Standard deviations of an interval of 95 %.
pub(super) const DEVIATE_95: f64 = 1.96;

/// How many of the parameters lie within so many standard errors of their estimate.
pub(super) fn held(results: &[Scored], deviate: f64) -> usize {
    let errors = results.iter().flat_map(|r| &r.errors);
    errors.filter(|e| e.deviate <= deviate).count()
}

/// The values of all cases, ascending.
pub(super) fn sorted(results: &[Scored], values: impl Fn(&Scored) -> Vec<f64>) -> Vec<f64> {
    let mut all: Vec<f64> = results.iter().flat_map(values).collect();
    all.sort_by(f64::total_cmp);
    all
}

pub(super) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len() - 1;
    sorted[((last as f64 * share).round() as usize).min(last)]
}
