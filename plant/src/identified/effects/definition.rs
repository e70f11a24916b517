//! What an effect is: where it acts, its parameters, how it is looked for and said.

use super::quantity::Quantity;
use super::{Effects, SpecimenEffects};
use crate::delay_line::MAX_DELAY_SAMPLES;
use crate::sensors::instrumentation::Instrumentation;

/// The part of the rig, an FMU, that has an effect's parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Component {
    /// Valve, actuator and table.
    ShakeTable,
    /// What stands on the table.
    Specimen,
    /// The sensors.
    Instrumentation,
}

impl Component {
    /// The name of its FMU.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ShakeTable => "ShakeTable",
            Self::Specimen => "Specimen",
            Self::Instrumentation => "Instrumentation",
        }
    }
}

/// The way to a parameter's value.
#[derive(Debug, Clone, Copy)]
pub enum Field {
    /// On actuator and table.
    Table(fn(&mut Effects) -> &mut f64),
    /// On the specimen.
    Specimen(fn(&mut SpecimenEffects) -> &mut f64),
    /// On the sensors.
    Sensors(fn(&mut Instrumentation) -> &mut f64),
}

impl Field {
    /// The value's place.
    pub fn of<'a>(self, effects: &'a mut Effects, sensors: &'a mut Instrumentation) -> &'a mut f64 {
        match self {
            Self::Table(field) => field(effects),
            Self::Specimen(field) => field(&mut effects.specimen),
            Self::Sensors(field) => field(sensors),
        }
    }
}

/// How a parameter is counted when it is estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// The value over a unit.
    Linear(f64),
    /// The logarithm of one plus the value, over a unit: a change by a factor.
    Factor(f64),
    /// The value's logarithm.
    Logarithmic,
    /// One over the value, in units of one over this; zero is off.
    Inverse(f64),
}

/// What a parameter tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Role {
    /// How strong the effect is; `weak` is barely there.
    Size {
        /// How it is counted.
        scale: Scale,
        /// The weakest value that matters.
        weak: f64,
    },
    /// A detail of its form, known to `spread` (in the scale's units) about `typical`.
    Shape {
        /// How it is counted.
        scale: Scale,
        /// The usual value.
        typical: f64,
        /// One standard deviation.
        spread: f64,
    },
    /// Not estimated.
    Given,
}

/// What a parameter's numbers are multiples of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Basis {
    /// The SI unit.
    Absolute,
    /// The largest command of the records.
    PeakCommand,
    /// The SI unit, up to what the delay line holds at the sampling period.
    Memory,
}

/// Where the FMU has a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variable {
    /// As `effect.parameter`.
    Own,
    /// Under the name of this effect, of which it is a parameter too.
    Of(&'static str),
    /// It has none.
    None,
}

/// What depends on a parameter at the start of a run, besides what the standing states tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AtStart {
    /// The acceleration of table or specimen.
    Acceleration,
    /// The rates of the actuator's states.
    ActuatorRates,
}

/// A parameter of an effect; values in SI.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// Its name.
    pub name: &'static str,
    /// Its quantity with its units.
    pub quantity: Quantity,
    /// What it means, in one line.
    pub about: &'static str,
    /// What it tells.
    pub role: Role,
    /// What its numbers are multiples of.
    pub basis: Basis,
    /// Smallest and largest value that is tried.
    pub bounds: (f64, f64),
    /// Where these come from.
    pub source: &'static str,
    /// The way to its value; none for a coordinate that only an estimate has.
    pub field: Option<Field>,
    /// Where the FMU has it.
    pub variable: Variable,
    /// Smallest value that can be simulated.
    pub min: Option<f64>,
    /// Largest value that can be simulated.
    pub max: Option<f64>,
    /// True where zero turns the effect off.
    pub is_switch: bool,
    /// What depends on it at the start of a run.
    pub at_start: Option<AtStart>,
}

/// Source of a range from weak to strong.
const PLAUSIBLE: &str = "plausible on a rig of this size, from barely there to dominating; tried \
                         up to four times the strongest";
/// Source of bounds that are not those of [`PLAUSIBLE`].
const WIDE: &str = "plausible on a rig of this size; tried as far as the model is valid";
/// Source of a form.
const USUAL: &str = "usual value, with a spread that covers the forms in use";
/// Source of a delay's bounds.
const MEMORY: &str = "plausible from two samples on; tried up to what the delay line holds";

impl Parameter {
    /// A parameter that is not estimated.
    pub const fn new(name: &'static str, quantity: Quantity, about: &'static str) -> Self {
        Self {
            name,
            quantity,
            about,
            role: Role::Given,
            basis: Basis::Absolute,
            bounds: (f64::NEG_INFINITY, f64::INFINITY),
            source: "a detail that records do not determine",
            field: None,
            variable: Variable::Own,
            min: None,
            max: None,
            is_switch: false,
            at_start: None,
        }
    }

