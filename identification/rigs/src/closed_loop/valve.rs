//! What a valve lacks to an ideal one: overlap or underlap, gain lost around null, asymmetry.
//!
//! The rig is replayed under its recorded command ([`super::replay`]), and valve, oil and seals are fitted
//! together. The search begins with an ideal valve. In each round every member that is not in the curve yet is tried on
//! a part of the records, and the best is fitted to more; it stays if it gains on the part that was not fitted, and the
//! search ends when none gains more than chance and `LEAST`. The first round also tries actuators that were found
//! behind several overlaps: a fit without one takes lost flow for soft oil and friction, from where none is found.
//! Then the table is found again behind the valve, and the search goes on once more.
//! What the null leaves uncertain is the scatter between blocks of the records, widened by how much more is left where
//! nothing was fitted.

use nalgebra::{DMatrix, Vector2};
use plant::identified::valve_curve::ValveCurve;
use rayon::prelude::*;
use recordings::{Recording, mean_and_deviation};

use super::equations::{HydraulicRig, PARAMETERS};
use super::fitting::Fitting;
use super::friction::SealShape;
use super::replay::{
    Actuator, CORRECTION, Errors, FITTED, MISTAKEN, OF_CURVE, PART, Replay, coordinates, speed,
};
use super::simulation::spool_transition;
use super::{Found, LEAST_INERTIA};
use sysid::nonlinear::{Coordinate, Derivatives, Effort, Optimum, minimise_with};

/// Least part of the squared error that a member of the curve has to take away.
const LEAST: f64 = 0.03;
/// Least overlap over the command (rms), least share lost, least asymmetry: what is smaller is none.
const SMALLEST: f64 = 5e-3;
/// Least width of lost gain over the command (rms), and least width over the overlap for it to be one of its own:
/// a narrower one is how the edges of the overlap leak.
const NARROWEST: f64 = 0.05;
/// Share of the gain lost beside an overlap that is none: the overlap itself may be a little smaller.
const FAINT: f64 = 0.1;
const EDGE: f64 = 0.25;
/// Error of the delay, s, that the form of the spool leaves beside its scatter: a quarter of a sample.
const DELAY_MISTAKEN: f64 = 5e-4;
/// Part of the delay, s, that the spool's lag takes where friction and flow are of another form: half a sample, and at
/// most a third of the lag.
const EXCHANGED: f64 = 1e-3;
/// Share of oil stiffness and force rate that is as uncertain: flow goes with the root of the pressure.
const OIL_MISTAKEN: f64 = 0.01;
/// Share of the overlap that is as uncertain: its edges leak.
const EDGE_MISTAKEN: f64 = 0.01;
/// Standard errors, from block to block, by which what it takes away has to be more than none.
const SURE: f64 = 2.5;
/// Length of such a block, s.
const BLOCK: f64 = 0.5;
/// Longest inner step of the search, s.
const STEP: f64 = 2e-3;
/// Part of the records on which a member is tried.
const TRIED_ON: f64 = 0.4;
/// How a member shows what it is worth, how the one that is taken is fitted, and how all of them are at the end.
const TRIED: Effort = Effort {
    iterations: 10,
    part: 1e-2,
    derivatives: Derivatives::Trusted,
};
const TAKEN: Effort = Effort {
    iterations: 30,
    part: 3e-3,
    derivatives: Derivatives::Carried,
};
const SETTLED: Effort = Effort {
    iterations: 30,
    part: 1e-4,
    derivatives: Derivatives::Carried,
};
/// Squared error over that of the fit before from which a trial is not followed.
const HOPELESS: f64 = 1.1;

/// What a valve's curve may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Member {
    /// Overlap, or underlap.
    Lap,
    /// Gain lost around null.
    NullLoss,
    /// Different gains to either side.
    Asymmetry,
}

impl Member {
    const ALL: [Self; 3] = [Self::Lap, Self::NullLoss, Self::Asymmetry];

