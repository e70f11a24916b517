//! The specimen and what is hidden in it.

use super::*;
use crate::form::Yielding;

impl Rig {
    pub(super) fn specimen_masses(&self) -> (f64, f64) {
        let mass = self.plant.specimen[0];
        if self.hidden.holds("specimen_second_mode") {
            (0.75 * mass, 0.25 * mass)
        } else {
            (mass, 0.0)
        }
    }

    /// Restoring force on the table and force of the second mass on the first.
    pub(super) fn specimen(&self, s: &State, derivative: &mut State) -> (f64, f64) {
        let h = &self.hidden;
        if h.holds("specimen_absent") {
            return (0.0, 0.0);
        }
        let (drift, rate) = (s[D], s[DV]);
        let mut k = self.plant.specimen[2] * (1.0 + h.value("specimen_stiffness"));
        let c = self.plant.specimen[1] * (1.0 + h.value("specimen_damping"));
        if let Some(loss) = h.get("specimen_degradation", 0) {
            let largest = self.largest_drift.max(drift.abs());
            let ratio = largest / h.form.degradation_drift;
            k *= 1.0
                - loss
                    * match h.form.degradation {
                        Degradation::Exponential => 1.0 - (-ratio).exp(),
                        Degradation::Hyperbola => ratio / (1.0 + ratio),
                        Degradation::Line => ratio.min(1.0),
                    };
        }
        let mut elastic = k * drift;
        if let Some(uplift) = h.get("specimen_uplift", 0) {
            elastic = k
                * (drift.clamp(-uplift, uplift)
                    + h.form.uplift_ratio * outside_band(drift, uplift));
        }
        if let Some(slack) = h.outside(Outside::SpecimenSlack) {
            elastic = k * (0.3 * drift.clamp(-slack, slack) + outside_band(drift, slack));
        }
        if let Some(yielding) = h.get("specimen_yielding", 0) {
            let z = s[HYSTERETIC];
            derivative[HYSTERETIC] = match h.form.yielding {
                Yielding::BoucWen => {
                    let shape = 0.5
                        * (1.0 + (z * rate).signum())
                        * (z.abs() / yielding).powf(h.form.yield_exponent);
                    rate * (1.0 - shape)
                }
                Yielding::Bilinear if z.abs() >= yielding && z * rate > 0.0 => 0.0,
                Yielding::Bilinear => rate,
            };
            let ratio = h.form.yield_ratio;
            elastic = k * (ratio * drift + (1.0 - ratio) * z);
        }
        if let Some(force) = h.outside(Outside::SpecimenFriction) {
            // An elastic-perfectly plastic slider beside the columns.
            let stiffness = 8.0 * k;
            let q = stiffness * s[SLIDER];
            let slides = q.abs() >= force && q * rate > 0.0;
            derivative[SLIDER] = if slides { 0.0 } else { rate };
            elastic += q.clamp(-force, force);
        }
        let drag = h.outside(Outside::SpecimenQuadraticDamping).unwrap_or(0.0);
        let restoring = elastic + c * rate + drag * rate * rate.abs();
        let second = self.specimen_masses().1;
        let mut on_second = 0.0;
        if let Some(frequency) = h.get("specimen_second_mode", 0) {
            let (omega, damping) = (TAU * frequency, h.form.second_mode_damping);
            on_second = second * omega * (omega * s[D2] + 2.0 * damping * s[D2V]);
        }
        (restoring, on_second)
    }
}
