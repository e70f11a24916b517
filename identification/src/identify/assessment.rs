//! What an identified rig is worth: refusal of what is none, fit and whiteness on the part that was
//! not fitted, uncertainty of the responses.

use nalgebra::{Complex, DMatrix, DVector};
use plant::identified::actuator::IdentifiedActuator;

use crate::IdentificationError;
use crate::data::OUTPUT_NAMES;
use crate::estimation::gauss_newton::GaussNewtonEstimate;
use crate::estimation::prediction::{Parameter, PredictionModel};
use crate::estimation::residuals::{ResidualTest, residual_test};
use crate::identify::model::{OUTPUTS, PHYSICAL, RigModel, rig_from};
use crate::identify::rig::RigIdentification;
use crate::identify::validation;

/// Refuses a rig that is none, and compares what was fitted with what was not.
pub(crate) fn assess(
    whole: &RigModel,
    fitted: &RigModel,
    parameters: &[Parameter],
    estimate: &GaussNewtonEstimate,
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
    let mut tests = Vec::new();
    for (index, data) in whole.experiments.iter().enumerate() {
        let first = fitted.experiments[index].command.len();
        let Some(errors) = whole.errors(index, parameters) else {
            continue;
        };
        if errors.len() < first + 100 {
            continue;
        }
        for i in (0..OUTPUTS).filter(|&i| data.measured[i]) {
            let errors: Vec<f64> = errors[first..].iter().map(|e| e[i]).collect();
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

/// Largest relative standard error of the responses of G1 and G2 over `frequencies` (Hz).
pub(crate) fn response_error(
    physical: &[f64],
    covariance: &DMatrix<f64>,
    frequencies: &[f64],
) -> [f64; 2] {
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
