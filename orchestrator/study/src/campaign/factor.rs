//! Factors: what they may be, written in a study, and the value at a point of a design.

use serde::Deserialize;
use statrs::distribution::{ContinuousCDF, Normal};

use fmi_system::Setting;
use units::{Quantity, UnitError};

/// What a factor may be.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// These, one after the other.
    List(Vec<Setting>),
    /// Drawn.
    Drawn(Drawn),
}

/// A distribution with the unit of its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// The distribution.
    pub distribution: Distribution,
    /// Unit of its numbers, as it was written; empty for plain numbers.
    pub unit: String,
    /// Whether its numbers are times the value that the system has otherwise.
    pub is_relative: bool,
}

/// A distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distribution {
    /// Even between two bounds.
    Uniform(f64, f64),
    /// Even in its logarithm between two bounds.
    LogUniform(f64, f64),
    /// Gaussian: mean and standard deviation.
    Normal(f64, f64),
    /// Its logarithm is Gaussian: median and standard deviation of the natural logarithm.
    LogNormal(f64, f64),
    /// Whole numbers between two bounds, both among them.
    Integers(i64, i64),
}

/// Why a factor is not one.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FactorError {
    /// A table with other keys or types.
    #[error("{}", .0.message())]
    Table(#[from] toml::de::Error),
    /// A number or unit that cannot be read.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// A single value.
    #[error(
        "{0} is a single value; expected a list such as [1, 2] or a distribution such as {{ uniform = [1, 2] }}; \
         values that are the same in all runs belong in [fixed]"
    )]
    Single(toml::Value),
    /// A list of nothing.
    #[error("is an empty list")]
    Empty,
    /// A value that is listed twice.
    #[error("has `{0}` twice")]
    Twice(String),
    /// No distribution, or several.
    #[error("expected one of list, range, uniform, loguniform, normal, lognormal, integers")]
    Kinds,
    /// A key without the one that it belongs to.
    #[error("`{key}` belongs to {owner}")]
    Belongs {
        /// The key.
        key: &'static str,
        /// Where it belongs.
        owner: &'static str,
    },
    /// A range without its number of values.
    #[error("`range` needs `steps`, such as {{ range = [0.2, 1.0], steps = 5 }}")]
    NoSteps,
    /// A number of values that is too small or too large.
    #[error("steps = {0}; expected 2 to {MOST_VALUES}")]
    Steps(usize),
    /// Bounds in the wrong order.
    #[error("the range from {low} to {high} is empty")]
    EmptyRange {
        /// The lower bound.
        low: f64,
        /// The upper bound.
        high: f64,
    },
    /// Relative values with a unit.
    #[error("relative values are multiples of the system's own; expected plain numbers, not {0}")]
    RelativeUnit(String),
    /// Not a number.
    #[error("`{0}` is not a number")]
    NotANumber(String),
    /// A number without the unit of the other one.
    #[error("`{written}` has no unit; expected {unit}")]
    NoUnit {
        /// What was written.
        written: String,
        /// The unit.
        unit: String,
    },
    /// A number that has to be positive.
    #[error("{0} is not positive")]
    NotPositive(f64),
}

/// A factor's table as written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    list: Option<Vec<Setting>>,
    range: Option<[Setting; 2]>,
    steps: Option<usize>,
    uniform: Option<[Setting; 2]>,
    loguniform: Option<[Setting; 2]>,
    normal: Option<[Setting; 2]>,
    lognormal: Option<[Setting; 2]>,
    integers: Option<[i64; 2]>,
    #[serde(default)]
    relative: bool,
    of: Option<Vec<String>>,
}

/// Most values of a list: more are mistakes.
const MOST_VALUES: usize = 1_000_000;

impl Values {
    /// Reads a factor as written, and the variables that it names where its own name is none.
    ///
    /// # Errors
    /// What is wrong and what was expected.
    pub fn read(written: &toml::Value) -> Result<(Self, Option<Vec<String>>), FactorError> {
        let table = match written {
            toml::Value::Array(_) => {
                let list = written.clone().try_into()?;
                return Ok((Self::list(list)?, None));
            }
            toml::Value::Table(table) => table.clone(),
            single => return Err(FactorError::Single(single.clone())),
        };
        let mut written: Written = toml::Value::Table(table).try_into()?;
        let of = written.of.take();
        Ok((written.check()?, of))
    }

    fn list(values: Vec<Setting>) -> Result<Self, FactorError> {
        if values.is_empty() {
            return Err(FactorError::Empty);
        }
        for (place, value) in values.iter().enumerate() {
            if values[..place]
                .iter()
                .any(|other| other.to_string() == value.to_string())
            {
                return Err(FactorError::Twice(value.to_string()));
            }
        }
        Ok(Self::List(values))
    }