    /// A size with `bounds` of its own.
    pub const fn size(mut self, scale: Scale, weak: f64, bounds: (f64, f64)) -> Self {
        self.role = Role::Size { scale, weak };
        self.bounds = bounds;
        self.source = WIDE;
        self.is_switch = true;
        self
    }

    const fn plausible(mut self, scale: Scale, weak: f64, bounds: (f64, f64)) -> Self {
        self = self.size(scale, weak, bounds);
        self.source = PLAUSIBLE;
        self
    }

    /// A size that may have either sign, from zero.
    pub const fn signed(self, weak: f64, strong: f64) -> Self {
        let most = 4.0 * strong;
        self.plausible(Scale::Linear(weak), weak, (-most, most))
    }

    /// A size that has one sign, from zero.
    pub const fn positive(self, weak: f64, strong: f64) -> Self {
        self.plausible(Scale::Linear(weak), weak, (0.0, 4.0 * strong))
    }

    /// A relative change that may have either sign.
    pub const fn relative(self, weak: f64, strong: f64) -> Self {
        let most = (4.0 * strong).min(0.9);
        self.plausible(Scale::Factor(weak), weak, (-most, 4.0 * strong))
    }

    /// A size that is weak when large: frequencies, limits.
    pub const fn inverse(mut self, weak: f64, strong: f64) -> Self {
        self = self.size(Scale::Inverse(weak), weak, (0.3 * strong, 3.0 * weak));
        self.source = "plausible on a rig of this size; tried from a third of the strongest to \
                       three times the weakest";
        self
    }

    /// A delay of two samples and more, as far as the delay line reaches.
    pub const fn delay(mut self) -> Self {
        self = self.size(Scale::Linear(0.004), 0.004, (0.0, f64::INFINITY));
        self.basis = Basis::Memory;
        self.source = MEMORY;
        self
    }

    /// A size of one sign in multiples of the records' largest command.
    pub const fn in_peak_commands(mut self, weak: f64, bounds: (f64, f64)) -> Self {
        self = self.size(Scale::Logarithmic, weak, bounds);
        self.basis = Basis::PeakCommand;
        self
    }

    /// A detail of the effect's form.
    pub const fn shape(
        mut self,
        scale: Scale,
        typical: f64,
        spread: f64,
        bounds: (f64, f64),
    ) -> Self {
        self.role = Role::Shape {
            scale,
            typical,
            spread,
        };
        self.bounds = bounds;
        self.source = USUAL;
        self
    }

    /// Its value on actuator and table.
    pub const fn on_table(mut self, field: fn(&mut Effects) -> &mut f64) -> Self {
        self.field = Some(Field::Table(field));
        self
    }

    /// Its value on the specimen.
    pub const fn on_specimen(mut self, field: fn(&mut SpecimenEffects) -> &mut f64) -> Self {
        self.field = Some(Field::Specimen(field));
        self
    }

    /// Its value on the sensors.
    pub const fn on_sensors(mut self, field: fn(&mut Instrumentation) -> &mut f64) -> Self {
        self.field = Some(Field::Sensors(field));
        self
    }

    /// A parameter of `effect` too, which has the FMU's variable and turns it on.
    pub const fn of(mut self, effect: &'static str) -> Self {
        self.variable = Variable::Of(effect);
        self.is_switch = false;
        self
    }

    /// A parameter that the FMU does without.
    pub const fn without_variable(mut self) -> Self {
        self.variable = Variable::None;
        self
    }

    /// Gives the smallest value that can be simulated.
    pub const fn min(mut self, min: f64) -> Self {
        self.min = Some(min);
        self
    }

    /// Gives the largest value that can be simulated.
    pub const fn max(mut self, max: f64) -> Self {
        self.max = Some(max);
        self
    }

    /// Says what it means, in one line.
    pub const fn about(mut self, about: &'static str) -> Self {
        self.about = about;
        self
    }

    /// A size of which zero does not turn the effect off.
    pub const fn without_switch(mut self) -> Self {
        self.is_switch = false;
        self
    }

    /// Makes zero turn the effect off.
    pub const fn switch(mut self) -> Self {
        self.is_switch = true;
        self
    }

    /// Says what depends on it at the start of a run.
    pub const fn at_start(mut self, what: AtStart) -> Self {
        self.at_start = Some(what);
        self
    }

    /// True where it is estimated.
    pub fn is_estimated(&self) -> bool {
        self.role != Role::Given
    }

    /// What its numbers are to be multiplied by on records whose largest command is
    /// `peak_command` (V).
    pub fn basis_value(&self, peak_command: f64) -> f64 {
        if self.basis == Basis::PeakCommand {
            peak_command
        } else {
            1.0
        }
    }