    /// Its places among the parameters.
    fn places(self) -> &'static [usize] {
        const PLACES: [usize; 4] = [OF_CURVE, OF_CURVE + 1, OF_CURVE + 2, OF_CURVE + 3];
        match self {
            Self::Lap => &PLACES[..1],
            Self::NullLoss => &PLACES[1..3],
            Self::Asymmetry => &PLACES[3..],
        }
    }

    /// Where its search starts, for commands of a size (rms, V).
    fn starts(self, command: f64) -> Vec<Vec<f64>> {
        match self {
            Self::Lap => [0.05, 0.4, -0.05].map(|part| vec![part * command]).to_vec(),
            Self::NullLoss => [0.3, 1.0]
                .map(|part| {
                    vec![
                        0.3,
                        (part * command / ValveCurve::default().null_width).ln(),
                    ]
                })
                .to_vec(),
            Self::Asymmetry => vec![vec![0.0]],
        }
    }
}

/// A valve that is not ideal.
#[derive(Debug, Clone, PartialEq)]
pub struct Valve {
    /// Its opening.
    pub curve: ValveCurve,
    /// Standard errors of the curve's numbers.
    pub standard_error: ValveCurve,
    /// What was found in it, the first found first.
    pub members: Vec<Member>,
    /// Root mean square of the replay's error where nothing was fitted, over that with an ideal valve.
    pub improvement: f64,
}

impl Valve {
    /// Names of what was found, as a diagnosis has them.
    pub fn causes(&self) -> Vec<&'static str> {
        let name = |member: &Member| match member {
            Member::Lap if self.curve.overlap < 0.0 => "valve_underlap",
            Member::Lap => "valve_dead_band",
            Member::NullLoss => "reduced_null_gain",
            Member::Asymmetry => "valve_asymmetric_gain",
        };
        let lap = self.members.contains(&Member::Lap);
        let is_edge = lap && self.curve.null_width < EDGE * self.curve.overlap;
        let own = |member: &&Member| **member != Member::NullLoss || !is_edge;
        self.members.iter().filter(own).map(name).collect()
    }
}

/// What the opening (V) differs by from the spool's position, at each sample of `command` (V, every `period` s).
pub(super) fn distortion(
    rig: &HydraulicRig,
    curve: &ValveCurve,
    command: &[f64],
    period: f64,
) -> Vec<f64> {
    let spool = spool(rig, command, period);
    spool.iter().map(|at| curve.opening(*at) - at).collect()
}

/// The opening (V) at each sample of `command` (V, every `period` s).
pub(super) fn opening(
    rig: &HydraulicRig,
    curve: &ValveCurve,
    command: &[f64],
    period: f64,
) -> Vec<f64> {
    let spool = spool(rig, command, period);
    spool.iter().map(|at| curve.opening(*at)).collect()
}

/// The position of the spool (V).
fn spool(rig: &HydraulicRig, command: &[f64], period: f64) -> Vec<f64> {
    let late = (rig.command_delay / period).max(0.0);
    let (whole, part) = (late.floor() as usize, late.fract());
    let pieces = [(whole + 1, part), (whole, 1.0 - part)]
        .map(|(back, share)| (back, spool_transition(rig, share * period)));
    let mut spool = Vector2::zeros();
    let mut all = Vec::with_capacity(command.len());
    for k in 0..command.len() {
        all.push(spool.x);
        for (back, transition) in pieces {
            let u = Vector2::new(k.checked_sub(back).map_or(0.0, |k| command[k]), 0.0);
            spool = u + transition * (spool - u);
        }
    }
    all
}

/// A fit of the search.
#[derive(Clone)]
struct Trial {
    members: Vec<Member>,
    fit: Optimum,
    /// Squared errors over their weights where nothing was fitted, block by block.
    blocks: Vec<f64>,
}

impl Trial {
    fn left(&self) -> f64 {
        self.blocks.iter().sum::<f64>() / self.blocks.len().max(1) as f64
    }

    /// Whether it leaves less than `other` by more than chance.
    fn is_better_than(&self, other: &Self) -> bool {
        let gains: Vec<f64> = other
            .blocks
            .iter()
            .zip(&self.blocks)
            .map(|(a, b)| a - b)
            .collect();
        let (mean, deviation) = mean_and_deviation(&gains);
        let error = deviation / (gains.len().max(1) as f64).sqrt();
        mean > LEAST * other.left() && mean > SURE * error
    }
}

