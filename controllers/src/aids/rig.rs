//! What the aids know of a rig: valve, oil and table.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, Matrix4, Vector4};
use plant::identified::shake_table::ShakeTable;
use plant::identified::table::Table;
use plant::linear::{StateSpace, log_space};
use plant::specimens::linear::LinearSpecimen;
use units::{Parameters, vocabulary};

use crate::ModelError;
pub use crate::preview::feedback::MAXIMUM_DELAY;
use crate::preview::model::{Hydraulics, RigModel, STATES};

/// Valve, oil and table as recordings give them; by default the physical rig's, nothing late.
#[derive(
    Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize, Parameters,
)]
pub struct KnownRig {
    /// Valve and oil.
    #[parameters]
    pub hydraulics: Hydraulics,
    /// The table.
    #[parameters]
    pub table: Table,
    /// Samples by which measurements are late.
    pub delay: usize,
}

impl KnownRig {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first with which nothing can be compensated.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.hydraulics.validate()?;
        if self.delay > MAXIMUM_DELAY {
            return Err(ModelError::Parameter {
                name: vocabulary::LOOP_DELAY_SAMPLES,
                value: self.delay as f64,
                expected: "at most 4",
            });
        }
        self.table.validate()
    }

    /// Valve and oil that move the table as an actuator of the form of Eq 2-4 does: `g`, `K`, `p` and `c_p`
    /// by least squares of the velocity's response from 0.25 to 10 Hz, the spool a lag of critical
    /// damping, of a grid up to 12 ms the one that leaves the least.
    ///
    /// # Errors
    /// An actuator that no such valve and oil come near.
    pub fn of(rig: &ShakeTable, delay: usize) -> Result<Self, ModelError> {
        let space = rig.state_space();
        let table = &rig.table;
        let lines: Vec<(Complex<f64>, Complex<f64>)> = log_space(0.25, 10.0, 120)
            .into_iter()
            .filter_map(|hertz| {
                let s = Complex::new(0.0, TAU * hertz);
                Some((s, space.evaluate(s)?[(1, 0)]))
            })
            .collect();
        let load = |s: Complex<f64>| s * table.mass + table.damping + table.stiffness / s;
        let mut best: Option<(f64, Hydraulics)> = None;
        for step in 1..=48 {
            let lag = 2.5e-4 * f64::from(step);
            let spool = |s: Complex<f64>| (1.0 + 0.5 * lag * s).powi(2);
            // s Z + p Z + (K + p c_p) + c_p s = g u/v with the table's Z.
            let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
            let scale = [table.mass, 1e3 * table.mass, table.mass, table.mass];
            for (s, response) in &lines {
                let v = response * spool(*s);
                let row = [load(*s) * v, v, s * v, Complex::new(-1.0, 0.0)];
                let target = -s * load(*s) * v;
                for part in [|c: Complex<f64>| c.re, |c: Complex<f64>| c.im] {
                    let row = Vector4::from_fn(|i, _| part(row[i]) * scale[i]);
                    normal += row * row.transpose();
                    right += row * part(target);
                }
            }
            let Some(found) = normal.lu().solve(&right) else {
                continue;
            };
            let [p, kappa, damping, g] = std::array::from_fn(|i| found[i] * scale[i]);
            let known = Hydraulics {
                spool_lag: lag,
                spool_inertia: 0.25 * lag * lag,
                force_rate: g,
                oil_stiffness: kappa - p * damping,
                leakage_rate: p.max(0.0),
                seal_damping: damping.max(0.0),
            };
            let own = Self {
                hydraulics: known,
                table: *table,
                delay,
            };
            let off = |(s, response): &(Complex<f64>, Complex<f64>)| {
                let got = own.acceleration_response(s.im, 0.0) / s;
                (got / response - 1.0).norm_sqr()
            };
            let left: f64 = lines.iter().map(off).sum();
            if own.validate().is_ok() && best.as_ref().is_none_or(|(least, _)| left < *least) {
                best = Some((left, known));
            }
        }
        let near = |left: f64| (left / lines.len() as f64).sqrt() < 0.25;
        let Some((_, hydraulics)) = best.filter(|(left, _)| near(*left)) else {
            return Err(ModelError::NoSolution {
                equation: "the separation of the actuator into valve and oil",
                reason: "no valve and oil reproduce the table's motion within 25 %".into(),
            });
        };
        Ok(Self {
            hydraulics,
            table: *table,
            delay,
        })
    }

    /// As preview control has it.
    #[must_use]
    pub fn model(&self) -> RigModel {
        RigModel {
            shake_table: ShakeTable {
                table: self.table,
                ..ShakeTable::default()
            },
            hydraulics: Some(self.hydraulics),
        }
    }

    /// From the valve command (V) to displacement, velocity, acceleration and the actuator's force (SI), bare or
    /// under a specimen.
    pub fn state_space(&self, specimen: Option<&LinearSpecimen>) -> StateSpace {
        const ALL: usize = STATES + 2;
        let (own, input) = self.model().dynamics();
        let order = if specimen.is_some() { ALL } else { STATES };
        let mut a = DMatrix::zeros(order, order);
        a.view_mut((0, 0), (STATES, STATES)).copy_from(&own);
        let mut force = DMatrix::zeros(1, order);
        if let Some(specimen) = specimen {
            // Drift and its rate, driven by the table's acceleration.
            for (state, coefficient) in [specimen.stiffness, specimen.damping]
                .into_iter()
                .enumerate()
            {
                force[STATES + state] = coefficient;
                a[(STATES - 1, STATES + state)] = coefficient / self.table.mass;
            }
            let shaken = -a.row(STATES - 1);
            a.row_mut(STATES + 1).copy_from(&shaken);
            a[(STATES + 1, STATES)] -= specimen.stiffness / specimen.mass;
            a[(STATES + 1, STATES + 1)] -= specimen.damping / specimen.mass;
            a[(STATES, STATES + 1)] = 1.0;
        }
        let mut b = DMatrix::zeros(order, 1);
        b.view_mut((0, 0), (STATES, 1)).copy_from(&input.column(0));
        let mut c = DMatrix::zeros(4, order);
        (c[(0, STATES - 2)], c[(1, STATES - 1)]) = (1.0, 1.0);
        let acceleration = a.row(STATES - 1).into_owned();
        c.row_mut(2).copy_from(&acceleration);
        // What the table takes beyond the specimen's force.
        let mut actuator = acceleration * self.table.mass - force;
        actuator[STATES - 2] += self.table.stiffness;
        actuator[STATES - 1] += self.table.damping;
        c.row_mut(3).copy_from(&actuator);
        StateSpace {
            a,
            b,
            c,
            d: DMatrix::zeros(4, 1),
        }
    }

    /// Opening of the valve (V) that makes a force (N) on the piston which changes at `rate` (N/s) while the
    /// piston stands still: `(df/dt + p f)/g`.
    #[inline]
    pub fn opening(&self, force: f64, rate: f64) -> f64 {
        (rate + self.hydraulics.leakage_rate * force) / self.hydraulics.force_rate
    }

    /// Undamped frequency (rad/s) and damping ratio of the oil column under the table and `mass` (kg)
    /// more: `w² = (K + p c)/m`, `2 D w = c/m + p`.
    pub fn oil_column(&self, mass: f64) -> (f64, f64) {
        let own = &self.hydraulics;
        let mass = self.table.mass + mass;
        let damping = own.seal_damping + self.table.damping;
        let stiffness = own.oil_stiffness + self.table.stiffness + own.leakage_rate * damping;
        let omega = (stiffness / mass).sqrt();
        (omega, 0.5 * (damping / mass + own.leakage_rate) / omega)
    }

    /// Response at `omega` (rad/s) of the measured acceleration to the valve command, m/s² per V; `late` (s) is
    /// all lateness beside the spool's.
    pub fn acceleration_response(&self, omega: f64, late: f64) -> Complex<f64> {
        let (own, table) = (&self.hydraulics, &self.table);
        let s = Complex::new(0.0, omega);
        let spool = (s * own.spool_inertia + own.spool_lag) * s + 1.0;
        // Force of the oil over velocity.
        let load = s * table.mass + table.damping + own.seal_damping + table.stiffness / s;
        let velocity = own.force_rate / (load * (s + own.leakage_rate) + own.oil_stiffness);
        s * velocity / spool * (-s * late).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The thesis's actuator pushes the table against its spring under a steady velocity: no oil does.
    #[test]
    fn the_identified_actuator_has_no_valve_and_oil() {
        let error = KnownRig::of(&ShakeTable::default(), 0).unwrap_err();
        assert!(error.to_string().contains("valve and oil"), "{error}");
    }

    #[test]
    fn the_oil_column_is_the_pole_of_the_response() {
        let known = KnownRig::default();
        let (omega, ratio) = known.oil_column(20.0);
        let mut loaded = known;
        loaded.table.mass += 20.0;
        let at = |omega: f64| loaded.acceleration_response(omega, 0.0).norm();
        // Acceleration over the spool's opening peaks near the undamped frequency.
        assert!(at(omega) > at(0.6 * omega) && at(omega) > at(1.8 * omega));
        assert!((0.1..0.4).contains(&ratio), "{ratio}");
    }
}
