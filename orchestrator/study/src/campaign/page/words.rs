//! Sentences about the results.

use crate::campaign::analysis::{
    ERROR, Endings, Findings, Fit, Fragility, Group, Importance, Method, Share, Why,
};
use pages::report::number::significant;
use pages::report::{Cell, UnitSystem, Units};

/// Controllers that the sentence names.
const MOST_NAMED: usize = 3;

pub(super) const QUANTILES: &str = "This share of the runs has at most this value. For errors, \
    runs that were stopped or failed count as worse than any other; a dash means that there are \
    too many of them. Other figures cover the complete runs.";
pub(super) const SOBOL: &str = "Sobol' indices: alone is the share of the variance that would \
    vanish if the factor were known (first order); in total is the share that would remain if all \
    others were known. The difference comes from interactions. Intervals of 95 %, by resampling \
    the base samples.";
pub(super) const ALONE: &str = "Alone is the share of the variance between the values of the \
    factor (numbers in bins of equal counts); 0 if shuffled values explain as much. The rest \
    comes from interactions and variation within bins; the design saltelli separates these. \
    Intervals of 95 %, by resampling the runs.";

/// `12345` as `12,345`.
pub(super) fn count(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A share in percent, as exact as its count allows.
pub(super) fn percent(part: usize, of: usize) -> String {
    let share = 100.0 * part as f64 / of.max(1) as f64;
    match share {
        share if part == 0 || part == of => format!("{share:.0} %"),
        share if share < 1.0 => format!("{} %", significant(share, 2)),
        share if share > 99.0 => {
            // As many places as what is missing needs.
            let places = (100.0 - share).log10().floor().abs() as usize;
            format!("{share:.places$} %")
        }
        share => format!("{share:.0} %"),
    }
}

/// A column in words.
pub(super) fn label(column: &str) -> String {
    let known = match column {
        "time_domain_percent" => "acceleration error",
        "frequency_domain_percent" => "Fourier amplitude error",
        "displacement_percent" => "displacement error",
        "peak_displacement_m" => "peak displacement",
        "peak_displacement_error_m" => "peak displacement error",
        "peak_acceleration_m_s2" => "peak acceleration",
        "peak_acceleration_error_m_s2" => "peak acceleration error",
        "delay_s" => "delay",
        "pga_g" => "peak ground acceleration",
        "peak_reference_m" => "peak displacement of the reference",
        other => {
            return match other.strip_prefix("peak.") {
                Some(signal) => format!("peak of {signal}"),
                None => other.to_string(),
            };
        }
    };
    known.to_string()
}

/// Units of a column: its own, else those at the end of its name.
pub(super) fn units(column: &str, unit: Option<&str>) -> Units {
    let ends = [
        ("_percent", Units::PERCENT),
        ("_m_s2", Units::ACCELERATION),
        ("_g", Units::same("g")),
        ("_m", Units::DISPLACEMENT),
        ("_s", Units::TIME),
    ];
    if let Some(unit) = unit.filter(|unit| *unit != "1" && !unit.is_empty()) {
        return Units::of(unit);
    }
    let mut ends = ends.into_iter();
    ends.find(|(end, _)| column.ends_with(end))
        .map_or(Units::NONE, |(_, units)| units)
}

/// Units of the intensity.
pub(super) fn intensity_units(findings: &Findings) -> Units {
    units(&findings.intensity, findings.intensity_unit.as_deref())
}

/// A value with its unit, for a sentence.
pub(super) fn quantity(value: f64, units: &Units, system: UnitSystem) -> String {
    Cell::Quantity(value, units.clone(), 3).text(system)
}

/// The groups that are compared: the controllers, or all runs as one.
pub(super) fn compared(findings: &Findings) -> Vec<&Group> {
    let is_controller =
        |group: &&Group| matches!(group.factor.as_deref(), Some("controller" | "system"));
    let found: Vec<&Group> = findings.groups.iter().filter(is_controller).collect();
    if found.is_empty() {
        return findings.groups.iter().take(1).collect();
    }
    found
}

/// What came of the study, in a few sentences: error, limit, factor.
#[must_use]
pub fn summary(findings: &Findings, system: UnitSystem) -> String {
    let invalid = invalid(findings);
    let Some(all) = findings.groups.first().filter(|all| all.endings.runs > 0) else {
        return format!("No run.{invalid}");
    };
    let mut groups = compared(findings);
    let at = |group: &Group, high: bool| {
        let own = group.figure(ERROR)?;
        if high { own.p95 } else { own.p50 }
    };
    let rank = |group: &Group| {
        let number = |high| at(group, high).unwrap_or(f64::INFINITY);
        [number(true), number(false)]
    };
    groups.sort_by(|a, b| {
        let (a, b) = (rank(a), rank(b));
        a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
    });
    let clauses = groups.iter().take(MOST_NAMED).map(|group| {
        let name = if group.factor.is_some() {
            &group.value
        } else {
            "The error"
        };
        let runs = count(group.endings.runs);
        match (at(group, true), at(group, false)) {
            (Some(high), _) => {
                format!(
                    "{name} stays below {} % in 95 % of {runs} runs",
                    at_most(high)
                )
            }
            (None, Some(half)) => format!(
                "{name} stays below {} % in half of {runs} runs{}",
                at_most(half),
                early(group.endings, ", ")
            ),
            (None, None) => {
                let told = early(group.endings, "");
                let told = if told.is_empty() {
                    "no error is known"
                } else {
                    &told
                };
                match group.factor {
                    Some(_) => format!("{name}: of {runs} runs {told}"),
                    None => format!("Of {runs} runs {told}"),
                }
            }
        }
    });
    let mut text = clauses.collect::<Vec<_>>().join("; ");
    if groups.len() > MOST_NAMED {
        text += &format!(
            "; {} other controllers have larger errors",
            groups.len() - MOST_NAMED
        );
    }
    text.push('.');
    let told = early(all.endings, "");
    // What the clauses have not said.
    let is_new = groups.iter().all(|group| at(group, true).is_some());
    if !told.is_empty() && is_new {
        text += &format!(" Of all {} runs {told}.", count(all.endings.runs));
    }
    if let Some(limit) = half(findings, groups[0], system) {
        text += &format!(" {limit}");
    }
    if let Some(factor) = decides(findings) {
        text += &format!(" {factor}");
    }
    text + &invalid
}

/// Names the runs that could not begin; empty where all could.
fn invalid(findings: &Findings) -> String {
    let runs: usize = findings.invalid.iter().map(|own| own.runs).sum();
    let Some(first) = findings.invalid.first() else {
        return String::new();
    };
    format!(
        " {} more could not begin and are not counted: {}.",
        count(runs),
        first.reason.trim_end_matches('.')
    )
}

/// An upper bound, rounded up to two digits.
fn at_most(percent: f64) -> String {
    let text = significant(percent, 2);
    match text.parse::<f64>() {
        Ok(rounded) if rounded < percent && percent > 0.0 => {
            let place = 10_f64.powf(percent.log10().floor() - 1.0);
            significant(rounded + place, 2)
        }
        _ => text,
    }
}

/// Those that were not played to their end; empty where all were.
fn early(endings: Endings, before: &str) -> String {
    let parts = [
        (endings.interlock, "stopped by the interlock"),
        (endings.failed, "failed"),
    ];
    let parts = parts.iter().filter(|(part, _)| *part > 0);
    let told: Vec<String> = parts
        .map(|(part, what)| format!("{} {what}", percent(*part, endings.runs)))
        .collect();
    match told.is_empty() {
        true => String::new(),
        false => format!("{before}{}", told.join(" and ")),
    }
}

/// Where half of the runs of the best controller exceed the first limit that has a curve.
fn half(findings: &Findings, best: &Group, system: UnitSystem) -> Option<String> {
    findings.fragility.iter().find_map(|own| {
        let (Fit::Lognormal(curve), Some(limit)) = (&own.fit, &own.limit) else {
            return None;
        };
        let is_best = own
            .controller
            .as_ref()
            .is_none_or(|name| *name == best.value);
        let under = own.controller.as_ref();
        let under = under.map_or(String::new(), |name| format!(" under {name}"));
        let units = intensity_units(findings);
        let [median, low, high] = [curve.median, curve.median_band[0], curve.median_band[1]]
            .map(|at| quantity(at, &units, system));
        is_best.then(|| {
            format!(
                "Half of the runs exceed {} of {limit}{under} at {median} of {} ({low} to {high}).",
                above(own, system),
                label(&findings.intensity)
            )
        })
    })
}

/// What is exceeded, as a heading.
pub(super) fn limit(own: &Fragility, system: UnitSystem) -> String {
    match &own.limit {
        Some(name) => {
            let what = match label(name) {
                same if same == *name => same,
                figure => capital(&figure),
            };
            format!("{what} above {}", above(own, system))
        }
        None => "Stopped by the interlock".to_string(),
    }
}

/// The limit with its unit.
pub(super) fn above(own: &Fragility, system: UnitSystem) -> String {
    let units = units(
        own.column.as_deref().unwrap_or_default(),
        own.unit.as_deref(),
    );
    own.above
        .map_or(String::new(), |above| quantity(above, &units, system))
}

/// The factor that decides over the error.
fn decides(findings: &Findings) -> Option<String> {
    let first = findings
        .importance
        .iter()
        .find(|own| own.column.as_deref() == Some(ERROR))?;
    let factor = first.factors.first().filter(|own| own.size() >= 0.1)?;
    let alone = match first.method {
        Method::Sobol => "with its interactions ",
        Method::CorrelationRatio => "alone ",
    };
    let among = first.among.as_ref();
    let among = among.map_or(String::new(), |name| format!(" of {name}"));
    Some(format!(
        "The error{among} depends most on {}: {alone}{:.0} % of the variance.",
        factor.factor,
        100.0 * factor.size().min(1.0)
    ))
}

/// What an outcome of [`Importance`] is called.
pub(super) fn outcome(own: &Importance) -> String {
    let what = own.column.as_deref();
    let what = what.map_or("being stopped by the interlock".to_string(), label);
    match &own.among {
        Some(among) => format!("{what}, {among}"),
        None => what,
    }
}

/// One outcome's decisive factors in a line.
pub(super) fn importance(own: &Importance) -> String {
    let named = own.factors.iter().filter(|own| own.size() >= 0.05).take(3);
    let one = |own: &Share| format!("{} {:.0} %", own.factor, 100.0 * own.size().clamp(0.0, 1.0));
    let named: Vec<String> = named.map(one).collect();
    let rest = match own.method {
        Method::Sobol => "by interactions",
        Method::CorrelationRatio => "not explained by one factor alone",
    };
    let left_out = match own.left_out {
        0 => String::new(),
        some => format!("; {} runs ended early and are not included", count(some)),
    };
    format!(
        "{}: {}; {:.0} % {rest} (of {} runs{left_out}).",
        capital(&outcome(own)),
        if named.is_empty() {
            "no factor stands out".to_string()
        } else {
            named.join(", ")
        },
        100.0 * own.rest,
        count(own.runs)
    )
}

pub(super) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

/// How to read fragility.
pub(super) fn fragility(findings: &Findings) -> String {
    let motions = findings.fragility.iter().find_map(|own| match &own.fit {
        Fit::Lognormal(curve) => Some(curve.motions),
        _ => None,
    });
    let band = match motions {
        Some(Some(motions)) => format!(
            "Band of 95 %, valid for other motions like these: runs are grouped by motion \
             ({motions} motions)."
        ),
        _ => "Band of 95 %, valid only for these motions: runs count as independent.".to_string(),
    };
    format!(
        "Share of runs that exceed a limit, or are stopped, against intensity: dots are counted \
         shares in groups of equally many runs, lines are lognormal curves of maximum likelihood. \
         {band}"
    )
}

/// The limits that have no curve, and why.
pub(super) fn without_curve(findings: &Findings, system: UnitSystem) -> Vec<String> {
    let told = findings.fragility.iter().filter_map(|own| {
        let under = own.controller.as_ref();
        let under = under.map_or(String::new(), |name| format!(", {name}"));
        without(own, &label(&findings.intensity))
            .map(|why| format!("{}{under}: {why}", limit(own, system)))
    });
    told.collect()
}

/// Why there is no curve.
fn without(own: &Fragility, intensity: &str) -> Option<String> {
    let share = |share: f64| significant(100.0 * share, 2);
    Some(match own.fit {
        Fit::Lognormal(_) => return None,
        Fit::Separated {
            between: [low, high],
        } => format!(
            "all runs up to {} stay within the limit, all from {} on exceed it: no curve, because \
             the likelihood has no maximum.",
            significant(low, 3),
            significant(high, 3)
        ),
        Fit::Never { share_below } => format!(
            "none of {} runs; with 95 % confidence fewer than {} % exceed it.",
            count(own.runs),
            share(share_below)
        ),
        Fit::Always { share_above } => format!(
            "all of {} runs; with 95 % confidence more than {} % exceed it.",
            count(own.runs),
            share(share_above)
        ),
        Fit::None { why: Why::NoRuns } => "no run tells.".into(),
        Fit::None {
            why: Why::SameIntensity,
        } => {
            format!("no curve: the runs have no {intensity}, or all have the same.")
        }
        Fit::None {
            why: Why::DoesNotGrow,
        } => format!(
            "{} of {} runs, but the share does not grow with {intensity}: no curve.",
            count(own.exceeded),
            count(own.runs)
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_upper_bound_is_rounded_up() {
        for (percent, shown) in [
            (12.0, "12"),
            (12.3, "13"),
            (12.9, "13"),
            (0.0451, "0.046"),
            (0.0459, "0.046"),
            (1.23, "1.3"),
        ] {
            assert_eq!(at_most(percent), shown);
        }
        assert_eq!(at_most(0.0), significant(0.0, 2));
    }
}
