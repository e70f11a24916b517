#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! A structure that OpenSees computes, on the table, as an FMU.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use units::vocabulary;

use bridges::opensees::{CARRIED, OpenSeesError, Reply, Role, Settings, Structure};
use fmu_kit::{Component, ComponentResult, Enumeration, Item, Variable};
use serde::{Deserialize, Serialize};

const TABLE: i32 = 1;
const SUBSTRUCTURE: i32 = 2;
/// What the structure is in the experiment.
const ROLES: Enumeration = Enumeration {
    name: "OpenSeesRole",
    items: &[
        Item {
            name: "table",
            value: TABLE,
            description: "It stands on the table: its base is moved",
        },
        Item {
            name: "substructure",
            value: SUBSTRUCTURE,
            description: "It is computed beside a specimen, whose force is applied to it",
        },
    ],
};

/// A structure in OpenSees.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct OpenSeesSpecimen {
    model: String,
    carried: String,
    units: String,
    python: String,
    role: i32,
    direction: i32,
    time_limit: f64,
    table_displacement: f64,
    table_velocity: f64,
    table_acceleration: f64,
    measured_force: f64,
    force: f64,
    acceleration: f64,
    displacement: f64,
    driven_displacement: f64,
    moving_mass: f64,
    /// Displacement and velocity of the interface at the last step.
    last: (f64, f64),
    #[serde(skip)]
    process: Process,
}

/// The process of a structure, if there is one.
#[derive(Clone, Default)]
struct Process(Option<Arc<Mutex<Running>>>);

struct Running {
    structure: Structure,
    settings: Settings,
    has_stepped: bool,
}

impl std::fmt::Debug for Process {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Process").field(&self.0.is_some()).finish()
    }
}

impl Default for OpenSeesSpecimen {
    fn default() -> Self {
        Self {
            model: String::new(),
            carried: String::new(),
            units: String::new(),
            python: String::new(),
            role: TABLE,
            direction: 0,
            time_limit: 120.0,
            table_displacement: 0.0,
            table_velocity: 0.0,
            table_acceleration: 0.0,
            measured_force: 0.0,
            force: 0.0,
            acceleration: 0.0,
            displacement: 0.0,
            driven_displacement: 0.0,
            moving_mass: 0.0,
            last: (0.0, 0.0),
            process: Process::default(),
        }
    }
}

/// A parameter that OpenSees cannot be started with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum SettingsError {
    /// A negative direction.
    #[error("direction = {0}, expected 1 to 6, or 0 for the model's own")]
    Direction(i32),
    /// A limit that is not a positive time, s.
    #[error("time_limit = {0} s, expected above 0")]
    TimeLimit(f64),
}

impl OpenSeesSpecimen {
    /// What is to run; none where nothing stands on the table.
    fn settings(&self) -> Result<Option<Settings>, SettingsError> {
        let model = match self.model.is_empty() {
            true => &self.carried,
            false => &self.model,
        };
        if model.is_empty() {
            return Ok(None);
        }
        let limit = Duration::try_from_secs_f64(self.time_limit);
        let limit = limit.ok().filter(|limit| !limit.is_zero());
        let given = |text: &String| (!text.is_empty()).then(|| text.clone());
        Ok(Some(Settings {
            model: PathBuf::from(model),
            role: match self.role {
                SUBSTRUCTURE => Role::Substructure,
                _ => Role::Table,
            },
            direction: match self.direction {
                0 => None,
                direction => {
                    let known = u32::try_from(direction);
                    Some(known.map_err(|_| SettingsError::Direction(direction))?)
                }
            },
            units: given(&self.units),
            python: given(&self.python),
            limit: limit.ok_or(SettingsError::TimeLimit(self.time_limit))?,
        }))
    }
}

impl Component for OpenSeesSpecimen {
    const NAME: &'static str = "OpenSeesSpecimen";
    const DESCRIPTION: &'static str = "Structure that OpenSees computes, on a shake table";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const SAVES_STATE: bool = false;
    const NEEDS_EXECUTION_TOOL: bool = true;

