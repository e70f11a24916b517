//! A servo-hydraulic table with an orifice valve that is not ideal, SI: spool, two chambers, friction, table,
//! payload and specimen as one system.
//!
//! ```text
//! Q_edge = k u' sign(dp) |dp| / (|dp| + p_0)^(1/2)     u' the opening of the edge, V
//! dp_A   = beta / (V/2 + A x) (Q_A - A v - C (p_A - p_B))
//! F      = A (p_A - p_B) - friction
//! ```

use serde::{Deserialize, Serialize};

/// Law of friction before it slides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Bristles {
    /// LuGre: deflection relaxes at any force.
    LuGre,
    /// Elasto-plastic: no drift below seven tenths of the level.
    ElastoPlastic,
}

/// Parameters, SI.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "named as the field names them")]
pub struct Rig {
    pub supply: f64,
    pub valve_frequency: f64,
    pub valve_damping: f64,
    /// Flow of an edge per volt and root of pressure, m³/(s V √Pa).
    pub flow_coefficient: f64,
    /// Half width of the overlap, V.
    pub overlap: f64,
    /// Share of the gain that is lost at null.
    pub null_loss: f64,
    /// Opening over which it comes back, V.
    pub null_width: f64,
    pub asymmetry: f64,
    pub null_bias: f64,
    /// Pure delay of the command, s.
    pub delay: f64,
    pub area: f64,
    /// Both chambers, m³.
    pub volume: f64,
    pub bulk_modulus: f64,
    pub leakage: f64,
    pub viscous: f64,
    pub coulomb: f64,
    pub breakaway: f64,
    pub stribeck_velocity: f64,
    /// Deflection of the bristles at which they give way, m.
    pub deflection: f64,
    pub bristles: Bristles,
    pub table_mass: f64,
    pub table_stiffness: f64,
    pub table_damping: f64,
    pub payload: f64,
    pub specimen_mass: f64,
    pub specimen_frequency: f64,
    pub specimen_damping_ratio: f64,
    /// Unseen voltage at the spool: rms (V), and centre (Hz) of three tenths of its power.
    pub disturbance: f64,
    pub disturbance_frequency: f64,
}

const INCH: f64 = 0.0254;
const POUND: f64 = 4.448_221_615_260_5;
const PSI: f64 = POUND / (INCH * INCH);
const SNAIL: f64 = POUND / INCH;

impl Default for Rig {
    fn default() -> Self {
        Self {
            supply: 3000.0 * PSI,
            valve_frequency: 60.0,
            valve_damping: 0.9,
            flow_coefficient: 0.0418 * INCH.powi(3) / PSI.sqrt(),
            overlap: 0.0,
            null_loss: 0.0,
            null_width: 0.15,
            asymmetry: 0.0,
            null_bias: 0.0,
            delay: 0.0,
            area: 0.4 * INCH * INCH,
            volume: 24.0 * INCH.powi(3),
            bulk_modulus: 4e4 * PSI,
            leakage: 4e-4 * INCH.powi(3) / PSI,
            viscous: 5.0 * POUND / INCH,
            coulomb: 3.0 * POUND,
            breakaway: 4.0 * POUND,
            stribeck_velocity: 0.1 * INCH,
            deflection: 1e-3 * INCH,
            bristles: Bristles::LuGre,
            table_mass: 0.1212 * SNAIL,
            table_stiffness: 23.3 * POUND / INCH,
            table_damping: 0.25 * POUND / INCH,
            payload: 0.0,
            specimen_mass: 0.0,
            specimen_frequency: 2.0,
            specimen_damping_ratio: 0.03,
            disturbance: 0.0,
            disturbance_frequency: 15.0,
        }
    }
}

/// State: spool and its rate (V), pressures of the chambers (Pa), displacement and velocity of the table,
/// bristles in deflections, drift and its rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "said above")]
pub struct State {
    pub values: [f64; 9],
    /// Commands (V) and the times (s) from which they hold, oldest first.
    pub commands: [(f64, f64); 16],
}

