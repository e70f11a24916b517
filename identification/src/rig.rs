//! From recordings to the rig: actuator, table and specimen with standard errors.
//!
//! Instrumental variables give a start; Gauss-Newton on the predictor of the whole rig
//! ([`crate::rig_model`]) refines it. The last quarter of each recording is kept for validation.

use nalgebra::{Complex, DMatrix, DVector};
use plant::actuator::IdentifiedActuator;
use plant::rig::Rig;

use crate::IdentificationError;
use crate::checks;
use crate::data::Recording;
use crate::gauss_newton::{self, Estimate, FINE, Parameter};
use crate::identifiability;
use crate::residuals::{ResidualTest, residual_test};
use crate::rig_model::{
    DELAY, Experiment, MASS, NUISANCE, OUTPUT_NAMES, OUTPUTS, PHYSICAL, PHYSICAL_NAMES, RigModel,
    SPECIMEN, STATES, rig_from,
};
use crate::rig_start;
use crate::validation::{self, ChannelFit};

/// How to identify.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Part of each recording that is fitted; the rest validates.
    pub fit_part: f64,
    /// Whether a delay of the command is looked for.
    pub delay: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            fit_part: 0.75,
            delay: true,
        }
    }
}

/// The identified rig, SI.
#[derive(Debug, Clone)]
pub struct RigIdentification {
    /// Physical parameters as in [`PHYSICAL_NAMES`].
    pub physical: Vec<f64>,
    /// Their standard errors.
    pub standard_error: Vec<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Whether a specimen stood on the table in any recording.
    pub specimen: bool,
    /// Payload of each recording over the first one's, kg, with its standard error.
    pub payload: Vec<(f64, f64)>,
    /// Whether the data determine the actuator.
    pub identifiable: bool,
    /// Part of the actuator that is not determined, in words.
    pub warnings: Vec<String>,
    /// Relative noise by channel and recording is in here, with offsets and initial states.
    pub parameters: Vec<f64>,
    /// The model that predicts.
    pub model: RigModel,
    /// Fit per recording and channel on the validation part.
    pub fits: Vec<ChannelFit>,
    /// Tests of the one-step errors on the validation part, per recording and channel.
    pub residuals: Vec<(String, &'static str, ResidualTest)>,
    /// Singular values of the subspace method.
    pub singular_values: DVector<f64>,
    /// Iterations of the refinement.
    pub iterations: usize,
}

impl RigIdentification {
    /// The rig with a recording's payload; `specimen` says whether one stands on it.
    pub fn rig(&self) -> Rig {
        rig_from(&self.physical, 0.0, self.specimen)
    }

    /// Poles of G1 and G2, 1/s.
    pub fn actuator_poles(&self) -> Vec<Complex<f64>> {
        self.rig().shake_table.actuator.g1().poles()
    }

    /// Poles of the bare table, 1/s.
    pub fn table_poles(&self) -> Vec<Complex<f64>> {
        self.rig().shake_table.table.transfer_function().poles()
    }

    /// Standard deviation of the white noise of an output of a recording, SI.
    pub fn noise(&self, recording: usize, output: usize) -> f64 {
        let relative = self.parameters[self.model.noise(recording, output)].exp();
        relative * self.model.experiments[recording].scale[output]
    }

    /// Takes over the numbers of an estimate.
    fn take(&mut self, parameters: &[Parameter], estimate: Estimate) {
        self.physical = estimate.parameters[..PHYSICAL].to_vec();
        self.covariance = estimate
            .covariance
            .view((0, 0), (PHYSICAL, PHYSICAL))
            .into_owned();
        self.standard_error = (0..PHYSICAL)
            .map(|i| {
                if parameters[i].free {
                    estimate.standard_error(i)
                } else {
                    0.0
                }
            })
            .collect();
        self.payload = (0..self.model.experiments.len())
            .map(|index| {
                let at = self.model.nuisance(index);
                (estimate.parameters[at], estimate.standard_error(at))
            })
            .collect();
        self.parameters = estimate.parameters;
    }

