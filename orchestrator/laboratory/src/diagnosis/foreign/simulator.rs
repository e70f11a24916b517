//! An FMU by itself, simulated again and again with other inputs and parameters.

use std::path::Path;
use std::sync::Arc;

use identification::diagnosis::rigs::foreign::{Parameter, Signal, Simulator};

use super::map::{Map, Stated};
use crate::diagnosis::file_fault;
use crate::error::Error;
use fmi_import::{Causality, FmiVersion, Fmu, Isolation, Kind, Options, Variable};
use fmi_master::{Algorithm, Outcome, Pace, Samples, Simulation};
use fmi_system::{
    Between, InputTable, Library, Origin, System, SystemFile, Value, VariableName, assemble,
};
use pack::Installation;
use pack::library::FmuLibrary;
use units::hint;

/// The table that drives the inputs.
pub(super) const TABLE: &str = "record";

/// The FMU as a system with a table of its inputs.
#[derive(Clone)]
pub(super) struct Alone {
    system: System,
    /// Names of the outputs in a record.
    columns: Vec<String>,
    /// Positions of the parameters that may have drifted.
    parameters: Vec<usize>,
    /// Name of the component.
    pub component: String,
    /// What was set at the start, as the map has it.
    pub file: SystemFile,
    /// How the FMU is run.
    options: Options,
    /// Where components of the project come from.
    installation: Installation,
}

/// A model with the signals and parameters that its map names.
pub(super) struct Mapped {
    pub alone: Alone,
    pub inputs: Vec<Signal>,
    pub outputs: Vec<Signal>,
    pub parameters: Vec<Parameter>,
}

fn signal(variable: &Variable) -> Signal {
    Signal {
        name: variable.name.clone(),
        unit: variable.unit.clone().unwrap_or_default(),
    }
}

/// A name of a map that is not that of a real variable.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum NotReal {
    /// No variable of that kind.
    #[error("{model} has no {what} `{name}`{hint}")]
    Unknown {
        model: String,
        what: &'static str,
        name: String,
        hint: String,
    },
    /// A variable of another type.
    #[error("the {what} `{name}` is of the type {kind}: expected Float64 or Float32")]
    Type {
        what: &'static str,
        name: String,
        kind: &'static str,
    },
}

/// A variable that holds a real number.
fn real<'a>(fmu: &'a Fmu, name: &str, causality: Causality) -> Result<&'a Variable, NotReal> {
    let description = &fmu.description;
    let of = description.of(causality).map(|i| &description.variables[i]);
    let what = match causality {
        Causality::Input => "input",
        Causality::Output => "output",
        _ => "parameter",
    };
    let found = description
        .variable(name)
        .filter(|variable| match causality {
            // Start values of states are as good as parameters.
            Causality::Parameter => variable.is_settable && variable.causality != Causality::Input,
            _ => variable.causality == causality,
        });
    let found = found.ok_or_else(|| {
        let known = of.map(|variable| variable.name.as_str());
        NotReal::Unknown {
            model: description.model_name.clone(),
            what,
            name: name.to_owned(),
            hint: hint(name, known),
        }
    })?;
    match found.kind {
        Kind::Float64 | Kind::Float32 => Ok(found),
        _ => Err(NotReal::Type {
            what,
            name: name.to_owned(),
            kind: found.kind.name(),
        }),
    }
}

/// The FMU in a file, or the component of this project of that name.
///
/// # Errors
/// No such file or component; an FMU that cannot be read.
pub(super) fn open(path: &Path, installation: &Installation) -> Result<Arc<Fmu>, Error> {
    if is_file(path) {
        return Ok(Fmu::open(path)?);
    }
    let mut library = FmuLibrary::new(FmiVersion::V3, None).from(installation);
    library
        .fmu(&path.display().to_string())
        .map_err(|error| Error::Option {
            option: "--fmu",
            reason: error.to_string(),
        })
}

