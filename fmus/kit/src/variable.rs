//! One row of a component's table of variables.

use std::ops::Deref;

use units::{Parameter, Parameters, Slot};

/// Where a variable's value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Causality {
    /// Set before the simulation (or during it, if tunable).
    Parameter,
    /// Set by the importer at communication points.
    Input,
    /// Computed by the component for others.
    Output,
    /// Computed by the component for itself, visible to the importer.
    Local,
}

/// When a variable may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variability {
    /// Only before initialization ends.
    Fixed,
    /// A parameter that may be changed between steps.
    Tunable,
    /// At steps or events.
    Discrete,
    /// At any time.
    Continuous,
}

/// How an unknown depends on a known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dependency {
    /// In a way not said further.
    Dependent,
    /// Linearly, by a number.
    Constant,
    /// Linearly, by an expression of fixed parameters.
    Fixed,
}

/// One choice of an enumeration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Item {
    /// Name as shown to people.
    pub name: &'static str,
    /// Value as exchanged.
    pub value: i32,
    /// What the choice means.
    pub description: &'static str,
}

/// The choices that an enumeration variable has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Enumeration {
    /// Name of the type.
    pub name: &'static str,
    /// The choices.
    pub items: &'static [Item],
}

/// The way to a Float64 that takes more than a field's name.
pub type Place<C> = Box<dyn for<'a> Fn(&'a mut C) -> &'a mut f64 + Send + Sync>;

/// The way to a part of the component that says itself what its parameters are.
pub type Group<C> = fn(&mut C) -> &mut dyn Parameters;

/// What a parameter of a group is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Held {
    /// A Float64.
    Real,
    /// An Int32.
    Integer,
    /// An Int32 that counts.
    Count,
    /// A Boolean.
    Boolean,
}

impl From<&Slot<'_>> for Held {
    fn from(slot: &Slot<'_>) -> Self {
        match slot {
            Slot::Real(_) => Self::Real,
            Slot::Integer(_) => Self::Integer,
            Slot::Count(_) => Self::Count,
            Slot::Boolean(_) => Self::Boolean,
        }
    }
}

/// The way to a variable's field.
pub enum Access<C> {
    /// A Float64 field.
    Real(fn(&mut C) -> &mut f64),
    /// A Float64 in a part of the component, found by a list outside it.
    Within(Place<C>),
    /// An element of an array of Float64.
    Element(fn(&mut C) -> &mut [f64], usize),
    /// The parameter of a group at an index.
    Grouped(Group<C>, usize, Held),
    /// An Int32 field.
    Integer(fn(&mut C) -> &mut i32),
    /// A field that counts, an Int32.
    Count(fn(&mut C) -> &mut usize),
    /// A Boolean field.
    Boolean(fn(&mut C) -> &mut bool),
    /// A text field.
    Text(fn(&mut C) -> &mut String),
    /// An Int32 field that holds one of the choices.
    Choice(fn(&mut C) -> &mut i32, Enumeration),
}

/// The type of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Type {
    /// Float64, Real in FMI 2.0.
    Real,
    /// Int32.
    Integer,
    /// Boolean.
    Boolean,
    /// String.
    Text,
    /// An enumeration.
    Choice(Enumeration),
}

impl Type {
    /// As FMI 3.0 calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Real => "Float64",
            Self::Integer => "Int32",
            Self::Boolean => "Boolean",
            Self::Text => "String",
            Self::Choice(_) => "Enumeration",
        }
    }
}

impl<C> Access<C> {
    /// The type of what is there.
    pub fn kind(&self) -> Type {
        match self {
            Self::Real(_) | Self::Within(_) | Self::Element(..) => Type::Real,
            Self::Integer(_) | Self::Count(_) => Type::Integer,
            Self::Boolean(_) => Type::Boolean,
            Self::Text(_) => Type::Text,
            Self::Choice(_, choices) => Type::Choice(*choices),
            Self::Grouped(_, _, held) => match held {
                Held::Real => Type::Real,
                Held::Integer | Held::Count => Type::Integer,
                Held::Boolean => Type::Boolean,
            },
        }
    }

    /// Whether the variable is a Float64.
    #[inline]
    pub fn is_real(&self) -> bool {
        matches!(
            self,
            Self::Real(_) | Self::Within(_) | Self::Element(..) | Self::Grouped(_, _, Held::Real)
        )
    }

    /// Whether the variable is a number of things, which is never below zero.
    pub fn counts(&self) -> bool {
        matches!(self, Self::Count(_) | Self::Grouped(_, _, Held::Count))
    }

