//! What the identified rig lacks against a real one: every effect with its one home, off by
//! default (zero is off).
//!
//! Valve and oil act between the command and G1, friction, masses and springs on the table's
//! equation, sensors on the channels. A family of effects is one file here and one line in
//! `families`; the diagnosis's candidates, the FMUs' variables, the extended model and the
//! sentences of a report follow from its [`Effect`]s.

mod definition;
pub mod quantity;
pub mod sensors;

pub use definition::{
    AtStart, Basis, Component, Effect, Field, Parameter, Reporting, Role, Scale, Variable,
};

use crate::ModelError;
use crate::sensors::instrumentation::Instrumentation;

/// Where the table is and how it moves, relative to the foundation, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableMotion {
    /// Displacement, m.
    pub displacement: f64,
    /// Velocity, m/s.
    pub velocity: f64,
}

/// The effects of one place.
pub trait Family {
    /// What they remember of the table's motion; plain data, saved with the state.
    type Memory: Copy + Default;

    /// Each of them.
    const EFFECTS: &'static [Effect];

    /// Refuses values without meaning.
    ///
    /// # Errors
    /// Names the parameter.
    fn validate(&self) -> Result<(), ModelError>;

    /// True when one of them acts.
    fn is_active(&self) -> bool;

    /// Force against the table's motion, N.
    #[inline]
    fn resisting_force(&self, motion: &TableMotion, memory: &Self::Memory) -> f64 {
        let _ = (motion, memory);
        0.0
    }

    /// These without those that act by [`Self::resisting_force`] alone. A family that does not say so is slower to
    /// simulate.
    fn without_resistance(self) -> Self
    where
        Self: Sized,
    {
        self
    }

    /// Takes in where the table has come to after a step.
    #[inline]
    fn remember(&self, memory: &mut Self::Memory, motion: &TableMotion) {
        let _ = (memory, motion);
    }
}

/// Makes modules, parameters, memory and list of all families.
macro_rules! families {
    ($($name:ident: $family:ident,)*) => {
        $(
            pub mod $name;
            pub use $name::$family;
        )*

        /// All effects on the rig itself; those on its sensors are parameters of the
        /// [`Instrumentation`].
        #[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Effects {
            $(
                #[doc = concat!("See [`", stringify!($family), "`].")]
                pub $name: $family,
            )*
        }

        /// What the effects remember of the table's motion.
        #[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
        pub struct Memory {
            $($name: <$family as Family>::Memory,)*
        }

        const LISTS: &[&[Effect]] = &[$($family::EFFECTS,)* sensors::EFFECTS];

        impl Effects {
            /// Refuses values that have no meaning.
            ///
            /// # Errors
            /// Names the parameter.
            pub fn validate(&self) -> Result<(), ModelError> {
                $(self.$name.validate()?;)*
                Ok(())
            }

            /// Force of all effects against the table's motion, N.
            #[inline]
            pub fn resisting_force(&self, motion: &TableMotion, memory: &Memory) -> f64 {
                0.0 $(+ self.$name.resisting_force(motion, &memory.$name))*
            }

            /// These without those that act by [`Self::resisting_force`] alone.
            pub fn without_resistance(self) -> Self {
                Self { $($name: self.$name.without_resistance(),)* }
            }

            /// Takes in where the table has come to after a step.
            #[inline]
            pub fn remember(&self, memory: &mut Memory, motion: &TableMotion) {
                $(self.$name.remember(&mut memory.$name, motion);)*
            }

            /// True when one of the effects acts on actuator and table.
            #[inline]
            pub fn is_active_on_table(&self) -> bool {
                $((!is_on_specimen::<$family>() && self.$name.is_active()))||*
            }
        }
    };
}

families! {
    valve: ValveEffects,
    hydraulics: HydraulicEffects,
    friction: FrictionEffects,
    table: TableEffects,
    foundation: FoundationEffects,
    specimen: SpecimenEffects,
    directional_friction: DirectionalFriction,
    fading_friction: FadingFriction,
    presliding_friction: PreslidingFriction,
}

const fn is_on_specimen<F: Family>() -> bool {
    matches!(
        F::EFFECTS,
        [
            Effect {
                component: Component::Specimen,
                ..
            },
            ..
        ]
    )
}

/// Every effect.
pub fn all() -> impl Iterator<Item = &'static Effect> {
    LISTS.iter().copied().flatten()
}

/// The effect of that name.
pub fn find(name: &str) -> Option<&'static Effect> {
    all().find(|effect| effect.name == name)
}

/// Every effect of a component.
pub fn of(component: Component) -> impl Iterator<Item = &'static Effect> {
    all().filter(move |effect| effect.component == component)
}

/// Every parameter of `component` that its FMU has, with the variable's name `effect.parameter`.
pub fn variables(component: Component) -> impl Iterator<Item = (String, &'static Parameter)> {
    of(component).flat_map(|effect| {
        let own = effect.parameters.iter();
        own.filter(|p| p.variable == Variable::Own)
            .map(|p| (format!("{}.{}", effect.name, p.name), p))
    })
}

/// The variables of `component` on which `what` depends at the start of a run.
pub fn acting_at_start(component: Component, what: AtStart) -> Vec<String> {
    variables(component)
        .filter(|(_, parameter)| parameter.at_start == Some(what))
        .map(|(name, _)| name)
        .collect()
}

/// The first effect of `component` that is on and that continuous states alone do not tell.
pub fn needing_co_simulation(component: Component, effects: &Effects) -> Option<&'static Effect> {
    let sensors = Instrumentation::default();
    of(component).find(|effect| effect.needs_co_simulation && effect.is_on(effects, &sensors))
}