/// Whether it is a file, and no name of a component.
pub(super) fn is_file(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("fmu"))
}

/// The model in the file `path` with the `map` from the file `place`.
///
/// # Errors
/// An FMU that cannot be read; names that it has not; values that cannot be set.
pub(super) fn mapped(
    path: &Path,
    map: &Map,
    place: &Path,
    (isolation, installation): (Isolation, &Installation),
) -> Result<Mapped, Error> {
    let wrong = |at: String, reason: String| file_fault(place, format!("`{at}`: {reason}"));
    let mut file = SystemFile::of_fmu(path);
    let fmu = open(path, installation)?;
    let signals = |names: &mut dyn Iterator<Item = &String>, causality, table: &str| {
        let own = names.map(|name| {
            let variable = real(&fmu, name, causality);
            variable
                .map(signal)
                .map_err(|error| wrong(format!("{table}.{name}"), error.to_string()))
        });
        own.collect::<Result<Vec<Signal>, Error>>()
    };
    let inputs = signals(&mut map.inputs.keys(), Causality::Input, "inputs")?;
    let outputs = signals(&mut map.outputs.keys(), Causality::Output, "outputs")?;
    let component = file.components.keys().next().cloned().unwrap_or_default();
    if let Some(own) = file.components.get_mut(&component) {
        own.parameters.clone_from(&map.start);
        for (name, stated) in &map.parameters {
            real(&fmu, name, Causality::Parameter)
                .map_err(|error| wrong(format!("parameters.{name}"), error.to_string()))?;
            if let Some(value) = &stated.value {
                own.parameters.insert(name.clone(), value.clone());
            }
        }
    }
    file.own_tables.extend(table(&inputs));
    for input in &inputs {
        file.connect(
            Origin::output(TABLE, &input.name),
            VariableName::new(&component, &input.name),
        );
    }
    let system = assemble(&file, &[], &mut fmu.clone())?;
    let part = &system.components[0];
    let given = part.given();
    let parameters: Vec<(usize, Parameter)> = map
        .parameters
        .iter()
        .map(|(name, stated)| {
            let at = part.fmu.description.position(name).unwrap_or(0);
            let variable = &part.fmu.description.variables[at];
            let value = part.start_value(&given, at).number();
            check(value, stated)
                .map_err(|error| wrong(format!("parameters.{name}"), error.to_string()))?;
            let parameter = Parameter {
                name: name.clone(),
                unit: variable.unit.clone().unwrap_or_default(),
                value,
                plus_minus: stated.plus_minus,
            };
            Ok((at, parameter))
        })
        .collect::<Result<_, Error>>()?;
    let (places, parameters) = parameters.into_iter().unzip();
    let columns = outputs
        .iter()
        .map(|output| format!("{component}.{}", output.name));
    Ok(Mapped {
        alone: Alone {
            columns: columns.collect(),
            parameters: places,
            component,
            file,
            system,
            options: Options {
                isolation,
                ..installation.options()
            },
            installation: installation.clone(),
        },
        inputs,
        outputs,
        parameters,
    })
}

/// The table that drives `inputs`, to be filled for every run; none without an input.
fn table(inputs: &[Signal]) -> Option<InputTable> {
    (!inputs.is_empty()).then(|| InputTable {
        name: TABLE.to_owned(),
        columns: inputs.iter().map(|input| input.name.clone()).collect(),
        units: vec![None; inputs.len()],
        times: vec![0.0],
        values: vec![vec![0.0]; inputs.len()],
        between: Between::Hold,
    })
}

/// A drift that a map does not define.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum NoDrift {
    /// A deviation that is negative or not a number.
    #[error("`plus_minus` is {0}: expected a number, not negative")]
    PlusMinus(f64),
    /// Neither a value nor a deviation to compare with.
    #[error("it starts at 0, so a relative drift has no scale: expected `plus_minus`")]
    Scale,
}

