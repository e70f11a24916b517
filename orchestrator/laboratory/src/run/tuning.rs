//! Which parameters may be changed during a run, and between which bounds.

use crate::error::Error;
use fmi_import::Variable;
use fmi_master::{Change, Panel, Tunable};
use fmi_system::{Component, System};
use pages::report::UnitSystem;
use pages::report::Units;
use pages::report::number::significant;
use units::hint;

/// Time that a change takes, s.
pub const CHANGE: f64 = 1.0;
/// Word for all parameters that can be changed.
const ALL: &str = "all";

/// The parameters that `wanted` names, each as `component.variable`, perhaps with its bounds as
/// `component.variable=LOW..HIGH`, or `all`. Without bounds they are half and twice the value at the start,
/// within what the FMU accepts. A sample takes `period` seconds.
///
/// # Errors
/// A parameter that there is not or that cannot be changed, bounds that do not hold its value.
pub fn panel(system: &System, wanted: &[String], period: f64) -> Result<Panel, Error> {
    let mut tunables: Vec<Tunable> = Vec::new();
    let mut add = |new: Tunable| {
        tunables.retain(|own| own.variable != new.variable);
        tunables.push(new);
    };
    // Bounds that somebody states come last, so that they replace those of `all`.
    if wanted.iter().any(|name| name == ALL) {
        let all = tunable(system).filter_map(|(component, variable)| {
            let start = start(component, variable)?;
            let (low, high) = usual_bounds(variable, start)?;
            Some(Tunable {
                variable: format!("{}.{}", component.name, variable.name),
                start,
                low,
                high,
            })
        });
        all.for_each(&mut add);
    }
    for text in wanted.iter().filter(|name| *name != ALL) {
        add(one(system, text)?);
    }
    if tunables.is_empty() {
        let reason = "the system has no tunable parameter whose value is not 0; state one with its bounds as \
                      --tune INSTANCE.VARIABLE=LOW..HIGH";
        return Err(fault(reason.to_string()));
    }
    Ok(Panel::new(tunables, (CHANGE / period).round() as usize))
}

fn fault(reason: String) -> Error {
    Error::Option {
        option: "--tune",
        reason,
    }
}

/// The parameters of a system that the standard lets be changed between steps.
fn tunable(system: &System) -> impl Iterator<Item = (&Component, &Variable)> {
    system.components.iter().flat_map(|component| {
        let variables = component.fmu.description.variables.iter();
        let own = variables.filter(|own| is_tunable(own));
        own.map(move |variable| (component, variable))
    })
}

fn is_tunable(variable: &Variable) -> bool {
    variable.is_tunable() && variable.is_real_number()
}

/// The value at the beginning.
fn start(component: &Component, variable: &Variable) -> Option<f64> {
    let position = component.fmu.description.position(&variable.name)?;
    let given = component
        .parameters
        .iter()
        .find(|(own, _)| *own == position);
    match given {
        Some((_, value)) => serde_json::json!(value).as_f64(),
        None => variable.start.as_deref()?.trim().parse().ok(),
    }
}

/// Half and twice the value, within what the FMU accepts; none of 0.
fn usual_bounds(variable: &Variable, start: f64) -> Option<(f64, f64)> {
    let [least, most] = variable.bounds;
    let (one, other) = (0.5 * start, 2.0 * start);
    let low = one.min(other).max(least.unwrap_or(f64::NEG_INFINITY));
    let high = one.max(other).min(most.unwrap_or(f64::INFINITY));
    (low < high).then_some((low, high))
}

/// A parameter as a user names it.
fn one(system: &System, text: &str) -> Result<Tunable, Error> {
    let (name, bounds) = match text.split_once('=') {
        Some((name, bounds)) => (name.trim(), Some(bounds)),
        None => (text.trim(), None),
    };
    let found = system.variable(name).map(|(component, position)| {
        let variable = &component.fmu.description.variables[position];
        (component, variable)
    });
    let Some((component, variable)) = found.filter(|(_, variable)| is_tunable(variable)) else {
        return Err(fault(not_tunable(system, name)));
    };
    let start = start(component, variable).ok_or_else(|| {
        fault(format!(
            "`{name}` has no value at the beginning; give one with --set"
        ))
    })?;
    let (low, high) = match bounds {
        Some(bounds) => stated(variable, name, bounds)?,
        None => usual_bounds(variable, start).ok_or_else(|| {
            fault(format!(
                "`{name}` is {start} at the beginning, so half and twice its value cannot be its bounds; \
                 expected {name}=LOW..HIGH"
            ))
        })?,
    };
    if !(low..=high).contains(&start) {
        return Err(fault(format!(
            "`{name}` is {start} at the beginning, which is outside of {low} to {high}{}",
            variable
                .unit
                .as_ref()
                .map_or(String::new(), |unit| format!(" {unit}")),
        )));
    }
    Ok(Tunable {
        variable: name.to_string(),
        start,
        low,
        high,
    })
}

