//! The parameters of the prediction model by name, and the index of each in the fitted vector: the
//! physical ones first, then those of each experiment.

use std::ops::{Index, IndexMut};

use plant::identified::actuator::IdentifiedActuator;
use plant::identified::coupled::Rig;
use plant::identified::shake_table::ShakeTable;
use plant::identified::table::Table;
use plant::specimens::linear::LinearSpecimen;

use recordings::Channel;

/// Number of outputs.
pub const OUTPUTS: usize = Channel::OUTPUTS.len();
/// Number of states: actuator, table, specimen.
pub const STATES: usize = 7;

macro_rules! physical {
    ($($(#[$about:meta])* $parameter:ident $name:literal),* $(,)?) => {
        /// A physical parameter, shared by all experiments.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Physical {
            $($(#[$about])* $parameter),*
        }

        impl Physical {
            /// All, in the order of the vector.
            pub const ALL: &[Self] = &[$(Self::$parameter),*];

            /// What messages call it.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$parameter => $name),*
                }
            }
        }
    };
}

physical! {
    /// Of s² in the monic denominator of G1 and G2, 1/s.
    A2 "a2",
    /// Of s in it, 1/s².
    A1 "a1",
    /// Its constant, 1/s³.
    A0 "a0",
    /// Of s² in the numerator of G1, N/(V s).
    B2 "b2",
    /// Of s in it, N/(V s²).
    B1 "b1",
    /// Its constant, N/(V s³).
    B0 "b0",
    /// Of s² in the numerator of G2, N/m.
    E2 "e2",
    /// Of s in it, N/(m s).
    E1 "e1",
    /// Its constant, N/(m s²).
    E0 "e0",
    /// kg.
    TableMass "table mass",
    /// N s/m.
    TableDamping "table damping",
    /// N/m.
    TableStiffness "table stiffness",
    /// kg.
    SpecimenMass "specimen mass",
    /// N s/m.
    SpecimenDamping "specimen damping",
    /// N/m.
    SpecimenStiffness "specimen stiffness",
    /// s.
    CommandDelay "command delay",
}

impl Physical {
    /// Those of the actuator.
    pub const ACTUATOR: [Self; 9] = [
        Self::A2,
        Self::A1,
        Self::A0,
        Self::B2,
        Self::B1,
        Self::B0,
        Self::E2,
        Self::E1,
        Self::E0,
    ];
    /// Those of the specimen.
    pub const SPECIMEN: [Self; 3] = [
        Self::SpecimenMass,
        Self::SpecimenDamping,
        Self::SpecimenStiffness,
    ];

    /// Its place in the vector.
    pub const fn place(self) -> usize {
        self as usize
    }
}

/// A number for each physical parameter: values, standard errors or scales.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhysicalValues([f64; Physical::ALL.len()]);

impl PhysicalValues {
    /// Zero everywhere.
    pub const ZERO: Self = Self([0.0; Physical::ALL.len()]);

    /// What `value` gives for each.
    pub fn from_fn(value: impl Fn(Physical) -> f64) -> Self {
        Self(std::array::from_fn(|place| value(Physical::ALL[place])))
    }

    /// Those at the head of a vector of all parameters.
    pub fn of(parameters: &[f64]) -> Self {
        Self::from_fn(|parameter| parameters[parameter.place()])
    }

    /// The rig of these numbers with a payload (kg) on its table, with or without the specimen.
    pub fn rig(&self, payload: f64, specimen: bool) -> Rig {
        use Physical::*;
        let three = |names: [Physical; 3]| names.map(|name| self[name]);
        Rig {
            shake_table: ShakeTable {
                actuator: IdentifiedActuator {
                    denominator: three([A2, A1, A0]),
                    voltage_to_force: three([B2, B1, B0]),
                    velocity_to_force: three([E2, E1, E0]),
                },
                table: Table {
                    mass: self[TableMass] + payload,
                    damping: self[TableDamping],
                    stiffness: self[TableStiffness],
                },
            },
            specimen: specimen.then(|| LinearSpecimen {
                mass: self[SpecimenMass],
                damping: self[SpecimenDamping],
                stiffness: self[SpecimenStiffness],
            }),
        }
    }
}

impl Index<Physical> for PhysicalValues {
    type Output = f64;

    fn index(&self, parameter: Physical) -> &f64 {
        &self.0[parameter.place()]
    }
}

impl IndexMut<Physical> for PhysicalValues {
    fn index_mut(&mut self, parameter: Physical) -> &mut f64 {
        &mut self.0[parameter.place()]
    }
}

/// What a white noise acts on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoiseOn {
    /// A measured output, by its place.
    Output(usize),
    /// The command.
    Command,
    /// The table, a force.
    Table,
}

impl NoiseOn {
    const COUNT: usize = OUTPUTS + 2;

    fn at(place: usize) -> Self {
        match place {
            0..OUTPUTS => Self::Output(place),
            OUTPUTS => Self::Command,
            _ => Self::Table,
        }
    }

    fn place(self) -> usize {
        match self {
            Self::Output(output) => output,
            Self::Command => OUTPUTS,
            Self::Table => OUTPUTS + 1,
        }
    }

    /// All.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..Self::COUNT).map(Self::at)
    }
}

/// A parameter that each experiment has of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Own {
    /// Mass on the table over that of the first experiment, kg.
    Payload,
    /// Offset of an output over its scale.
    Offset(usize),
    /// A state at the first sample over its scale.
    InitialState(usize),
    /// Logarithm of a noise over its scale.
    LogNoise(NoiseOn),
}

impl Own {
    const OFFSETS: usize = 1;
    const STATES: usize = Self::OFFSETS + OUTPUTS;
    const NOISE: usize = Self::STATES + STATES;
    const COUNT: usize = Self::NOISE + NoiseOn::COUNT;

    fn at(place: usize) -> Self {
        match place {
            0 => Self::Payload,
            Self::OFFSETS..Self::STATES => Self::Offset(place - Self::OFFSETS),
            Self::STATES..Self::NOISE => Self::InitialState(place - Self::STATES),
            _ => Self::LogNoise(NoiseOn::at(place - Self::NOISE)),
        }
    }

    fn place(self) -> usize {
        match self {
            Self::Payload => 0,
            Self::Offset(output) => Self::OFFSETS + output,
            Self::InitialState(state) => Self::STATES + state,
            Self::LogNoise(noise) => Self::NOISE + noise.place(),
        }
    }

    /// All, in the order of the vector.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..Self::COUNT).map(Self::at)
    }

    /// Its place in the vector of all parameters.
    pub fn of(self, experiment: usize) -> usize {
        Physical::ALL.len() + experiment * Self::COUNT + self.place()
    }
}

/// The parameter at a place of the vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Name {
    /// One of the rig.
    Physical(Physical),
    /// One of an experiment.
    Own(Own),
}

impl Name {
    /// The value at `place`.
    pub fn at(place: usize) -> Self {
        match place.checked_sub(Physical::ALL.len()) {
            None => Self::Physical(Physical::ALL[place]),
            Some(own) => Self::Own(Own::at(own % Own::COUNT)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_has_one_name() {
        for (place, parameter) in Physical::ALL.iter().enumerate() {
            assert_eq!(parameter.place(), place);
            assert_eq!(Name::at(place), Name::Physical(*parameter));
        }
        let mut place = Physical::ALL.len();
        for experiment in 0..3 {
            for own in Own::all() {
                assert_eq!(own.of(experiment), place);
                assert_eq!(Name::at(place), Name::Own(own));
                place += 1;
            }
        }
    }
}