    /// The place of a Float64.
    #[inline]
    pub fn real<'a>(&self, component: &'a mut C) -> Option<&'a mut f64> {
        match self {
            Self::Real(field) => Some(field(component)),
            Self::Within(place) => Some(place(component)),
            Self::Element(field, index) => field(component).get_mut(*index),
            Self::Grouped(group, index, Held::Real) => match group(component).slot(*index) {
                Some(Slot::Real(place)) => Some(place),
                _ => None,
            },
            _ => None,
        }
    }

    /// The value of an Int32 or a choice.
    pub fn integer(&self, component: &mut C) -> Option<i32> {
        match self {
            Self::Integer(field) | Self::Choice(field, _) => Some(*field(component)),
            Self::Count(field) => i32::try_from(*field(component)).ok(),
            Self::Grouped(group, index, _) => match group(component).slot(*index)? {
                Slot::Integer(place) => Some(*place),
                Slot::Count(place) => i32::try_from(*place).ok(),
                _ => None,
            },
            _ => None,
        }
    }

    /// Sets an Int32 or a choice; `None` if it is of another type or counts and `value` is below zero.
    pub fn set_integer(&self, component: &mut C, value: i32) -> Option<()> {
        match self {
            Self::Integer(field) | Self::Choice(field, _) => *field(component) = value,
            Self::Count(field) => *field(component) = usize::try_from(value).ok()?,
            Self::Grouped(group, index, _) => match group(component).slot(*index)? {
                Slot::Integer(place) => *place = value,
                Slot::Count(place) => *place = usize::try_from(value).ok()?,
                _ => return None,
            },
            _ => return None,
        }
        Some(())
    }

    /// The place of a Boolean.
    pub fn boolean<'a>(&self, component: &'a mut C) -> Option<&'a mut bool> {
        match self {
            Self::Boolean(field) => Some(field(component)),
            Self::Grouped(group, index, Held::Boolean) => match group(component).slot(*index) {
                Some(Slot::Boolean(place)) => Some(place),
                _ => None,
            },
            _ => None,
        }
    }

    /// What the field holds.
    fn value(&self, component: &mut C) -> Value {
        let value = match self.kind() {
            Type::Real => self.real(component).map(|place| Value::Real(*place)),
            Type::Integer | Type::Choice(_) => self.integer(component).map(Value::Integer),
            Type::Boolean => self.boolean(component).map(|place| Value::Boolean(*place)),
            Type::Text => match self {
                Self::Text(field) => Some(Value::Text(field(component).clone())),
                _ => None,
            },
        };
        value.unwrap_or(Value::Missing)
    }
}

/// What a field holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A Float64.
    Real(f64),
    /// An Int32 or a choice.
    Integer(i32),
    /// A Boolean.
    Boolean(bool),
    /// A text.
    Text(String),
    /// Nothing: an element beyond the end of its array.
    Missing,
}

/// A row of the table without the way to the field, so that what reads it is compiled once and not
/// for every component.
pub struct Row<'a> {
    /// What the table says.
    pub declaration: &'a Declaration,
    /// The type.
    pub kind: Type,
    /// The start value.
    pub start: Value,
}

/// A type that a variable's field may have.
pub trait Scalar: Sized {
    /// Wraps the way to the field.
    fn access<C>(field: fn(&mut C) -> &mut Self) -> Access<C>;
}

impl Scalar for f64 {
    fn access<C>(field: fn(&mut C) -> &mut Self) -> Access<C> {
        Access::Real(field)
    }
}

impl Scalar for i32 {
    fn access<C>(field: fn(&mut C) -> &mut Self) -> Access<C> {
        Access::Integer(field)
    }
}

impl Scalar for usize {
    fn access<C>(field: fn(&mut C) -> &mut Self) -> Access<C> {
        Access::Count(field)
    }
}

impl Scalar for bool {
    fn access<C>(field: fn(&mut C) -> &mut Self) -> Access<C> {
        Access::Boolean(field)
    }
}

impl Scalar for String {
    fn access<C>(field: fn(&mut C) -> &mut Self) -> Access<C> {
        Access::Text(field)
    }
}

