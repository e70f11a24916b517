//! What is done to a value on its way along a connection: conversions between units, and the
//! transformations that a file gives.

use fmi_import::{BaseUnit, Kind, Linear};
use units::{Unit, UnitError};

/// A unit that a file names, and what it is in SI where the file says so.
#[derive(Debug, Clone, PartialEq)]
pub struct DeclaredUnit {
    /// Its name.
    pub name: String,
    /// In SI.
    pub base: Option<BaseUnit>,
}

/// What is done to a value after its unit was converted.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Transformation {
    /// Nothing.
    #[default]
    None,
    /// `factor * value + offset`, in the unit of the end.
    Linear {
        /// The factor.
        factor: f64,
        /// The offset.
        offset: f64,
    },
    /// Whole numbers and truth values for others.
    Numbers(Vec<(f64, f64)>),
    /// Choices for others, by their names.
    Names(Vec<(String, String)>),
}

/// A part of the way, between two connectors.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Hop {
    /// The unit of the connector at its end, where the file declares one.
    pub end: Option<DeclaredUnit>,
    /// Units are not converted.
    pub suppresses_units: bool,
    /// What is done then.
    pub transformation: Transformation,
}

/// A whole way: the unit that the file declares where it begins, and its parts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Way {
    /// The unit of the connector where it begins, where the file declares one.
    pub start: Option<DeclaredUnit>,
    /// Its parts, in the direction of the value; none: one without declared units.
    pub hops: Vec<Hop>,
}

/// What comes of a value on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Passage {
    /// The factor.
    pub factor: f64,
    /// Added after the factor.
    pub offset: f64,
    /// Values for others in place of factor and offset; one that is not there stays as it is.
    pub map: Vec<(f64, f64)>,
}

impl Passage {
    /// What comes of a value.
    #[must_use]
    pub fn of(&self, value: f64) -> f64 {
        if !self.map.is_empty() {
            let found = self.map.iter().find(|(from, _)| *from == value);
            return found.map_or(value, |(_, to)| *to);
        }
        self.linear_part().of(value)
    }

    /// Factor and offset alone; none where values are mapped.
    #[must_use]
    pub fn linear(&self) -> Option<Linear> {
        self.map.is_empty().then(|| self.linear_part())
    }

    fn linear_part(&self) -> Linear {
        Linear {
            factor: self.factor,
            offset: self.offset,
        }
    }
}

impl Passage {
    /// Whether values stay as they are, to the bit.
    #[must_use]
    pub fn is_nothing(&self) -> bool {
        self.map.is_empty() && self.factor == 1.0 && self.offset == 0.0
    }

    /// How much what comes of a value changes with it.
    #[must_use]
    pub fn slope(&self) -> f64 {
        match self.map.is_empty() {
            true => self.factor,
            false => 0.0,
        }
    }
}

/// An end of a way: its type, its unit and what that is in SI, as its FMU describes it.
#[derive(Debug, Clone, Copy)]
pub struct End<'a> {
    /// The type.
    pub kind: &'a Kind,
    /// The unit's name.
    pub unit: Option<&'a str>,
    /// In SI.
    pub base: Option<BaseUnit>,
}

