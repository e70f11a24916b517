#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! A restoring force, linear or yielding, as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Variable};
use serde::{Deserialize, Serialize};

/// A spring that answers a displacement with a force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RestoringForce {
    stiffness: f64,
    yield_force: f64,
    hardening: f64,
    displacement: f64,
    force: f64,
    /// Where the last step began: m, N.
    kept: (f64, f64),
}

impl Default for RestoringForce {
    fn default() -> Self {
        Self {
            stiffness: 1e5,
            yield_force: 0.0,
            hardening: 0.0,
            displacement: 0.0,
            force: 0.0,
            kept: (0.0, 0.0),
        }
    }
}

impl Component for RestoringForce {
    const NAME: &'static str = "RestoringForce";
    const DESCRIPTION: &'static str = "Restoring force of a spring, linear or yielding";
    const DOCUMENTATION: &'static str = include_str!("../README.md");

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("displacement", s.displacement, "Displacement", "m" => "in").nominal(0.05);
            output("force", s.force, "Force that resists the displacement", "N" => "lbf")
                .nominal(1000.0).depends_on(&["displacement"], Dependent)
                .initially_depends_on(&["displacement", "stiffness", "yield_force", "hardening"]);
            parameter("stiffness", s.stiffness, "Stiffness before yielding", "N/m" => "lbf/in");
            parameter("yield_force", s.yield_force, "Force at which it yields; 0 for never", "N" => "lbf");
            parameter("hardening", s.hardening, "Stiffness after yielding over that before", "1" => "1");
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        if !(self.stiffness > 0.0 && self.stiffness.is_finite()) {
            return Err(format!("stiffness = {} N/m, expected above 0", self.stiffness).into());
        }
        if !(self.yield_force >= 0.0 && self.yield_force.is_finite()) {
            return Err(format!("yield_force = {} N, expected 0 or more", self.yield_force).into());
        }
        if !(0.0..1.0).contains(&self.hardening) {
            let given = self.hardening;
            return Err(format!("hardening = {given}, expected from 0 to below 1").into());
        }
        self.kept = (0.0, 0.0);
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        let u = self.displacement;
        if self.yield_force == 0.0 {
            self.force = self.stiffness * u;
            return;
        }
        let elastic = self.kept.1 + self.stiffness * (u - self.kept.0);
        let middle = self.hardening * self.stiffness * u;
        let reach = self.yield_force * (1.0 - self.hardening);
        self.force = elastic.clamp(middle - reach, middle + reach);
    }

    fn step(&mut self, time: f64, _step_size: f64) -> ComponentResult {
        self.update_outputs(time);
        self.kept = (self.displacement, self.force);
        Ok(())
    }
}

fmu_kit::export!(RestoringForce);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cycle_dissipates_what_the_parallelogram_holds() {
        let mut spring = RestoringForce {
            stiffness: 2e5,
            yield_force: 1e3,
            hardening: 0.1,
            ..RestoringForce::default()
        };
        spring.initialize().unwrap();
        let amplitude = 0.02;
        let (mut work, mut last) = (0.0, (0.0, 0.0));
        for k in 0..=20_000 {
            // Four whole cycles; the last is measured.
            spring.displacement =
                amplitude * (0.4e-3 * std::f64::consts::TAU * f64::from(k) / 2.0).sin();
            spring.update_outputs(0.0);
            if k > 15_000 {
                work += 0.5 * (spring.force + last.1) * (spring.displacement - last.0);
            }
            last = (spring.displacement, spring.force);
            spring.step(0.0, 0.002).unwrap();
        }
        // 4 f_y (1 - b) (u - u_y), as for every bilinear loop.
        let expected = 4.0 * 1e3 * 0.9 * (amplitude - 1e3 / 2e5);
        assert!((work / expected - 1.0).abs() < 1e-3, "{work} {expected}");
    }

    #[test]
    fn a_displacement_that_no_step_keeps_leaves_no_trace() {
        let mut spring = RestoringForce {
            yield_force: 10.0,
            ..RestoringForce::default()
        };
        spring.initialize().unwrap();
        for u in [1.0, -1.0, 0.5e-4] {
            spring.displacement = u;
            spring.update_outputs(0.0);
        }
        assert_eq!(spring.force, spring.stiffness * 0.5e-4);
    }
}