/// What a table says of a variable, but for the way to its field.
#[derive(Debug, Clone)]
pub struct Declaration {
    /// Name, unique in the component, with array elements as `name[1]`.
    pub name: String,
    /// What it means, in one line.
    pub description: String,
    /// Where its value comes from.
    pub causality: Causality,
    /// When it may change.
    pub variability: Variability,
    /// SI unit, such as `m/s2` or `N.s/m`; `None` if it has none.
    pub unit: Option<&'static str>,
    /// Unit of the laboratory, such as `in`.
    pub display_unit: Option<&'static str>,
    /// Smallest value accepted.
    pub min: Option<f64>,
    /// Largest value accepted.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// The inputs and states that it depends on at a communication point.
    pub dependencies: Vec<(String, Dependency)>,
    /// The inputs and parameters that its initial value depends on.
    pub initial_dependencies: Vec<String>,
    /// The continuous state whose time derivative it is.
    pub state: Option<String>,
}

impl Declaration {
    /// Whether the component computes it.
    #[inline]
    pub fn is_computed(&self) -> bool {
        matches!(self.causality, Causality::Output | Causality::Local)
    }
}

/// A variable of the component `C`: its name, its meaning and the way to its field.
///
/// The start value is what the field holds in `C::default()`.
pub struct Variable<C> {
    /// Name, meaning, units, dependencies.
    pub declaration: Declaration,
    /// The way to the field.
    pub access: Access<C>,
    /// How it depends on all inputs of its table, until these are known.
    on_inputs: Option<Dependency>,
}

impl<C> Deref for Variable<C> {
    type Target = Declaration;

    #[inline]
    fn deref(&self) -> &Declaration {
        &self.declaration
    }
}

impl<C> IntoIterator for Variable<C> {
    type Item = Self;
    type IntoIter = std::iter::Once<Self>;

    fn into_iter(self) -> Self::IntoIter {
        std::iter::once(self)
    }
}

/// What is changed of the rows of a group.
pub trait Rows: Sized {
    /// Puts `prefix` before each name.
    #[must_use]
    fn prefixed(self, prefix: &str) -> Self;
    /// Gives all of them one meaning.
    #[must_use]
    fn about(self, description: &str) -> Self;
    /// Puts `words` before each meaning, which then begins small.
    #[must_use]
    fn introduced(self, words: &str) -> Self;
    /// Leaves out those with these names.
    #[must_use]
    fn without(self, names: &[&str]) -> Self;
    /// Lets those with these names be changed between steps.
    #[must_use]
    fn tunable(self, names: &[&str]) -> Self;
}

impl<C> Rows for Vec<Variable<C>> {
    fn prefixed(mut self, prefix: &str) -> Self {
        for row in &mut self {
            row.declaration.name.insert_str(0, prefix);
        }
        self
    }

    fn about(mut self, description: &str) -> Self {
        for row in &mut self {
            row.declaration.description = description.into();
        }
        self
    }

    fn introduced(mut self, words: &str) -> Self {
        for row in &mut self {
            let told = std::mem::take(&mut row.declaration.description);
            let mut letters = told.chars();
            let first = letters.next().map(|letter| letter.to_ascii_lowercase());
            row.declaration.description = words.chars().chain(first).chain(letters).collect();
        }
        self
    }

    fn without(mut self, names: &[&str]) -> Self {
        self.retain(|row| !names.contains(&row.name.as_str()));
        self
    }

    fn tunable(mut self, names: &[&str]) -> Self {
        for row in &mut self {
            if names.contains(&row.name.as_str()) {
                row.declaration.variability = Variability::Tunable;
            }
        }
        self
    }
}

impl<C> Variable<C> {
    fn new(name: String, causality: Causality, access: Access<C>) -> Self {
        let variability = match causality {
            Causality::Parameter => Variability::Fixed,
            _ if access.is_real() => Variability::Continuous,
            _ => Variability::Discrete,
        };
        let declaration = Declaration {
            name,
            description: String::new(),
            causality,
            variability,
            unit: None,
            display_unit: None,
            min: None,
            max: None,
            nominal: None,
            dependencies: Vec::new(),
            initial_dependencies: Vec::new(),
            state: None,
        };
        Self {
            declaration,
            access,
            on_inputs: None,
        }
    }

    /// An input.
    pub fn input<T: Scalar>(name: &str, field: fn(&mut C) -> &mut T) -> Self {
        Self::new(name.into(), Causality::Input, T::access(field))
    }

    /// An output.
    pub fn output<T: Scalar>(name: &str, field: fn(&mut C) -> &mut T) -> Self {
        Self::new(name.into(), Causality::Output, T::access(field))
    }

