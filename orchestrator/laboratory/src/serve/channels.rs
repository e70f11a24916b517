//! Which signals of a system are a trial, the displacement and the force.

use crate::error::Error;
use fmi_import::Causality;
use fmi_system::{ElementFile, Origin, System, SystemFile};
use units::{convert, hint};

/// What a trial moves.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// The motion that the system follows.
    Reference,
    /// Inputs, one for each degree of freedom, as `component.input`.
    Inputs(Vec<String>),
}

/// A signal with its factor to SI and its sign.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// `component.output`.
    pub name: String,
    /// What makes it SI and positive against a positive displacement.
    pub factor: f64,
}

/// What a trial moves and what is measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Channels {
    /// What moves.
    pub command: Command,
    /// Displacements; none where only the command is known.
    pub displacement: Vec<Channel>,
    /// Velocities and accelerations beside the displacements, where they are there.
    pub velocity: Vec<Channel>,
    /// See [`Channels::velocity`].
    pub acceleration: Vec<Channel>,
    /// Forces.
    pub force: Vec<Channel>,
}

/// What a trial moves: the setting, or else the motion that the system follows.
///
/// # Errors
/// No setting, and no motion.
pub fn command(file: &SystemFile, wanted: &ElementFile) -> Result<Command, Error> {
    match &wanted.command[..] {
        [one] if one == "reference" => return Ok(Command::Reference),
        [] => {}
        inputs => return Ok(Command::Inputs(inputs.to_vec())),
    }
    let follows = |origin: &Origin| matches!(origin, Origin::Reference { .. });
    if file.connections.iter().any(|link| follows(&link.from)) {
        return Ok(Command::Reference);
    }
    Err(Error::Option {
        option: "--command",
        reason: "the system follows no motion; say which input a trial moves, such as --command \
                 element.displacement (shakebench info lists the inputs)"
            .to_string(),
    })
}

impl Channels {
    /// Finds the signals of an assembled system.
    ///
    /// # Errors
    /// A name that is unknown, or a signal that must be named.
    pub fn find(system: &System, command: Command, wanted: &ElementFile) -> Result<Self, Error> {
        let count = match &command {
            Command::Reference => 1,
            Command::Inputs(inputs) => inputs.len(),
        };
        let outputs = Outputs::of(system);
        let force = if wanted.force.is_empty() {
            vec![outputs.usual_force()?]
        } else {
            let named = wanted.force.iter();
            named
                .map(|name| outputs.find("--force-signal", name, "N"))
                .collect::<Result<_, _>>()?
        };
        let displacement: Vec<Channel> = if wanted.displacement.is_empty() {
            outputs.usual_displacement().into_iter().collect()
        } else {
            let named = wanted.displacement.iter();
            let found = named.map(|name| outputs.find("--displacement", name, "m"));
            found.collect::<Result<_, _>>()?
        };
        for (option, channels) in [
            ("--force-signal", &force),
            ("--displacement", &displacement),
        ] {
            if !channels.is_empty() && channels.len() != count {
                return Err(Error::Option {
                    option,
                    reason: format!(
                        "{} signals for {count} degrees of freedom; name one for each",
                        channels.len()
                    ),
                });
            }
        }
        let beside = |quantity: &str, unit: &str| -> Vec<Channel> {
            let found = displacement.iter().map(|channel| {
                let stem = channel.name.strip_suffix("displacement")?;
                outputs.find("", &format!("{stem}{quantity}"), unit).ok()
            });
            found.collect::<Option<_>>().unwrap_or_default()
        };
        Ok(Self {
            command,
            velocity: beside("velocity", "m/s"),
            acceleration: beside("acceleration", "m/s2"),
            displacement,
            force,
        })
    }

    /// How many degrees of freedom there are.
    pub fn degrees_of_freedom(&self) -> usize {
        self.force.len()
    }
}

/// The outputs of a system, with their units.
struct Outputs {
    all: Vec<(String, Option<String>)>,
}

impl Outputs {
    fn of(system: &System) -> Self {
        let mut all = Vec::new();
        for component in &system.components {
            let description = &component.fmu.description;
            for position in description.of(Causality::Output) {
                let variable = &description.variables[position];
                let name = format!("{}.{}", component.name, variable.name);
                all.push((name, variable.unit.clone()));
            }
        }
        Self { all }
    }

    /// The output of a name, with a sign before it or not.
    fn find(&self, option: &'static str, name: &str, unit: &str) -> Result<Channel, Error> {
        let (plain, sign) = match name.strip_prefix('-') {
            Some(rest) => (rest, -1.0),
            None => (name, 1.0),
        };
        let fault = |reason: String| Error::Option { option, reason };
        let Some((_, own)) = self.all.iter().find(|(known, _)| known == plain) else {
            let known = self.all.iter().map(|(name, _)| name.as_str());
            return Err(fault(format!(
                "the system has no output `{plain}`{}",
                hint(plain, known)
            )));
        };
        let factor = match own {
            None => 1.0,
            Some(own) => convert(1.0, own, unit).map_err(|error| fault(error.to_string()))?,
        };
        Ok(Channel {
            name: plain.to_string(),
            factor: sign * factor,
        })
    }

