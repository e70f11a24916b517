#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Eccentric payload on a biaxial table as an FMU.

use fmu_kit::{Component, ComponentResult, Variable};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// A body on springs that translates along two axes and twists.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct EccentricPayload {
    mass: f64,
    stiffness: [f64; 2],
    torsional_stiffness: f64,
    damping_ratio: f64,
    eccentricity: [f64; 2],
    gyration: f64,
    inverse_mass: [f64; 9],
    table: [f64; 2],
    place: [f64; 3],
    rate: [f64; 3],
    force: [f64; 2],
    acceleration: [f64; 2],
}

impl Default for EccentricPayload {
    /// The linear specimen, 100 lbf with a period of 1 s and 5 % damping, along both axes.
    fn default() -> Self {
        let mass = 45.359_237;
        let stiffness = mass * std::f64::consts::TAU.powi(2);
        Self {
            mass,
            stiffness: [stiffness; 2],
            torsional_stiffness: 0.09 * stiffness,
            damping_ratio: 0.05,
            eccentricity: [0.0; 2],
            gyration: 0.2,
            inverse_mass: [0.0; 9],
            table: [0.0; 2],
            place: [0.0; 3],
            rate: [0.0; 3],
            force: [0.0; 2],
            acceleration: [0.0; 2],
        }
    }
}

/// Steps of the Runge-Kutta method in a step of the component, s at most.
const SUBSTEP: f64 = 5e-4;

impl EccentricPayload {
    fn mass_matrix(&self) -> Matrix3<f64> {
        let (m, [x, y]) = (self.mass, self.eccentricity);
        let inertia = m * (self.gyration.powi(2) + x * x + y * y);
        Matrix3::new(m, 0.0, -m * y, 0.0, m, m * x, -m * y, m * x, inertia)
    }

    fn springs(&self) -> Vector3<f64> {
        Vector3::new(
            self.stiffness[0],
            self.stiffness[1],
            self.torsional_stiffness,
        )
    }

    /// Damping over stiffness, s.
    fn retardation(&self) -> f64 {
        2.0 * self.damping_ratio * (self.mass / self.stiffness[0]).sqrt()
    }

    /// Relative acceleration.
    fn pull(&self, place: Vector3<f64>, rate: Vector3<f64>) -> Vector3<f64> {
        let force = self
            .springs()
            .component_mul(&(place + rate * self.retardation()));
        let base = Vector3::new(self.table[0], self.table[1], 0.0);
        -base - Matrix3::from_row_slice(&self.inverse_mass) * force
    }
}

