//! From recordings to the rig: actuator, table and specimen with standard errors.
//!
//! Instrumental variables give a start; Gauss-Newton on the predictor of the whole rig
//! ([`crate::identify::model`]) refines it. The last quarter of each recording is kept for validation.

use plant::specimens::linear::LinearSpecimen;

use crate::identify::assessment::assess;
use crate::identify::checks;
use crate::identify::identifiability;
use crate::identify::identified::RigIdentification;
use crate::identify::instrument::bias;
use crate::identify::model::RigModel;
use crate::identify::parameters::{Name, NoiseOn, Own, Physical, PhysicalValues};
use crate::identify::setup::{fit_part, parameters, whole_recordings};
use crate::identify::start;
use recordings::IdentificationError;
use recordings::{Channel, Recording};
use sysid::gauss_newton::{self, FINE, GaussNewtonEstimate, Search};
use sysid::prediction::{Parameter, cost};

/// How to identify.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Part of each recording that is fitted; the rest validates.
    pub fit_part: f64,
    /// Whether a delay of the command is looked for.
    pub delay: bool,
    /// A specimen whose parameters are known: they are held. It stands on the table in the
    /// recordings with `specimen_acceleration`, or in all of them if none has that channel.
    pub specimen: Option<LinearSpecimen>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            fit_part: 0.75,
            delay: true,
            specimen: None,
        }
    }
}

/// Identifies a rig from its recordings: `valve_command`, `displacement`, `acceleration`,
/// `actuator_force` and, where a specimen stands on the table, `specimen_acceleration`.
///
/// # Errors
/// Every way in which data give no model, see [`IdentificationError`].
pub fn identify(
    recordings: &[Recording],
    options: Options,
) -> Result<RigIdentification, IdentificationError> {
    let mut experiments = Vec::new();
    let mut warnings = Vec::new();
    let sensed = recordings
        .iter()
        .any(|recording| recording.channel(SPECIMEN_SENSOR).is_some());
    for recording in recordings {
        warnings.extend(checks::check(recording, options.fit_part)?);
        let mut data = fit_part(recording, options.fit_part)?;
        data.specimen |= options.specimen.is_some() && !sensed;
        experiments.push(data);
    }
    if experiments.is_empty() {
        return Err(IdentificationError::Unreadable {
            recording: "no recording".into(),
            what: "nothing to fit".into(),
            expected: "at least one recording",
        });
    }
    let start = start::start(&experiments, options.specimen, options.delay)?;
    let model = RigModel { experiments };
    let known = options.specimen.is_some();
    let mut parameters = parameters(&model, &start, recordings, known, options.delay);
    let separable = identifiability::inseparable(&model, &parameters);
    let mut identifiable = true;
    if let Some(found) = separable {
        warnings.push(found.message);
        parameters[found.hold].free = false;
        identifiable = false;
    }
    approach(&model, &mut parameters)?;
    let mut estimate = gauss_newton::fit(&model, &parameters, Search::nearby(FITTED))?;
    let mut iterations = estimate.iterations;
    restart(&mut parameters, &estimate);
    for _ in 0..3 {
        if !move_delay(&model, &mut parameters) {
            break;
        }
        estimate = gauss_newton::fit(&model, &parameters, Search::nearby(FITTED))?;
        iterations += estimate.iterations;
        restart(&mut parameters, &estimate);
    }
    if options.delay && drop_no_delay(&model, &mut parameters, &estimate) {
        estimate = gauss_newton::fit(&model, &parameters, Search::nearby(FITTED))?;
        iterations += estimate.iterations;
    }
    if identifiable {
        estimate = hold_undetermined_slow_zero(&model, &mut parameters, estimate, &mut warnings)?;
    }
    let whole = whole_recordings(recordings, &model)?;
    let mut found = assess(
        &whole,
        &model,
        &parameters,
        &estimate,
        identifiable,
        warnings,
    )?;
    // What was validated is then fitted to everything there is.
    restart(&mut parameters, &estimate);
    let estimate = gauss_newton::fit(&whole, &parameters, Search::nearby(FINE))?;
    found.iterations = iterations + estimate.iterations;
    found.singular_values = start.singular_values;
    found.take(&parameters, estimate);
    found.warnings.splice(0..0, bias(&found, recordings));
    Ok(found)
}

/// The channel that tells that a specimen stands on the table.
const SPECIMEN_SENSOR: Channel = Channel::SpecimenAcceleration;
/// The constants of denominator and G1, which make the slow pole and zero.
const SLOW: [Physical; 2] = [Physical::A0, Physical::B0];
/// Place of the delay.
const DELAY: usize = Physical::CommandDelay.place();
/// Tolerance of the fit that is validated; the last one starts from it.
const FITTED: f64 = 0.3;