/// Bounds as `LOW..HIGH`, both with units.
fn stated(variable: &Variable, name: &str, text: &str) -> Result<(f64, f64), Error> {
    let unit = variable.unit.as_deref().unwrap_or_default();
    let expected = || match unit {
        "" => format!("expected {name}=LOW..HIGH"),
        unit => format!("expected {name}=\"LOW {unit}..HIGH {unit}\""),
    };
    let (low, high) = text
        .split_once("..")
        .ok_or_else(|| fault(format!("`{text}` is not a range; {}", expected())))?;
    let read = |text: &str| {
        let number = text.trim().parse::<f64>().ok();
        // Zero is zero in every unit.
        match number.filter(|number| unit.is_empty() || *number == 0.0) {
            Some(number) => Ok(number),
            None if number.is_some() => Err(fault(format!(
                "`{}` has no unit; {}",
                text.trim(),
                expected()
            ))),
            None => units::value_in(text.trim(), unit)
                .map_err(|error| fault(format!("`{}`: {error}; {}", text.trim(), expected()))),
        }
    };
    let (low, high) = (read(low)?, read(high)?);
    let [least, most] = variable.bounds;
    let is_accepted = low >= least.unwrap_or(f64::NEG_INFINITY)
        && high <= most.unwrap_or(f64::INFINITY)
        && low.is_finite()
        && high.is_finite();
    if low >= high {
        return Err(fault(format!("`{text}` holds no values; {}", expected())));
    }
    if !is_accepted {
        let side = |bound: Option<f64>| bound.map_or("any".to_string(), |bound| bound.to_string());
        return Err(fault(format!(
            "`{text}` is beyond what the FMU accepts for `{name}`, {} to {} {unit}",
            side(least),
            side(most)
        )));
    }
    Ok((low, high))
}

/// Why a name is not one of a parameter that can be changed.
fn not_tunable(system: &System, name: &str) -> String {
    let known: Vec<String> = tunable(system)
        .map(|(component, variable)| format!("{}.{}", component.name, variable.name))
        .collect();
    let reason = match system.variable(name) {
        Some(_) => {
            format!("`{name}` is not a tunable parameter: its FMU takes it before the run only")
        }
        None => format!(
            "the system has no parameter `{name}`{}",
            hint(name, known.iter().map(String::as_str))
        ),
    };
    match known.is_empty() {
        true => format!("{reason}; no component of the system has a tunable parameter"),
        false => format!("{reason}; tunable are {}", known.join(", ")),
    }
}