fn check(value: f64, stated: &Stated) -> Result<(), NoDrift> {
    if !(stated.plus_minus.is_finite() && stated.plus_minus >= 0.0) {
        return Err(NoDrift::PlusMinus(stated.plus_minus));
    }
    if value == 0.0 && stated.plus_minus == 0.0 {
        return Err(NoDrift::Scale);
    }
    Ok(())
}

impl Alone {
    /// The system `file` whose component is that of `self`, driven by a table of `inputs` in place of its
    /// own; `columns` are its outputs.
    ///
    /// # Errors
    /// A system that does not fit its FMUs.
    pub(super) fn within(
        &self,
        mut file: SystemFile,
        inputs: &[Signal],
        columns: Vec<String>,
    ) -> Result<Self, Error> {
        file.tables.remove(TABLE);
        file.own_tables.extend(table(inputs));
        let mut library = FmuLibrary::of(FmiVersion::V3, &file).from(&self.installation);
        let system = assemble(&file, &[], &mut library)?;
        Ok(Self {
            system,
            columns,
            parameters: Vec::new(),
            component: self.component.clone(),
            file,
            options: self.options.clone(),
            installation: self.installation.clone(),
        })
    }

    /// The same, run otherwise.
    pub(super) fn isolated(&self, isolation: Isolation) -> Self {
        let mut own = self.clone();
        own.options.isolation = isolation;
        own
    }

    /// A run of `steps` steps.
    ///
    /// # Errors
    /// A model that cannot be loaded or initialized.
    pub(super) fn run(
        &self,
        inputs: &[&[f64]],
        parameters: &[(usize, f64)],
        step: f64,
        steps: usize,
    ) -> Result<Outcome, Error> {
        let mut system = self.system.clone();
        if let Some(table) = system.tables.first_mut() {
            table.times = (0..steps).map(|k| k as f64 * step).collect();
            table.values = inputs.iter().map(|own| own.to_vec()).collect();
        }
        for (place, value) in parameters {
            let position = self.parameters[*place];
            let own = &mut system.components[0].parameters;
            own.retain(|(known, _)| *known != position);
            own.push((position, Value::Number(*value)));
        }
        let plan = (step, steps as f64 * step);
        let algorithm = Algorithm::GaussSeidel;
        let simulation = Simulation::with(
            &system,
            &Samples::none(step),
            algorithm,
            plan,
            &self.options,
        )?;
        Ok(simulation.run(steps, Pace::Fastest, &mut |_| {}))
    }

    /// What the reader should know of the system.
    pub(super) fn notes(&self) -> &[String] {
        &self.system.notes
    }

    /// The outputs of a run of `steps` steps; none where it ended before.
    pub(super) fn outputs(&self, outcome: &Outcome, steps: usize) -> Option<Vec<Vec<f64>>> {
        if !outcome.ended.is_regular() || outcome.record.len() < steps {
            return None;
        }
        let own = self.columns.iter().map(|name| outcome.record.column(name));
        own.collect()
    }
}

