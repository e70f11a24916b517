//! Named parameters of a rig: one list makes the struct that its equations read, the table that
//! descriptions and the search read, and the way between them.

use super::{Named, Natural};
use diagnosis::{Candidate, EffectParameter, Role, Scale};

/// An effect that a rig may have, with the values at which it is absent.
#[derive(Debug, Clone)]
pub struct Effect {
    /// What the engine searches.
    pub candidate: Candidate,
    /// Values (SI) without the effect.
    pub off: Vec<f64>,
    /// What it is.
    pub about: &'static str,
    /// Whether its parameters are in units of their own, whatever the units of the table are.
    pub is_in_own_units: bool,
}

/// A struct of nominal parameters, made by `nominal_parameters!`.
pub trait NominalTable: Sized {
    /// Names and SI units.
    const TABLE: &'static [Named];
    /// What each is.
    const ABOUT: &'static [&'static str];
    /// Value of a parameter that a description may leave out, in the order of the table.
    const DEFAULTS: &'static [Option<f64>];

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

/// A parameter that a file has for itself. Zero without it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SessionParameter {
    /// Its name.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// One standard deviation in the rig's natural units.
    pub spread: f64,
    /// What it tells.
    pub role: SessionRole,
}

/// Meaning of a parameter of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SessionRole {
    /// How the rig was set up on that day.
    Setup,
    /// As [`Self::Setup`], against the first file that the model is fitted to.
    AgainstFirst,
    /// How the file begins, and nothing of the rig.
    Start,
}

/// A struct of parameters that differ from file to file, made by `session_parameters!`.
pub trait SessionTable: Sized {
    /// Names, SI units and spreads.
    const TABLE: &'static [SessionParameter];

    /// The struct with values (SI) in the order of the table; none where their number is another.
    fn from_values(values: &[f64]) -> Option<Self>;
}

impl SessionTable for () {
    const TABLE: &'static [SessionParameter] = &[];

    fn from_values(values: &[f64]) -> Option<Self> {
        values.is_empty().then_some(())
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

impl Effect {
    /// The same effect where its table was in natural units.
    #[must_use]
    pub fn scaled(mut self, natural: &Natural) -> Self {
        if self.is_in_own_units {
            return self;
        }
        let parameters = self.candidate.parameters.iter_mut();
        for (i, (parameter, off)) in parameters.zip(&mut self.off).enumerate() {
            let unit = natural.unit(parameter.unit);
            parameter.bounds = (parameter.bounds.0 * unit, parameter.bounds.1 * unit);
            *off *= unit;
            match &mut parameter.role {
                Role::Size { weak } => *weak *= unit,
                Role::Shape { typical, .. } => *typical *= unit,
            }
            if let Scale::Linear(one) | Scale::Inverse(one) = &mut parameter.scale {
                *one *= unit;
            }
            for start in &mut self.candidate.starts {
                start[i] *= unit;
            }
        }
        self
    }
}

impl Entry {
    /// The same, absent at `value`.
    pub const fn off_at(self, value: f64) -> Self {
        Self { off: value, ..self }
    }

    /// The same, `most` at most.
    pub fn at_most(mut self, most: f64) -> Self {
        self.bounds.1 = self.bounds.1.min(most);
        self
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
    about: &'static str,
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
            look_alikes,
            ..Candidate::new(
                effect,
                parameters.iter().map(parameter).collect(),
                starts.iter().map(|start| start.to_vec()).collect(),
            )
        },
        off: parameters.iter().map(|(_, entry)| entry.off).collect(),
        about: about.trim(),
        is_in_own_units: false,
    }
}

/// A struct of nominal parameters, each with its SI unit, and a value where a description may leave
/// it out: `nominal_parameters! { mass: "kg", offset: "N" = 0.0 }` makes `Nominal`.
macro_rules! nominal_parameters {
    ($($(#[doc = $about:literal])* $field:ident: $unit:literal $(= $default:expr)?),* $(,)?) => {
        /// Nominal parameters, SI.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Nominal {
            $($(#[doc = $about])* pub $field: f64),*
        }

        impl $crate::kinds::table::NominalTable for Nominal {
            const TABLE: &'static [$crate::kinds::Named] =
                &[$((stringify!($field), $unit)),*];
            const ABOUT: &'static [&'static str] = &[$(concat!($($about),*)),*];
            const DEFAULTS: &'static [Option<f64>] = &[$({
                #[allow(unused_mut, unused_assignments, reason = "most have no default")]
                let mut default: Option<f64> = None;
                $(default = Some($default);)?
                default
            }),*];

            fn from_values(values: &[f64]) -> Option<Self> {
                let &[$($field),*] = values else { return None };
                Some(Self { $($field),* })
            }
        }
    };
}

/// A struct of parameters that every file has for itself, each with its SI unit and its spread in
/// natural units and its [`SessionRole`]:
/// `session_parameters! { zero: "m" within 0.1 as Setup }` makes `Session`.
macro_rules! session_parameters {
    ($($(#[$about:meta])* $field:ident: $unit:literal within $spread:literal as $role:ident),*
     $(,)?) => {
        /// Parameters of a file, SI.
        #[derive(Debug, Clone, Copy, PartialEq, Default)]
        pub struct Session {
            $($(#[$about])* pub $field: f64),*
        }

        impl $crate::kinds::table::SessionTable for Session {
            const TABLE: &'static [$crate::kinds::table::SessionParameter] =
                &[$($crate::kinds::table::SessionParameter {
                    name: stringify!($field),
                    unit: $unit,
                    spread: $spread,
                    role: $crate::kinds::table::SessionRole::$role,
                }),*];

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
    ($($(#[doc = $about:literal])* $effect:ident: $kind:ident {
        $($field:ident: $entry:expr),* $(,)?
    } from $starts:expr $(, like $alike:expr)?;)*) => {
        $(
            $(#[doc = $about])*
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

        impl $crate::kinds::table::EffectTable for Effects {
            fn table() -> Vec<$crate::kinds::table::Effect> {
                vec![$({
                    #[allow(unused_mut, unused_assignments, reason = "most have no look-alikes")]
                    let mut alike: &'static [&'static str] = &[];
                    $(alike = &$alike;)?
                    $crate::kinds::table::effect(
                        stringify!($effect),
                        concat!($($about),*),
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

pub(super) use {effects, nominal_parameters, session_parameters};