    /// Largest relative standard error of the responses of G1 and G2 over `frequencies` (Hz).
    pub fn response_error(&self, frequencies: &[f64]) -> [f64; 2] {
        response_error(&self.physical, &self.covariance, frequencies)
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
    for recording in recordings {
        warnings.extend(checks::check(recording, options.fit_part)?);
        experiments.push(experiment(recording, options.fit_part)?);
    }
    if experiments.is_empty() {
        return Err(IdentificationError::Unreadable {
            recording: "no recording".into(),
            what: "nothing to fit".into(),
            expected: "at least one recording",
        });
    }
    let start = rig_start::start(&experiments)?;
    let model = RigModel { experiments };
    let mut parameters = parameters(&model, &start, recordings);
    let separable = identifiability::inseparable(&model, &parameters);
    let mut identifiable = true;
    if let Some(found) = separable {
        warnings.push(found.message);
        parameters[found.hold].free = false;
        identifiable = false;
    }
    approach(&model, &mut parameters)?;
    if options.delay && identifiable {
        free_late_command(&model, &mut parameters)?;
    }
    let mut estimate = gauss_newton::fit(&model, &parameters, FITTED)?;
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
    let estimate = gauss_newton::fit(&whole, &parameters, FINE)?;
    found.iterations += estimate.iterations;
    found.singular_values = start.singular_values;
    found.take(&parameters, estimate);
    Ok(found)
}

/// Tolerance of the fit that is validated; the last one starts from it.
const FITTED: f64 = 0.3;

/// Goes on with the delay free, and keeps it so where it is clearly above zero.
fn free_late_command(
    model: &RigModel,
    parameters: &mut [Parameter],
) -> Result<(), IdentificationError> {
    let mut late = parameters.to_vec();
    late[DELAY].free = true;
    late[DELAY].largest_step = 2.0 * model.experiments[0].period;
    approach(model, &mut late)?;
    let (step, error) = gauss_newton::score_test(model, &late, DELAY)?;
    let delay = late[DELAY].start + step;
    if delay > 4.0 * error && delay > 1e-3 * model.experiments[0].period {
        parameters.clone_from_slice(&late);
    }
    Ok(())
}

/// The same experiments to their end, with the scales of the fitted part.
fn whole_recordings(
    recordings: &[Recording],
    model: &RigModel,
) -> Result<RigModel, IdentificationError> {
    let mut experiments = Vec::new();
    for (recording, data) in recordings.iter().zip(&model.experiments) {
        let mut whole = scaled_experiment(recording, &recording.cut(0, data.command.len()))?;
        whole.scale = data.scale;
        whole.command_scale = data.command_scale;
        experiments.push(whole);
    }
    Ok(RigModel { experiments })
}

/// One recording's fit part, scaled.
fn experiment(recording: &Recording, fit_part: f64) -> Result<Experiment, IdentificationError> {
    let fitted = recording.cut(0, (recording.len() as f64 * fit_part) as usize);
    scaled_experiment(&fitted, &fitted)
}

/// `recording` with the scales of `fitted`.
pub(crate) fn scaled_experiment(
    recording: &Recording,
    fitted: &Recording,
) -> Result<Experiment, IdentificationError> {
    const NEEDED: &str = "valve_command, displacement, acceleration, actuator_force and, with a specimen, \
         specimen_acceleration";
    let command = fitted.require("valve_command", NEEDED)?;
    let command_scale = crate::data::mean_and_deviation(command).1;
    let mut scale = [1.0; OUTPUTS];
    let mut measured = [true; OUTPUTS];
    for (i, name) in OUTPUT_NAMES.iter().enumerate() {
        let optional = i == OUTPUTS - 1;
        if optional && fitted.channel(name).is_none() {
            measured[i] = false;
        } else {
            scale[i] = crate::data::mean_and_deviation(fitted.require(name, NEEDED)?).1;
        }
    }
    let specimen = measured[OUTPUTS - 1];
    let column = |name: &str| recording.channel(name).unwrap_or(&[]);
    let channels = OUTPUT_NAMES.map(column);
    let outputs = (0..recording.len())
        .map(|k| {
            nalgebra::SVector::from_fn(|i, _| {
                channels[i].get(k).map_or(0.0, |value| value / scale[i])
            })
        })
        .collect();
    Ok(Experiment {
        name: recording.name.clone(),
        period: recording.period,
        command: column("valve_command").to_vec(),
        outputs,
        scale,
        command_scale,
        measured,
        specimen,
    })
}

/// All parameters with start, scale and bounds.
fn parameters(
    model: &RigModel,
    start: &rig_start::Start,
    recordings: &[Recording],
) -> Vec<Parameter> {
    let s = &start.physical;
    let specimen = model.experiments.iter().any(|e| e.specimen);
    // What each coefficient is worth beside its neighbour at 0.01 to 5 rad/s.
    let natural = [
        s[0].abs().max(0.5 * s[1].abs().sqrt()),
        s[1].abs(),
        s[2].abs().max(0.01 * s[1].abs()),
        s[3].abs(),
        s[4].abs(),
        s[5].abs().max(0.01 * s[4].abs()),
        s[6].abs(),
        s[7].abs().max(5.0 * s[6].abs()),
        s[8].abs(),
        s[MASS],
        s[MASS + 1]
            .abs()
            .max(0.02 * (s[MASS] * s[MASS + 2].abs()).sqrt()),
        s[MASS + 2].abs(),
        s[SPECIMEN].abs(),
        s[SPECIMEN + 1]
            .abs()
            .max(0.01 * (s[SPECIMEN] * s[SPECIMEN + 2].abs()).sqrt()),
        s[SPECIMEN + 2].abs(),
        model.experiments[0].period,
    ];
    let mut parameters: Vec<Parameter> = (0..PHYSICAL)
        .map(|i| {
            let mut parameter = Parameter::new(PHYSICAL_NAMES[i], s[i], 0.1 * natural[i]);
            parameter.largest_step = natural[i].max(f64::MIN_POSITIVE);
            if (SPECIMEN..DELAY).contains(&i) {
                parameter.free = specimen;
            }
            parameter
        })
        .collect();
    parameters[MASS].bounds = (1e-3 * s[MASS], 1e3 * s[MASS]);
    parameters[SPECIMEN].bounds = (1e-4 * s[MASS], 1e4 * s[MASS]);
    parameters[DELAY].free = false;
    parameters[DELAY].bounds = (0.0, 0.1);
    for (index, data) in model.experiments.iter().enumerate() {
        let own = |name: &str, start: f64, scale: f64| {
            let mut parameter = Parameter::new(name, start, scale);
            parameter.experiment = Some(index);
            parameter
        };
        let earlier =
            (0..index).any(|before| recordings[before].source == recordings[index].source);
        let mut payload = own("payload", start.mass[index] - s[MASS], 0.1 * s[MASS]);
        payload.free = index > 0 && !earlier;
        if !payload.free {
            payload.start = 0.0;
        }
        payload.bounds = (-0.9 * s[MASS], 1e3 * s[MASS]);
        parameters.push(payload);
        for i in 0..OUTPUTS {
            let mut offset = own(&format!("{} offset", OUTPUT_NAMES[i]), 0.0, 1.0);
            offset.free = data.measured[i];
            parameters.push(offset);
        }
        for i in 0..STATES {
            let mut state = own("initial state", 0.0, 1.0);
            state.free = i < 5 || data.specimen;
            parameters.push(state);
        }
        for i in 0..OUTPUTS + 2 {
            let (start, low) = match i {
                0..OUTPUTS => (start.noise[index][i].clamp(1e-5, 0.3).ln(), 1e-6f64.ln()),
                _ => (0.02f64.ln(), 1e-4f64.ln()),
            };
            let mut noise = own("logarithm of noise", start, 1.0);
            noise.free = i >= OUTPUTS || data.measured[i];
            noise.bounds = (low, 1f64.ln());
            noise.largest_step = 1.5;
            parameters.push(noise);
        }
        debug_assert_eq!(parameters.len(), PHYSICAL + (index + 1) * NUISANCE);
    }
    parameters
}

/// First steps with the noise held: offsets and initial states alone, which enter linearly, then
/// everything but the noise.
fn approach(model: &RigModel, parameters: &mut [Parameter]) -> Result<(), IdentificationError> {
    const COARSE: f64 = 3.0;
    let mut held = parameters.to_vec();
    for experiment in 0..model.experiments.len() {
        for channel in 0..OUTPUTS + 2 {
            held[model.noise(experiment, channel)].free = false;
        }
    }
    let mut linear = held.clone();
    for (i, parameter) in linear.iter_mut().enumerate() {
        let payload = (0..model.experiments.len()).any(|e| i == model.nuisance(e));
        parameter.free &= i >= PHYSICAL && !payload;
    }
    // What a late command makes of these steps need not settle.
    const STEPS: usize = 12;
    let (estimate, _) = gauss_newton::fit_within(model, &linear, COARSE, STEPS)?;
    restart(&mut held, &estimate);
    let (estimate, _) = gauss_newton::fit_within(model, &held, COARSE, STEPS)?;
    restart(parameters, &estimate);
    Ok(())
}

fn restart(parameters: &mut [Parameter], estimate: &Estimate) {
    for (parameter, value) in parameters.iter_mut().zip(&estimate.parameters) {
        parameter.start = *value;
    }
}

/// Where the constants of denominator and G1 are lost in their errors and would make a rig that
/// must not be simulated, both are held at zero (they cancel) and the rest is fitted anew.
fn hold_undetermined_slow_zero(
    model: &RigModel,
    parameters: &mut [Parameter],
    estimate: Estimate,
    warnings: &mut Vec<String>,
) -> Result<Estimate, IdentificationError> {
    const A0: usize = 2;
    const B0: usize = 5;
    let lost = [A0, B0]
        .iter()
        .any(|&i| estimate.standard_error(i) > 0.5 * estimate.parameters[i].abs());
    if lost {
        warnings.push(
            "the slow pole and zero of the actuator (a0, b0) are not determined by these data: \
             excite down to 0.02 Hz for a minute or longer to find them"
                .into(),
        );
    }
    let p = &estimate.parameters;
    let actuator = rig_from(p, 0.0, false).shake_table.actuator;
    if p[A0] >= 0.0 && p[B0] >= 0.0 && actuator.validate().is_ok() {
        return Ok(estimate);
    }
    if !lost {
        warnings.push(
            "slow drift that this model lacks gave the actuator a slow pole or zero that must \
             not be simulated; both are held at zero, where they cancel"
                .into(),
        );
    }
    restart(parameters, &estimate);
    for i in [A0, B0] {
        parameters[i].start = 0.0;
        parameters[i].free = false;
    }
    gauss_newton::fit(model, parameters, FITTED)
}

/// Refuses a rig that is none, and compares what was fitted with what was not.
fn assess(
    whole: &RigModel,
    fitted: &RigModel,
    parameters: &[Parameter],
    estimate: &Estimate,
    identifiable: bool,
    mut warnings: Vec<String>,
) -> Result<RigIdentification, IdentificationError> {
    let specimen = fitted.experiments.iter().any(|e| e.specimen);
    let rig = rig_from(&estimate.parameters, 0.0, specimen);
    let table = rig.shake_table.table;
    if table.stiffness <= 0.0 || table.damping < 0.0 {
        return Err(IdentificationError::Unstable {
            what: format!(
                "the table comes out with damping {:.4} N s/m and stiffness {:.4} N/m",
                table.damping, table.stiffness
            ),
            remedy: "record the free decay, or excite around the table's natural frequency".into(),
        });
    }
    let fits = validation::fits(whole, fitted, &estimate.parameters);
    let residuals = validation_residuals(whole, fitted, &estimate.parameters);
    for (recording, channel, test) in &residuals {
        if !test.is_white() {
            warnings.push(format!(
                "{recording}: one-step errors of `{channel}` are not white ({:.0} % of lags \
                 outside the 99 % band): the rig does something this model lacks, and the \
                 standard errors are too small",
                100.0 * test.outside()
            ));
        }
    }
    let mut found = RigIdentification {
        physical: Vec::new(),
        standard_error: Vec::new(),
        covariance: DMatrix::zeros(0, 0),
        specimen,
        payload: Vec::new(),
        identifiable,
        warnings,
        parameters: Vec::new(),
        model: whole.clone(),
        fits,
        residuals,
        singular_values: DVector::zeros(0),
        iterations: estimate.iterations,
    };
    found.take(parameters, estimate.clone());
    if !identifiable {
        return Ok(found);
    }
    if let Some(pole) = found.actuator_poles().iter().find(|pole| pole.re > 1e-9) {
        return Err(IdentificationError::Unstable {
            what: format!(
                "the actuator has a pole at {:+.4} {:+.4}i 1/s",
                pole.re, pole.im
            ),
            remedy: "check the sign of valve_command and actuator_force, and record a longer \
                     test with a specimen or two payloads"
                .into(),
        });
    }
    let grid: Vec<f64> = (0..30)
        .map(|k| 0.1 * 300f64.powf(f64::from(k) / 29.0))
        .collect();
    let [g1, g2] = found.response_error(&grid);
    if g1.max(g2) > 0.5 {
        found.identifiable = false;
        found.warnings.push(format!(
            "the data hardly separate denominator and velocity path: G1 and G2 are uncertain by \
             {:.0} and {:.0} %; measure with a heavier specimen or two payloads that differ more",
            100.0 * g1,
            100.0 * g2
        ));
    }
    Ok(found)
}

fn validation_residuals(
    whole: &RigModel,
    fitted: &RigModel,
    parameters: &[f64],
) -> Vec<(String, &'static str, ResidualTest)> {
    use crate::gauss_newton::PredictionModel;
    let mut tests = Vec::new();
    for (index, data) in whole.experiments.iter().enumerate() {
        let first = fitted.experiments[index].command.len();
        let Some(innovations) = whole.innovations(index, parameters) else {
            continue;
        };
        if innovations.errors.len() < first + 100 {
            continue;
        }
        for i in (0..OUTPUTS).filter(|&i| data.measured[i]) {
            let errors: Vec<f64> = innovations.errors[first..].iter().map(|e| e[i]).collect();
            tests.push((
                data.name.clone(),
                OUTPUT_NAMES[i],
                residual_test(&errors, &data.command[first..], 25),
            ));
        }
    }
    tests
}

/// Responses of G1 and G2 at a frequency (Hz).
fn responses(physical: &[f64], frequency: f64) -> [Complex<f64>; 2] {
    let s = Complex::new(0.0, std::f64::consts::TAU * frequency);
    let actuator: IdentifiedActuator = rig_from(physical, 0.0, false).shake_table.actuator;
    [actuator.g1().evaluate(s), actuator.g2().evaluate(s)]
}

fn response_error(physical: &[f64], covariance: &DMatrix<f64>, frequencies: &[f64]) -> [f64; 2] {
    let mut largest = [0.0f64; 2];
    for &frequency in frequencies {
        let at = responses(physical, frequency);
        for (path, largest) in largest.iter_mut().enumerate() {
            let mut slope = [DVector::zeros(PHYSICAL), DVector::zeros(PHYSICAL)];
            for i in 0..9 {
                let mut moved = physical.to_vec();
                let change = 1e-6 * physical[i].abs().max(1e-6);
                moved[i] += change;
                let relative = (responses(&moved, frequency)[path] / at[path] - 1.0) / change;
                slope[0][i] = relative.re;
                slope[1][i] = relative.im;
            }
            let variance: f64 = slope.iter().map(|s| (covariance * s).dot(s)).sum();
            *largest = largest.max(variance.max(0.0).sqrt());
        }
    }
    largest
}