/// Quantities at an instant, SI.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[allow(missing_docs, reason = "named as the field names them")]
pub struct Now {
    pub derivative: [f64; 9],
    pub acceleration: f64,
    /// Force of the actuator on the table, friction taken off, N.
    pub force: f64,
    pub specimen_acceleration: f64,
    /// Flow out of the supply, m³/s.
    pub flow: f64,
}

impl Rig {
    /// At rest with both chambers at half the supply's pressure.
    pub fn rest(&self) -> State {
        let half = self.supply / 2.0;
        State {
            values: [0.0, 0.0, half, half, 0.0, 0.0, 0.0, 0.0, 0.0],
            commands: [(f64::MIN, 0.0); 16],
        }
    }

    /// Opening of the valve at a spool position, V; positive feeds chamber A.
    pub fn opening(&self, spool: f64) -> f64 {
        let u = spool + self.null_bias;
        let past = u - u.clamp(-self.overlap, self.overlap);
        let lost = self.null_loss * (-(past / self.null_width).powi(2)).exp();
        past * (1.0 - lost) * (1.0 + self.asymmetry * past.signum())
    }

    /// Unseen voltage at times `step` apart, the first at `time`: sines of a resonance, and slow ones of a 1/f spectrum.
    fn unseen(&self, time: f64, step: f64) -> Unseen {
        if self.disturbance == 0.0 {
            return Unseen::default();
        }
        let golden = |k: f64| (k * 0.618_033_988_749_895).fract();
        // Eight sines of amplitude 1 have an rms of 2.
        let size = self.disturbance / 2.0;
        let mut own = Unseen::default();
        for k in 0..8 {
            let n = f64::from(k);
            let near = self.disturbance_frequency * (0.96 + 0.08 * golden(n));
            let slow = 0.03 * 2000f64.powf((n + golden(n)) / 8.0);
            for (place, frequency, phase, part) in [
                (0, near, n, 0.3f64.sqrt()),
                (8, slow, n + 20.0, 0.7f64.sqrt()),
            ] {
                let place = place + k as usize;
                let omega = std::f64::consts::TAU * frequency;
                let (sine, cosine) =
                    (std::f64::consts::TAU * (frequency * time + golden(phase + 7.0))).sin_cos();
                own.sines[place] = [size * part * sine, size * part * cosine];
                let (sine, cosine) = (omega * step).sin_cos();
                own.turns[place] = [sine, cosine];
            }
        }
        own
    }

