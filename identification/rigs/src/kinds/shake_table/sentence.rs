//! A verdict as one sentence for a laboratory engineer.

use super::course::Course;
use super::diagnosis::Finding;
use super::gain::Gain;
use crate::kinds::INTERVAL_95;
use diagnosis::Test;
use diagnosis::adequacy::LARGEST_DEVIATE;
use diagnosis::{NamedEffect, ParameterEstimate, Verdict, WeighedModel};
use plant::identified::effects::{find, quantity::laboratory_unit};
use units::convert;

/// Value and half of the 95 % interval of `parameter` in `unit`, as [`with_interval`] writes them.
pub fn amount(parameter: &ParameterEstimate, unit: &str) -> String {
    with_interval(
        parameter.value,
        INTERVAL_95 * parameter.standard_error,
        parameter.unit,
        unit,
    )
}

/// Value and half of its interval, given in `si`, in `unit`, with as many digits as the interval leaves
/// meaning: `0.0865 ± 0.0001 V`.
pub fn with_interval(value: f64, half: f64, si: &str, unit: &str) -> String {
    let converted = convert(1.0, si, unit);
    let (factor, unit) = converted.map_or((1.0, si), |factor| (factor, unit));
    let (value, error) = (factor * value, factor * half);
    let unit = if unit == "1" { "" } else { unit };
    let order = |x: f64| x.abs().log10().floor() as i32;
    if !(error.is_finite() && error > 0.0 && value.is_finite() && value != 0.0) {
        return format!("{} {unit}", plain(value)).trim_end().to_string();
    }
    // One digit of an error of 3 and more, two of a smaller one.
    let place = order(error);
    let digits = if error / 10f64.powi(place) < 2.95 {
        1
    } else {
        0
    };
    let last = place - digits;
    if order(value) < -4 || order(value) > 5 {
        let ten = order(value.abs().max(error));
        let (value, error) = (value / 10f64.powi(ten), error / 10f64.powi(ten));
        let decimals = (ten - last).clamp(0, 8) as usize;
        return format!("({value:.decimals$} ± {error:.decimals$})e{ten} {unit}")
            .trim_end()
            .to_string();
    }
    let decimals = (-last).clamp(0, 8) as usize;
    format!("{value:.decimals$} ± {error:.decimals$} {unit}")
        .trim_end()
        .to_string()
}

/// `value` alone, with five digits at most.
fn plain(value: f64) -> String {
    let order = value.abs().log10().floor();
    let trimmed = |text: String| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    };
    if (-5.0..6.0).contains(&order) {
        let decimals = (4.0 - order).max(0.0) as usize;
        return trimmed(format!("{value:.decimals$}"));
    }
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let scaled = trimmed(format!("{:.4}", value / 10f64.powf(order)));
    format!("{scaled}e{order}")
}

/// An effect in words, its sizes in the laboratory's units.
pub fn said(effect: &NamedEffect) -> String {
    let mut sizes = effect.parameters.iter().filter(|p| !p.is_shape);
    let mut text = String::new();
    let phrase = find(effect.effect).map_or("there is an effect of {}", |known| known.sentence);
    let mut pieces = phrase.split("{}").peekable();
    while let Some(piece) = pieces.next() {
        text += piece;
        if pieces.peek().is_some() {
            text += &sizes.next().map_or_else(
                || "an unknown amount".into(),
                |p| amount(p, laboratory_unit(p.unit)),
            );
        }
    }
    text
}

/// Share of the excess error from which on a candidate is told with its values, though more is left.
pub(super) const MOST: f64 = 0.5;

fn uncapitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_lowercase().chain(letters).collect()
    })
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// Share by which an error falls at least that is told by its begin and its end.
const CLEAR_FALL: f64 = 0.03;