    /// A parameter, fixed unless made [`tunable`](Self::tunable).
    pub fn parameter<T: Scalar>(name: &str, field: fn(&mut C) -> &mut T) -> Self {
        Self::new(name.into(), Causality::Parameter, T::access(field))
    }

    /// A parameter of a part of the component, which a list outside it describes.
    pub fn parameter_within(
        name: String,
        place: impl for<'a> Fn(&'a mut C) -> &'a mut f64 + Send + Sync + 'static,
    ) -> Self {
        Self::new(name, Causality::Parameter, Access::Within(Box::new(place)))
    }

    /// The parameters of a part of the component that says itself what they are.
    pub fn group(group: Group<C>) -> Vec<Self>
    where
        C: Default,
    {
        let mut rows = Vec::new();
        let mut row = |parameter: &Parameter, slot: Slot<'_>| {
            let access = Access::Grouped(group, rows.len(), Held::from(&slot));
            let mut row = Self::new(parameter.name.into(), Causality::Parameter, access);
            row.declaration.description = parameter.about.into();
            row.declaration.unit = parameter.unit;
            row.declaration.display_unit = parameter.shown;
            rows.push(row.between(parameter.min, parameter.max));
        };
        group(&mut C::default()).visit(&mut |parameter, slot| row(parameter, slot));
        rows
    }

    /// A local variable, such as a continuous state.
    pub fn local<T: Scalar>(name: &str, field: fn(&mut C) -> &mut T) -> Self {
        Self::new(name.into(), Causality::Local, T::access(field))
    }

    /// A parameter that takes one of the choices of an enumeration.
    pub fn choice(name: &str, choices: Enumeration, field: fn(&mut C) -> &mut i32) -> Self {
        Self::parameter(name, field).choices(choices)
    }

    /// Makes an integer variable one of the choices of an enumeration.
    pub fn choices(mut self, choices: Enumeration) -> Self {
        if let Access::Integer(field) = self.access {
            self.access = Access::Choice(field, choices);
        }
        self
    }

    /// The elements `name[1]` to `name[count]` of an array.
    pub fn array(
        name: &str,
        causality: Causality,
        count: usize,
        field: fn(&mut C) -> &mut [f64],
    ) -> Vec<Self> {
        (0..count)
            .map(|i| {
                let name = format!("{name}[{}]", i + 1);
                Self::new(name, causality, Access::Element(field, i))
            })
            .collect()
    }

    /// Says what the variable means, in one line.
    pub fn about(mut self, description: &str) -> Self {
        self.declaration.description = description.into();
        self
    }

    /// Gives the SI unit.
    pub fn unit(mut self, unit: &'static str) -> Self {
        self.declaration.unit = Some(unit);
        self
    }

    /// Gives the unit in which a laboratory wants to see it.
    pub fn shown_in(mut self, unit: &'static str) -> Self {
        self.declaration.display_unit = Some(unit);
        self
    }

    /// Gives the SI unit and the one in which a laboratory wants to see it.
    pub fn measured_in(mut self, unit: &'static str, shown: Option<&'static str>) -> Self {
        self.declaration.unit = Some(unit);
        self.declaration.display_unit = shown;
        self
    }

    /// Gives the smallest and the largest value accepted, where there are such.
    pub fn between(mut self, min: Option<f64>, max: Option<f64>) -> Self {
        self.declaration.min = min;
        self.declaration.max = max;
        self
    }

    /// Gives the smallest value accepted.
    pub fn min(mut self, min: f64) -> Self {
        self.declaration.min = Some(min);
        self
    }

    /// Gives the largest value accepted.
    pub fn max(mut self, max: f64) -> Self {
        self.declaration.max = Some(max);
        self
    }

    /// Gives the typical magnitude.
    pub fn nominal(mut self, nominal: f64) -> Self {
        self.declaration.nominal = Some(nominal);
        self
    }

    /// Makes it change at steps and events only.
    pub fn discrete(mut self) -> Self {
        self.declaration.variability = Variability::Discrete;
        self
    }

    /// Lets a parameter be changed between steps.
    pub fn tunable(mut self) -> Self {
        self.declaration.variability = Variability::Tunable;
        self
    }

    /// Declares that it depends directly on inputs or states.
    pub fn depends_on(mut self, names: &[&str], kind: Dependency) -> Self {
        self.declaration
            .dependencies
            .extend(names.iter().map(|name| (name.to_string(), kind)));
        self
    }

    /// Declares that it depends directly on all inputs of its table.
    pub fn depends_on_inputs(mut self, kind: Dependency) -> Self {
        self.on_inputs = Some(kind);
        self
    }

    /// Names the inputs for the rows of which all are dependencies.
    #[doc(hidden)]
    pub fn resolve_inputs(table: &mut [Self]) {
        let is_input = |row: &&Self| row.causality == Causality::Input;
        let inputs: Vec<String> = table
            .iter()
            .filter(is_input)
            .map(|row| row.name.clone())
            .collect();
        for row in table {
            if let Some(kind) = row.on_inputs.take() {
                let all = inputs.iter().map(|name| (name.clone(), kind));
                row.declaration.dependencies.extend(all);
            }
        }
    }

    /// Declares that its initial value depends on inputs or parameters.
    pub fn initially_depends_on<S: AsRef<str>>(mut self, names: &[S]) -> Self {
        self.declaration
            .initial_dependencies
            .extend(names.iter().map(|name| name.as_ref().to_string()));
        self
    }

    /// Declares it the time derivative of a continuous state, an output or local of the table.
    pub fn derivative_of(mut self, state: &str) -> Self {
        self.declaration.state = Some(state.into());
        self
    }

    /// The row without the way to the field; `start` is a component as it begins.
    pub fn row(&self, start: &mut C) -> Row<'_> {
        Row {
            declaration: &self.declaration,
            kind: self.access.kind(),
            start: self.access.value(start),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default, units::Parameters)]
    struct Law {
        /// Gain of the loop.
        #[parameter("V/m" => "V/in", min = 0.5, max = 2.0)]
        gain: f64,
        /// Samples.
        #[parameter]
        samples: usize,
        /// Choice.
        #[parameter]
        choice: i32,
        /// Switch.
        #[parameter]
        on: bool,
    }

    #[derive(Default)]
    struct Example {
        law: Law,
        input: f64,
    }

    fn rows() -> Vec<Variable<Example>> {
        crate::table! { Example, s:
            output("before", s.input, "Depends on the input below").depends_on_inputs(Dependency::Fixed);
            group(s.law).prefixed("own_").without(&["own_choice"]);
            group(s.law).about("The same").introduced("Not quite ");
            input("input", s.input, "Input");
        }
    }

    #[test]
    fn a_group_has_a_row_for_each_of_its_parameters() {
        let rows = rows();
        let names: Vec<&str> = rows.iter().map(|row| row.name.as_str()).collect();
        let own = ["before", "own_gain", "own_samples", "own_on"];
        let whole = ["gain", "samples", "choice", "on", "input"];
        assert_eq!(names, [&own[..], &whole].concat());
        assert_eq!(rows[0].dependencies, [("input".into(), Dependency::Fixed)]);
        let gain = &rows[1];
        assert_eq!(gain.causality, Causality::Parameter);
        assert_eq!(gain.description, "Gain of the loop");
        assert_eq!((gain.unit, gain.display_unit), (Some("V/m"), Some("V/in")));
        assert_eq!((gain.min, gain.max), (Some(0.5), Some(2.0)));
        assert_eq!(rows[4].description, "Not quite the same");
        let kinds = rows.iter().map(|row| row.access.kind().name());
        let [real, whole, yes] = ["Float64", "Int32", "Boolean"];
        assert!(kinds.eq([real, real, whole, yes, real, whole, whole, yes, real]));
    }

    #[test]
    fn a_row_of_a_group_leads_to_its_field() {
        let (rows, mut example) = (rows(), Example::default());
        let access = |index: usize| &rows[index].access;
        *access(1).real(&mut example).unwrap() = 1.5;
        *access(3).boolean(&mut example).unwrap() = true;
        access(2).set_integer(&mut example, 4).unwrap();
        access(6).set_integer(&mut example, -3).unwrap();
        let Law {
            gain,
            samples,
            choice,
            on,
        } = example.law;
        assert_eq!((gain, samples, choice, on), (1.5, 4, -3, true));
        assert_eq!(access(5).integer(&mut example), Some(4));
        assert_eq!(access(6).integer(&mut example), Some(-3));
        assert_eq!(access(7).boolean(&mut example), Some(&mut true));
        // Of another type, or below zero where it counts.
        assert!(access(1).integer(&mut example).is_none());
        assert!(access(2).real(&mut example).is_none());
        assert!(access(2).set_integer(&mut example, -1).is_none());
        assert!(access(2).counts() && !access(6).counts());
        assert_eq!(example.law.samples, 4);
    }
}
