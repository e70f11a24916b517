//! The nominal parameters of the identified rig, listed once.

use crate::identified::effects::Component;
use crate::identified::shake_table::ShakeTable;
use crate::specimens::linear::LinearSpecimen;
use units::Parameters;
use units::vocabulary;

/// Actuator, table and specimen of the thesis, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NominalRig {
    /// Actuator and table.
    pub shake_table: ShakeTable,
    /// The specimen, if one stands on the table.
    pub specimen: Option<LinearSpecimen>,
}

/// The way to a parameter.
#[derive(Debug, Clone, Copy)]
enum Field {
    Table(fn(&mut ShakeTable) -> &mut f64),
    Specimen(fn(&mut LinearSpecimen) -> &mut f64),
}

/// A nominal parameter.
#[derive(Debug, Clone, Copy)]
pub struct NominalParameter {
    /// Its name in `nominal.toml`, with the place in a list.
    pub name: &'static str,
    /// Its name in the FMU of its component.
    pub variable: &'static str,
    field: Field,
}

macro_rules! parameters {
    ($($kind:ident $name:literal $variable:expr => $field:expr;)*) => {
        &[$(NominalParameter { name: $name, variable: $variable, field: Field::$kind($field) }),*]
    };
}

impl NominalParameter {
    /// Its SI unit in the notation of FMI.
    pub fn unit(&self) -> Option<&'static str> {
        let mut unit = None;
        let mut look = |parameter: &'static units::Parameter, _: units::Slot<'_>| {
            if parameter.name == self.variable {
                unit = parameter.unit;
            }
        };
        match self.field {
            Field::Table(_) => {
                let mut table = ShakeTable::default();
                table
                    .actuator
                    .visit(&mut |parameter, slot| look(parameter, slot));
                table
                    .table
                    .visit(&mut |parameter, slot| look(parameter, slot));
            }
            Field::Specimen(_) => {
                LinearSpecimen::default().visit(&mut |parameter, slot| look(parameter, slot));
            }
        }
        unit
    }

    /// The component whose FMU has it.
    pub fn component(&self) -> Component {
        match self.field {
            Field::Table(_) => Component::ShakeTable,
            Field::Specimen(_) => Component::Specimen,
        }
    }
}

/// All of them: actuator, table, specimen.
pub const PARAMETERS: &[NominalParameter] = parameters! {
    Table "actuator.denominator[1]" vocabulary::ACTUATOR_A2 => |r| &mut r.actuator.denominator[0];
    Table "actuator.denominator[2]" "actuator_a1" => |r| &mut r.actuator.denominator[1];
    Table "actuator.denominator[3]" "actuator_a0" => |r| &mut r.actuator.denominator[2];
    Table "actuator.voltage_to_force[1]" "actuator_b2" => |r| &mut r.actuator.voltage_to_force[0];
    Table "actuator.voltage_to_force[2]" "actuator_b1" => |r| &mut r.actuator.voltage_to_force[1];
    Table "actuator.voltage_to_force[3]" "actuator_b0" => |r| &mut r.actuator.voltage_to_force[2];
    Table "actuator.velocity_to_force[1]" "actuator_e2" => |r| &mut r.actuator.velocity_to_force[0];
    Table "actuator.velocity_to_force[2]" "actuator_e1" => |r| &mut r.actuator.velocity_to_force[1];
    Table "actuator.velocity_to_force[3]" "actuator_e0" => |r| &mut r.actuator.velocity_to_force[2];
    Table "table.mass" vocabulary::TABLE_MASS => |r| &mut r.table.mass;
    Table "table.damping" vocabulary::TABLE_DAMPING => |r| &mut r.table.damping;
    Table "table.stiffness" vocabulary::TABLE_STIFFNESS => |r| &mut r.table.stiffness;
    Specimen "specimen.mass" "mass" => |s| &mut s.mass;
    Specimen "specimen.damping" "damping" => |s| &mut s.damping;
    Specimen "specimen.stiffness" "stiffness" => |s| &mut s.stiffness;
};

/// The parameters of [`ShakeTable`] by the names of its FMU.
pub fn shake_table_values(rig: &ShakeTable) -> Vec<(&'static str, f64)> {
    let mut rig = *rig;
    let values = PARAMETERS.iter().filter_map(|p| match p.field {
        Field::Table(field) => Some((p.variable, *field(&mut rig))),
        Field::Specimen(_) => None,
    });
    values.collect()
}

/// The parameters of [`LinearSpecimen`] by the names of its FMU.
pub fn specimen_values(specimen: &LinearSpecimen) -> Vec<(&'static str, f64)> {
    let mut specimen = *specimen;
    let values = PARAMETERS.iter().filter_map(|p| match p.field {
        Field::Specimen(field) => Some((p.variable, *field(&mut specimen))),
        Field::Table(_) => None,
    });
    values.collect()
}

impl NominalRig {
    /// Those of [`PARAMETERS`] that the rig has, with their values.
    pub fn parameters(&self) -> impl Iterator<Item = (&'static NominalParameter, f64)> {
        PARAMETERS.iter().filter_map(|p| Some((p, self.value(p)?)))
    }

    /// The value of `parameter`; none of a specimen that is not there.
    pub fn value(&self, parameter: &NominalParameter) -> Option<f64> {
        let mut rig = *self;
        rig.place(parameter).copied()
    }

    /// The place of the value of `parameter`; none of a specimen that is not there.
    pub fn place(&mut self, parameter: &NominalParameter) -> Option<&mut f64> {
        match parameter.field {
            Field::Table(field) => Some(field(&mut self.shake_table)),
            Field::Specimen(field) => self.specimen.as_mut().map(field),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_read_where_it_is_set() {
        let mut rig = NominalRig {
            shake_table: ShakeTable::default(),
            specimen: Some(LinearSpecimen::appendix_a()),
        };
        assert_eq!(rig.parameters().count(), PARAMETERS.len());
        for (i, parameter) in PARAMETERS.iter().enumerate() {
            *rig.place(parameter).unwrap() = 1.5 + i as f64;
        }
        for (i, parameter) in PARAMETERS.iter().enumerate() {
            assert_eq!(
                rig.value(parameter),
                Some(1.5 + i as f64),
                "{}",
                parameter.name
            );
        }
        assert_eq!(rig.shake_table.table.mass, 10.5);
        assert_eq!(rig.specimen.unwrap().stiffness, 15.5);
    }

    #[test]
    fn a_rig_without_a_specimen_has_none_of_its_parameters() {
        let rig = NominalRig {
            shake_table: ShakeTable::default(),
            specimen: None,
        };
        let own: Vec<_> = rig.parameters().map(|(p, _)| p.component()).collect();
        assert_eq!(own.len(), 12);
        assert!(own.iter().all(|c| matches!(c, Component::ShakeTable)));
    }
}