impl Simulator for Alone {
    fn simulate(
        &self,
        inputs: &[&[f64]],
        parameters: &[(usize, f64)],
        step: f64,
        steps: usize,
    ) -> Option<Vec<Vec<f64>>> {
        let outcome = self.run(inputs, parameters, step, steps).ok()?;
        self.outputs(&outcome, steps)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    #[test]
    fn a_parameter_needs_a_scale_for_its_drift() {
        let stated = |plus_minus| Stated {
            value: None,
            plus_minus,
        };
        assert_eq!(check(2.0, &stated(0.0)), Ok(()));
        assert_eq!(check(0.0, &stated(0.5)), Ok(()));
        assert_eq!(check(0.0, &stated(0.0)), Err(NoDrift::Scale));
        for wrong in [-0.5, f64::NAN, f64::INFINITY] {
            let told = check(2.0, &stated(wrong)).unwrap_err().to_string();
            assert!(told.contains("expected a number, not negative"), "{told}");
        }
    }

    #[test]
    fn a_table_drives_every_input_and_there_is_none_without_one() {
        let signal = |name: &str| Signal {
            name: name.into(),
            unit: String::new(),
        };
        assert!(table(&[]).is_none());
        let own = table(&[signal("u"), signal("v")]).unwrap();
        assert_eq!(
            (own.columns, own.values.len(), own.units.len()),
            (vec!["u".into(), "v".into()], 2, 2)
        );
        assert_eq!((&*own.name, own.between), (TABLE, Between::Hold));
    }

    /// `y = 3 u` at the end of each step.
    pub(in crate::diagnosis::foreign) fn alone() -> Alone {
        use crate::made;
        let gain = made::real(1, "gain", "parameter", r#"variability="fixed" start="1""#);
        let fmu = made::computed("Gain", [&["u"], &["y"]], &gain, false, |inputs, outputs| {
            outputs[0] = 3.0 * inputs[0]
        });
        let mut library = FmuLibrary::new(FmiVersion::V3, None);
        library.give("Gain", fmu.clone());
        let mut file = SystemFile::default();
        file.add("own", fmi_system::ComponentFile::new("Gain"));
        file.own_tables
            .extend(table(&[signal(fmu.description.variable("u").unwrap())]));
        file.connect(Origin::output(TABLE, "u"), VariableName::new("own", "u"));
        let system = assemble(&file, &[], &mut library).unwrap();
        Alone {
            parameters: vec![fmu.description.position("gain").unwrap()],
            system,
            columns: vec!["own.y".into()],
            component: "own".into(),
            file,
            options: Options::default(),
            installation: Installation::default(),
        }
    }

    #[test]
    fn a_model_is_simulated_with_its_inputs_held_over_each_step() {
        let own = alone();
        let input = [1.0, 2.0, -1.0, 0.5];
        let found = own.simulate(&[&input], &[(0, 2.0)], 0.1, 4).unwrap();
        // The output at a sample is that of the step before it.
        assert_eq!(found, [[0.0, 3.0, 6.0, -3.0]]);
        let outcome = own.run(&[&input], &[], 0.1, 4).unwrap();
        assert!(own.outputs(&outcome, 4).is_some());
        assert!(
            own.outputs(&outcome, 5).is_none(),
            "a run that ended before"
        );
        let other = Alone {
            columns: vec!["own.z".into()],
            ..own.clone()
        };
        assert!(other.outputs(&outcome, 4).is_none());
        assert_eq!(
            own.isolated(Isolation::All).options.isolation,
            Isolation::All
        );
        assert!(own.notes().is_empty());
    }

    #[test]
    fn variables_of_a_map_are_real_and_of_their_kind() {
        use crate::made;
        let variables = made::real(1, "u", "input", r#"start="0""#)
            + &made::real(2, "y", "output", "")
            + &made::real(3, "p", "parameter", r#"variability="fixed" start="1""#)
            + r#"<Boolean name="on" valueReference="4" causality="input" start="true"/>"#;
        let fmu = made::fmu("Own", &variables);
        let found = |name: &str, causality| real(&fmu, name, causality).map(|own| own.name.clone());
        assert_eq!(found("u", Causality::Input).unwrap(), "u");
        assert_eq!(found("y", Causality::Output).unwrap(), "y");
        assert_eq!(found("p", Causality::Parameter).unwrap(), "p");
        let told = found("v", Causality::Input).unwrap_err().to_string();
        assert!(told.starts_with("Own has no input `v`"), "{told}");
        assert!(
            found("u", Causality::Output)
                .unwrap_err()
                .to_string()
                .starts_with("Own has no output `u`")
        );
        assert!(found("u", Causality::Parameter).is_err());
        let told = found("on", Causality::Input).unwrap_err().to_string();
        assert!(
            told.contains("is of the type Boolean: expected Float64 or Float32"),
            "{told}"
        );
        assert!(is_file(Path::new("a.FMU")) && !is_file(Path::new("ShakeTable")));
    }
}