    /// The force of a specimen, against the table's on it; else the only output that is a force.
    fn usual_force(&self) -> Result<Channel, Error> {
        if let Ok(found) = self.find("--force-signal", "-specimen.force", "N") {
            return Ok(found);
        }
        let is_force = |unit: &Option<String>| {
            let unit = unit.as_deref();
            unit.is_some_and(|unit| convert(1.0, unit, "N").is_ok())
        };
        let forces = self.all.iter().filter(|(_, unit)| is_force(unit));
        let forces: Vec<&str> = forces.map(|(name, _)| name.as_str()).collect();
        match forces[..] {
            [only] => self.find("--force-signal", only, "N"),
            _ => Err(Error::Option {
                option: "--force-signal",
                reason: format!(
                    "say which output is the force that resists a positive displacement (with `-` \
                     before it where its sign is the other); {}",
                    match forces.is_empty() {
                        true => "none of the system's outputs is a force in N".to_string(),
                        false => format!("there are {}", forces.join(", ")),
                    }
                ),
            }),
        }
    }

    /// Where the rig really is, as far as that is plain.
    fn usual_displacement(&self) -> Option<Channel> {
        let usual = [
            "table.displacement",
            "plant.displacement",
            "actuator.displacement",
        ];
        let mut usual = usual.into_iter();
        usual.find_map(|name| self.find("", name, "m").ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outputs(all: &[(&str, Option<&str>)]) -> Outputs {
        let owned =
            |(name, unit): &(&str, Option<&str>)| ((*name).to_string(), unit.map(str::to_string));
        Outputs {
            all: all.iter().map(owned).collect(),
        }
    }

    #[test]
    fn an_output_is_found_with_its_sign_and_factor() {
        let own = outputs(&[("a.force", Some("kN")), ("a.x", Some("m")), ("a.y", None)]);
        let found = |name: &str, unit: &str| own.find("--force-signal", name, unit);
        let channel = found("-a.force", "N").unwrap();
        assert_eq!((&*channel.name, channel.factor), ("a.force", -1000.0));
        assert_eq!(found("a.y", "N").unwrap().factor, 1.0);
        assert!(found("a.x", "N").is_err(), "a length is not a force");
        let told = found("a.forse", "N").unwrap_err().to_string();
        assert!(
            told.contains("no output `a.forse`") && told.contains("a.force"),
            "{told}"
        );
    }

    #[test]
    fn the_usual_force_is_that_of_the_specimen_or_the_only_one() {
        let usual = |all: &[(&str, Option<&str>)]| {
            outputs(all)
                .usual_force()
                .map_err(|error| error.to_string())
        };
        let specimen = usual(&[("specimen.force", Some("N")), ("a.force", Some("N"))]).unwrap();
        assert_eq!((&*specimen.name, specimen.factor), ("specimen.force", -1.0));
        let only = usual(&[("a.force", Some("kN")), ("a.x", Some("m")), ("a.y", None)]).unwrap();
        assert_eq!((&*only.name, only.factor), ("a.force", 1000.0));
        let both = usual(&[("a.force", Some("N")), ("b.force", Some("N"))]).unwrap_err();
        assert!(both.ends_with("there are a.force, b.force"), "{both}");
        let none = usual(&[("a.x", Some("m"))]).unwrap_err();
        assert!(
            none.ends_with("none of the system's outputs is a force in N"),
            "{none}"
        );
        let place = |all: &[(&str, Option<&str>)]| outputs(all).usual_displacement();
        assert_eq!(
            place(&[("plant.displacement", Some("mm"))]).unwrap().factor,
            0.001
        );
        assert!(place(&[("a.displacement", Some("m"))]).is_none());
    }

    #[test]
    fn a_trial_moves_what_is_named_or_the_reference() {
        let file = |links: &[&str]| SystemFile {
            connections: links
                .iter()
                .map(|text| fmi_system::Link::try_from((*text).to_string()).unwrap())
                .collect(),
            ..SystemFile::default()
        };
        let wanted = |names: &[&str]| ElementFile {
            command: names.iter().map(ToString::to_string).collect(),
            ..ElementFile::default()
        };
        let follows = file(&["reference.displacement -> a.u"]);
        let none = file(&["b.y -> a.u"]);
        assert_eq!(
            command(&none, &wanted(&["reference"])).unwrap(),
            Command::Reference
        );
        assert_eq!(command(&follows, &wanted(&[])).unwrap(), Command::Reference);
        let inputs = ["a.u", "a.v"];
        assert_eq!(
            command(&follows, &wanted(&inputs)).unwrap(),
            Command::Inputs(inputs.map(String::from).to_vec())
        );
        let told = command(&none, &wanted(&[])).unwrap_err().to_string();
        assert!(told.contains("the system follows no motion"), "{told}");
    }
}
