//! The aids of operators from a model of the rig, by stated rules.

use std::f64::consts::TAU;

use nalgebra::Complex;
use plant::identified::shake_table::ShakeTable;
use plant::linear::log_space;
use plant::linear::margins::nyquist;
use plant::specimens::linear::LinearSpecimen;

use crate::aids::rig::KnownRig;
use crate::aids::specimen_force::{LAG_DAMPING, SpecimenForceCompensation};
use crate::aids::{AidsInput, OperatorAids};
use crate::robustness::{self, LateRig, Pushed};
use crate::{Controller, ModelError};

/// Largest sensitivity that the loop of an aid by itself may have.
const AID_SENSITIVITY: f64 = 2.0;
/// Largest sensitivity of a displacement loop over the stabilised rig.
const LOOP_SENSITIVITY: f64 = 1.6;
/// Corners that are tried, Hz.
const CORNERS: (f64, f64) = (0.5, 30.0);
/// Stiffness that a specimen may have, over that which is known: a fifth either way.
const STIFFNESSES: [f64; 3] = [0.8, 1.0, 1.25];

/// How long a push is followed, s.
const PUSHED: f64 = 10.0;

/// What the rules need.
#[derive(Debug, Clone, Copy)]
pub struct AidsDesign<'a> {
    /// The rig.
    pub rig: &'a KnownRig,
    /// Lateness of the measurements, s.
    pub late: f64,
    /// Sampling period, s.
    pub period: f64,
    /// The specimen before it yields, as far as it is known.
    pub specimen: Option<&'a LinearSpecimen>,
}

