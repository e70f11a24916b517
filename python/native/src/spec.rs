//! What is simulated, from its description to a checked system.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use fmi_import::{Causality, FmiVersion, Fmu};
use fmi_master::Algorithm;
use fmi_system::{ComponentFile, Library, Origin, SystemFile, VariableName};
use laboratory::error::Error;
use laboratory::run::experiment::{
    Motions, Prepared, Request, is_file, prepare_shared, system_file,
};
use laboratory::systems::built_in;
use laboratory::systems::tuning::Tuning;
use motion::Scaling;
use pack::Installation;
use pack::library::FmuLibrary;
use serde::{Deserialize, Serialize};
use units::{STANDARD_GRAVITY, hint};

use super::callback::{Callback, Callbacks};

/// A number in a given unit, or text with one.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Quantity {
    Number(f64),
    Text(String),
}

/// The arguments that are data.
#[derive(Debug, Deserialize)]
pub struct Spec {
    system: String,
    plant: Option<String>,
    specimen: Option<String>,
    structure: Option<String>,
    tuning: Option<Tuning>,
    control_model: Option<PathBuf>,
    record: Option<PathBuf>,
    reference: Option<PathBuf>,
    scale: Option<f64>,
    pga: Option<Quantity>,
    peak: Option<Quantity>,
    seed: Option<u64>,
    #[serde(default)]
    set: Vec<String>,
    algorithm: Option<Algorithm>,
    step: Option<Quantity>,
    duration: Option<Quantity>,
    #[serde(default)]
    inputs: Vec<PathBuf>,
    #[serde(default)]
    functions: Vec<Given>,
    /// The folder of the project's FMUs.
    fmus: Option<PathBuf>,
    /// The program that becomes the process of a foreign FMU.
    guest: Option<PathBuf>,
}

/// A function in place of a component.
#[derive(Debug, Clone, Deserialize)]
struct Given {
    component: String,
    /// Names of inputs that the function takes.
    arguments: Vec<String>,
    /// Where inputs come from, `component.output`.
    #[serde(default)]
    sources: BTreeMap<String, String>,
    /// Period, s; none for that of the component.
    period: Option<f64>,
    /// What messages call it.
    label: String,
}

/// What a function gets and gives, in this order.
#[derive(Debug, Serialize)]
pub struct FunctionInterface {
    inputs: Vec<String>,
    outputs: Vec<String>,
    /// The output that a number alone is for.
    single: Option<usize>,
}

/// A checked system.
pub struct Made {
    pub request: Request,
    pub prepared: Prepared,
    pub functions: Vec<FunctionInterface>,
}

/// The project's components, opened once in a process, by the folder that they come from.
type Own = HashMap<Option<PathBuf>, Arc<Mutex<FmuLibrary>>>;
static OWN: LazyLock<Mutex<Own>> = LazyLock::new(Mutex::default);
static MOTIONS: LazyLock<Motions> = LazyLock::new(Motions::default);

fn fault(option: &'static str, reason: String) -> Error {
    Error::Option { option, reason }
}

fn positive(
    name: &'static str,
    quantity: Option<&Quantity>,
    unit: &str,
) -> Result<Option<f64>, Error> {
    let value = match quantity {
        None => return Ok(None),
        Some(Quantity::Number(value)) => *value,
        Some(Quantity::Text(text)) => {
            units::value_in(text, unit).map_err(|error| fault(name, error.to_string()))?
        }
    };
    match value > 0.0 {
        true => Ok(Some(value)),
        false => Err(fault(name, format!("{value} {unit} is not positive"))),
    }
}

impl Spec {
    /// The request, as the command line would make it.
    ///
    /// # Errors
    /// Quantities that cannot be read.
    fn request(&self) -> Result<Request, Error> {
        let absolute = |path: &PathBuf| std::path::absolute(path).unwrap_or_else(|_| path.clone());
        let scaling = match (self.scale, &self.pga, &self.peak) {
            (None, None, None) => None,
            (Some(factor), None, None) => Some(Scaling::Factor(factor)),
            (None, pga @ Some(_), None) => positive("pga", pga.as_ref(), "g")?
                .map(|pga| Scaling::PeakAcceleration(pga * STANDARD_GRAVITY)),
            (None, None, peak) => {
                positive("peak", peak.as_ref(), "m")?.map(Scaling::PeakDisplacement)
            }
            _ => {
                let reason = "scale, pga and peak exclude each other; pass one of them";
                return Err(fault("scale", reason.to_string()));
            }
        };
        let plant = self.plant.as_deref().unwrap_or(built_in::DEFAULT_PLANT);
        let specimen = self.specimen.as_deref();
        let specimen = specimen.unwrap_or(built_in::DEFAULT_SPECIMEN);
        let built_in = Request::built_in(&self.system);
        Ok(Request {
            system: match is_file(&self.system) {
                true => absolute(&PathBuf::from(&self.system)).display().to_string(),
                false => self.system.clone(),
            },
            plant: built_in::plant_path(plant),
            specimen: built_in::specimen_path(specimen),
            structure: self.structure.clone(),
            tuning: self.tuning,
            control_model: self.control_model.as_ref().map(absolute),
            record: self.record.as_ref().map(absolute),
            reference: self.reference.as_ref().map(absolute),
            seed: self.seed.unwrap_or(built_in.seed),
            scaling,
            set: self.set.clone(),
            algorithm: self.algorithm,
            step_s: positive("step", self.step.as_ref(), "s")?,
            duration_s: positive("duration", self.duration.as_ref(), "s")?,
            inputs: self.inputs.iter().map(absolute).collect(),
            installation: Installation::new(self.fmus.clone(), self.guest.clone()),
            ..built_in
        })
    }

