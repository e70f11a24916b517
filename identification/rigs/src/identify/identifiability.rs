//! Parameters that no record could tell apart.
//!
//! With a bare linear table `v = s G_table F` holds exactly, so `a1 + alpha` with
//! `e + alpha (m, c, k)` gives the same data for every `alpha`: denominator and velocity path are
//! inseparable, however long the record.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};

use crate::identify::model::RigModel;
use crate::identify::parameters::{Name, Own, Physical, PhysicalValues};
use sysid::prediction::Parameter;

/// What was found inseparable.
pub(crate) struct Inseparable {
    /// In words, with what to measure instead.
    pub message: String,
    /// The parameter to hold so that the others can be fitted.
    pub hold: usize,
}

/// A singular value below this, relative to the largest, is zero.
const RANK: f64 = 1e-5;

/// Looks for a combination of the free physical parameters on which no response from command to
/// any measured output depends.
pub(crate) fn inseparable(model: &RigModel, parameters: &[Parameter]) -> Option<Inseparable> {
    let columns: Vec<usize> = (0..parameters.len())
        .filter(|&i| {
            let moves_responses = match Name::at(i) {
                Name::Physical(name) => name != Physical::CommandDelay,
                Name::Own(own) => own == Own::Payload,
            };
            parameters[i].free && moves_responses
        })
        .collect();
    let values: Vec<f64> = parameters.iter().map(|p| p.start).collect();
    let base = responses(model, &values)?;
    let mut jacobian = DMatrix::zeros(2 * base.len(), columns.len());
    for (column, &i) in columns.iter().enumerate() {
        let change = 1e-3 * parameters[i].scale;
        let moved = |sign: f64| {
            let mut moved = values.clone();
            moved[i] += sign * change;
            responses(model, &moved)
        };
        let (up, down) = (moved(1.0)?, moved(-1.0)?);
        for (row, at) in base.iter().enumerate() {
            let slope = (up[row] - down[row]) / (2e-3 * at.norm().max(f64::MIN_POSITIVE));
            jacobian[(2 * row, column)] = slope.re;
            jacobian[(2 * row + 1, column)] = slope.im;
        }
        let length = jacobian.column(column).norm().max(f64::MIN_POSITIVE);
        jacobian.column_mut(column).scale_mut(1.0 / length);
    }
    let svd = jacobian.svd(false, true);
    let (smallest, &value) = svd
        .singular_values
        .iter()
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(b.1))?;
    if value > RANK * svd.singular_values.max() {
        return None;
    }
    let direction = svd.v_t.as_ref()?.row(smallest).into_owned();
    let named: Vec<&str> = columns
        .iter()
        .enumerate()
        .filter(|(column, _)| direction[*column].abs() > 1e-5)
        .filter_map(|(_, &i)| match Name::at(i) {
            Name::Physical(name) => Some(name.name()),
            Name::Own(_) => None,
        })
        .collect();
    let hold = columns
        .iter()
        .enumerate()
        .max_by(|a, b| direction[a.0].abs().total_cmp(&direction[b.0].abs()))
        .map(|(_, &i)| i)?;
    Some(Inseparable {
        message: format!(
            "the denominator and the velocity path of the actuator are inseparable ({} move \
             together without any effect on the data): on a bare table the velocity is a fixed \
             function of the force. Measure with a specimen on the table, or with two payloads",
            named.join(", ")
        ),
        hold,
    })
}

/// Responses from command to each measured output of each experiment.
fn responses(model: &RigModel, values: &[f64]) -> Option<Vec<Complex<f64>>> {
    let mut all = Vec::new();
    for (index, data) in model.experiments.iter().enumerate() {
        let payload = values[Own::Payload.of(index)];
        let rig = PhysicalValues::of(values).rig(payload, data.specimen);
        let (actuator, table) = (rig.shake_table.actuator, rig.shake_table.table);
        for k in 0..40 {
            let s = Complex::new(0.0, TAU * 0.03 * 1600f64.powf(f64::from(k) / 39.0));
            // Force over displacement: the table and, if there is one, the specimen.
            let mut impedance = (s * table.mass + table.damping) * s + table.stiffness;
            let mut carried = Complex::new(0.0, 0.0);
            if let Some(specimen) = rig.specimen {
                let spring = s * specimen.damping + specimen.stiffness;
                carried = spring / (s * s * specimen.mass + spring);
                impedance += s * s * specimen.mass * carried;
            }
            let (g1, g2) = (actuator.g1().evaluate(s), actuator.g2().evaluate(s));
            let force = g1 / (1.0 - g2 * s / impedance);
            let displacement = force / impedance;
            let acceleration = s * s * displacement;
            let outputs = [displacement, acceleration, force, acceleration * carried];
            for (output, value) in outputs.into_iter().enumerate() {
                if data.measured[output] {
                    all.push(value);
                }
            }
        }
    }
    all.iter().all(|v| v.is_finite()).then_some(all)
}