    /// Smallest and largest value that is tried on records with this largest command (V) and
    /// sampling `period` (s).
    pub fn bounds_on(&self, peak_command: f64, period: f64) -> (f64, f64) {
        match self.basis {
            Basis::Absolute => self.bounds,
            Basis::PeakCommand => (self.bounds.0 * peak_command, self.bounds.1 * peak_command),
            Basis::Memory => (self.bounds.0, (MAX_DELAY_SAMPLES - 1) as f64 * period),
        }
    }
}

/// How the estimates of an effect are told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reporting {
    /// As they are estimated.
    AsEstimated,
    /// Two quadratures as `amplitude` and `phase`.
    AmplitudeAndPhase,
}

/// An effect that the identified rig lacks against a real one.
#[derive(Debug, Clone, Copy)]
pub struct Effect {
    /// Its name.
    pub name: &'static str,
    /// The component that has its parameters.
    pub component: Component,
    /// What it does, as an equation.
    pub equation: &'static str,
    /// What it is in words, with a gap for the size of each of its parameters that tells one.
    pub sentence: &'static str,
    /// Its parameters, in the order of estimation and of the FMU's variables.
    pub parameters: &'static [Parameter],
    /// Values of the estimated parameters from which fits begin, SI.
    pub starts: &'static [&'static [f64]],
    /// Effects that one record often cannot tell from this one.
    pub confounded_with: &'static [&'static str],
    /// Effect that this one holds as a special case.
    pub contains: Option<&'static str>,
    /// Law whose form it changes; empty where that is its own.
    pub law: &'static str,
    /// True where it is linear about rest, offsets aside.
    pub is_linear: bool,
    /// True where it needs finer steps than the rig without it.
    pub is_fast: bool,
    /// True where the FMU's continuous states do not tell all of it.
    pub needs_co_simulation: bool,
    /// How much larger than usual the traces may be that the right model with it leaves.
    pub tolerance: f64,
    /// What else estimated values make of the rig.
    pub settle: fn(&mut Effects, &mut Instrumentation, &[f64]),
    /// How its estimates are told.
    pub reporting: Reporting,
}

impl Effect {
    /// An effect without parameters, not linear, that any component can hold in its states.
    pub const fn new(name: &'static str, component: Component) -> Self {
        Self {
            name,
            component,
            equation: "",
            sentence: "there is an effect of {}",
            parameters: &[],
            starts: &[],
            confounded_with: &[],
            contains: None,
            law: "",
            is_linear: false,
            is_fast: false,
            needs_co_simulation: false,
            tolerance: 1.0,
            settle: |_, _, _| {},
            reporting: Reporting::AsEstimated,
        }
    }

    /// The parameters that are estimated.
    pub fn estimated(&self) -> impl Iterator<Item = &'static Parameter> + use<> {
        self.parameters.iter().filter(|p| p.is_estimated())
    }

    /// Turns the effect on with `values` (SI) of the estimated parameters.
    pub fn apply(&self, effects: &mut Effects, sensors: &mut Instrumentation, values: &[f64]) {
        for (parameter, &value) in self.estimated().zip(values) {
            if let Some(field) = parameter.field {
                *field.of(effects, sensors) = value;
            }
        }
        (self.settle)(effects, sensors, values);
    }

    /// Turns it off.
    pub fn turn_off(&self, effects: &mut Effects, sensors: &mut Instrumentation) {
        for field in self.switches() {
            *field.of(effects, sensors) = 0.0;
        }
    }

    /// True where it is on.
    pub fn is_on(&self, effects: &Effects, sensors: &Instrumentation) -> bool {
        let (mut effects, mut sensors) = (*effects, *sensors);
        self.switches()
            .any(|field| *field.of(&mut effects, &mut sensors) != 0.0)
    }

    fn switches(&self) -> impl Iterator<Item = Field> + use<> {
        let switches = self.parameters.iter().filter(|p| p.is_switch);
        switches.filter_map(|p| p.field)
    }

    /// Values (SI) of plain strengths for records whose largest command is `peak_command` (V): the
    /// starts, with twice the weakest where a size is off.
    pub fn examples(&self, peak_command: f64) -> Vec<Vec<f64>> {
        let example = |start: &&[f64]| {
            let pairs = self.estimated().zip(start.iter());
            pairs
                .map(|(parameter, &value)| {
                    let value = match parameter.role {
                        Role::Size { weak, .. } if value == 0.0 => 2.0 * weak,
                        _ => value,
                    };
                    parameter.basis_value(peak_command) * value
                })
                .collect()
        };
        self.starts.iter().map(example).collect()
    }
}