    fn variables() -> Vec<Variable<Self>> {
        // The motion is that at the communication point: a master that extrapolates continuous inputs
        // to the middle of the step would have it half a step ahead.
        fmu_kit::table! { Self, s:
            input(vocabulary::TABLE_DISPLACEMENT, s.table_displacement, "Absolute displacement of the table", "m" => "in").discrete().nominal(0.05);
            input(vocabulary::TABLE_VELOCITY, s.table_velocity, "Absolute velocity of the table", "m/s" => "in/s").discrete().nominal(0.5);
            input(vocabulary::TABLE_ACCELERATION, s.table_acceleration, "Absolute acceleration of the table", "m/s2" => "g").discrete().nominal(10.0);
            input(vocabulary::MEASURED_FORCE, s.measured_force, "Force with which the specimen resists; of a substructure", "N" => "lbf").nominal(400.0);
            output("force", s.force, "Force on the table", "N" => "lbf").nominal(400.0);
            output("acceleration", s.acceleration, "Mean absolute acceleration of the mass: force on the structure over mass", "m/s2" => "g").nominal(10.0);
            output("displacement", s.displacement, "Displacement of the base, or of the interface of a substructure", "m" => "in").nominal(0.05);
            local("driven_displacement", s.driven_displacement, "Where the adapter was last asked to be", "m" => "in").nominal(0.05);
            local("moving_mass", s.moving_mass, "Mass that moves in the direction of motion", "kg" => "lbf.s2/in");
            parameter("model", s.model, "Script of the model; empty for the one that the FMU carries, or none");
            parameter("units", s.units, "Units of the model, a length and a force such as in,kip; empty for what it says");
            parameter("python", s.python, "Python with openseespy; empty to look for one");
            parameter("role", s.role, "What the structure is in the experiment").choices(ROLES);
            parameter("direction", s.direction, "Direction of motion, from 1; 0 for what the model says, or 1");
            parameter(vocabulary::TIME_LIMIT, s.time_limit, "How long OpenSees may be silent", "s" => "s");
        }
    }

    fn load(&mut self, resources: &Path) -> ComponentResult {
        let carried = resources.join(CARRIED);
        if carried.is_file() {
            self.carried = carried.display().to_string();
        }
        Ok(())
    }

    fn initialize(&mut self) -> ComponentResult {
        self.force = 0.0;
        self.acceleration = 0.0;
        self.displacement = 0.0;
        self.driven_displacement = 0.0;
        self.moving_mass = 0.0;
        self.last = (0.0, 0.0);
        let Some(settings) = self.settings()? else {
            self.process = Process::default();
            return Ok(());
        };
        // Called again after another parameter was set: what has not moved yet is as good as new.
        if let Some(running) = &self.process.0 {
            let running = running.lock().unwrap_or_else(PoisonError::into_inner);
            if !running.has_stepped && running.settings == settings {
                self.moving_mass = running.structure.mass();
                return Ok(());
            }
        }
        self.process = Process::default();
        let structure = Structure::start(settings.clone())?;
        self.moving_mass = structure.mass();
        self.process = Process(Some(Arc::new(Mutex::new(Running {
            structure,
            settings,
            has_stepped: false,
        }))));
        Ok(())
    }

    fn step(&mut self, _time: f64, h: f64) -> ComponentResult {
        let Some(running) = &self.process.0 else {
            return Ok(());
        };
        let mut running = running.lock().unwrap_or_else(PoisonError::into_inner);
        running.has_stepped = true;
        let reply: Result<Reply, OpenSeesError> = if self.role == SUBSTRUCTURE {
            let near = self.last.0 + h * self.last.1;
            let reply = running.structure.push(-self.measured_force, near, h);
            reply.inspect(|reply| {
                self.driven_displacement = near;
                self.last = (reply.displacement, (reply.displacement - self.last.0) / h);
            })
        } else {
            let [u, v, a] = [
                self.table_displacement,
                self.table_velocity,
                self.table_acceleration,
            ];
            self.driven_displacement = u + h * (v + 0.5 * h * a);
            running.structure.advance(self.driven_displacement, h)
        };
        let reply = reply?;
        self.displacement = reply.displacement;
        self.force = -reply.force;
        if self.moving_mass > 0.0 {
            self.acceleration = reply.force / self.moving_mass;
        }
        Ok(())
    }
}

fmu_kit::export!(OpenSeesSpecimen);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_model_nothing_stands_on_the_table() {
        let mut specimen = OpenSeesSpecimen::default();
        specimen.initialize().unwrap();
        specimen.table_acceleration = 10.0;
        specimen.step(0.0, 0.002).unwrap();
        assert_eq!((specimen.force, specimen.acceleration), (0.0, 0.0));
    }

    #[test]
    fn parameters_at_fault_are_named() {
        let mut specimen = OpenSeesSpecimen {
            model: "no-such-model.py".to_string(),
            ..OpenSeesSpecimen::default()
        };
        let said = specimen.initialize().unwrap_err().to_string();
        assert!(said.contains("no-such-model.py"), "{said}");
        specimen.time_limit = -1.0;
        let said = specimen.initialize().unwrap_err().to_string();
        assert!(said.contains("time_limit"), "{said}");
        specimen.time_limit = 1.0;
        specimen.direction = -1;
        let said = specimen.initialize().unwrap_err().to_string();
        assert!(said.contains("direction"), "{said}");
    }
}
