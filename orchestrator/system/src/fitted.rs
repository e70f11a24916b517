//! An FMU as its system has it: with arrays of other sizes, and with units that the file gives.

use std::sync::Arc;

use super::error::Misfit;
use super::file::{ComponentFile, Stepping};
use super::given::as_toml;
use super::value::{self, Value};
use fmi_import::{BaseUnit, Fmu, FmuError, Interface, Kind};
use units::{Unit, hint};

/// Why an FMU cannot be used as the file or the command line asks.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// An interface of no name.
    #[error("`{0}`: expected `co-simulation` or `model-exchange`")]
    Interface(String),
    /// A tolerance that is not a number.
    #[error("`{0}`: expected a number between 1e-12 and 0.01")]
    NotANumber(String),
    /// A tolerance that is too small or too large.
    #[error("{0}: expected a number between 1e-12 and 0.01")]
    Tolerance(f64),
    /// An interface that the FMU does not offer.
    #[error("it offers model exchange only; remove this line")]
    ModelExchangeOnly,
    /// It does not become what is asked.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// A unit for a variable that is not there.
    #[error("no such variable{hint}")]
    NoVariable {
        /// The nearest name.
        hint: String,
    },
    /// A unit for a variable that is not a real number.
    #[error("a {0} has no unit")]
    NoUnit(&'static str),
}

/// The FMU with arrays as large as the structural parameters say that the file or the command line
/// gives.
pub(super) fn resized(
    fmu: Arc<Fmu>,
    name: &str,
    part: &ComponentFile,
    settings: &[String],
) -> Result<Arc<Fmu>, Misfit> {
    let description = &fmu.description;
    let structural = |variable: &str| {
        let position = description.position(variable)?;
        let sizes_arrays = description.variables[position].is_structural;
        sizes_arrays.then_some(position)
    };
    let mut sizes: Vec<(usize, u64)> = Vec::new();
    let mut note = |position: usize, value: Value| {
        let size = match value {
            Value::Unsigned(size) => Some(size),
            Value::Signed(size) => u64::try_from(size).ok(),
            Value::Number(size) => Some(size as u64),
            Value::Text(_) => None,
        };
        if let Some(size) = size {
            sizes.retain(|(known, _)| *known != position);
            sizes.push((position, size));
        }
    };
    for (variable, written) in &part.parameters {
        if let Some(position) = structural(variable) {
            note(
                position,
                value::read(&description.variables[position], written)?,
            );
        }
    }
    for setting in settings {
        if let Some((variable, text)) = setting.split_once('=')
            && let Some(variable) = variable.trim().strip_prefix(name)
            && let Some(variable) = variable.strip_prefix('.')
            && let Some(position) = structural(variable)
        {
            let variable = &description.variables[position];
            note(
                position,
                value::read(variable, &as_toml(variable, text.trim()))?,
            );
        }
    }
    if sizes.is_empty() {
        return Ok(fmu);
    }
    Ok(fmu.resized(&sizes)?)
}

/// Names that `--set component.NAME=VALUE` gives to how a component is stepped, unless they are variables
/// of it.
const STEPPING: [&str; 2] = ["interface", "tolerance"];

/// Whether a setting of the command line is about how the FMU is stepped.
pub(super) fn is_stepping(fmu: &Fmu, variable: &str) -> bool {
    STEPPING.contains(&variable) && fmu.description.position(variable).is_none()
}

/// The FMU for the interface, and with the tolerance, that the file or the command line asks for. Faults
/// come with the key that they belong to.
pub(super) fn stepped(
    fmu: Arc<Fmu>,
    name: &str,
    part: &ComponentFile,
    settings: &[String],
) -> Result<Arc<Fmu>, (&'static str, FitError)> {
    let set = |key: &str| {
        let found = settings.iter().rev().find_map(|setting| {
            let (variable, text) = setting.split_once('=')?;
            let variable = variable.trim().strip_prefix(name)?.strip_prefix('.')?;
            (variable == key).then(|| text.trim().to_string())
        });
        found.filter(|_| is_stepping(&fmu, key))
    };
    let interface = match set("interface").as_deref() {
        Some("model-exchange") => Some(Stepping::ModelExchange),
        Some("co-simulation") => Some(Stepping::CoSimulation),
        Some(other) => {
            let reason = FitError::Interface(other.to_string());
            return Err(("interface", reason));
        }
        None => part.interface,
    };
    let tolerance = match set("tolerance") {
        Some(text) => Some(text.parse().map_err(|_| {
            let reason = FitError::NotANumber(text.clone());
            ("tolerance", reason)
        })?),
        None => part.tolerance,
    };
    if let Some(tolerance) = tolerance
        && !(1e-12..=1e-2).contains(&tolerance)
    {
        return Err(("tolerance", FitError::Tolerance(tolerance)));
    }
    let offered = fmu.description.interface;
    let fmu = match interface {
        Some(Stepping::ModelExchange) => fmu
            .for_model_exchange()
            .map_err(|error| ("interface", error.into()))?,
        Some(Stepping::CoSimulation) if offered == Interface::ModelExchange => {
            return Err(("interface", FitError::ModelExchangeOnly));
        }
        _ => fmu,
    };
    if tolerance.is_none() {
        return Ok(fmu);
    }
    let mut changed = Fmu::clone(&fmu);
    changed.tolerance = tolerance;
    Ok(Arc::new(changed))
}

/// The FMU with the units that the file gives to its variables.
pub(super) fn with_units(
    fmu: Arc<Fmu>,
    part: &ComponentFile,
) -> Result<Arc<Fmu>, (String, FitError)> {
    if part.units.is_empty() {
        return Ok(fmu);
    }
    let mut changed = Fmu::clone(&fmu);
    for (variable, unit) in &part.units {
        let fault = |reason: FitError| (variable.clone(), reason);
        let found = fmu
            .description
            .array(variable)
            .or_else(|| fmu.description.position(variable).map(|at| at..at + 1));
        let found = found.ok_or_else(|| {
            let known = fmu.description.variables.iter();
            let known = known.map(|variable| variable.name.as_str());
            fault(FitError::NoVariable {
                hint: hint(variable, known),
            })
        })?;
        // A unit that only FMUs know is taken by its name.
        let parsed = Unit::parse(unit).ok().and_then(|unit| unit.base_unit());
        let base = parsed.map(|base| {
            let [kg, m, s, a, k, mol, cd, _] = base.exponents;
            BaseUnit {
                exponents: [kg, m, s, a, k, mol, cd],
                factor: base.factor,
                offset: 0.0,
            }
        });
        for position in found {
            let variable = &mut changed.description.variables[position];
            if !matches!(variable.kind, Kind::Float64 | Kind::Float32) {
                return Err(fault(FitError::NoUnit(variable.kind.name())));
            }
            variable.unit = Some(unit.clone());
            variable.base_unit = base;
        }
    }
    Ok(Arc::new(changed))
}
