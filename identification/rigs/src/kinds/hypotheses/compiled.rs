//! A hypothesis that was checked against a kind of rig.

use super::expression::{Expression, ExpressionError};
use super::file::listed;
use super::{Hypothesis, Memory};
use crate::kinds::Rig;
use crate::kinds::table::Effect;
use diagnosis::{Candidate, EffectParameter, Role, Scale};
use recordings::Channel;

/// Names that an expression may use beside parameters, memory, channels and nominal parameters.
const SIGNALS: [&str; 5] = ["u", "du", "t", "x", "v"];
/// Places of [`SIGNALS`] among the values of an expression.
pub(super) const SIGNAL: usize = 0;
pub(super) const SIGNAL_RATE: usize = 1;
pub(super) const TIME: usize = 2;
pub(super) const POSITION: usize = 3;
pub(super) const SPEED: usize = 4;
/// Place of the first parameter.
pub(super) const FIRST: usize = SIGNALS.len();
/// Share of the smallest start that is the least size worth a name.
const WEAK: f64 = 0.1;
/// Deviations of a shape's logarithm, or of itself, from the middle to the end of its range.
const DEVIATIONS: f64 = 2.0;
/// Combinations of starts at most.
const MOST_STARTS: usize = 16;
/// A signal that passes unchanged where the sizes are zero does so to this share.
const UNCHANGED: f64 = 1e-9;

/// Where an effect acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// On an input before the rig receives it.
    Input(Channel),
    /// On the output before it is recorded.
    Output,
    /// A force, N, on what moves, in the direction of its displacement.
    Force,
    /// A force, N, that a device adds to its own, for its displacement and velocity.
    Device,
    /// On what the controller sends to the valve, in the unit of the command.
    Valve,
}

/// How a remembered value goes on.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Course {
    Rate(Expression),
    Next(Expression),
}

/// A hypothesis with its expressions read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Compiled {
    pub effect: &'static str,
    pub about: &'static str,
    look_alikes: &'static [&'static str],
    pub place: Place,
    pub value: Expression,
    pub parameters: Vec<EffectParameter>,
    /// From each parameter's unit to SI.
    pub factors: Vec<f64>,
    pub off: Vec<f64>,
    starts: Vec<Vec<f64>>,
    /// Start and course of what is remembered.
    pub memory: Vec<(Expression, Course)>,
    /// The kind's channels that expressions may read, in their order behind the memory.
    pub channels: Vec<Channel>,
    /// Values that an expression is given.
    pub slots: usize,
}

/// What is wrong with a hypothesis: the key below its name, the text there, and what.
pub(super) struct Wrong {
    pub key: String,
    pub text: String,
    pub what: String,
}