/// Mean squares of blocks of errors.
fn blocks(errors: &Errors, replay: &Replay) -> Vec<f64> {
    let mut all = Vec::new();
    for (errors, own) in errors.iter().zip(replay.records) {
        let length = (BLOCK / own.recording.period()).max(1.0) as usize;
        let square = |e: &[f64; 2]| e[0] * e[0] + e[1] * e[1];
        all.extend(
            errors
                .chunks_exact(length)
                .map(|block| block.iter().map(square).sum::<f64>() / length as f64),
        );
    }
    all
}

/// The search on recordings.
#[derive(Clone, Copy)]
struct Search<'a> {
    replay: Replay<'a>,
    command: f64,
}

impl Search<'_> {
    fn is_free(&self, members: &[Member], parameter: usize) -> bool {
        let rig = &self.replay.start.rig;
        match parameter {
            0 => rig.seal_friction > 0.0,
            1 => rig.seal_damping > 0.0,
            own if own < OF_CURVE => true,
            own => members.iter().any(|member| member.places().contains(&own)),
        }
    }

    fn fit(&self, members: &[Member], start: &[f64], within: Effort) -> Option<Trial> {
        let start: [f64; FITTED] = start.try_into().ok()?;
        let own: Vec<Coordinate> = coordinates(&start, self.replay.start.curve.null_loss, |i| {
            self.is_free(members, i)
        });
        let fit = minimise_with(&self.replay, &own, within)?;
        let rest = self.replay.rest();
        let blocks = blocks(&rest.errors(&fit.values)?, &rest);
        Some(Trial {
            members: members.to_vec(),
            fit,
            blocks,
        })
    }

    /// A fit that costs little and shows what it is worth.
    fn attempt(&self, members: &[Member], start: &[f64]) -> Option<Trial> {
        let own = Self {
            replay: Replay {
                part: (0.0, TRIED_ON),
                ..self.replay
            },
            ..*self
        };
        own.fit(members, start, TRIED)
    }

    /// Whether what a member adds to the curve is more than a trifle.
    fn is_there(&self, own: &Trial, member: Member) -> bool {
        let curve = self.replay.start.at(&own.fit.values).curve;
        let size = match member {
            Member::Lap => curve.overlap.abs() / self.command,
            Member::NullLoss if curve.null_width < NARROWEST * self.command => 0.0,
            Member::NullLoss if own.members.contains(&Member::Lap) => curve.null_loss - FAINT,
            Member::NullLoss => curve.null_loss,
            Member::Asymmetry => curve.asymmetry.abs(),
        };
        size > SMALLEST
    }

    /// What a fit says of the actuator, without members that have become trifles, and the others.
    fn settled(&self, own: &Trial) -> (Actuator, Vec<Member>) {
        let mut moved = self.replay.start.at(&own.fit.values);
        let mut members = own.members.clone();
        members.retain(|member| self.is_there(own, *member));
        let ideal = ValveCurve::default();
        for member in own.members.iter().filter(|own| !members.contains(own)) {
            match member {
                Member::Lap => moved.curve.overlap = ideal.overlap,
                Member::NullLoss => moved.curve.null_loss = ideal.null_loss,
                Member::Asymmetry => moved.curve.asymmetry = ideal.asymmetry,
            }
        }
        (moved, members)
    }

    /// The same values with a seal that is as abrupt as seals are: where the valve lacked something its shape may
    /// have gone to a limit, from which no fit comes back.
    fn with_usual_seals(&self, values: &[f64]) -> Vec<f64> {
        let (known, mut own) = (&self.replay.start.shape, values.to_vec());
        own[3] = 0.2 - known.excess;
        own[4] = (4e-3 / known.stribeck_velocity).ln();
        own[5] = (3.0 / known.sharpness).ln();
        own
    }

    /// Fits behind overlaps that are not small, each with the search that begins there.
    fn behind(
        &self,
        lapped: &[(HydraulicRig, ValveCurve)],
        shape: SealShape,
    ) -> Vec<(Self, Trial)> {
        let trials = lapped.par_iter().filter_map(|(rig, curve)| {
            let own = Self {
                replay: Replay {
                    start: Actuator {
                        rig: *rig,
                        shape,
                        curve: *curve,
                    },
                    ..self.replay
                },
                ..*self
            };
            let trial = own.attempt(&[Member::Lap], &[0.0; FITTED])?;
            own.is_there(&trial, Member::Lap).then_some((own, trial))
        });
        trials.collect()
    }

    /// `best` with what gains most, as long as something does, and the actuator with what gains too little to be sure
    /// of. The first member may be one of `rivals`.
    fn further(
        self,
        mut best: Trial,
        mut rivals: Vec<(Self, Trial)>,
    ) -> (Self, Trial, Option<Actuator>) {
        let mut own = self;
        while let Some((search, next)) = own.extended(&best, std::mem::take(&mut rivals)) {
            if !next.is_better_than(&best) {
                let doubted = search.replay.start.at(&next.fit.values);
                let doubted = (next.left() < best.left()).then_some(doubted);
                return (own, best, doubted);
            }
            (own, best) = (search, next);
        }
        (own, best, None)
    }

    /// The best fit with one member more, or of `rivals`.
    fn extended(&self, from: &Trial, rivals: Vec<(Self, Trial)>) -> Option<(Self, Trial)> {
        let wanting = Member::ALL
            .into_iter()
            .filter(|member| !from.members.contains(member));
        let starts: Vec<(Member, Vec<f64>)> = wanting
            .flat_map(|member| {
                let all = member.starts(self.command);
                all.into_iter().map(move |own| (member, own))
            })
            .collect();
        let trials = starts.par_iter().filter_map(|(member, own)| {
            let mut members = from.members.clone();
            members.push(*member);
            let mut start = self.with_usual_seals(&from.fit.values);
            for (place, value) in member.places().iter().zip(own) {
                start[*place] = *value;
            }
            let trial = self.attempt(&members, &start)?;
            self.is_there(&trial, *member).then_some((*self, trial))
        });
        let mut trials: Vec<_> = trials.collect();
        trials.extend(rivals);
        trials.retain(|(_, trial)| trial.left() < HOPELESS * from.left());
        trials.sort_by(|a, b| a.1.left().total_cmp(&b.1.left()));
        trials.into_iter().find_map(|(search, trial)| {
            let found = search.fit(&trial.members, &trial.fit.values, TAKEN)?;
            let member = *found.members.last()?;
            search.is_there(&found, member).then_some((search, found))
        })
    }
}