    /// How many there are; none where they are drawn.
    #[must_use]
    pub fn count(&self) -> Option<usize> {
        match self {
            Self::List(values) => Some(values.len()),
            Self::Drawn(_) => None,
        }
    }

    /// The value where the design has `at`, from 0 on and below 1.
    #[must_use]
    pub fn value(&self, at: f64) -> Setting {
        match self {
            Self::List(values) => {
                let place = (at * values.len() as f64) as usize;
                values[place.min(values.len() - 1)].clone()
            }
            Self::Drawn(drawn) => drawn.value(at),
        }
    }

    /// Whether its values are times what the system has otherwise.
    #[must_use]
    pub fn is_relative(&self) -> bool {
        matches!(self, Self::Drawn(drawn) if drawn.is_relative)
    }
}

impl Written {
    fn check(self) -> Result<Values, FactorError> {
        let Self {
            list,
            range,
            steps,
            uniform,
            loguniform,
            normal,
            lognormal,
            integers,
            relative,
            of: _,
        } = self;
        let given = [
            list.is_some(),
            range.is_some(),
            uniform.is_some(),
            loguniform.is_some(),
            normal.is_some(),
            lognormal.is_some(),
            integers.is_some(),
        ];
        if given.iter().filter(|given| **given).count() != 1 {
            return Err(FactorError::Kinds);
        }
        if range.is_none() && steps.is_some() {
            return Err(FactorError::Belongs {
                key: "steps",
                owner: "`range`",
            });
        }
        if relative && (list.is_some() || range.is_some() || integers.is_some()) {
            return Err(FactorError::Belongs {
                key: "relative",
                owner: "a distribution",
            });
        }
        if let Some(values) = list {
            return Values::list(values);
        }
        if let Some([low, high]) = range {
            let steps = steps.ok_or(FactorError::NoSteps)?;
            if !(2..=MOST_VALUES).contains(&steps) {
                return Err(FactorError::Steps(steps));
            }
            let (low, high, unit) = pair(&low, &high)?;
            ordered(low, high)?;
            let value = |step: usize| match step + 1 == steps {
                // To the digit.
                true => high,
                false => low + (high - low) * step as f64 / (steps - 1) as f64,
            };
            return Ok(Values::List(
                (0..steps)
                    .map(|step| with_unit(value(step), &unit))
                    .collect(),
            ));
        }
        if let Some([low, high]) = integers {
            if low > high {
                let (low, high) = (low as f64, high as f64);
                return Err(FactorError::EmptyRange { low, high });
            }
            return Ok(Values::Drawn(Drawn {
                distribution: Distribution::Integers(low, high),
                unit: String::new(),
                is_relative: false,
            }));
        }
        let (distribution, unit) = if let Some([low, high]) = uniform {
            let (low, high, unit) = pair(&low, &high)?;
            ordered(low, high)?;
            (Distribution::Uniform(low, high), unit)
        } else if let Some([low, high]) = loguniform {
            let (low, high, unit) = pair(&low, &high)?;
            ordered(low, high)?;
            positive(low)?;
            (Distribution::LogUniform(low, high), unit)
        } else if let Some([mean, deviation]) = normal {
            let (mean, unit) = quantity(&mean)?;
            let share = share(&deviation);
            let deviation = match share {
                Some(share) => share * mean.abs(),
                None => self::deviation(&deviation, &unit)?,
            };
            positive(deviation)?;
            (Distribution::Normal(mean, deviation), unit)
        } else {
            let [median, deviation] = lognormal.ok_or(FactorError::Kinds)?;
            let (median, unit) = quantity(&median)?;
            positive(median)?;
            let deviation = match share(&deviation) {
                Some(share) => share,
                None => self::deviation(&deviation, "")?,
            };
            positive(deviation)?;
            (Distribution::LogNormal(median, deviation), unit)
        };
        if relative && !unit.is_empty() {
            return Err(FactorError::RelativeUnit(unit));
        }
        Ok(Values::Drawn(Drawn {
            distribution,
            unit,
            is_relative: relative,
        }))
    }
}

impl Drawn {
    fn value(&self, at: f64) -> Setting {
        if let Distribution::Integers(low, high) = self.distribution {
            let count = (high - low) as f64 + 1.0;
            return Setting::Integer(low.saturating_add((at * count) as i64).min(high));
        }
        with_unit(self.distribution.quantile(at), &self.unit)
    }
}

