//! What an identified rig is worth: refusal of what is none, fit and whiteness on the part that was
//! not fitted.

use nalgebra::{DMatrix, DVector};

use crate::identify::identified::RigIdentification;
use crate::identify::model::RigModel;
use crate::identify::parameters::{OUTPUTS, PhysicalValues};
use crate::identify::validation;
use recordings::IdentificationError;
use recordings::OUTPUT_NAMES;
use sysid::gauss_newton::GaussNewtonEstimate;
use sysid::prediction::{Parameter, PredictionModel};
use sysid::residuals::{ResidualTest, residual_test};

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
    let rig = PhysicalValues::of(&estimate.parameters).rig(0.0, specimen);
    let table = rig.shake_table.table;
    if table.stiffness <= 0.0 || table.damping < 0.0 {
        return Err(IdentificationError::Unstable {
            what: format!(
                "the estimated table has damping {:.4} N s/m and stiffness {:.4} N/m",
                table.damping, table.stiffness
            ),
            remedy: "check that no channels are swapped and their signs, record the free decay, or excite around \
                     the table's natural frequency"
                .into(),
        });
    }
    let fits = validation::fits(whole, fitted, &estimate.parameters);
    let residuals = validation_residuals(whole, fitted, &estimate.parameters);
    for (recording, channel, test) in &residuals {
        if !test.is_white() {
            warnings.push(format!(
                "{recording}: one-step errors of `{channel}` are not white ({:.0} % of lags \
                 outside the 99 % band): the model lacks an effect of the rig, and the standard \
                 errors are too small",
                100.0 * test.outside()
            ));
        }
    }
    let mut found = RigIdentification {
        physical: PhysicalValues::ZERO,
        standard_error: PhysicalValues::ZERO,
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
