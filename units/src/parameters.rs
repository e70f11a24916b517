//! Parameters that say themselves what they are: name, meaning, units and range, once.

/// What a parameter is, but for the way to its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its name, as components show it.
    pub name: &'static str,
    /// What it means, in one line.
    pub about: &'static str,
    /// SI unit in the notation of FMI, such as `N.s/m`; `None` if it has none.
    pub unit: Option<&'static str>,
    /// Unit in which a laboratory wants to see it, such as `lbf.s/in`.
    pub shown: Option<&'static str>,
    /// Smallest value that a component accepts.
    pub min: Option<f64>,
    /// Largest value that a component accepts.
    pub max: Option<f64>,
    /// What [`Parameters::check`] asks of it.
    pub range: Range,
}

/// What is asked of a parameter's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Range {
    /// Nothing.
    Any,
    /// A finite number.
    Finite,
    /// A finite number above zero.
    Positive,
    /// A finite number, zero or above.
    NonNegative,
}

impl Range {
    /// Whether `value` is inside.
    #[must_use]
    pub fn holds(self, value: f64) -> bool {
        match self {
            Self::Any => true,
            Self::Finite => value.is_finite(),
            Self::Positive => value.is_finite() && value > 0.0,
            Self::NonNegative => value.is_finite() && value >= 0.0,
        }
    }

    /// The range in words.
    #[must_use]
    pub fn expected(self) -> &'static str {
        match self {
            Self::Any => "any value",
            Self::Finite => "a finite number",
            Self::Positive => "a positive number",
            Self::NonNegative => "zero or a positive number",
        }
    }
}

/// A parameter's value outside its range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("parameter `{}` is {value}, expected {}", parameter.name, parameter.range.expected())]
pub struct OutOfRange {
    /// The parameter.
    pub parameter: &'static Parameter,
    /// What was given.
    pub value: f64,
}