impl Found {
    /// Looks for what the valve lacks to an ideal one, and takes it over where there is something. The search
    /// begins with this rig, and with `lapped`, rigs behind valves with overlap.
    pub(super) fn replay_valve(
        &mut self,
        recordings: &[Recording],
        lapped: &[(HydraulicRig, ValveCurve)],
        fitting: &Fitting,
    ) {
        let Some(records) = self.replayed(recordings) else {
            return;
        };
        let replay = Replay {
            records: &records,
            start: Actuator {
                curve: fitting.centred(),
                ..self.actuator()
            },
            weights: [1.0; 2],
            known: f64::INFINITY,
            part: (0.0, PART),
            step: STEP,
        };
        let Some((search, plain)) = search(replay, fitting.command) else {
            return;
        };
        let rivals = search.behind(lapped, fitting.usual_shape());
        let (mut search, mut best, mut doubted) = search.further(plain.clone(), rivals);
        let mut own = self.clone();
        if best.members.is_empty() {
            return;
        }
        // What is known of the table by equations that a valve of another form has bent.
        let mut rounds = 2;
        while rounds > 0 {
            rounds -= 1;
            let (moved, members) = search.settled(&best);
            own.take(&moved, &members);
            let Some((fit, equations)) = fitting.refit(&own) else {
                break;
            };
            let Some(rig) = HydraulicRig::at(&fit.values) else {
                break;
            };
            own.take_table(&rig, &fit);
            search.replay.start = own.actuator();
            let mut moved = fit.values.clone();
            moved[..PARAMETERS].copy_from_slice(&own.rig.coordinates());
            own.mean_squares = equations.mean_squares(&moved).unwrap_or(own.mean_squares);
            let (start, effort) = match rounds {
                0 => ([0.0; FITTED].to_vec(), SETTLED),
                _ => (search.with_usual_seals(&[0.0; FITTED]), TAKEN),
            };
            let Some(next) = search.fit(&members, &start, effort) else {
                break;
            };
            best = next;
            if rounds > 0 {
                // With a table that is right, what is left may be of the valve.
                (search, best, doubted) = search.further(best, Vec::new());
            }
            if search.settled(&best).1 != best.members {
                rounds = 1;
            }
        }
        let moved = search.replay.start.at(&best.fit.values);
        own.take(&moved, &best.members);
        if own
            .take_errors(&search, &best, &plain, doubted.as_ref())
            .is_some()
        {
            *self = own;
        }
    }