impl AidsDesign<'_> {
    /// The aids' numbers, everything off:
    ///
    /// 1. Stabilisation: of a grid, the gain with which a proportional displacement loop can be
    ///    stiffest at a sensitivity of 1.6; no high pass.
    /// 2. Specimen: the largest corner from 0.5 to 30 Hz with which the aid's own loop is stable and keeps its
    ///    sensitivity below 2, bare and under the specimen, its stiffness a fifth off either way.
    ///
    /// Friction is what was identified.
    ///
    /// # Errors
    /// A rig that no such corner holds.
    pub fn tuned(&self) -> Result<OperatorAids, ModelError> {
        let mut aids = OperatorAids {
            rig: *self.rig,
            ..OperatorAids::default()
        };
        aids.pressure.gain = self.pressure_gain()?;
        aids.specimen.corner = self.specimen_corner()?;
        Ok(aids)
    }

    fn frequencies(&self) -> Vec<f64> {
        log_space(0.5, 0.999 * nyquist(self.period), 300)
    }

    /// The rig bare and under the specimen.
    fn loads(&self) -> Vec<Option<LinearSpecimen>> {
        let mut loads = vec![None];
        loads.extend(self.specimen.iter().flat_map(|specimen| {
            STIFFNESSES.map(|factor| {
                Some(LinearSpecimen {
                    stiffness: factor * specimen.stiffness,
                    ..**specimen
                })
            })
        }));
        loads
    }

    /// Responses of what is measured to the valve command.
    fn responses(
        &self,
        load: Option<&LinearSpecimen>,
        late: f64,
    ) -> Result<Vec<Heard>, ModelError> {
        let space = self.rig.state_space(load);
        let rig = LateRig::new(&space, late, self.period)?;
        let at = |omega| {
            let all = rig.responses(omega);
            (omega, [all[0], all[1], all[2], all[3]])
        };
        Ok(self.frequencies().into_iter().map(at).collect())
    }

    fn pressure_gain(&self) -> Result<f64, ModelError> {
        let grid = self.responses(None, self.late)?;
        let most = grid
            .iter()
            .map(|(_, own)| own[3].norm())
            .fold(0.0, f64::max);
        let peak = |displacement: f64, force: f64| {
            let distances = grid
                .iter()
                .map(|(_, own)| (1.0 + own[0] * displacement + own[3] * force).norm());
            1.0 / distances.fold(f64::INFINITY, f64::min)
        };
        let low = 1e-2 / grid[0].1[0].norm();
        let (mut best, mut stiffest) = (0.0, 0.0);
        for step in 0..=20 {
            let force = 0.1 * f64::from(step) / most;
            let mut gain = low;
            if peak(gain, force) > LOOP_SENSITIVITY {
                continue;
            }
            while peak(1.05 * gain, force) <= LOOP_SENSITIVITY && gain < 1e4 * low {
                gain *= 1.05;
            }
            // What adds less than a step adds nothing.
            if gain > 1.04 * stiffest {
                (best, stiffest) = (force, gain);
            }
        }
        Ok(best)
    }

    fn specimen_corner(&self) -> Result<f64, ModelError> {
        let (table, own) = (&self.rig.table, &self.rig.hydraulics);
        let mut loops = Vec::new();
        for load in self.loads() {
            for (omega, [x, v, a, force]) in self.responses(load.as_ref(), self.late)? {
                let s = Complex::new(0.0, omega);
                let found = a * table.mass + v * table.damping + x * table.stiffness - force;
                loops.push((omega, found * (s + own.leakage_rate) / own.force_rate));
            }
        }
        self.largest_corner(
            SpecimenForceCompensation::SPECIMEN_CORNER,
            &loops,
            |aids, corner| {
                aids.on.specimen = true;
                aids.specimen.corner = corner;
            },
        )
    }

    /// The largest corner (rad/s) of a lag with which `1/(1 + Q L)` stays below 2 at all frequencies of all
    /// `loops`, and with which the aid, put on by `with`, comes to rest after a push.
    fn largest_corner(
        &self,
        name: &'static str,
        loops: &[(f64, Complex<f64>)],
        with: impl Fn(&mut OperatorAids, f64),
    ) -> Result<f64, ModelError> {
        let is_calm = |corner: f64| {
            loops.iter().all(|(omega, open)| {
                let s = Complex::new(0.0, omega / corner);
                let lag = 1.0 / (s * s + s * (2.0 * LAG_DAMPING) + 1.0);
                (1.0 + lag * open).norm() >= 1.0 / AID_SENSITIVITY
            })
        };
        let (lowest, mut corner) = (TAU * CORNERS.0, TAU * CORNERS.1);
        while corner > lowest {
            if is_calm(corner) && self.holds(|aids| with(aids, corner))? {
                return Ok(corner);
            }
            corner /= 1.08;
        }
        Err(ModelError::NoSolution {
            equation: "the rule for the aids",
            reason: format!("no {name} from {} Hz upwards stabilises the rig", CORNERS.0),
        })
    }

    /// Whether the rig, bare and under its specimen, comes to rest with the aids that `with` puts on and a
    /// weak hold of the displacement.
    fn holds(&self, with: impl Fn(&mut OperatorAids)) -> Result<bool, ModelError> {
        let period = self.period;
        for load in self.loads() {
            let mut aids = OperatorAids {
                rig: *self.rig,
                ..OperatorAids::default()
            };
            with(&mut aids);
            let own = &self.rig.hydraulics;
            // A hold of 2 rad/s: the table's velocity per volt is g/K.
            let hold = 2.0 * own.oil_stiffness / own.force_rate;
            let space = self.rig.state_space(load.as_ref());
            let rig = LateRig::new(&space, self.late, period)?;
            let mut law = |heard: &robustness::Heard| {
                let input = AidsInput {
                    command: -hold * heard.motion.displacement,
                    measured: heard.motion,
                    force: heard.force,
                    ..AidsInput::default()
                };
                aids.step(&input, period)
            };
            if !Pushed::new(&rig, &mut law, PUSHED).is_stable() {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Angular frequency, and the responses there of displacement, velocity, acceleration and force.
type Heard = (f64, [Complex<f64>; 4]);

/// The rig as a controller finds it whose actuator is stabilised by `gain` (V/N) times its force, measured `late`
/// (s): `F = (N1 u + N2 v)/(D + k N1 exp(-s T))`, the delay to its second power.
#[must_use]
pub fn stabilised(rig: &ShakeTable, gain: f64, late: f64) -> ShakeTable {
    let mut own = *rig;
    let [b2, b1, b0] = own.actuator.voltage_to_force;
    let square = 0.5 * late * late;
    let leading = 1.0 + gain * (square * b1 - late * b2);
    let added = [b2 - late * b1 + square * b0, b1 - late * b0, b0];
    let actuator = &mut own.actuator;
    for (value, added) in actuator.denominator.iter_mut().zip(added) {
        *value = (*value + gain * added) / leading;
    }
    for value in actuator
        .voltage_to_force
        .iter_mut()
        .chain(&mut actuator.velocity_to_force)
    {
        *value /= leading;
    }
    own
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robustness::Heard;
    use crate::tuning::known_rig::fitted;
    use plant::servo_hydraulic::ServoHydraulicTable;

    const PERIOD: f64 = 0.002;

    fn known(delay: usize) -> KnownRig {
        KnownRig {
            table: ServoHydraulicTable::default().table,
            delay,
            ..KnownRig::default()
        }
    }

    fn specimen() -> LinearSpecimen {
        LinearSpecimen {
            mass: 45.0,
            damping: 57.0,
            stiffness: 45.0 * (TAU / 0.5).powi(2),
        }
    }

    /// Pushes the rig under a weak displacement loop with the aids as they run.
    fn peak(mut aids: OperatorAids, load: Option<&LinearSpecimen>, late: f64) -> f64 {
        let space = aids.rig.state_space(load);
        let rig = LateRig::new(&space, late, PERIOD).unwrap();
        let mut law = |heard: &Heard| {
            let input = AidsInput {
                command: -80.0 * heard.motion.displacement,
                measured: heard.motion,
                force: heard.force,
                ..AidsInput::default()
            };
            aids.step(&input, PERIOD)
        };
        let run = Pushed::new(&rig, &mut law, 30.0);
        if !run.is_stable() {
            return f64::INFINITY;
        }
        run.open_loop(0.5).peak_sensitivity()
    }

    /// Independent of the rule's responses: the laws themselves, pushed.
    #[test]
    fn the_aids_by_rule_hold_the_rig_bare_and_under_its_specimen() {
        let rig = known(1);
        let own = specimen();
        let design = AidsDesign {
            rig: &rig,
            late: 0.002,
            period: PERIOD,
            specimen: Some(&own),
        };
        let aids = design.tuned().unwrap();
        let hertz = aids.specimen.corner / TAU;
        println!("{hertz} Hz, {} V/N", aids.pressure.gain);
        for load in [None, Some(&own)] {
            for which in 0..2 {
                let mut aids = aids;
                aids.on.specimen = which == 0;
                aids.on.pressure = which == 1;
                let got = peak(aids, load, 0.002);
                println!("{} {which}: {got}", load.is_some());
                assert!(got < 2.6, "{which}: {got}");
            }
        }
    }

    /// The form of Eq 2-4, fitted to a hydraulic rig, gives its valve and oil back.
    #[test]
    fn an_actuator_parts_into_valve_and_oil() {
        let rig = fitted(&ServoHydraulicTable::default());
        let known = KnownRig::of(&rig, 0).unwrap();
        println!("{known:?}");
        let whole = rig.state_space();
        for hertz in [0.5, 1.0, 2.0, 5.0, 10.0] {
            let omega = TAU * hertz;
            let expected = whole.evaluate(Complex::new(0.0, omega)).unwrap()[(2, 0)];
            let got = known.acceleration_response(omega, 0.0);
            assert!(
                (got / expected - 1.0).norm() < 0.05,
                "{hertz} Hz: {got} {expected}"
            );
        }
        let rate = known.hydraulics.force_rate / known.hydraulics.oil_stiffness;
        let usual = KnownRig::default().hydraulics;
        let true_rate = usual.force_rate / usual.oil_stiffness;
        assert!((rate / true_rate - 1.0).abs() < 0.05, "{rate} {true_rate}");
    }

    #[test]
    fn the_stabilised_rig_is_the_loop_closed_over_the_force() {
        let rig = fitted(&ServoHydraulicTable::default());
        let (gain, late) = (1.5e-3, 0.003);
        let whole = stabilised(&rig, gain, late).state_space();
        let bare = rig.state_space();
        for hertz in [0.5, 3.0, 10.0, 20.0] {
            let s = Complex::new(0.0, TAU * hertz);
            let open = bare.evaluate(s).unwrap();
            let expected = open[(2, 0)] / (1.0 + gain * open[(3, 0)] * (-s * late).exp());
            let got = whole.evaluate(s).unwrap()[(2, 0)];
            assert!(
                (got / expected - 1.0).norm() < 0.03,
                "{hertz} Hz: {got} {expected}"
            );
        }
    }
}