impl Distribution {
    /// The value below which a share `at` of all lies.
    #[must_use]
    pub fn quantile(&self, at: f64) -> f64 {
        // The ends of a Gaussian lie nowhere.
        const EDGE: f64 = 1.0 / (1_u64 << 33) as f64;
        let gaussian = || Normal::standard().inverse_cdf(at.clamp(EDGE, 1.0 - EDGE));
        match *self {
            Self::Uniform(low, high) => low + (high - low) * at,
            Self::LogUniform(low, high) => low * (high / low).powf(at),
            Self::Normal(mean, deviation) => mean + deviation * gaussian(),
            Self::LogNormal(median, deviation) => median * (deviation * gaussian()).exp(),
            Self::Integers(low, high) => low as f64 + ((high - low) as f64 + 1.0) * at,
        }
    }
}

/// A number in a unit as a setting.
pub(crate) fn with_unit(value: f64, unit: &str) -> Setting {
    match unit {
        "" => Setting::Number(value),
        unit => Setting::Text(format!("{value:?} {unit}")),
    }
}

/// A number with the text of its unit.
fn quantity(written: &Setting) -> Result<(f64, String), FactorError> {
    match written {
        Setting::Integer(number) => Ok((*number as f64, String::new())),
        Setting::Number(number) if number.is_finite() => Ok((*number, String::new())),
        Setting::Text(text) => {
            let found = Quantity::parse(text)?;
            Ok((found.value, found.unit.text))
        }
        other => Err(FactorError::NotANumber(other.to_string())),
    }
}

/// Two numbers in the unit of the first.
fn pair(first: &Setting, second: &Setting) -> Result<(f64, f64, String), FactorError> {
    let (low, unit) = quantity(first)?;
    Ok((low, deviation(second, &unit)?, unit))
}

/// A number in `unit`.
fn deviation(written: &Setting, unit: &str) -> Result<f64, FactorError> {
    let (value, own) = quantity(written)?;
    if own == unit {
        return Ok(value);
    }
    if own.is_empty() {
        return Err(FactorError::NoUnit {
            written: written.to_string(),
            unit: unit.to_string(),
        });
    }
    Ok(units::convert(value, &own, unit)?)
}

/// The share in `"5 %"`.
fn share(written: &Setting) -> Option<f64> {
    let Setting::Text(text) = written else {
        return None;
    };
    let number = text.trim().strip_suffix('%')?.trim().parse::<f64>().ok()?;
    Some(number / 100.0)
}

fn ordered(low: f64, high: f64) -> Result<(), FactorError> {
    match low < high {
        true => Ok(()),
        false => Err(FactorError::EmptyRange { low, high }),
    }
}

