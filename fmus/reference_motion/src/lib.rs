#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! A motion, played sample by sample, as an FMU.

mod motion;

use std::path::Path;

use fmu_kit::{
    Causality, Component, ComponentResult, Dependency, Terminal, Variable, resources::optional_text,
};
use motion::Motion;
use serde::{Deserialize, Serialize};

/// Samples ahead that are outputs, too.
const AHEAD: usize = 20;
/// The file with the motion.
const FILE: &str = "motion.csv";

/// A motion and where it stands.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ReferenceMotion {
    scale: f64,
    sine_amplitude: f64,
    sine_frequency: f64,
    motion: Motion,
    /// Now, then so many samples ahead.
    displacement: [f64; AHEAD + 1],
    velocity: [f64; AHEAD + 1],
    acceleration: [f64; AHEAD + 1],
    /// Displacement, velocity and acceleration one sample before.
    before: [f64; 3],
}

impl Default for ReferenceMotion {
    fn default() -> Self {
        Self {
            scale: 1.0,
            sine_amplitude: 0.0254,
            sine_frequency: 1.0,
            motion: Motion::default(),
            displacement: [0.0; AHEAD + 1],
            velocity: [0.0; AHEAD + 1],
            acceleration: [0.0; AHEAD + 1],
            before: [0.0; 3],
        }
    }
}

/// Unit, unit in which people want to see it, and usual size of a quantity.
type Shown = (&'static str, &'static str, f64);

const DISPLACEMENT: Shown = ("m", "in", 0.0381);
const VELOCITY: Shown = ("m/s", "in/s", 0.5);
const ACCELERATION: Shown = ("m/s2", "g", 10.0);

fn wanted(
    variable: Variable<ReferenceMotion>,
    (unit, shown, nominal): Shown,
) -> Variable<ReferenceMotion> {
    let shown = variable.unit(unit).shown_in(shown).nominal(nominal);
    let shown = shown.depends_on(&["scale"], Dependency::Dependent);
    shown.initially_depends_on(&["scale", "sine_amplitude", "sine_frequency"])
}

/// A quantity one sample before.
fn before(
    name: &str,
    shown: Shown,
    field: fn(&mut ReferenceMotion) -> &mut f64,
) -> Variable<ReferenceMotion> {
    let variable = Variable::output(&format!("{name}_before"), field);
    wanted(
        variable.about(&format!("Wanted {name} one sample before")),
        shown,
    )
}

/// A quantity now and ahead.
fn histories(
    name: &str,
    shown: Shown,
    now: fn(&mut ReferenceMotion) -> &mut f64,
    ahead: fn(&mut ReferenceMotion) -> &mut [f64],
) -> Vec<Variable<ReferenceMotion>> {
    let mut all = vec![Variable::output(name, now).about(&format!("Wanted {name}"))];
    let elements = Variable::array(name, Causality::Output, AHEAD, ahead);
    all.extend(
        elements
            .into_iter()
            .enumerate()
            .map(|(i, element)| element.about(&format!("Wanted {name} {} samples ahead", i + 1))),
    );
    let all = all.into_iter().map(|variable| wanted(variable, shown));
    all.collect()
}

impl Component for ReferenceMotion {
    const NAME: &'static str = "ReferenceMotion";
    const DESCRIPTION: &'static str = "A motion that a shake table is asked for";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[Terminal::bus(
        "reference",
        "reference",
        &[
            ("displacement", "displacement"),
            ("velocity", "velocity"),
            ("acceleration", "acceleration"),
        ],
    )];

    fn variables() -> Vec<Variable<Self>> {
        let mut all = fmu_kit::table! { Self, s:
            input("scale", s.scale, "Factor on all outputs").nominal(1.0);
            parameter("sine_amplitude", s.sine_amplitude, "Peak of the sine that is played where there is no motion", "m" => "in");
            parameter("sine_frequency", s.sine_frequency, "Frequency of that sine", "Hz").min(0.0);
        };
        all.extend(histories(
            "displacement",
            DISPLACEMENT,
            |s| &mut s.displacement[0],
            |s| &mut s.displacement[1..],
        ));
        all.extend(histories(
            "velocity",
            VELOCITY,
            |s| &mut s.velocity[0],
            |s| &mut s.velocity[1..],
        ));
        all.extend(histories(
            "acceleration",
            ACCELERATION,
            |s| &mut s.acceleration[0],
            |s| &mut s.acceleration[1..],
        ));
        all.extend([
            before("displacement", DISPLACEMENT, |s| &mut s.before[0]),
            before("velocity", VELOCITY, |s| &mut s.before[1]),
            before("acceleration", ACCELERATION, |s| &mut s.before[2]),
        ]);
        all
    }

    fn load(&mut self, resources: &Path) -> ComponentResult {
        if let Some(text) = optional_text(&resources.join(FILE))? {
            self.motion = Motion::parse(&text).map_err(|problem| format!("{FILE}: {problem}"))?;
        }
        Ok(())
    }

    fn initialize(&mut self) -> ComponentResult {
        Ok(())
    }

    fn update_outputs(&mut self, time: f64) {
        let sine = (self.sine_amplitude, self.sine_frequency);
        let now = self.motion.sample_at(time);
        for ahead in 0..=AHEAD {
            let [x, v, a] = self.motion.at(now.saturating_add(ahead), sine);
            self.displacement[ahead] = self.scale * x;
            self.velocity[ahead] = self.scale * v;
            self.acceleration[ahead] = self.scale * a;
        }
        // Before its beginning it rests at zero.
        let last = now.checked_sub(1);
        let last = last.map_or([0.0; 3], |sample| self.motion.at(sample, sine));
        self.before = last.map(|value| self.scale * value);
    }

    fn step(&mut self, _time: f64, _step_size: f64) -> ComponentResult {
        Ok(())
    }
}

fmu_kit::export!(ReferenceMotion);