    /// Quantities at `s` with `command` volts arriving and `push` newtons on the table.
    pub fn now(&self, s: &[f64; 9], command: f64, push: f64) -> Now {
        let [spool, spool_rate, a, b, x, v, z, drift, drift_rate] = *s;
        let w = std::f64::consts::TAU * self.valve_frequency;
        let edge = |from: f64, to: f64| (from - to) / ((from - to).abs() + 7e3).sqrt();
        let opening = self.flow_coefficient * self.opening(spool);
        let (into_a, into_b, flow) = if opening > 0.0 {
            let drawn = opening * edge(self.supply, a);
            (drawn, -opening * edge(b, 0.0), drawn)
        } else {
            let drawn = -opening * edge(self.supply, b);
            (opening * edge(a, 0.0), drawn, drawn)
        };
        let leak = self.leakage * (a - b);
        // Leakage past the closed edges centres the pressures at null.
        let centre = self.leakage / 4.0 * (self.supply - a - b);
        let rate_a = self.bulk_modulus / (self.volume / 2.0 + self.area * x)
            * (into_a - self.area * v - leak + centre);
        let rate_b = self.bulk_modulus / (self.volume / 2.0 - self.area * x)
            * (into_b + self.area * v + leak + centre);

        let speed = (v / self.stribeck_velocity).powi(2);
        let level = self.coulomb + (self.breakaway - self.coulomb) * (-speed).exp();
        let slides = match self.bristles {
            Bristles::LuGre => 1.0,
            Bristles::ElastoPlastic if v * z <= 0.0 => 0.0,
            Bristles::ElastoPlastic => {
                let share = ((z.abs() - 0.7) / 0.3).clamp(0.0, 1.0);
                share * share * (3.0 - 2.0 * share)
            }
        };
        let bristle_rate = (v - slides * v.abs() * z) / self.deflection;
        let damping = 0.3 * (self.coulomb / self.deflection * self.table_mass).sqrt();
        let rubbing = level * z
            + damping * self.deflection * bristle_rate * (-speed).exp()
            + self.viscous * v;
        let force = self.area * (a - b) - rubbing;

        let ws = std::f64::consts::TAU * self.specimen_frequency;
        let columns =
            self.specimen_mass * ws * (ws * drift + 2.0 * self.specimen_damping_ratio * drift_rate);
        let acceleration =
            (force + push + columns - self.table_stiffness * x - self.table_damping * v)
                / (self.table_mass + self.payload);
        let (mut specimen, mut bends) = (0.0, [0.0; 2]);
        if self.specimen_mass > 0.0 {
            specimen = -columns / self.specimen_mass;
            bends = [drift_rate, specimen - acceleration];
        }
        Now {
            derivative: [
                spool_rate,
                w * (w * (command - spool) - 2.0 * self.valve_damping * spool_rate),
                rate_a,
                rate_b,
                v,
                acceleration,
                bristle_rate,
                bends[0],
                bends[1],
            ],
            acceleration,
            force,
            specimen_acceleration: specimen,
            flow,
        }
    }

    /// Goes on from `time` by `period` with `command` given at `time`; steps end where a late command arrives.
    pub fn advance(&self, state: &mut State, time: f64, period: f64, command: f64, push: f64) {
        state.commands.rotate_left(1);
        state.commands[15] = (time, command);
        let mut cuts = [period; 17];
        for (cut, (given, _)) in cuts.iter_mut().zip(&state.commands) {
            *cut = (given + self.delay - time).clamp(0.0, period);
        }
        let mut from = 0.0;
        for to in cuts {
            if to <= from {
                continue;
            }
            let middle = time + (from + to) / 2.0 - self.delay;
            let arrived = state
                .commands
                .iter()
                .rev()
                .find(|(given, _)| *given <= middle);
            let u = arrived.map_or(0.0, |(_, u)| *u);
            let steps = ((to - from) / 20e-6).ceil();
            let h = (to - from) / steps;
            let mut unseen = self.unseen(time + from, h / 2.0);
            for _ in 0..steps as usize {
                let noise = [u + unseen.value(), u + unseen.next(), u + unseen.next()];
                step(&mut state.values, h, |s, i| {
                    self.now(s, noise[i], push).derivative
                });
            }
            from = to;
        }
    }
}

/// Sixteen sines (V) that turn by a constant angle from one time to the next.
#[derive(Default)]
struct Unseen {
    /// Sine and cosine, V.
    sines: [[f64; 2]; 16],
    /// Sine and cosine of the angle.
    turns: [[f64; 2]; 16],
}

impl Unseen {
    fn value(&self) -> f64 {
        self.sines.iter().map(|own| own[0]).sum()
    }

    /// The value at the next time.
    fn next(&mut self) -> f64 {
        for ([sine, cosine], [up, on]) in self.sines.iter_mut().zip(&self.turns) {
            (*sine, *cosine) = (*sine * on + *cosine * up, *cosine * on - *sine * up);
        }
        self.value()
    }
}

