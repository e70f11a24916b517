//! One row of a component's table of variables.

use std::ops::Deref;

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

/// The way to a variable's field.
pub enum Access<C> {
    /// A Float64 field.
    Real(fn(&mut C) -> &mut f64),
    /// A Float64 in a part of the component, found by a list outside it.
    Within(Place<C>),
    /// An element of an array of Float64.
    Element(fn(&mut C) -> &mut [f64], usize),
    /// An Int32 field.
    Integer(fn(&mut C) -> &mut i32),
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
            Self::Integer(_) => Type::Integer,
            Self::Boolean(_) => Type::Boolean,
            Self::Text(_) => Type::Text,
            Self::Choice(_, choices) => Type::Choice(*choices),
        }
    }

    /// Whether the variable is a Float64.
    #[inline]
    pub fn is_real(&self) -> bool {
        matches!(self, Self::Real(_) | Self::Within(_) | Self::Element(..))
    }

    /// What the field holds.
    fn value(&self, component: &mut C) -> Value {
        match self {
            Self::Real(field) => Value::Real(*field(component)),
            Self::Within(place) => Value::Real(*place(component)),
            Self::Element(field, index) => field(component)
                .get(*index)
                .map_or(Value::Missing, |value| Value::Real(*value)),
            Self::Integer(field) | Self::Choice(field, _) => Value::Integer(*field(component)),
            Self::Boolean(field) => Value::Boolean(*field(component)),
            Self::Text(field) => Value::Text(field(component).clone()),
        }
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
}

impl<C> Deref for Variable<C> {
    type Target = Declaration;

    #[inline]
    fn deref(&self) -> &Declaration {
        &self.declaration
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

    /// Declares that it depends directly on all of `knowns`.
    pub fn depends_on_all(self, knowns: &[Self], kind: Dependency) -> Self {
        let names: Vec<&str> = knowns.iter().map(|known| known.name.as_str()).collect();
        self.depends_on(&names, kind)
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