/// Why no value can pass between two ends.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WayError {
    /// A unit that cannot be read, or two of different quantities.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// One unit's name for two units.
    #[error("both are in `{name}`, but that is {from} in one FMU and {to} in the other")]
    TwoMeanings {
        /// The unit.
        name: String,
        /// In SI, where the way begins.
        from: String,
        /// In SI, where it ends.
        to: String,
    },
    /// Units of different quantities.
    #[error("`{from}` is {from_si} and `{to}` is {to_si}")]
    Quantities {
        /// Where the way begins.
        from: String,
        /// The same in SI.
        from_si: String,
        /// Where it ends.
        to: String,
        /// The same in SI.
        to_si: String,
    },
    /// A map and a factor on one way.
    #[error("values are both mapped and scaled; expected one of the two")]
    MappedAndScaled,
    /// A linear transformation of something else.
    #[error("a linear transformation is for real numbers, and this is a {0}")]
    NotReal(&'static str),
    /// An endless transformation.
    #[error("factor {factor} and offset {offset} are not finite")]
    NotFinite {
        /// The factor.
        factor: f64,
        /// The offset.
        offset: f64,
    },
    /// Names for something without choices.
    #[error("names are mapped, and this is a {0}")]
    NoChoices(&'static str),
    /// A name that is not among the choices.
    #[error("`{0}` is not a choice")]
    NotAChoice(String),
}

impl Way {
    /// What comes of a value between two ends.
    ///
    /// # Errors
    /// Units that do not fit, transformations that do not fit the types.
    pub(super) fn between(&self, from: End, to: End) -> Result<Passage, WayError> {
        let mut passage = Passage {
            factor: 1.0,
            offset: 0.0,
            map: Vec::new(),
        };
        let mut unit = declared(self.start.as_ref(), (from.unit, from.base));
        let plain = [Hop::default()];
        let hops = if self.hops.is_empty() {
            &plain[..]
        } else {
            &self.hops[..]
        };
        for (place, hop) in hops.iter().enumerate() {
            let is_last = place + 1 == hops.len();
            let own = if is_last {
                (to.unit, to.base)
            } else {
                (None, None)
            };
            let end = declared(hop.end.as_ref(), own);
            if !hop.suppresses_units {
                let (factor, offset) = conversion(unit, end)?;
                passage.then(factor, offset);
            }
            if end.0.is_some() || hop.suppresses_units {
                unit = end;
            }
            passage.transform(&hop.transformation, from.kind, to.kind)?;
        }
        if !passage.map.is_empty() && (passage.factor != 1.0 || passage.offset != 0.0) {
            return Err(WayError::MappedAndScaled);
        }
        Ok(passage)
    }

    /// Whether types are chosen by a map of values, which may lead from one type to another.
    pub(super) fn maps(&self) -> bool {
        let mapped = |hop: &Hop| {
            matches!(
                hop.transformation,
                Transformation::Numbers(_) | Transformation::Names(_)
            )
        };
        self.hops.iter().any(mapped)
    }
}

impl Passage {
    fn then(&mut self, factor: f64, offset: f64) {
        // Factors of one keep the bits of what they are applied to.
        if factor != 1.0 {
            self.factor *= factor;
            self.offset *= factor;
        }
        if offset != 0.0 {
            self.offset += offset;
        }
    }

    fn transform(
        &mut self,
        transformation: &Transformation,
        from: &Kind,
        to: &Kind,
    ) -> Result<(), WayError> {
        let map = match transformation {
            Transformation::None => return Ok(()),
            Transformation::Linear { factor, offset } => {
                let is_float = |kind: &Kind| matches!(kind, Kind::Float64 | Kind::Float32);
                if !is_float(to) {
                    return Err(WayError::NotReal(to.name()));
                }
                let (factor, offset) = (*factor, *offset);
                if !(factor.is_finite() && offset.is_finite()) {
                    return Err(WayError::NotFinite { factor, offset });
                }
                self.then(factor, offset);
                return Ok(());
            }
            Transformation::Numbers(map) => map.clone(),
            Transformation::Names(names) => {
                let value = |kind: &Kind, name: &String| {
                    let Kind::Enumeration(items) = kind else {
                        return Err(WayError::NoChoices(kind.name()));
                    };
                    let item = items.iter().find(|item| item.name == *name);
                    item.map(|item| item.value as f64)
                        .ok_or_else(|| WayError::NotAChoice(name.clone()))
                };
                let pairs = names.iter();
                pairs
                    .map(|(source, target)| Ok((value(from, source)?, value(to, target)?)))
                    .collect::<Result<Vec<_>, WayError>>()?
            }
        };
        self.map = if self.map.is_empty() {
            map
        } else {
            let second = |value: f64| {
                let found = map.iter().find(|(from, _)| *from == value);
                found.map_or(value, |(_, to)| *to)
            };
            self.map
                .iter()
                .map(|&(from, to)| (from, second(to)))
                .collect()
        };
        Ok(())
    }
}

/// A unit as a description names it, and what it is in SI where the description says so.
pub(super) type NamedUnit<'a> = (Option<&'a str>, Option<BaseUnit>);

/// What a file declares goes before what the FMU says; its definition is the FMU's where the file
/// gives none.
fn declared<'a>(unit: Option<&'a DeclaredUnit>, own: NamedUnit<'a>) -> NamedUnit<'a> {
    match unit {
        None => own,
        Some(unit) if unit.base.is_none() && own.0 == Some(unit.name.as_str()) => own,
        Some(unit) => (Some(&unit.name), unit.base),
    }
}