fn positive(number: f64) -> Result<(), FactorError> {
    match number > 0.0 {
        true => Ok(()),
        false => Err(FactorError::NotPositive(number)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Values, FactorError> {
        let table: toml::Table = toml::from_str(&format!("x = {text}")).unwrap();
        Values::read(&table["x"]).map(|(values, _)| values)
    }

    #[test]
    fn values_keep_the_unit_in_which_they_were_written() {
        let even = read(r#"{ uniform = ["80 lbf/in", "120 lbf/in"] }"#).unwrap();
        assert_eq!(even.value(0.25), Setting::Text("90.0 lbf/in".into()));
        let mixed = read(r#"{ uniform = ["1 in", "50.8 mm"] }"#).unwrap();
        assert_eq!(mixed.value(0.5), Setting::Text("1.5 in".into()));
        let list = read("{ range = [0.2, 1.0], steps = 5 }").unwrap();
        assert_eq!(list.count(), Some(5));
        assert_eq!(list.value(0.99), Setting::Number(1.0));
        let whole = read("{ integers = [1, 3] }").unwrap();
        assert_eq!(whole.value(0.0), Setting::Integer(1));
        assert_eq!(whole.value(0.999), Setting::Integer(3));
    }

    /// Quantiles of the standard normal from tables: 84.134 % at 1, 97.725 % at 2.
    #[test]
    fn distributions_have_their_quantiles() {
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-6 * b.abs(), "{a} is not {b}");
        let quantile = |text, at| match read(text).unwrap().value(at) {
            Setting::Number(number) => number,
            other => panic!("{other}"),
        };
        close(
            quantile("{ normal = [10.0, 2.0] }", 0.841_344_746_068_543),
            12.0,
        );
        close(
            quantile(r#"{ normal = [10.0, "5 %"] }"#, 0.977_249_868_051_821),
            11.0,
        );
        close(
            quantile("{ lognormal = [3.0, 0.4] }", 0.841_344_746_068_543),
            3.0 * 0.4_f64.exp(),
        );
        close(quantile("{ loguniform = [0.5, 2.0] }", 0.5), 1.0);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        for (text, expected) in [
            ("5", "belong in [fixed]"),
            ("[]", "empty list"),
            ("[1, 1]", "`1` twice"),
            ("{ uniform = [2, 1] }", "range from 2 to 1 is empty"),
            ("{ integers = [2, 1] }", "range from 2 to 1 is empty"),
            (
                r#"{ uniform = ["1 in", 2] }"#,
                "`2` has no unit; expected in",
            ),
            (r#"{ uniform = ["1 in", "2 s"] }"#, "s"),
            ("{ loguniform = [0, 1] }", "not positive"),
            ("{ normal = [1, 0] }", "not positive"),
            ("{ range = [0, 1] }", "needs `steps`"),
            ("{ uniform = [0, 1], normal = [0, 1] }", "expected one of"),
            ("{ gauss = [0, 1] }", "gauss"),
            (
                r#"{ uniform = ["1 in", "2 in"], relative = true }"#,
                "plain numbers",
            ),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn numbers_and_units_are_read_as_they_are_written() {
        let number = |own| Setting::Number(own);
        assert_eq!(quantity(&number(1.5)), Ok((1.5, String::new())));
        assert_eq!(quantity(&Setting::Integer(-2)), Ok((-2.0, String::new())));
        assert_eq!(
            quantity(&Setting::Text("2.5 kN".into())),
            Ok((2.5, "kN".into()))
        );
        for wrong in [f64::NAN, f64::INFINITY] {
            assert_eq!(
                quantity(&number(wrong)),
                Err(FactorError::NotANumber(Setting::Number(wrong).to_string()))
            );
        }
        assert_eq!(share(&Setting::Text(" 5 % ".into())), Some(0.05));
        assert_eq!(share(&Setting::Text("5".into())), None);
        assert_eq!(share(&number(5.0)), None);
        assert_eq!(deviation(&Setting::Text("2000 mm".into()), "m"), Ok(2.0));
        assert_eq!(deviation(&number(2.0), ""), Ok(2.0));
        assert_eq!(with_unit(2.0, "mm"), Setting::Text("2.0 mm".into()));
        assert_eq!(with_unit(2.0, ""), number(2.0));
    }

    #[test]
    fn ranges_hold_both_ends_and_their_steps() {
        let Values::List(list) = read(r#"{ range = ["1 m", "2000 mm"], steps = 3 }"#).unwrap()
        else {
            panic!("no list");
        };
        let expected = ["1.0 m", "1.5 m", "2.0 m"];
        assert_eq!(list, expected.map(|text| Setting::Text(text.into())));
        assert!(read("{ range = [0, 1], steps = 2 }").is_ok());
        for (text, expected) in [
            (
                "{ range = [0, 1], steps = 1 }",
                "steps = 1; expected 2 to 1000000",
            ),
            (
                "{ range = [1, 1], steps = 2 }",
                "the range from 1 to 1 is empty",
            ),
            (
                "{ uniform = [0, 1], steps = 2 }",
                "`steps` belongs to `range`",
            ),
            (
                "{ list = [0, 1], relative = true }",
                "`relative` belongs to a distribution",
            ),
            (
                "{ integers = [0, 1], relative = true }",
                "`relative` belongs to a distribution",
            ),
            ("{ lognormal = [0, 1] }", "0 is not positive"),
            ("{ normal = [true, 1] }", "is not a number"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
        let list = read("[1, 2]").unwrap();
        assert_eq!((list.count(), list.is_relative()), (Some(2), false));
        assert_eq!(
            [0.0, 0.49, 0.5, 1.0].map(|at| list.value(at)),
            [1, 1, 2, 2].map(Setting::Integer)
        );
        let times = read("{ uniform = [0.5, 1.5], relative = true }").unwrap();
        assert_eq!((times.count(), times.is_relative()), (None, true));
        assert!(!read("{ uniform = [0.5, 1.5] }").unwrap().is_relative());
        let same = read("{ integers = [4, 4] }").unwrap();
        assert_eq!(
            [0.0, 1.0].map(|at| same.value(at)),
            [4, 4].map(Setting::Integer)
        );
    }

    #[test]
    fn quantiles_at_the_ends_are_finite() {
        assert_eq!(Distribution::Uniform(2.0, 6.0).quantile(0.25), 3.0);
        assert_eq!(Distribution::Integers(2, 5).quantile(0.5), 4.0);
        let [low, high] = [0.0, 1.0].map(|at| Distribution::Normal(10.0, 2.0).quantile(at));
        // A share of 2^-33 is 6.338 standard deviations off.
        assert!((high - 10.0 - 2.0 * 6.338).abs() < 0.001, "{high}");
        assert!((low + high - 20.0).abs() < 1e-6, "{low} {high}");
        let relative = read(r#"{ lognormal = [2.0, "10 %"] }"#).unwrap();
        let Setting::Number(own) = relative.value(0.841_344_746_068_543) else {
            panic!("no number");
        };
        assert!((own - 2.0 * 0.1_f64.exp()).abs() < 1e-6, "{own}");
    }
}
