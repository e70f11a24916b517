//! What is done to a value on its way along a connection: conversions between units, and the
//! transformations that a file gives.

use crate::fmu::{BaseUnit, Kind};
use crate::units::Unit;

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
        let value = self.factor * value;
        // A sum with nothing would turn -0 into 0.
        if self.offset == 0.0 {
            value
        } else {
            value + self.offset
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

impl Way {
    /// What comes of a value between two ends.
    ///
    /// # Errors
    /// Units that do not fit, transformations that do not fit the types.
    pub(super) fn between(&self, from: End, to: End) -> Result<Passage, String> {
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
            return Err("values are mapped one by one and scaled as well".to_string());
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
    ) -> Result<(), String> {
        let map = match transformation {
            Transformation::None => return Ok(()),
            Transformation::Linear { factor, offset } => {
                let is_float = |kind: &Kind| matches!(kind, Kind::Float64 | Kind::Float32);
                if !is_float(to) {
                    let name = to.name();
                    return Err(format!(
                        "a linear transformation is for real numbers, and this is a {name}"
                    ));
                }
                if !(factor.is_finite() && offset.is_finite()) {
                    return Err(format!(
                        "factor {factor} and offset {offset} are not finite"
                    ));
                }
                self.then(*factor, *offset);
                return Ok(());
            }
            Transformation::Numbers(map) => map.clone(),
            Transformation::Names(names) => {
                let value = |kind: &Kind, name: &String| -> Result<f64, String> {
                    let Kind::Enumeration(items) = kind else {
                        let kind = kind.name();
                        return Err(format!("names are mapped, and this is a {kind}"));
                    };
                    let item = items.iter().find(|item| item.name == *name);
                    item.map(|item| item.value as f64)
                        .ok_or_else(|| format!("`{name}` is no choice"))
                };
                let pairs = names.iter();
                pairs
                    .map(|(source, target)| Ok((value(from, source)?, value(to, target)?)))
                    .collect::<Result<Vec<_>, String>>()?
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
pub(super) fn conversion(from: NamedUnit, to: NamedUnit) -> Result<(f64, f64), String> {
    let ((Some(name), base), (Some(target), target_base)) = (from, to) else {
        return Ok((1.0, 0.0));
    };
    let (Some(base), Some(target_base)) = (base, target_base) else {
        if name == target {
            return Ok((1.0, 0.0));
        }
        let unit = |text: &str| Unit::parse(text).map_err(|error| error.to_string());
        let factor = unit(name)?.factor_to(&unit(target)?);
        return factor
            .map(|factor| (factor, 0.0))
            .map_err(|error| error.to_string());
    };
    if base == target_base {
        return Ok((1.0, 0.0));
    }
    if name == target {
        return Err(format!(
            "both are in `{name}`, but that is {} in one FMU and {} in the other",
            in_si(&base),
            in_si(&target_base)
        ));
    }
    if base.exponents != target_base.exponents {
        return Err(format!(
            "`{name}` is {} and `{target}` is {}",
            in_si(&base),
            in_si(&target_base)
        ));
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