/// Factor and offset from one unit to the other; a side without a unit takes the other's.
///
/// # Errors
/// Units of different quantities, or the same name for two.
pub(super) fn conversion(from: NamedUnit, to: NamedUnit) -> Result<(f64, f64), WayError> {
    let ((Some(name), base), (Some(target), target_base)) = (from, to) else {
        return Ok((1.0, 0.0));
    };
    let (Some(base), Some(target_base)) = (base, target_base) else {
        if name == target {
            return Ok((1.0, 0.0));
        }
        let factor = Unit::parse(name)?.factor_to(&Unit::parse(target)?)?;
        return Ok((factor, 0.0));
    };
    if base == target_base {
        return Ok((1.0, 0.0));
    }
    if name == target {
        return Err(WayError::TwoMeanings {
            name: name.to_string(),
            from: in_si(&base),
            to: in_si(&target_base),
        });
    }
    if base.exponents != target_base.exponents {
        return Err(WayError::Quantities {
            from: name.to_string(),
            from_si: in_si(&base),
            to: target.to_string(),
            to_si: in_si(&target_base),
        });
    }
    // Written units that our own grammar knows keep its factors, which are exact.
    let known = || Some((Unit::parse(name).ok()?, Unit::parse(target).ok()?));
    if base.offset == 0.0
        && target_base.offset == 0.0
        && let Some((from, to)) = known()
        && let Ok(factor) = from.factor_to(&to)
        && (factor * target_base.factor / base.factor - 1.0).abs() < 1e-6
    {
        return Ok((factor, 0.0));
    }
    Ok((
        base.factor / target_base.factor,
        (base.offset - target_base.offset) / target_base.factor,
    ))
}