/// A change in words.
#[must_use]
pub fn in_words(change: &Change, unit: &str, system: UnitSystem) -> String {
    let units = Units::of(unit);
    let (from, name) = units.shown(change.from, system);
    let (to, _) = units.shown(change.to, system);
    let unit = match name {
        "" => String::new(),
        name => format!(" {name}"),
    };
    format!(
        "`{}` from {} to {}{unit} at {:.3} s",
        change.variable,
        significant(from, 4),
        significant(to, 4),
        change.time_s
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;
    use fmi_system::Value;

    fn bench() -> System {
        let tunable = |n, name: &str, more: &str| {
            made::real(
                n,
                name,
                "parameter",
                &format!(r#"variability="tunable" {more}"#),
            )
        };
        let variables = tunable(1, "gain", r#"start="2" unit="V/m" min="0.5" max="100""#)
            + &tunable(2, "zero", r#"start="0""#)
            + &tunable(3, "below", r#"start="-4""#)
            + &tunable(4, "narrow", r#"start="8" min="7""#)
            + &made::real(5, "fixed", "parameter", r#"variability="fixed" start="1""#);
        let mut control = made::component("control", &variables);
        let narrow = control.fmu.description.position("narrow").unwrap();
        control.parameters.push((narrow, Value::Number(10.0)));
        made::system(vec![control])
    }

    fn found(wanted: &[&str]) -> Result<Vec<(String, [f64; 3])>, String> {
        let wanted: Vec<String> = wanted.iter().map(ToString::to_string).collect();
        let panel = panel(&bench(), &wanted, 0.002).map_err(|error| error.to_string())?;
        let all = panel.tunables().iter();
        Ok(all
            .map(|own| (own.variable.clone(), [own.start, own.low, own.high]))
            .collect())
    }

    #[test]
    fn parameters_may_change_between_half_and_twice_their_value_or_stated_bounds() {
        let own = |name: &str, three: [f64; 3]| (format!("control.{name}"), three);
        assert_eq!(
            found(&["control.gain"]),
            Ok(vec![own("gain", [2.0, 1.0, 4.0])])
        );
        assert_eq!(
            found(&["control.below"]),
            Ok(vec![own("below", [-4.0, -8.0, -2.0])])
        );
        // The value that is set counts, and what the FMU accepts.
        assert_eq!(
            found(&["control.narrow"]),
            Ok(vec![own("narrow", [10.0, 7.0, 20.0])])
        );
        assert_eq!(
            found(&["control.gain=\u{31} V/m..3 V/m"]),
            Ok(vec![own("gain", [2.0, 1.0, 3.0])])
        );
        assert_eq!(
            found(&["control.zero=-1..1"]),
            Ok(vec![own("zero", [0.0, -1.0, 1.0])])
        );
        // All but what is zero; stated bounds replace the usual ones and come last.
        assert_eq!(
            found(&["control.gain=0.5 V/m..2 V/m", "all"]),
            Ok(vec![
                own("below", [-4.0, -8.0, -2.0]),
                own("narrow", [10.0, 7.0, 20.0]),
                own("gain", [2.0, 0.5, 2.0]),
            ])
        );
    }

    #[test]
    fn bounds_and_names_at_fault_are_refused_with_what_is_expected() {
        for (wanted, expected) in [
            ("control.gian", "the system has no parameter `control.gian`"),
            (
                "control.fixed",
                "`control.fixed` is not a tunable parameter",
            ),
            ("control.zero", "expected control.zero=LOW..HIGH"),
            (
                "control.gain=3",
                "`3` is not a range; expected control.gain=\"LOW V/m..HIGH V/m\"",
            ),
            ("control.gain=1..3 V/m", "`1` has no unit"),
            ("control.gain=1 kg..3 V/m", "`1 kg`"),
            ("control.gain=3 V/m..1 V/m", "holds no values"),
            (
                "control.gain=1 V/m..200 V/m",
                "beyond what the FMU accepts for `control.gain`, 0.5 to 100 V/m",
            ),
            (
                "control.gain=3 V/m..5 V/m",
                "is 2 at the beginning, which is outside of 3 to 5 V/m",
            ),
        ] {
            let told = found(&[wanted]).unwrap_err();
            assert!(told.contains(expected), "{wanted}: {told}");
        }
        let told = found(&["control.gian"]).unwrap_err();
        assert!(
            told.ends_with("tunable are control.gain, control.zero, control.below, control.narrow"),
            "{told}"
        );
        let told = found(&[]).unwrap_err();
        assert!(
            told.contains("no tunable parameter whose value is not 0"),
            "{told}"
        );
    }

    #[test]
    fn a_change_is_told_in_the_units_of_its_reader() {
        let change = Change {
            variable: "control.gain".into(),
            time_s: 1.25,
            sample: 0,
            samples: 500,
            from: 100.0,
            to: 200.0,
        };
        let words = |unit: &str, system| in_words(&change, unit, system);
        assert_eq!(
            words("V/m", UnitSystem::Us),
            "`control.gain` from 2.540 to 5.080 V/in at 1.250 s"
        );
        assert_eq!(
            words("V/m", UnitSystem::Si),
            "`control.gain` from 0.1000 to 0.2000 V/mm at 1.250 s"
        );
        assert_eq!(
            words("", UnitSystem::Si),
            "`control.gain` from 100.0 to 200.0 at 1.250 s"
        );
    }
}