/// Holds a delay that is not clearly above zero at zero, and says whether it did.
fn drop_no_delay(
    model: &RigModel,
    parameters: &mut [Parameter],
    estimate: &GaussNewtonEstimate,
) -> bool {
    let delay = parameters[DELAY].start;
    let least = 1e-3 * model.experiments[0].period;
    let none = delay < least.max(4.0 * estimate.standard_error(DELAY));
    if none {
        parameters[DELAY].free = false;
        parameters[DELAY].start = 0.0;
    }
    none
}

/// First steps, to where full ones of everything converge: offsets and initial states alone, which
/// enter linearly; then all but the noise; then the noise.
fn approach(model: &RigModel, parameters: &mut [Parameter]) -> Result<(), IdentificationError> {
    const COARSE: f64 = 3.0;
    let is_noise = |i: usize| matches!(Name::at(i), Name::Own(Own::LogNoise(_)));
    let is_linear = |i: usize| {
        matches!(
            Name::at(i),
            Name::Own(Own::Offset(_) | Own::InitialState(_))
        )
    };
    let linear = Search {
        iterations: 4,
        ..Search::nearby(COARSE)
    };
    let coarse = Search {
        iterations: 25,
        ..Search::within(COARSE)
    };
    // Where command and table force are noisy, the start may be far off; where they are not, the
    // delay is sharp.
    for process in [0.03f64, 0.005] {
        for experiment in 0..model.experiments.len() {
            for noise in [NoiseOn::Command, NoiseOn::Table] {
                parameters[Own::LogNoise(noise).of(experiment)].start = process.ln();
            }
        }
        stage(model, parameters, &is_linear, linear)?;
        for _ in 0..4 {
            stage(model, parameters, &|i| !is_noise(i), coarse)?;
            if !move_delay(model, parameters) {
                break;
            }
        }
    }
    stage(model, parameters, &is_noise, coarse)?;
    Ok(())
}

/// Fits those of the free parameters that are chosen; returns the cost.
fn stage(
    model: &RigModel,
    parameters: &mut [Parameter],
    chosen: &dyn Fn(usize) -> bool,
    search: Search,
) -> Result<f64, IdentificationError> {
    let mut some = parameters.to_vec();
    for (i, parameter) in some.iter_mut().enumerate() {
        parameter.free &= chosen(i);
    }
    let (estimate, _) = gauss_newton::fit_within(model, &some, search)?;
    restart(parameters, &estimate);
    Ok(estimate.cost)
}

/// Moves a free delay to where the cost is less, up to two samples away.
///
/// The command of a controlled rig is noise from sample to sample, so the cost has a kink at every
/// whole sample and may have a minimum between any two.
fn move_delay(model: &RigModel, parameters: &mut [Parameter]) -> bool {
    if !parameters[DELAY].free {
        return false;
    }
    let mut values: Vec<f64> = parameters.iter().map(|p| p.start).collect();
    let here = values[DELAY];
    let mut least = cost(model, &values);
    let period = model.experiments[0].period;
    let steps = (0..7).map(|halvings| 2.0 * period * 0.5f64.powi(halvings));
    for change in steps.flat_map(|step| [-step, step]) {
        values[DELAY] = (here + change).max(0.0);
        let own = cost(model, &values);
        if own.is_some() && (least.is_none() || own < least) {
            least = own;
            parameters[DELAY].start = values[DELAY];
        }
    }
    parameters[DELAY].start != here
}

fn restart(parameters: &mut [Parameter], estimate: &GaussNewtonEstimate) {
    for (parameter, value) in parameters.iter_mut().zip(&estimate.parameters) {
        parameter.start = *value;
    }
}

/// Where the constants of denominator and G1 are lost in their errors and would make a rig that
/// must not be simulated, both are held at zero (they cancel) and the rest is fitted again.
fn hold_undetermined_slow_zero(
    model: &RigModel,
    parameters: &mut [Parameter],
    estimate: GaussNewtonEstimate,
    warnings: &mut Vec<String>,
) -> Result<GaussNewtonEstimate, IdentificationError> {
    let lost = SLOW
        .map(Physical::place)
        .iter()
        .any(|&place| estimate.standard_error(place) > 0.5 * estimate.parameters[place].abs());
    if lost {
        warnings.push(
            "the slow pole and zero of the actuator (a0, b0) are not determined by these data: \
             excite down to 0.02 Hz for a minute or longer to find them"
                .into(),
        );
    }
    let physical = PhysicalValues::of(&estimate.parameters);
    let actuator = physical.rig(0.0, false).shake_table.actuator;
    if SLOW.iter().all(|&name| physical[name] >= 0.0) && actuator.validate().is_ok() {
        return Ok(estimate);
    }
    if !lost {
        warnings.push(
            "slow drift outside this model gave the actuator a slow pole or zero that cannot be \
             simulated; both are held at zero, where they cancel"
                .into(),
        );
    }
    restart(parameters, &estimate);
    for name in SLOW {
        parameters[name.place()].start = 0.0;
        parameters[name.place()].free = false;
    }
    gauss_newton::fit(model, parameters, Search::nearby(FITTED))
}