/// A name that lives as long as the program, as the kind that has it does ([`super::extended`]).
fn kept(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

fn is_name(name: &str) -> bool {
    let mut all = name.chars();
    all.next().is_some_and(|c| c.is_ascii_alphabetic())
        && all.all(|c| c.is_ascii_alphanumeric() || c == '_')
}

fn wrong<T>(key: impl Into<String>, text: &str, what: impl Into<String>) -> Result<T, Wrong> {
    Err(Wrong {
        key: key.into(),
        text: text.to_owned(),
        what: what.into(),
    })
}

/// The channels that a kind reads, its output last.
fn channels(rig: &dyn Rig) -> Vec<Channel> {
    let optional = rig.optional().iter().map(|(channel, _)| *channel);
    rig.inputs().iter().copied().chain(optional).collect()
}

/// The place called `at`, or the names of those that there are.
fn place(at: &str, rig: &dyn Rig) -> Result<Place, Wrong> {
    let inputs = rig.inputs();
    let is_device = rig.output().unit() == "N" && inputs.contains(&Channel::Displacement);
    let mut all: Vec<(&str, Place)> = Vec::new();
    if let Some(first) = inputs.first() {
        all.push(("input", Place::Input(*first)));
    }
    all.push(("output", Place::Output));
    for own in rig.places() {
        let place = if *own == "valve" {
            Place::Valve
        } else {
            Place::Force
        };
        all.push((own, place));
    }
    if is_device {
        all.push(("force", Place::Device));
    }
    for channel in inputs {
        all.push((channel.name(), Place::Input(*channel)));
    }
    let found = all.iter().find(|(name, _)| *name == at);
    if let Some((_, place)) = found {
        return Ok(*place);
    }
    let mut names: Vec<&str> = all.iter().map(|(name, _)| *name).collect();
    // An oscillator has an input and a place of one name.
    names.dedup();
    let what = format!(
        "`{at}` is not a place of the kind {}: expected {}",
        rig.kind(),
        listed(&names)
    );
    wrong("at", at, what)
}

impl Compiled {
    /// The hypothesis `name` on a rig of this kind.
    pub fn new(name: &str, own: &Hypothesis, rig: &dyn Rig) -> Result<Self, Wrong> {
        if !is_name(name) {
            return wrong("", name, "expected a name of letters, digits and `_`");
        }
        let known = rig.effects();
        if known.iter().any(|effect| effect.candidate.effect == name) {
            let what = format!(
                "the kind {} has an effect of this name: choose another",
                rig.kind()
            );
            return wrong("", name, what);
        }
        if own.sentence.trim().is_empty() {
            return wrong(
                "sentence",
                "",
                "is empty: expected what the effect is, for the report",
            );
        }
        let place = place(&own.at, rig)?;
        let channels = channels(rig);
        let mut names: Vec<String> = SIGNALS.map(String::from).to_vec();
        names.extend(own.parameters.keys().cloned());
        names.extend(own.memory.keys().cloned());
        names.extend(channels.iter().map(|channel| channel.name().to_owned()));
        names.extend(rig.parameters().iter().map(|(name, _)| (*name).to_owned()));
        let own_names = own.parameters.keys().map(|key| ("parameters", key));
        for (section, key) in own_names.chain(own.memory.keys().map(|key| ("memory", key))) {
            if !is_name(key) {
                return wrong(section, key, "expected a name of letters, digits and `_`");
            }
            if names.iter().filter(|name| *name == key).count() > 1 || key == "pi" {
                let what =
                    "is the name of a signal, a channel or a nominal parameter: choose another";
                return wrong(format!("{section}.{key}"), key, what);
            }
        }
        let expression = |key: &str, text: &str| -> Result<Expression, Wrong> {
            let read = Expression::parse(text, &names);
            let read =
                read.or_else(|error: ExpressionError| wrong(key, text, error.to_string()))?;
            usable(&read, place, &names, own, (key, text))?;
            Ok(read)
        };
        let value = expression("value", &own.value)?;
        if place == Place::Valve && !own.memory.is_empty() {
            let what = "is not available at `valve`: put the effect at `input` or `output`";
            return wrong("memory", name, what);
        }
        let mut memory = Vec::new();
        for (key, own) in &own.memory {
            memory.push(remembered(key, own, &expression)?);
        }
        let mut compiled = Self {
            effect: kept(name),
            about: kept(own.sentence.trim()),
            look_alikes: Box::leak(own.like.iter().map(|name| kept(name)).collect()),
            place,
            value,
            parameters: Vec::new(),
            factors: Vec::new(),
            off: Vec::new(),
            starts: vec![Vec::new()],
            memory,
            channels,
            slots: names.len(),
        };
        for (key, parameter) in &own.parameters {
            compiled.add(key, parameter)?;
        }
        let is_size = |p: &EffectParameter| matches!(p.role, Role::Size { .. });
        if !compiled.parameters.iter().any(is_size) {
            let what = "has no size: expected a parameter whose range holds 0, where the effect is \
                absent, such as a relative change instead of a factor";
            return wrong("parameters", name, what);
        }
        compiled.is_absent_at_zero(&own.value)?;
        Ok(compiled)
    }

    fn add(&mut self, key: &str, own: &super::Parameter) -> Result<(), Wrong> {
        let at = |what: &str| format!("parameters.{key}{what}");
        let unit = units::Unit::parse(&own.unit)
            .or_else(|error| wrong(at(".unit"), &own.unit, error.to_string()))?;
        let [low, high] = own.range;
        let shown = format!("[{low}, {high}]");
        if !(low.is_finite() && high.is_finite() && low < high) {
            let what = format!("{shown}: expected the smallest and the largest value");
            return wrong(at(".range"), key, what);
        }
        let starts = own.start.values();
        if starts.is_empty() || !starts.iter().all(|start| (low..=high).contains(start)) {
            let what = format!("{starts:?}: expected one value or more within {shown}");
            return wrong(at(".start"), key, what);
        }
        let is_size = low <= 0.0 && 0.0 <= high;
        let smallest = starts
            .iter()
            .map(|start| start.abs())
            .fold(f64::INFINITY, f64::min);
        if is_size && smallest == 0.0 {
            let what = "0, where the effect is absent: expected a value that shows it";
            return wrong(at(".start"), key, what);
        }
        let (scale, role, off) = if is_size {
            let weak = WEAK * smallest;
            (Scale::Linear(weak), Role::Size { weak }, 0.0)
        } else {
            let typical = starts[0];
            let (scale, width) = if low > 0.0 {
                (Scale::Logarithmic, (high / low).ln())
            } else {
                (Scale::Linear(1.0), high - low)
            };
            let spread = 0.5 * width / DEVIATIONS;
            (scale, Role::Shape { typical, spread }, typical)
        };
        self.parameters.push(EffectParameter {
            name: kept(key),
            unit: kept(&own.unit),
            scale,
            role,
            bounds: (low, high),
        });
        self.factors.push(unit.factor);
        self.off.push(off);
        let before = std::mem::take(&mut self.starts);
        for begun in before {
            for start in starts {
                self.starts
                    .push(begun.iter().copied().chain([*start]).collect());
            }
        }
        if self.starts.len() > MOST_STARTS {
            let what = format!(
                "{} combinations of starts, more than {MOST_STARTS}: give fewer",
                self.starts.len()
            );
            return wrong(at(".start"), key, what);
        }
        Ok(())
    }

    /// What the engine searches.
    pub fn effect(&self) -> Effect {
        Effect {
            candidate: Candidate {
                look_alikes: self.look_alikes,
                ..Candidate::new(self.effect, self.parameters.clone(), self.starts.clone())
            },
            off: self.off.clone(),
            about: self.about,
            is_in_own_units: true,
        }
    }

    /// Whether these values of the parameters are those without the effect.
    pub fn is_off(&self, values: &[f64]) -> bool {
        let mut pairs = self.parameters.iter().zip(values);
        pairs.all(|(p, value)| matches!(p.role, Role::Shape { .. }) || *value == 0.0)
    }

    /// An effect must be nothing where its sizes are zero, or a search could not say that it is absent.
    fn is_absent_at_zero(&self, text: &str) -> Result<(), Wrong> {
        for u in [0.0, 1.0, -0.3, 0.02] {
            let mut values = vec![0.0; FIRST + self.parameters.len()];
            values[SIGNAL] = u;
            values[SIGNAL_RATE] = 0.7 * u;
            values[TIME] = 1.0;
            values[POSITION] = u;
            values[SPEED] = 0.7 * u;
            for ((slot, off), factor) in
                values[FIRST..].iter_mut().zip(&self.off).zip(&self.factors)
            {
                *slot = off * factor;
            }
            // What is remembered follows the signal or is at rest.
            let followed = |rest: f64| {
                let mut all = values.clone();
                all.extend(self.memory.iter().map(|_| rest));
                all.resize(self.slots, u);
                self.value.value(&all, &|place, _| all[place])
            };
            let wanted = match self.place {
                Place::Force | Place::Device => 0.0,
                _ => u,
            };
            let off = |value: f64| (value - wanted).abs() <= UNCHANGED * (1.0 + wanted.abs());
            let (at_rest, following) = (followed(0.0), followed(u));
            if !off(at_rest) && !off(following) {
                let what = format!(
                    "is {at_rest} where its sizes are 0 and {} is {u}: expected {wanted}, because an \
                     effect is absent there{}",
                    if wanted == u && u != 0.0 {
                        "`u`"
                    } else {
                        "the signal"
                    },
                    if matches!(self.place, Place::Force | Place::Device) {
                        ""
                    } else {
                        "; write `u + ...`"
                    }
                );
                return wrong("value", text, what);
            }
        }
        Ok(())
    }
}

/// Whether the names that an expression reads have a value at `place`; `key` and `text` are what it was read from.
fn usable(
    expression: &Expression,
    place: Place,
    names: &[String],
    own: &Hypothesis,
    (key, text): (&str, &str),
) -> Result<(), Wrong> {
    let (none, instead): (&[usize], &str) = match place {
        Place::Input(_) | Place::Output => {
            (&[POSITION, SPEED], "`u` is the signal and `du` its rate")
        }
        Place::Force | Place::Device => (
            &[SIGNAL, SIGNAL_RATE],
            "`x` is the displacement and `v` the velocity",
        ),
        Place::Valve => (
            &[SIGNAL_RATE, POSITION, SPEED],
            "`u` is what the controller sends",
        ),
    };
    if let Some(slot) = none.iter().find(|slot| expression.reads(**slot)) {
        let what = format!(
            "`{}` has no value at `{}`: {instead}",
            SIGNALS[*slot], own.at
        );
        return wrong(key, text, what);
    }
    let Some(delayed) = expression.delays() else {
        return Ok(());
    };
    let is_recorded = delayed >= FIRST + own.parameters.len() + own.memory.len();
    let is_signal = delayed == SIGNAL && matches!(place, Place::Input(_) | Place::Output);
    if is_recorded || is_signal {
        return Ok(());
    }
    let expected = match place {
        Place::Input(_) | Place::Output => "`u` or a channel",
        _ => "a channel",
    };
    let what = format!(
        "the past of `{}` is not kept: expected {expected}",
        names[delayed]
    );
    wrong(key, text, what)
}

fn remembered(
    key: &str,
    own: &Memory,
    expression: &impl Fn(&str, &str) -> Result<Expression, Wrong>,
) -> Result<(Expression, Course), Wrong> {
    let at = |what: &str| format!("memory.{key}{what}");
    let start = expression(&at(".start"), own.start.as_deref().unwrap_or("0"))?;
    let course = match (&own.rate, &own.next) {
        (Some(rate), None) => Course::Rate(expression(&at(".rate"), rate)?),
        (None, Some(next)) => Course::Next(expression(&at(".next"), next)?),
        _ => {
            let what = "expected `rate`, an expression of how fast it changes, or `next`, of its value \
                at each sample";
            return wrong(at(""), key, what);
        }
    };
    Ok((start, course))
}