/// A unit in SI, for people.
fn in_si(base: &BaseUnit) -> String {
    let names = ["kg", "m", "s", "A", "K", "mol", "cd"];
    let mut text = base.factor.to_string();
    for (name, &exponent) in names.iter().zip(&base.exponents) {
        match exponent {
            0 => {}
            1 => text += &format!(" {name}"),
            exponent => text += &format!(" {name}^{exponent}"),
        }
    }
    if base.offset != 0.0 {
        text += &format!(" + {}", base.offset);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_import::Item;

    const METRE: [i32; 7] = [0, 1, 0, 0, 0, 0, 0];
    const KELVIN: [i32; 7] = [0, 0, 0, 0, 1, 0, 0];

    fn unit(name: &'static str, exponents: [i32; 7], factor: f64, offset: f64) -> End<'static> {
        End {
            kind: &Kind::Float64,
            unit: Some(name),
            base: Some(BaseUnit {
                exponents,
                factor,
                offset,
            }),
        }
    }

    fn alone(name: &'static str) -> End<'static> {
        End {
            kind: &Kind::Float64,
            unit: Some(name),
            base: None,
        }
    }

    fn linear(factor: f64, offset: f64) -> Hop {
        Hop {
            transformation: Transformation::Linear { factor, offset },
            ..Hop::default()
        }
    }

    fn way(hops: Vec<Hop>) -> Way {
        Way { start: None, hops }
    }

    #[test]
    fn temperatures_are_converted_with_their_offset() {
        let celsius = unit("degC", KELVIN, 1.0, 273.15);
        let fahrenheit = unit("degF", KELVIN, 5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0);
        let passage = Way::default().between(celsius, fahrenheit).unwrap();
        for (from, to) in [(100.0, 212.0), (0.0, 32.0), (-40.0, -40.0)] {
            assert!((passage.of(from) - to).abs() < 1e-9, "{}", passage.of(from));
        }
        let back = Way::default().between(fahrenheit, celsius).unwrap();
        assert!((back.of(passage.of(37.0)) - 37.0).abs() < 1e-9);
    }

    #[test]
    fn lengths_are_converted_with_exact_factors_and_the_same_unit_keeps_the_bits() {
        let (inch, millimetre) = (
            unit("in", METRE, 0.025_4, 0.0),
            unit("mm", METRE, 0.001, 0.0),
        );
        let passage = Way::default().between(inch, millimetre).unwrap();
        assert_eq!((passage.of(10.0), passage.slope()), (254.0, 25.4));
        assert!(!passage.is_nothing());
        let same = Way::default().between(inch, inch).unwrap();
        assert!(same.is_nothing());
        assert_eq!(same.of(-0.0).to_bits(), (-0.0_f64).to_bits());
        // Units that the descriptions only name are read as they are written.
        let passage = Way::default().between(alone("in"), alone("mm")).unwrap();
        assert!((passage.of(1.0) - 25.4).abs() < 1e-12);
    }

    #[test]
    fn units_that_do_not_fit_are_refused_with_what_they_are() {
        let (inch, celsius) = (
            unit("in", METRE, 0.025_4, 0.0),
            unit("degC", KELVIN, 1.0, 273.15),
        );
        let said = Way::default().between(inch, celsius).unwrap_err();
        let said = said.to_string();
        for part in ["`in`", "0.0254 m", "`degC`", "1 K + 273.15"] {
            assert!(said.contains(part), "{said} lacks {part}");
        }
        let other = unit("in", METRE, 0.03, 0.0);
        let said = Way::default().between(inch, other).unwrap_err();
        let said = said.to_string();
        assert!(
            said.contains("0.0254 m") && said.contains("0.03 m"),
            "{said}"
        );
    }

    #[test]
    fn what_the_file_declares_comes_before_what_the_fmu_says() {
        // Between connectors in mm: whatever the FMU's own unit is.
        let hop = Hop {
            end: Some(DeclaredUnit {
                name: "mm".into(),
                base: None,
            }),
            ..Hop::default()
        };
        let start = Some(DeclaredUnit {
            name: "in".into(),
            base: None,
        });
        let declared = Way {
            start,
            hops: vec![hop],
        };
        let passage = declared.between(alone("m"), alone("m")).unwrap();
        assert!((passage.of(1.0) - 25.4).abs() < 1e-12);
        // A declared unit without a definition is the FMU's, where the FMU has one of that name.
        let odd_inch = unit("in", METRE, 0.03, 0.0);
        let declared = Way {
            start: Some(DeclaredUnit {
                name: "in".into(),
                base: None,
            }),
            hops: Vec::new(),
        };
        let passage = declared.between(odd_inch, unit("mm", METRE, 0.001, 0.0));
        assert!((passage.unwrap().of(1.0) - 30.0).abs() < 1e-12);
        let suppressed = Hop {
            suppresses_units: true,
            ..Hop::default()
        };
        let passage = way(vec![suppressed]).between(alone("in"), alone("mm"));
        assert!(passage.unwrap().is_nothing());
    }

    #[test]
    fn linear_transformations_follow_the_conversion_one_after_the_other() {
        // 25.4 (mm) * 2 + 3, then * 10 - 1.
        let hops = vec![linear(2.0, 3.0), linear(10.0, -1.0)];
        let passage = way(hops).between(alone("mm"), alone("mm")).unwrap();
        assert_eq!(passage.of(25.4), (25.4 * 2.0 + 3.0) * 10.0 - 1.0);
        assert_eq!(passage.slope(), 20.0);
        let whole = End {
            kind: &Kind::Int32,
            unit: None,
            base: None,
        };
        let said = way(vec![linear(2.0, 0.0)]).between(whole, whole);
        assert_eq!(said, Err(WayError::NotReal("Int32")));
        let endless = way(vec![linear(f64::INFINITY, 0.0)]);
        assert!(endless.between(alone("m"), alone("m")).is_err());
    }

    #[test]
    fn maps_follow_each_other_by_value_and_by_name() {
        let numbers = |pairs: &[(f64, f64)]| Hop {
            transformation: Transformation::Numbers(pairs.to_vec()),
            ..Hop::default()
        };
        let mapped = way(vec![
            numbers(&[(1.0, 2.0), (5.0, 6.0)]),
            numbers(&[(2.0, 7.0)]),
        ]);
        assert!(mapped.maps() && !way(vec![linear(1.0, 0.0)]).maps());
        let plain = End {
            kind: &Kind::Float64,
            unit: None,
            base: None,
        };
        let passage = mapped.between(plain, plain).unwrap();
        // One that is not there stays as it is.
        assert_eq!([1.0, 5.0, 3.0].map(|v| passage.of(v)), [7.0, 6.0, 3.0]);
        assert_eq!(passage.slope(), 0.0);
        assert!(!passage.is_nothing());

        let items = |names: [(&str, i64); 2]| {
            Kind::Enumeration(
                names
                    .map(|(name, value)| Item {
                        name: name.into(),
                        value,
                        description: String::new(),
                    })
                    .to_vec(),
            )
        };
        let (from, to) = (
            items([("off", 0), ("on", 1)]),
            items([("rot", 8), ("grün", 9)]),
        );
        let [from, to] = [&from, &to].map(|kind| End {
            kind,
            unit: None,
            base: None,
        });
        let names = |target: &str| {
            let pairs = vec![("on".to_string(), target.to_string())];
            way(vec![Hop {
                transformation: Transformation::Names(pairs),
                ..Hop::default()
            }])
        };
        assert_eq!(names("grün").between(from, to).unwrap().of(1.0), 9.0);
        let unknown = names("blau").between(from, to);
        assert_eq!(unknown, Err(WayError::NotAChoice("blau".into())));
        let plain_number = names("grün").between(plain, to);
        assert_eq!(plain_number, Err(WayError::NoChoices("Float64")));
        // Mapped and scaled at once is refused.
        let both = way(vec![numbers(&[(1.0, 2.0)]), linear(3.0, 0.0)]);
        assert!(both.between(plain, plain).is_err());
    }
}