/// The place of a parameter's value.
#[derive(Debug, PartialEq)]
pub enum Slot<'a> {
    /// A number.
    Real(&'a mut f64),
    /// A whole number.
    Integer(&'a mut i32),
    /// A number of things.
    Count(&'a mut usize),
    /// Yes or no.
    Boolean(&'a mut bool),
}

macro_rules! slots {
    ($($kind:ident $type:ty;)*) => {$(
        impl<'a> From<&'a mut $type> for Slot<'a> {
            fn from(place: &'a mut $type) -> Self {
                Self::$kind(place)
            }
        }
    )*};
}

slots! {
    Real f64;
    Integer i32;
    Count usize;
    Boolean bool;
}

/// A struct whose fields are parameters. Derive it:
///
/// ```
/// use units::Parameters;
///
/// #[derive(Clone, Parameters)]
/// #[parameters(prefix = "storey_")]
/// struct Storey {
///     /// Mass of the storey.
///     #[parameter("kg" => "lbf.s2/in", positive)]
///     mass: f64,
///     /// Damping of the storey.
///     #[parameter("N.s/m", min = 0.0)]
///     damping: f64,
///     /// Not a parameter.
///     drift: f64,
/// }
///
/// let storey = Storey { mass: -1.0, damping: 20.0, drift: 0.0 };
/// assert_eq!(storey.named(), [("storey_mass", -1.0), (Storey::STOREY_DAMPING, 20.0)]);
/// let error = storey.check().unwrap_err().to_string();
/// assert_eq!(error, "parameter `storey_mass` is -1, expected a positive number");
/// ```
///
/// The name is that of the field behind the struct's `prefix`; `name = "..."` or `name = CONSTANT`
/// gives another. Each name that is a literal becomes a constant of the struct. The description is
/// the first paragraph of the doc comment without its full stop and its unit, or `about = "..."`.
/// Then come the unit with the unit shown, `min` and `max` for components, and what
/// [`check`](Self::check) asks for: `finite`, `positive` or `non_negative`. Of an array, each
/// element has an attribute that begins with its index. `#[parameters]` on a field takes in the
/// parameters of a struct.
pub trait Parameters {
    /// Calls `visit` with every parameter and the place of its value, in the order of the fields.
    fn visit<'visited>(
        &'visited mut self,
        visit: &mut dyn FnMut(&'static Parameter, Slot<'visited>),
    );

    /// The place of the value of the parameter at `index`.
    fn slot(&mut self, index: usize) -> Option<Slot<'_>> {
        let (mut found, mut at) = (None, 0);
        self.visit(&mut |_, slot| {
            if at == index {
                found = Some(slot);
            }
            at += 1;
        });
        found
    }

    /// The parameters that are numbers, by name.
    fn named(&self) -> Vec<(&'static str, f64)>
    where
        Self: Clone,
    {
        let mut named = Vec::new();
        self.clone().visit(&mut |parameter, slot| {
            if let Slot::Real(value) = slot {
                named.push((parameter.name, *value));
            }
        });
        named
    }

    /// Checks that every number is in its range.
    ///
    /// # Errors
    /// The first that is not.
    fn check(&self) -> Result<(), OutOfRange>
    where
        Self: Clone,
    {
        let mut wrong = None;
        self.clone().visit(&mut |parameter, slot| {
            if let Slot::Real(&mut value) = slot
                && wrong.is_none()
                && !parameter.range.holds(value)
            {
                wrong = Some(OutOfRange { parameter, value });
            }
        });
        wrong.map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units_derive::Parameters;

    #[derive(Clone, Parameters)]
    struct Inner {
        #[parameter(about = "Turned on", name = "is_on")]
        on: bool,
        /// Gain
        /// of the loop, V/m.
        ///
        /// More words.
        #[parameter("V/m" => "V/in", finite, max = 2.0)]
        gain: f64,
    }

    const NAME: &str = "elsewhere";

    #[derive(Clone, Parameters)]
    struct Outer {
        #[parameter(0, name = "first", about = "One", non_negative)]
        #[parameter(1, name = "last[2]", about = "Two", positive)]
        pair: [f64; 2],
        #[parameters]
        inner: Inner,
        /// Samples.
        #[parameter(name = NAME)]
        samples: usize,
        /// No parameter.
        memory: f64,
    }

    fn example() -> Outer {
        Outer {
            pair: [0.0, 1.0],
            inner: Inner {
                on: true,
                gain: 3.0,
            },
            samples: 4,
            memory: f64::NAN,
        }
    }

    #[test]
    fn the_table_has_every_field_in_order() {
        let mut outer = example();
        let mut seen = Vec::new();
        outer.visit(&mut |parameter, slot| seen.push((parameter.name, slot)));
        assert_eq!(
            seen,
            [
                (Outer::FIRST, Slot::Real(&mut 0.0)),
                (Outer::LAST_2, Slot::Real(&mut 1.0)),
                (Inner::IS_ON, Slot::Boolean(&mut true)),
                (Inner::GAIN, Slot::Real(&mut 3.0)),
                (NAME, Slot::Count(&mut 4)),
            ]
        );
        assert_eq!(outer.slot(4), Some(Slot::Count(&mut 4)));
        assert_eq!(outer.slot(5), None);
        assert_eq!(
            outer.named(),
            [("first", 0.0), ("last[2]", 1.0), ("gain", 3.0)]
        );
        assert!(outer.memory.is_nan());
    }

    #[test]
    fn a_row_says_what_its_attribute_and_its_documentation_say() {
        let mut rows = Vec::new();
        example().visit(&mut |parameter, _| rows.push(*parameter));
        let gain = Parameter {
            name: "gain",
            about: "Gain of the loop",
            unit: Some("V/m"),
            shown: Some("V/in"),
            min: None,
            max: Some(2.0),
            range: Range::Finite,
        };
        assert_eq!(rows[3], gain);
        assert_eq!(rows[1].about, "Two");
    }

    #[test]
    fn what_is_out_of_range_is_refused_by_name() {
        let refused = |change: fn(&mut Outer)| {
            let mut outer = example();
            change(&mut outer);
            let refused = outer.check().err();
            refused.map(|wrong| wrong.parameter.name)
        };
        assert_eq!(refused(|_| ()), None);
        assert_eq!(refused(|o| o.pair[0] = -1e-9), Some("first"));
        assert_eq!(refused(|o| o.pair[1] = 0.0), Some("last[2]"));
        assert_eq!(refused(|o| o.pair = [f64::INFINITY; 2]), Some("first"));
        assert_eq!(refused(|o| o.inner.gain = f64::NAN), Some("gain"));
    }
}
