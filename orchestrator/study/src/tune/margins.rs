//! Margins of the loop at the valve as it runs: the FMUs of a run, pushed at the valve.
//!
//! The run is made twice, the second time with a small constant added to the valve command. The
//! difference of the valve commands is the step response of the sensitivity `S = 1/(1 + L)` along the
//! run's motion, and its increments are what [`Pushed`] reads margins from. It needs no model of
//! controller or rig, and noise, which is the same both times, drops out.

use std::sync::Mutex;
use units::vocabulary;

use controllers::robustness::Pushed;
use plant::linear::margins::Margins;

use crate::campaign::Bench;
use fmi_system::{ComponentFile, Origin, Setting, SystemFile, VariableName};
use laboratory::error::Error;
use laboratory::run::experiment::{Motions, prepare_shared};
use pack::library::FmuLibrary;

/// Time over which the push is followed, s.
const FOLLOWED: f64 = 8.0;
/// The push, V: a hundredth of the valve's range is far from every limit, and far above the
/// resolution of sensors.
const PUSH: f64 = 0.1;
/// Lowest frequency that is looked at, rad/s.
const LOWEST: f64 = 2.0;
/// The component that pushes.
const PUSHER: &str = "push_at_the_valve";

/// What the loop at the valve bears.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Held {
    /// Whether the push dies out.
    pub is_stable: bool,
    /// Crossover and margins; of an unstable loop they say nothing.
    #[serde(flatten)]
    pub margins: Margins,
    /// Largest sensitivity.
    pub peak_sensitivity: f64,
}

/// Margins of the run `number` of a study with the parameters `set` besides its own.
///
/// # Errors
/// A system without a valve, FMUs or a motion at fault.
pub fn held(bench: &Bench, number: u64, set: &[String]) -> Result<Held, Error> {
    let (mut request, mut file) = bench.request_of(number)?;
    request.set.extend_from_slice(set);
    request.duration_s = Some(request.duration_s.map_or(FOLLOWED, |own| own.min(FOLLOWED)));
    let signal = break_at_valve(&mut file)?;
    let library = Mutex::new(FmuLibrary::of(request.fmi, &file).from(&request.installation));
    let motions = Motions::default();
    let mut commands = Vec::new();
    let mut period = 0.0;
    for push in [0.0, PUSH] {
        let mut request = request.clone();
        request.set.push(format!("{PUSHER}.offset={push:?}"));
        let prepared = prepare_shared(&request, &file, &library, &motions)?;
        period = prepared.motion.dt;
        let outcome = prepared.run(prepared.algorithm)?;
        commands.push(outcome.record.column(&signal).unwrap_or_default());
    }
    let [plain, pushed] = commands.as_slice() else {
        return Ok(Held::default());
    };
    let steps: Vec<f64> = pushed
        .iter()
        .zip(plain)
        .map(|(b, a)| (b - a) / PUSH)
        .collect();
    let mut before = 0.0;
    let increments = steps
        .into_iter()
        .map(|step| step - std::mem::replace(&mut before, step));
    let pushed = Pushed::measured(increments.collect(), period);
    let open = pushed.open_loop(LOWEST);
    Ok(Held {
        is_stable: pushed.is_stable(),
        margins: open.margins(),
        peak_sensitivity: open.peak_sensitivity(),
    })
}

/// Puts a component that adds a constant before the valve, and gives the name of its output.
fn break_at_valve(file: &mut SystemFile) -> Result<String, Error> {
    let is_table = |name: &str| {
        let part = file.components.get(name);
        part.is_some_and(|part| part.period.is_none())
    };
    let mut links = file.connections.iter_mut();
    let link = links
        .find(|link| link.to.variable == vocabulary::VALVE_COMMAND && is_table(&link.to.component));
    let Some(link) = link else {
        let reason = "nothing drives a `valve_command` of its plant: margins cannot be measured; expected \
                      a study without `gain_margin` and `phase_margin`";
        return Err(file.at_fault("connections", reason.to_string()).into());
    };
    let valve = link.to.clone();
    link.to = VariableName::new(PUSHER, "u");
    let period = file
        .components
        .values()
        .find_map(|part| part.period.clone());
    let period = period.unwrap_or(Setting::Text("2 ms".to_string()));
    file.add(PUSHER, ComponentFile::new("SignalPath").period(period));
    file.connect(Origin::output(PUSHER, "y"), valve);
    Ok(format!("{PUSHER}.y"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_system::Link;

    fn file(links: &[&str]) -> SystemFile {
        let mut file = SystemFile::default();
        let sampled = ComponentFile::new("DisplacementPid").period(Setting::Text("4 ms".into()));
        file.add("control", sampled.clone());
        file.add("interlock", sampled);
        file.add("table", ComponentFile::new("ShakeTable"));
        let links = links
            .iter()
            .map(|text| Link::try_from((*text).to_string()).unwrap());
        file.connections = links.collect();
        file
    }

    #[test]
    fn the_loop_is_broken_between_the_last_command_and_the_valve() {
        let mut own = file(&[
            "control.valve_command -> interlock.valve_command",
            "interlock.valve_command -> table.valve_command",
        ]);
        assert_eq!(break_at_valve(&mut own).unwrap(), "push_at_the_valve.y");
        let links: Vec<String> = own.connections.iter().map(ToString::to_string).collect();
        assert_eq!(
            links,
            [
                "control.valve_command -> interlock.valve_command",
                "interlock.valve_command -> push_at_the_valve.u",
                "push_at_the_valve.y -> table.valve_command",
            ]
        );
        let pusher = &own.components[PUSHER];
        assert_eq!(
            (&*pusher.fmu, &pusher.period),
            ("SignalPath", &Some(Setting::Text("4 ms".into())))
        );
    }

    #[test]
    fn a_system_without_a_valve_has_no_margins() {
        let mut own = file(&["control.valve_command -> interlock.valve_command"]);
        let told = break_at_valve(&mut own).unwrap_err().to_string();
        assert!(
            told.contains("nothing drives a `valve_command` of its plant"),
            "{told}"
        );
    }
}