    fn take(&mut self, moved: &Actuator, members: &[Member]) {
        self.rig = moved.rig;
        self.shape = moved.shape;
        self.valve = Some(Valve {
            curve: moved.curve,
            standard_error: ValveCurve::default(),
            members: members.to_vec(),
            improvement: 1.0,
        });
    }

    /// Takes table, payloads and sensors over from a fit of the equations.
    fn take_table(&mut self, rig: &HydraulicRig, fit: &Optimum) {
        self.rig = HydraulicRig {
            mass: rig.mass,
            damping: rig.damping,
            stiffness: rig.stiffness,
            specimen_mass: rig.specimen_mass,
            accelerometer_delay: rig.accelerometer_delay,
            load_cell_delay: rig.load_cell_delay,
            accelerometer_scale: rig.accelerometer_scale,
            ..self.rig
        };
        let slopes = rig.slopes();
        let excess = self.mean_squares.iter().copied().fold(1.0, f64::max);
        self.covariance = DMatrix::from_fn(PARAMETERS, PARAMETERS, |i, j| {
            excess * fit.covariance[(i, j)] * slopes[i] * slopes[j]
        });
    }

    /// Errors of what was replayed, and the position of the null.
    /// What a member that is not taken would change is as uncertain by half.
    fn take_errors(
        &mut self,
        search: &Search,
        best: &Trial,
        plain: &Trial,
        doubted: Option<&Actuator>,
    ) -> Option<()> {
        let replay = &search.replay;
        let free: Vec<usize> = (0..FITTED)
            .filter(|i| search.is_free(&best.members, *i))
            .collect();
        let values = &best.fit.values;
        let fitted = blocks(&replay.errors(values)?, replay);
        let fitted = fitted.iter().sum::<f64>() / fitted.len().max(1) as f64;
        let misfit = (best.left() / fitted).max(1.0);
        let covariance = replay.covariance(values, &free)? * misfit;
        let place = |i: usize| free.iter().position(|own| *own == i);
        let moved = replay.start.at(values);
        let slopes = moved.slopes();
        for (_, parameter, _) in slopes {
            for other in 0..PARAMETERS {
                self.covariance[(parameter, other)] = 0.0;
                self.covariance[(other, parameter)] = 0.0;
            }
        }
        for (i, row, by_row) in slopes {
            for (j, column, by_column) in slopes {
                if let (Some(i), Some(j)) = (place(i), place(j)) {
                    self.covariance[(row, column)] = by_row * by_column * covariance[(i, j)];
                }
            }
        }
        let seal = slopes[0].1;
        let mistaken = MISTAKEN * moved.rig.seal_damping * speed(replay.records)?;
        self.covariance[(seal, seal)] += mistaken * mistaken;
        for (_, oil, own) in &slopes[2..4] {
            self.covariance[(*oil, *oil)] += (OIL_MISTAKEN * own).powi(2);
        }
        let delay = slopes[7].1;
        // Without inertia the spool's lag is no more certain than what was taken from it for delay.
        let exchanged = if moved.rig.spool_inertia <= 1.01 * LEAST_INERTIA {
            moved.rig.spool_lag
        } else {
            0.0
        };
        self.covariance[(delay, delay)] += DELAY_MISTAKEN.powi(2) + exchanged.powi(2);
        let places = [delay, slopes[5].1, slopes[6].1];
        let together = exchange(&moved.rig);
        for (row, by_row) in places.into_iter().zip(together) {
            for (column, by_column) in places.into_iter().zip(together) {
                self.covariance[(row, column)] += by_row * by_column;
            }
        }
        let mut edge = EDGE_MISTAKEN * moved.curve.overlap;
        if let Some(other) = doubted {
            edge = edge.hypot(0.5 * (other.curve.overlap - moved.curve.overlap));
            let [own, other]: [[f64; PARAMETERS]; 2] = [moved.rig.into(), other.rig.into()];
            let half = |i: usize| 0.5 * (other[i] - own[i]);
            // They change together.
            for (_, i, _) in slopes {
                for (_, j, _) in slopes {
                    self.covariance[(i, j)] += half(i) * half(j);
                }
            }
        }
        self.standard_error = std::array::from_fn(|i| self.covariance[(i, i)].max(0.0).sqrt());
        let error = |i: usize| place(i).map_or(0.0, |i| covariance[(i, i)].max(0.0).sqrt());
        let (bias, bias_error) = null(replay, &moved)?;
        let valve = self.valve.as_mut()?;
        valve.curve.null_bias += bias;
        valve.standard_error = ValveCurve {
            overlap: error(OF_CURVE).hypot(edge),
            null_loss: error(OF_CURVE + 1),
            null_width: moved.curve.null_width * error(OF_CURVE + 2),
            asymmetry: error(OF_CURVE + 3),
            null_bias: bias_error,
        };
        valve.improvement = (best.left() / plain.left()).sqrt();
        Some(())
    }
}

