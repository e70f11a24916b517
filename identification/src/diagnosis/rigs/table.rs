//! Named parameters of a rig: one list makes the struct that its equations read, the table that
//! descriptions and the search read, and the way between them.

use super::Named;
use crate::diagnosis::engine::{Candidate, EffectParameter, Role, Scale};

/// An effect that a rig may have, with the values at which it is absent.
#[derive(Debug, Clone)]
pub struct Effect {
    /// What the engine searches.
    pub candidate: Candidate,
    /// Values (SI) without the effect.
    pub off: Vec<f64>,
}

/// A struct of nominal parameters, made by `nominal_parameters!`.
pub trait NominalTable: Sized {
    /// Names and SI units.
    const TABLE: &'static [Named];

    /// The struct with values (SI) in the order of the table; none where their number is another.
    fn from_values(values: &[f64]) -> Option<Self>;
}

/// A struct of effects, made by `effects!`.
pub trait EffectTable: Sized {
    /// The effects in the order in which [`Self::from_values`] takes their parameters.
    fn table() -> Vec<Effect>;

    /// The struct with the values (SI) of all effects' parameters; none where their number is
    /// another.
    fn from_values(values: &[f64]) -> Option<Self>;

    /// The struct without any effect.
    #[cfg(test)]
    fn off() -> Option<Self> {
        let off: Vec<f64> = Self::table().into_iter().flat_map(|e| e.off).collect();
        Self::from_values(&off)
    }
}

/// All of a parameter but its name.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    unit: &'static str,
    scale: Scale,
    role: Role,
    bounds: (f64, f64),
    off: f64,
}

impl Entry {
    /// The same, absent at `value`.
    pub const fn off_at(self, value: f64) -> Self {
        Self { off: value, ..self }
    }
}

/// A size counted in `weak`, the least worth a name; absent at zero.
pub const fn size(unit: &'static str, weak: f64, bounds: (f64, f64)) -> Entry {
    Entry {
        unit,
        scale: Scale::Linear(weak),
        role: Role::Size { weak },
        bounds,
        off: 0.0,
    }
}

/// A positive detail of form, usually `typical`, within a factor `e^spread`; without the effect it is
/// the usual one.
pub fn shape(unit: &'static str, typical: f64, spread: f64) -> Entry {
    Entry {
        unit,
        scale: Scale::Logarithmic,
        role: Role::Shape { typical, spread },
        bounds: (
            typical * (-6.0 * spread).exp(),
            typical * (6.0 * spread).exp(),
        ),
        off: typical,
    }
}

/// An effect; every start has a value (SI) for each parameter.
pub fn effect<const N: usize>(
    effect: &'static str,
    look_alikes: &'static [&'static str],
    parameters: [(&'static str, Entry); N],
    starts: &[[f64; N]],
) -> Effect {
    let parameter = |(name, entry): &(&'static str, Entry)| EffectParameter {
        name,
        unit: entry.unit,
        scale: entry.scale,
        role: entry.role,
        bounds: entry.bounds,
    };
    Effect {
        candidate: Candidate {
            effect,
            parameters: parameters.iter().map(parameter).collect(),
            starts: starts.iter().map(|start| start.to_vec()).collect(),
            look_alikes,
            tolerance: 1.0,
            contains: None,
        },
        off: parameters.iter().map(|(_, entry)| entry.off).collect(),
    }
}

/// A struct of nominal parameters, each with its SI unit:
/// `nominal_parameters! { mass: "kg", stiffness: "N/m" }` makes `Nominal`.
macro_rules! nominal_parameters {
    ($($field:ident: $unit:literal),* $(,)?) => {
        /// Nominal parameters, SI.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Nominal {
            $(pub $field: f64),*
        }

        impl $crate::diagnosis::rigs::table::NominalTable for Nominal {
            const TABLE: &'static [$crate::diagnosis::rigs::Named] =
                &[$((stringify!($field), $unit)),*];

            fn from_values(values: &[f64]) -> Option<Self> {
                let &[$($field),*] = values else { return None };
                Some(Self { $($field),* })
            }
        }
    };
}

/// A struct of effects, each a struct of its parameters with the values from which fits begin:
/// `effects! { delay: Delay { time: size("s", 1e-3, (0.0, 0.1)) } from [[5e-3]]; }` makes `Effects`
/// and `Delay`. `like ["other"]` names effects that records often cannot tell from this one.
macro_rules! effects {
    ($($(#[$about:meta])* $effect:ident: $kind:ident {
        $($field:ident: $entry:expr),* $(,)?
    } from $starts:expr $(, like $alike:expr)?;)*) => {
        $(
            $(#[$about])*
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct $kind {
                $(pub $field: f64),*
            }
        )*

        /// The effects, SI.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Effects {
            $(pub $effect: $kind),*
        }

        impl $crate::diagnosis::rigs::table::EffectTable for Effects {
            fn table() -> Vec<$crate::diagnosis::rigs::table::Effect> {
                vec![$({
                    #[allow(unused_mut, unused_assignments, reason = "most have no look-alikes")]
                    let mut alike: &'static [&'static str] = &[];
                    $(alike = &$alike;)?
                    $crate::diagnosis::rigs::table::effect(
                        stringify!($effect),
                        alike,
                        [$((stringify!($field), $entry)),*],
                        &$starts,
                    )
                }),*]
            }

            fn from_values(values: &[f64]) -> Option<Self> {
                let mut values = values.iter().copied();
                let effects = Self {
                    $($effect: $kind { $($field: values.next()?),* }),*
                };
                values.next().is_none().then_some(effects)
            }
        }
    };
}

pub(super) use {effects, nominal_parameters};