fn falls(gain: &Gain) -> String {
    let (before, after) = (gain.before_ratio, gain.after_ratio);
    if after < (1.0 - CLEAR_FALL) * before {
        return format!(
            "the error on the validation record falls from {before:.2} to {after:.2} times the noise floor"
        );
    }
    let change = change(gain.interval_95.map(|share| 100.0 * share));
    format!(
        "the error on the validation record {change} (95 %) and is {after:.2} times the noise floor"
    )
}

/// How an error changes that falls by so many percent, such as "falls by 3 to 5 %".
pub fn change([low, high]: [f64; 2]) -> String {
    let decimals = usize::from(high - low < 2.0);
    let unit = 10_f64.powi(-(decimals as i32));
    // Adding 0 takes the sign from a zero.
    let [low, high] = [low, high].map(|own| (own / unit).round() * unit + 0.0);
    let [from, to] = [low.abs(), high.abs()].map(|own| format!("{own:.decimals$}"));
    match (low < 0.0, high > 0.0) {
        (false, false) => format!("changes by less than {unit} %"),
        (true, false) => format!("rises by {to} to {from} %"),
        (true, true) => format!("may rise by {from} % or fall by {to} %"),
        (false, true) => format!("falls by {from} to {to} %"),
    }
}

/// The sentence.
pub(super) fn sentence(
    verdict: Verdict,
    effects: &[NamedEffect],
    alternatives: &[Vec<&'static str>],
    gain: &Gain,
    tests: &[Test],
    candidates: &[WeighedModel],
) -> String {
    let causes: Vec<String> = effects.iter().map(said).collect();
    let causes = capitalised(&causes.join(" and "));
    let it = if effects.len() > 1 { "them" } else { "it" };
    let falls = falls(gain);
    match verdict {
        Verdict::Adequate => format!(
            "The nominal model is adequate: with its parameters refitted the error on the validation \
             record is {:.2} times the noise floor.",
            gain.after_ratio
        ),
        Verdict::Named => {
            let left = tests.iter().find(|test| test.deviate > LARGEST_DEVIATE);
            let left = left.map_or_else(String::new, |test| {
                format!("; a little is left, most in \"{}\"", test.what)
            });
            format!("{causes}; with {it} {falls}{left}.")
        }
        Verdict::Ambiguous => {
            let sets: Vec<String> = alternatives
                .iter()
                .map(|set| set.join(" and ").replace('_', " "))
                .collect();
            format!(
                "{causes}, or equally likely {}; with {it} {falls}.",
                sets.join(", or ")
            )
        }
        Verdict::TooSmall => format!(
            "Present but too small to matter: {}; with {it} {falls}.",
            uncapitalised(&causes)
        ),
        Verdict::Unexplained => {
            let left = tests.first().map_or("nothing", |test| test.what.as_str());
            let best = candidates.first();
            match best.filter(|own| own.explains > MOST) {
                Some(best) => {
                    let causes: Vec<String> = best.effects.iter().map(said).collect();
                    format!(
                        "{:.0} % of the excess error is explained if {}; the rest is not explained \
                         and is largest in \"{left}\".",
                        100.0 * best.explains.min(1.0),
                        causes.join(" and ")
                    )
                }
                None => format!(
                    "No set of effects that was searched explains the records: the best one explains \
                     {:.0} % of the excess error; the residual is largest in \"{left}\".",
                    100.0 * best.map_or(0.0, |own| own.explains.clamp(0.0, 1.0))
                ),
            }
        }
    }
}

/// When effects act that do not act throughout; nothing of the others.
pub(super) fn of_courses(courses: &[Course]) -> String {
    let told = courses.iter().map(|own| {
        let unit = laboratory_unit(&own.unit);
        let [before, after] = [own.before, own.after].map(|value| {
            let factor = convert(1.0, &own.unit, unit).unwrap_or(1.0);
            let unit = if unit == "1" { "" } else { unit };
            format!("{:.3} {unit}", factor * value)
                .trim_end()
                .to_string()
        });
        let effect = own.effect.replace('_', " ");
        let effect = capitalised(&effect);
        match own.onset_s {
            Some(onset) => format!(
                " {effect} changes {onset:.1} s into `{}`, from {before} to {after}.",
                own.record
            ),
            None => format!(
                " {effect} drifts during `{}`, from {before} to {after}.",
                own.record
            ),
        }
    });
    told.collect()
}

/// Findings that the sentence holds; the report has them all.
const TOLD: usize = 2;
/// Standard deviations from which the sentence holds them. One of fifteen parameters is farther off than
/// two by chance in every second rig, than this in one of a hundred.
const FAR: f64 = 3.5;

/// What is said of nominal parameters that are not what was stated; nothing without one.
pub(super) fn of_findings(findings: &[Finding]) -> String {
    let off = |own: &&Finding| (own.found / own.stated - 1.0).abs();
    let is_far = |own: &&Finding| own.deviations.is_none_or(|own| own.abs() > FAR);
    let far = findings.iter().filter(is_far);
    let mut farthest: Vec<&Finding> = far.collect();
    farthest.sort_by(|a, b| off(b).total_cmp(&off(a)));
    let count = farthest.len();
    let told = farthest.iter().take(TOLD).map(|own| {
        let unit = laboratory_unit(&own.unit);
        format!(
            "`{}` is {}, stated {}",
            own.parameter,
            with_interval(own.found, INTERVAL_95 * own.standard_error, &own.unit, unit),
            with_interval(own.stated, 0.0, &own.unit, unit),
        )
    });
    let told: Vec<String> = told.collect();
    match (told.is_empty(), count.saturating_sub(TOLD)) {
        (true, _) => String::new(),
        (false, 0) => format!(" Beyond its stated uncertainty: {}.", told.join("; ")),
        (false, more) => format!(
            " Beyond their stated uncertainty: {}; and {more} more.",
            told.join("; ")
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(value: f64, standard_error: f64, unit: &'static str) -> ParameterEstimate {
        ParameterEstimate {
            name: "size".into(),
            value,
            unit,
            standard_error,
            is_shape: false,
        }
    }

    #[test]
    fn digits_end_where_the_error_begins() {
        for (value, error, si, unit, want) in [
            (0.086_532, 0.000_109, "V", "V", "0.08653 ± 0.00011 V"),
            (0.086_532, 0.000_8, "V", "V", "0.0865 ± 0.0008 V"),
            (0.025_4, 0.001_27, "m", "in", "1.00 ± 0.05 in"),
            (0.154_2, 0.004, "1", "%", "15.4 ± 0.4 %"),
            (-0.007_614, 0.000_2, "s", "ms", "-7.61 ± 0.20 ms"),
            (6.928, 0.031, "Hz", "Hz", "6.93 ± 0.03 Hz"),
            (2.4e-6, 1e-8, "V s/N", "V s/N", "(2.400 ± 0.010)e-6 V s/N"),
            (4321.0, 250.0, "N", "N", "4321 ± 250 N"),
            (98_964.174_6, 0.0, "N/m", "N/m", "98964 N/m"),
            (
                5.463_957_26e7,
                0.0,
                "N/(m.s2)",
                "N/(m.s2)",
                "5.464e7 N/(m.s2)",
            ),
            (0.121_2, 0.0, "1", "1", "0.1212"),
            (0.0, 0.0, "N", "N", "0 N"),
        ] {
            assert_eq!(with_interval(value, error, si, unit), want);
        }
        let late = estimate(0.01206, 5e-5, "s");
        assert_eq!(amount(&late, "ms"), "12.06 ± 0.10 ms");
    }

    #[test]
    fn a_change_is_said_by_its_sign() {
        for (interval, said) in [
            ([31.2, 52.6], "falls by 31 to 53 %"),
            ([0.04, 0.61], "falls by 0.0 to 0.6 %"),
            ([-0.04, 0.03], "changes by less than 0.1 %"),
            ([-0.3, 0.4], "may rise by 0.3 % or fall by 0.4 %"),
            ([-12.0, -7.0], "rises by 7 to 12 %"),
            ([-12.0, -0.2], "rises by 0 to 12 %"),
        ] {
            assert_eq!(change(interval), said);
        }
    }

    #[test]
    fn an_error_that_hardly_falls_is_told_by_how_much_it_does() {
        let told = |before_ratio, after_ratio, interval_95| {
            falls(&Gain {
                channels: Vec::new(),
                before_nrmse: 0.3,
                after_nrmse: 0.3,
                noise_floor_nrmse: 0.3,
                before_ratio,
                after_ratio,
                interval_95,
            })
        };
        assert_eq!(
            told(1.34, 1.01, [0.2, 0.3]),
            "the error on the validation record falls from 1.34 to 1.01 times the noise floor"
        );
        assert_eq!(
            told(1.004, 0.998, [0.003_2, 0.008_8]),
            "the error on the validation record falls by 0.3 to 0.9 % (95 %) and is 1.00 times the noise floor"
        );
        assert_eq!(
            told(1.0, 1.0, [-1e-6, 2e-6]),
            "the error on the validation record changes by less than 0.1 % (95 %) and is 1.00 times the noise floor"
        );
    }

    #[test]
    fn what_a_named_effect_leaves_is_said() {
        let lag = NamedEffect {
            effect: "displacement_lag",
            parameters: vec![estimate(10.0, 0.1, "Hz")],
            confidence: 0.95,
        };
        let gain = Gain {
            channels: Vec::new(),
            before_nrmse: 0.3,
            after_nrmse: 0.1,
            noise_floor_nrmse: 0.1,
            before_ratio: 3.0,
            after_ratio: 1.04,
            interval_95: [0.6, 0.7],
        };
        let said = |deviate| {
            let test = Test {
                what: "validation: displacement, mean".into(),
                deviate,
                place: None,
                is_stated: false,
            };
            let effects = std::slice::from_ref(&lag);
            sentence(Verdict::Named, effects, &[], &gain, &[test], &[])
        };
        assert!(said(5.5).ends_with("to 1.04 times the noise floor."));
        let left = "; a little is left, most in \"validation: displacement, mean\".";
        assert!(said(5.7).ends_with(left), "{}", said(5.7));
    }

    #[test]
    fn a_course_is_said_with_its_instant() {
        let course = |onset_s| Course {
            effect: "accelerometer_scale".into(),
            parameter: "relative_change".into(),
            record: "identification".into(),
            onset_s,
            before: 0.001,
            after: -0.1,
            unit: "1".into(),
            gain: 500.0,
        };
        assert_eq!(
            of_courses(&[course(Some(10.04))]),
            " Accelerometer scale changes 10.0 s into `identification`, from 0.100 % to -10.000 %."
        );
        assert!(of_courses(&[course(None)]).contains("drifts during `identification`"));
    }

    #[test]
    fn the_findings_that_are_farthest_off_are_said() {
        let finding = |parameter: &str, found: f64| Finding {
            parameter: parameter.into(),
            stated: 100.0,
            found,
            standard_error: 1.0,
            deviations: Some(found - 100.0),
            unit: "kg".into(),
        };
        assert_eq!(of_findings(&[]), "");
        let said = of_findings(&[
            finding("by chance", 102.5),
            finding("one", 104.0),
            finding("two", 90.0),
            finding("three", 105.0),
        ]);
        assert!(said.contains("`two`") && said.contains("`three`"), "{said}");
        assert!(
            !said.contains("`one`") && !said.contains("chance") && said.contains("and 1 more"),
            "{said}"
        );
    }

    #[test]
    fn an_effect_is_said_with_its_sizes() {
        let friction = NamedEffect {
            effect: "stribeck_friction",
            parameters: vec![
                estimate(4.448_221_6, 0.044, "N"),
                estimate(8.896_443_2, 0.2, "N"),
            ],
            confidence: 1.0,
        };
        assert_eq!(
            said(&friction),
            "the table has dry friction of 1.000 ± 0.019 lbf and 2.00 ± 0.09 lbf more to break away"
        );
    }
}