impl Component for EccentricPayload {
    const NAME: &'static str = "EccentricPayload";
    const DESCRIPTION: &'static str =
        "Payload on a biaxial table that couples the axes by its eccentricity";
    const DOCUMENTATION: &'static str = include_str!("../README.md");

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("table_acceleration_x", s.table[0], "Absolute acceleration of the table along x", "m/s2" => "g").nominal(10.0);
            input("table_acceleration_y", s.table[1], "Absolute acceleration of the table along y", "m/s2" => "g").nominal(10.0);
            output("force_x", s.force[0], "Force on the table along x", "N" => "lbf").nominal(400.0);
            output("force_y", s.force[1], "Force on the table along y", "N" => "lbf").nominal(400.0);
            output("acceleration_x", s.acceleration[0], "Absolute acceleration of the centre of the springs along x", "m/s2" => "g").nominal(10.0);
            output("acceleration_y", s.acceleration[1], "Absolute acceleration of the centre of the springs along y", "m/s2" => "g").nominal(10.0);
            output("twist", s.place[2], "Rotation of the payload", "rad").nominal(0.01);
            parameter("mass", s.mass, "Mass", "kg" => "lbf.s2/in").min(1e-3);
            parameter("stiffness_x", s.stiffness[0], "Stiffness along x", "N/m" => "lbf/in").min(1.0);
            parameter("stiffness_y", s.stiffness[1], "Stiffness along y", "N/m" => "lbf/in").min(1.0);
            parameter("torsional_stiffness", s.torsional_stiffness, "Stiffness against rotation about the centre of the springs", "N.m/rad").min(1e-3);
            parameter("damping_ratio", s.damping_ratio, "Damping ratio along x").min(0.0);
            parameter("eccentricity_x", s.eccentricity[0], "Centre of mass from the centre of the springs along x", "m" => "in");
            parameter("eccentricity_y", s.eccentricity[1], "Centre of mass from the centre of the springs along y", "m" => "in");
            parameter("gyration_radius", s.gyration, "Radius of gyration about the centre of mass", "m" => "in").min(1e-3);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        let Some(inverse) = self.mass_matrix().try_inverse() else {
            return Err("`mass` and `gyration_radius` make a mass matrix that cannot be inverted; expected positive numbers".into());
        };
        self.inverse_mass
            .copy_from_slice(inverse.transpose().as_slice());
        (self.place, self.rate) = ([0.0; 3], [0.0; 3]);
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        let (place, rate) = (Vector3::from(self.place), Vector3::from(self.rate));
        let own = self
            .springs()
            .component_mul(&(place + rate * self.retardation()));
        self.force = [own[0], own[1]];
        let absolute = -(Matrix3::from_row_slice(&self.inverse_mass) * own);
        self.acceleration = [absolute[0], absolute[1]];
    }

    fn step(&mut self, time: f64, step_size: f64) -> ComponentResult {
        let count = (step_size / SUBSTEP).ceil().max(1.0);
        let h = step_size / count;
        let (mut place, mut rate) = (Vector3::from(self.place), Vector3::from(self.rate));
        for _ in 0..count as usize {
            let (v1, a1) = (rate, self.pull(place, rate));
            let (v2, a2) = (
                rate + 0.5 * h * a1,
                self.pull(place + 0.5 * h * v1, rate + 0.5 * h * a1),
            );
            let (v3, a3) = (
                rate + 0.5 * h * a2,
                self.pull(place + 0.5 * h * v2, rate + 0.5 * h * a2),
            );
            let (v4, a4) = (rate + h * a3, self.pull(place + h * v3, rate + h * a3));
            place += h / 6.0 * (v1 + 2.0 * (v2 + v3) + v4);
            rate += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4);
        }
        if !place
            .iter()
            .chain(rate.iter())
            .all(|value| value.is_finite())
        {
            return Err(format!(
                "the payload's motion is no longer finite after t = {} s",
                time + step_size
            )
            .into());
        }
        (self.place, self.rate) = (place.into(), rate.into());
        Ok(())
    }
}

fmu_kit::export!(EccentricPayload);

#[cfg(test)]
mod tests {
    use super::*;

    fn settled(payload: &mut EccentricPayload, seconds: f64) {
        payload.initialize().unwrap();
        for k in 0..(seconds / 0.002) as usize {
            payload.step(k as f64 * 0.002, 0.002).unwrap();
        }
        payload.update_outputs(seconds);
    }

    /// Under a steady acceleration along x the springs hold -m a, and the eccentric mass twists the payload by
    /// m e_y a over the torsional stiffness.
    #[test]
    fn a_steady_acceleration_moves_and_twists_it_statically() {
        let mut payload = EccentricPayload {
            eccentricity: [0.03, 0.05],
            damping_ratio: 0.3,
            table: [2.0, 0.0],
            ..EccentricPayload::default()
        };
        settled(&mut payload, 60.0);
        assert!(
            (payload.force[0] + 2.0 * payload.mass).abs() < 1e-6 && payload.force[1].abs() < 1e-6
        );
        let twist = payload.mass * 0.05 * 2.0 / payload.torsional_stiffness;
        assert!(
            (payload.place[2] - twist).abs() < 1e-9,
            "{}",
            payload.place[2]
        );
    }

    /// Without damping and eccentricity: -m a (1 - cos w t) along x, nothing along y.
    #[test]
    fn without_eccentricity_the_axes_are_oscillators_of_their_own() {
        let mut payload = EccentricPayload {
            damping_ratio: 0.0,
            table: [1.5, 0.0],
            ..EccentricPayload::default()
        };
        settled(&mut payload, 1.3);
        let wanted = -payload.mass * 1.5 * (1.0 - (std::f64::consts::TAU * 1.3).cos());
        assert!(
            (payload.force[0] - wanted).abs() < 1e-3,
            "{} {wanted}",
            payload.force[0]
        );
        assert_eq!((payload.force[1], payload.place[2]), (0.0, 0.0));
    }
}