/// Classical Runge-Kutta; the slope's second argument is the half step.
fn step(y: &mut [f64; 9], h: f64, slope: impl Fn(&[f64; 9], usize) -> [f64; 9]) {
    let along = |k: &[f64; 9], by: f64| std::array::from_fn(|i| y[i] + by * k[i]);
    let k1 = slope(y, 0);
    let k2 = slope(&along(&k1, h / 2.0), 1);
    let k3 = slope(&along(&k2, h / 2.0), 1);
    let k4 = slope(&along(&k3, h), 2);
    for i in 0..9 {
        y[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn played(rig: &Rig, seconds: f64, command: impl Fn(f64) -> f64) -> Vec<[f64; 3]> {
        let mut state = rig.rest();
        (0..(seconds / 0.002) as usize)
            .map(|k| {
                let t = 0.002 * k as f64;
                rig.advance(&mut state, t, 0.002, command(t), 0.0);
                [state.values[4], state.values[5], state.values[6]]
            })
            .collect()
    }

    #[test]
    fn a_steady_command_gives_the_orifices_flow() {
        // No spring, no dry friction, no leakage: v = k u sqrt(P/2) / A. The seals' drag, which calms the oil,
        // takes 0.1 % of it.
        let rig = Rig {
            table_stiffness: 0.0,
            table_damping: 0.0,
            coulomb: 0.0,
            breakaway: 0.0,
            leakage: 0.0,
            ..Rig::default()
        };
        let velocity = played(&rig, 0.6, |_| 0.1).last().map(|row| row[1]);
        let expected = rig.flow_coefficient * 0.1 * (rig.supply / 2.0).sqrt() / rig.area;
        assert!((velocity.unwrap_or_default() / expected - 1.0).abs() < 2e-3);
    }

    #[test]
    fn an_overlap_holds_the_table_until_it_is_passed() {
        let rig = Rig {
            overlap: 0.1,
            ..Rig::default()
        };
        let still = played(&rig, 0.5, |t| 0.09 * (30.0 * t).sin());
        assert!(still.iter().all(|row| row[0].abs() < 1e-5));
        let moved = played(&rig, 0.5, |_| 0.2);
        assert!(moved.last().is_some_and(|row| row[0] > 1e-3));
    }

    #[test]
    fn bristles_end_at_the_level() {
        for bristles in [Bristles::LuGre, Bristles::ElastoPlastic] {
            let rig = Rig {
                bristles,
                ..Rig::default()
            };
            let rows = played(&rig, 0.4, |_| 0.5);
            let last = rows[rows.len() - 1];
            assert!(
                last[1] > 0.02 && (last[2] - 1.0).abs() < 1e-3,
                "{bristles:?} {last:?}"
            );
        }
    }

    /// The turned sines against sines, their sum's size against that which is asked for.
    #[test]
    fn the_unseen_voltage_is_a_sum_of_sines() {
        let rig = Rig {
            disturbance: 3e-3,
            ..Rig::default()
        };
        let mut own = rig.unseen(7.0, 1e-5);
        for k in 1..=2000 {
            let turned = own.next();
            let fresh = rig.unseen(7.0 + 1e-5 * f64::from(k), 1e-5).value();
            assert!((turned - fresh).abs() < 1e-12, "{k}: {turned} {fresh}");
        }
        let values = (0..40_000).map(|k| rig.unseen(0.025 * f64::from(k), 1e-5).value());
        let square = values.map(|v| v * v).sum::<f64>() / 40_000.0;
        assert!((square.sqrt() / 3e-3 - 1.0).abs() < 0.03, "{square}");
    }

    #[test]
    fn a_delay_moves_the_motion_by_itself() {
        let with = |delay| {
            played(
                &Rig {
                    delay,
                    ..Rig::default()
                },
                0.4,
                |t| (20.0 * t).sin(),
            )
        };
        let (early, late) = (with(0.0), with(0.004));
        let off = (2..200)
            .map(|k| (early[k - 2][0] - late[k][0]).abs())
            .fold(0.0, f64::max);
        assert!(off < 1e-7, "{off}");
    }
}
