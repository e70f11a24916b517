//! The identified rig sampled at 500 Hz under the laws themselves, without FMI.

use std::f64::consts::TAU;

use controllers::allocation::{ControlAllocation, LoopCommands};
use controllers::hierarchy::{SlidingModeInput, displacement_loop, force_loop};
use controllers::loop_shaping::LoopShaping;
use controllers::pid::{Pid, PidInput};
use controllers::sliding_mode::SlidingMode;
use controllers::three_variable::{ThreeVariableControl, ThreeVariableInput};
use controllers::{Controller, Motion};
use nalgebra::{DVector, dvector};
use plant::identified::coupled::Rig;
use units::constants::{G, INCH};

pub const PERIOD: f64 = 0.002;

/// What the sensors give.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sensors {
    pub motion: Motion,
    pub force: f64,
    pub specimen_acceleration: f64,
}

pub trait Law {
    fn step(&mut self, reference: &Motion, sensors: &Sensors) -> f64;
}

#[derive(Debug, Clone)]
pub struct Run {
    pub motion: Vec<Motion>,
    pub command: Vec<f64>,
}

impl Run {
    /// `100 rms(a_ref - a) / max|a_ref|`.
    pub fn time_domain_percent(&self, reference: &[Motion]) -> f64 {
        let peak = reference
            .iter()
            .map(|r| r.acceleration.abs())
            .fold(0.0, f64::max);
        let sum: f64 = reference
            .iter()
            .zip(&self.motion)
            .map(|(r, y)| (r.acceleration - y.acceleration).powi(2))
            .sum();
        100.0 * (sum / reference.len() as f64).sqrt() / peak
    }
}

/// Plays `reference` with `delay` samples between law and valve; `bias` is added to the sensors.
pub fn run_biased(
    rig: &Rig,
    reference: &[Motion],
    delay: usize,
    bias: &Sensors,
    law: &mut dyn Law,
) -> Run {
    let system = rig.state_space().sample(PERIOD);
    let mut x = DVector::zeros(system.order());
    let mut waiting = vec![0.0; delay];
    let mut run = Run {
        motion: Vec::new(),
        command: Vec::new(),
    };
    for r in reference {
        let y = &system.c * &x;
        let motion = Motion {
            displacement: y[0],
            velocity: y[1],
            acceleration: y[2],
        };
        let sensors = Sensors {
            motion: Motion {
                displacement: y[0] + bias.motion.displacement,
                velocity: y[1] + bias.motion.velocity,
                acceleration: y[2] + bias.motion.acceleration,
            },
            force: y[3] + bias.force,
            specimen_acceleration: y[6] + bias.specimen_acceleration,
        };
        let command = law.step(r, &sensors);
        waiting.push(command);
        x = system.advance(&x, &dvector![waiting.remove(0)]);
        run.motion.push(motion);
        run.command.push(command);
    }
    run
}

pub fn run(rig: &Rig, reference: &[Motion], delay: usize, law: &mut dyn Law) -> Run {
    run_biased(rig, reference, delay, &Sensors::default(), law)
}

#[derive(Default)]
pub struct ThreeVariableLaw(pub ThreeVariableControl);

impl Law for ThreeVariableLaw {
    fn step(&mut self, reference: &Motion, sensors: &Sensors) -> f64 {
        self.0.step(
            &ThreeVariableInput {
                reference: *reference,
                measured: sensors.motion,
            },
            PERIOD,
        )
    }
}

pub struct DisplacementLaw<T>(pub T);

impl<T: Controller<Input = PidInput, Output = f64>> Law for DisplacementLaw<T> {
    fn step(&mut self, reference: &Motion, sensors: &Sensors) -> f64 {
        self.0.step(
            &PidInput {
                reference: reference.displacement,
                measured: sensors.motion.displacement,
            },
            PERIOD,
        )
    }
}

pub fn loop_shaping() -> DisplacementLaw<LoopShaping> {
    DisplacementLaw(LoopShaping::equation_3_10())
}

/// Fig 4-3: sliding mode, the two loops, the allocation.
pub struct Hierarchy {
    pub sliding: SlidingMode,
    pub displacement: Pid,
    pub force: Pid,
    pub allocation: ControlAllocation,
}

impl Default for Hierarchy {
    fn default() -> Self {
        let allocation = ControlAllocation::default();
        Self {
            sliding: SlidingMode::default(),
            displacement: displacement_loop(&allocation),
            force: force_loop(&allocation),
            allocation,
        }
    }
}

impl Law for Hierarchy {
    fn step(&mut self, reference: &Motion, sensors: &Sensors) -> f64 {
        let references = self.sliding.step(
            &SlidingModeInput {
                reference: *reference,
                measured: sensors.motion,
                measured_force: sensors.force,
                specimen_acceleration: sensors.specimen_acceleration,
            },
            PERIOD,
        );
        let displacement_loop = self.displacement.step(
            &PidInput {
                reference: references.displacement,
                measured: sensors.motion.displacement,
            },
            PERIOD,
        );
        let force_loop = self.force.step(
            &PidInput {
                reference: references.force,
                measured: sensors.force,
            },
            PERIOD,
        );
        self.allocation.step(
            &LoopCommands {
                displacement_loop,
                force_loop,
            },
            PERIOD,
        )
    }
}

/// A seeded motion of 20 s in the band 0.25 to 20 Hz, within 0.3 g and 1.2 in: 300 harmonics of
/// random phase and an acceleration that falls off above 2.5 Hz, windowed by sin^4.
pub fn band_limited(seed: u64) -> Vec<Motion> {
    let duration = 20.0;
    let samples = (duration / PERIOD) as usize;
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut random = || {
        // Xorshift (Marsaglia 2003).
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let tones: Vec<(f64, f64, f64)> = (0..300)
        .map(|i| {
            let f = 0.25 + (20.0 - 0.25) * (f64::from(i) + random()) / 300.0;
            let amplitude = 1.0 / (1.0 + (f / 2.5).powi(2)) / (1.0 + (0.5 / f).powi(4));
            (TAU * f, amplitude, TAU * random())
        })
        .collect();
    let mut motion: Vec<Motion> = (0..samples)
        .map(|k| {
            let t = k as f64 * PERIOD;
            let (mut x, mut v, mut a) = (0.0, 0.0, 0.0);
            for &(w, amplitude, phase) in &tones {
                let (s, c) = (w * t + phase).sin_cos();
                a += amplitude * c;
                v += amplitude / w * s;
                x -= amplitude / (w * w) * c;
            }
            let p = TAU / 2.0 / duration;
            let (s, c) = (p * t).sin_cos();
            let window = s.powi(4);
            let slope = 4.0 * p * s.powi(3) * c;
            let curvature = 4.0 * p * p * s * s * (3.0 * c * c - s * s);
            Motion {
                displacement: window * x,
                velocity: window * v + slope * x,
                acceleration: window * a + 2.0 * slope * v + curvature * x,
            }
        })
        .collect();
    let peak = |f: fn(&Motion) -> f64| motion.iter().map(|m| f(m).abs()).fold(0.0, f64::max);
    let scale = (0.3 * G / peak(|m| m.acceleration)).min(1.2 * INCH / peak(|m| m.displacement));
    for m in &mut motion {
        m.displacement *= scale;
        m.velocity *= scale;
        m.acceleration *= scale;
    }
    motion
}