    /// The system with functions in place of components, checked.
    ///
    /// # Errors
    /// Whatever is at fault.
    pub fn prepare(&self, callbacks: Callbacks) -> Result<Made, Error> {
        let request = self.request()?;
        let mut file = system_file(&request, None)?;
        let mut functions = Vec::new();
        // A file's FMUs may change between two simulations; those of the project do not.
        let prepared = if is_file(&request.system) || !self.functions.is_empty() {
            let library =
                Mutex::new(FmuLibrary::of(FmiVersion::V3, &file).from(&request.installation));
            for (given, number) in self.functions.iter().zip(0..) {
                let callback = (number, callbacks);
                functions.push(given.put_into(&mut file, &library, callback)?);
            }
            prepare_shared(&request, &file, &library, &MOTIONS)?
        } else {
            let open = || FmuLibrary::new(FmiVersion::V3, None).from(&request.installation);
            let library = Arc::clone(
                OWN.lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .entry(self.fmus.clone())
                    .or_insert_with(|| Arc::new(Mutex::new(open()))),
            );
            prepare_shared(&request, &file, &library, &MOTIONS)?
        };
        Ok(Made {
            request,
            prepared,
            functions,
        })
    }
}

impl Given {
    /// Puts the function in place of its component.
    ///
    /// # Errors
    /// A component that the system has not, or arguments that are not inputs of it.
    fn put_into(
        &self,
        file: &mut SystemFile,
        library: &Mutex<FmuLibrary>,
        (number, callbacks): (u32, Callbacks),
    ) -> Result<FunctionInterface, Error> {
        let name = self.component.clone();
        let wrong = |reason: String| fault("functions", reason);
        let Some(part) = file.components.get(&name) else {
            let known: Vec<&str> = file.components.keys().map(String::as_str).collect();
            return Err(wrong(format!(
                "`{name}` is not a component of `{}`{}; expected one of {}",
                file.name,
                hint(&name, known.iter().copied()),
                known.join(", ")
            )));
        };
        let own = fmu(part, library).map_err(|reason| wrong(format!("`{name}`: {reason}")))?;
        let is_sampled = part.period.is_some() || self.period.is_some();
        for (input, source) in &self.sources {
            let from = source.parse::<Origin>();
            let from = from.map_err(|error| wrong(error.to_string()))?;
            let to = VariableName::new(&name, input);
            file.connections.retain(|link| link.to != to);
            file.connect(from, to);
        }
        let further: Vec<String> = self
            .sources
            .keys()
            .filter(|input| own.description.position(input).is_none())
            .cloned()
            .collect();
        let inputs = own.description.of(Causality::Input);
        let inputs = inputs.map(|at| own.description.variables[at].name.clone());
        let inputs: Vec<String> = inputs.chain(further.iter().cloned()).collect();
        let outputs = own.description.of(Causality::Output);
        let outputs = outputs.map(|at| own.description.variables[at].name.clone());
        let outputs: Vec<String> = outputs.collect();
        for argument in &self.arguments {
            if !inputs.contains(argument) {
                return Err(wrong(format!(
                    "{}: its argument `{argument}` is not an input of `{name}`{}; expected time, step \
                     or some of {}, or name its source in `inputs`",
                    self.label,
                    hint(argument, inputs.iter().map(String::as_str)),
                    inputs.join(", ")
                )));
            }
        }
        let is_used = |output: &&String| {
            file.connections.iter().any(|link| {
                matches!(&link.from, Origin::Output(from)
                    if from.component == name && from.variable == **output)
            })
        };
        let used: Vec<&String> = match outputs.len() {
            1 => outputs.iter().collect(),
            _ => outputs.iter().filter(is_used).collect(),
        };
        let single = match used[..] {
            [only] => outputs.iter().position(|output| output == only),
            _ => None,
        };
        let make = move |_: &str| {
            let callback = Callback { number, callbacks };
            Ok(Box::new(callback) as Box<dyn fmi_import::Behaviour>)
        };
        let mut computed = own.computed_by(&further, is_sampled, Arc::new(make));
        computed.path = PathBuf::from(&self.label);
        let key = format!("the function in place of {name}");
        library
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .give(&key, Arc::new(computed));
        if let Some(part) = file.components.get_mut(&name) {
            part.fmu = key;
            if let Some(period) = self.period {
                part.period = Some(period.into());
            }
        }
        Ok(FunctionInterface {
            inputs,
            outputs,
            single,
        })
    }
}

/// The FMU of a component.
fn fmu(part: &ComponentFile, library: &Mutex<FmuLibrary>) -> Result<Arc<Fmu>, String> {
    let mut library = library.lock().unwrap_or_else(PoisonError::into_inner);
    library.fmu(&part.fmu).map_err(|error| error.to_string())
}