/// What delay (s), spool's lag (s) and its inertia (s²) take from each other. Phase and gain of the spool at low frequencies
/// are `T + l` and `j - l²/2`: recordings show those, and less of how they are divided.
fn exchange(rig: &HydraulicRig) -> [f64; 3] {
    let part = EXCHANGED.min(rig.spool_lag / 3.0);
    [-part, part, rig.spool_lag * part]
}

/// Fits the rig with an ideal valve. None where it cannot be replayed.
fn search(replay: Replay<'_>, command: f64) -> Option<(Search<'_>, Trial)> {
    let replay = replay.weighed(&[0.0; FITTED])?;
    let mut search = Search { replay, command };
    let first = search.fit(&[], &[0.0; FITTED], TRIED)?;
    search.replay = search.replay.weighed(&first.fit.values)?;
    let plain = search.fit(&[], &first.fit.values, TAKEN)?;
    Some((search, plain))
}

/// Position of the spool at zero command beyond that of the curve (V) and its standard error: what has to be added
/// to the command so that
/// the replayed displacement stays at the measured one.
fn null(replay: &Replay, moved: &Actuator) -> Option<(f64, f64)> {
    let whole = Replay {
        start: *moved,
        part: (0.0, 1.0),
        weights: [1.0; 2],
        ..*replay
    };
    let lead = CORRECTION * moved.rig.oil_stiffness / moved.rig.force_rate;
    let (errors, offsets) = whole.raw(&[0.0; FITTED])?;
    let corrections: Vec<f64> = errors
        .iter()
        .zip(&offsets)
        .map(|(_, offset)| -lead * offset[0])
        .collect();
    let mean = corrections.iter().sum::<f64>() / corrections.len().max(1) as f64;
    let mut blocks = Vec::new();
    for (errors, own) in errors.iter().zip(replay.records) {
        let length = (10.0 * BLOCK / own.recording.period()) as usize;
        blocks.extend(
            errors
                .chunks_exact(length.max(1))
                .map(|block| lead * block.iter().map(|e| e[0]).sum::<f64>() / block.len() as f64),
        );
    }
    let (_, deviation) = mean_and_deviation(&blocks);
    Some((mean, deviation / (blocks.len().max(1) as f64).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::super::simulation::Simulation;
    use super::*;
    use recordings::Channel;

    /// Lags of 4 ms and 1 ms in a row, after steps of 1 V and -3 V that arrive 2.3 samples late.
    #[test]
    fn the_spool_answers_steps_in_closed_form_after_its_delay() {
        const PERIOD: f64 = 2e-3;
        let (slow, fast) = (4e-3, 1e-3);
        let rig = HydraulicRig {
            spool_lag: slow + fast,
            spool_inertia: slow * fast,
            command_delay: 2.3 * PERIOD,
            ..super::super::start::empty()
        };
        let command: Vec<f64> = (0..40).map(|k| if k < 10 { 1.0 } else { -2.0 }).collect();
        let answer = |t: f64| {
            let rest = slow * (-t / slow).exp() - fast * (-t / fast).exp();
            if t > 0.0 {
                1.0 - rest / (slow - fast)
            } else {
                0.0
            }
        };
        for (k, found) in spool(&rig, &command, PERIOD).iter().enumerate() {
            let t = (k as f64 - 2.3) * PERIOD;
            let expected = answer(t) - 3.0 * answer(t - 10.0 * PERIOD);
            assert!((found - expected).abs() < 1e-9, "{k}: {found} {expected}");
        }
    }

    /// The spool with its delay, at frequencies of a table's motion.
    #[test]
    fn what_delay_and_spool_exchange_hardly_shows() {
        let rig = HydraulicRig {
            spool_lag: 4.8e-3,
            spool_inertia: 7e-6,
            command_delay: 4.4e-3,
            ..super::super::start::empty()
        };
        let [delay, lag, inertia] = exchange(&rig);
        assert!(delay.abs() >= 0.9e-3);
        let other = HydraulicRig {
            spool_lag: rig.spool_lag + lag,
            spool_inertia: rig.spool_inertia + inertia,
            command_delay: rig.command_delay + delay,
            ..rig
        };
        let late = HydraulicRig {
            command_delay: other.command_delay,
            ..rig
        };
        let shown = |rig: &HydraulicRig, hertz: f64| {
            let s = nalgebra::Complex::new(0.0, std::f64::consts::TAU * hertz);
            let spool = s * s * rig.spool_inertia + s * rig.spool_lag + 1.0;
            (-s * rig.command_delay).exp() / spool
        };
        for hertz in [2.0, 5.0, 10.0] {
            let away = (shown(&other, hertz) - shown(&rig, hertz)).norm();
            let alone = (shown(&late, hertz) - shown(&rig, hertz)).norm();
            assert!(away < 0.1 * alone, "{hertz} Hz: {away} {alone}");
        }
        // A spool without lag has none to exchange.
        assert_eq!(exchange(&super::super::start::empty()), [0.0; 3]);
    }

    /// A search that begins again where a fit ended may also lower the share that is lost at null.
    #[test]
    fn a_lost_gain_that_was_found_too_large_comes_down() {
        const PERIOD: f64 = 2e-3;
        let rig = HydraulicRig {
            spool_lag: 4.8e-3,
            spool_inertia: 7e-6,
            force_rate: 1.9e4,
            oil_stiffness: 1.9e5,
            leakage_rate: 3.0,
            seal_damping: 880.0,
            seal_friction: 13.0,
            mass: 21.0,
            damping: 44.0,
            stiffness: 4080.0,
            command_delay: PERIOD,
            ..super::super::start::empty()
        };
        let shape = SealShape {
            presliding: 2e-5,
            excess: 0.2,
            stribeck_velocity: 4e-3,
            sharpness: 3.0,
            relaxation: 1e-3,
        };
        let lost = |null_loss: f64| ValveCurve {
            null_loss,
            ..ValveCurve::default()
        };
        let mut truth = Simulation::new(rig, shape, 0.0, None, PERIOD).through(lost(0.2));
        let mut channels = [const { Vec::new() }; 3];
        for k in 0..10_000 {
            let t = PERIOD * f64::from(k);
            let shown = truth.shown();
            let command =
                0.25 * (7.0 * t).sin() + 0.15 * (23.0 * t).cos() + 0.08 * (61.0 * t).sin();
            for (channel, value) in
                channels
                    .iter_mut()
                    .zip([command, shown.displacement, shown.acceleration])
            {
                channel.push(value);
            }
            truth.step(command);
        }
        let names = [
            Channel::ValveCommand,
            Channel::Displacement,
            Channel::Acceleration,
        ];
        let channels = names.into_iter().zip(channels).collect();
        let recording = Recording::new("lost", PERIOD, channels).unwrap();
        let records = [super::super::replay::Replayed {
            recording: &recording,
            payload: 0.0,
            specimen: None,
        }];
        let replay = Replay {
            records: &records,
            start: Actuator {
                rig,
                shape,
                curve: lost(0.4),
            },
            weights: [1e-5, 1e-2],
            known: f64::INFINITY,
            part: (0.0, PART),
            step: STEP,
        };
        let search = Search {
            replay,
            command: 0.2,
        };
        let trial = search
            .fit(&[Member::NullLoss], &[0.0; FITTED], TAKEN)
            .unwrap();
        let found = replay.start.at(&trial.fit.values).curve.null_loss;
        assert!((found - 0.2).abs() < 0.02, "{found}");
    }
}
