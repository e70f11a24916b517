//! Start values of the rig's parameters, by state-variable filters and instrumental variables.
//!
//! The instruments are one-step predictions of the measured channels out of past data (the
//! high-order predictor of the subspace method): they carry the signal, and the noise of their
//! own sample is not in them.

use nalgebra::{DMatrix, DVector};
use plant::specimens::linear::LinearSpecimen;
use rayon::prelude::*;

use crate::identify::model::ScaledRecording;
use crate::identify::parameters::{OUTPUTS, Physical, PhysicalValues};
use recordings::IdentificationError;
use recordings::mean_and_deviation;
use sysid::instrumental_variables::{Signal, Signals, regress, simulate, stabilised};
use sysid::state_variable_filter::{Between, equal_lags, filter};
use sysid::subspace;

/// Corner of the filters, rad/s: between the table's and the oil column's natural frequency.
const CORNER: f64 = 80.0;
/// Rounds of refinement of the actuator's start.
const ROUNDS: usize = 5;

/// Start values.
pub(crate) struct Start {
    /// The physical parameters.
    pub physical: PhysicalValues,
    /// Table mass seen in each experiment.
    pub mass: Vec<f64>,
    /// Relative noise of each output of each experiment, by the high-order predictor.
    pub noise: Vec<[f64; OUTPUTS]>,
    /// Singular values of the subspace method on the longest experiment.
    pub singular_values: DVector<f64>,
}

/// An experiment in SI units with instruments.
struct Channels {
    period: f64,
    command: Vec<f64>,
    measured: Vec<Vec<f64>>,
    clean: Vec<Vec<f64>>,
}

impl Channels {
    fn signal(&self, output: usize) -> Signal<'_> {
        Signal {
            measured: &self.measured[output],
            instrument: &self.clean[output],
            between: Between::Straight,
        }
    }

    /// The first seconds.
    fn first(&self, seconds: f64) -> Self {
        let count = self.command.len().min((seconds / self.period) as usize);
        let cut = |all: &[Vec<f64>]| all.iter().map(|own| own[..count].to_vec()).collect();
        Self {
            period: self.period,
            command: self.command[..count].to_vec(),
            measured: cut(&self.measured),
            clean: cut(&self.clean),
        }
    }
}

/// Finds start values, with the delay of the command where it is looked for; those of a known
/// specimen are taken over.
///
/// # Errors
/// Too little data, or signals that do not determine the table or the actuator.
pub(crate) fn start(
    experiments: &[ScaledRecording],
    known: Option<LinearSpecimen>,
    delay: bool,
) -> Result<Start, IdentificationError> {
    let mut channels = Vec::new();
    let mut noise = Vec::new();
    let mut longest: (usize, Option<DVector<f64>>) = (0, None);
    for data in experiments {
        let (found, own_noise, singular_values) = predicted_channels(data, known)?;
        channels.push(found);
        noise.push(own_noise);
        if data.command.len() > longest.0 {
            longest = (data.command.len(), Some(singular_values));
        }
    }
    let mut physical = PhysicalValues::ZERO;
    let tables = table(experiments, &channels, known)?;
    let mass: Vec<f64> = tables.mass;
    physical[Physical::TableMass] = mass[0];
    physical[Physical::TableDamping] = tables.damping;
    physical[Physical::TableStiffness] = tables.stiffness;
    let carried = if let Some(known) = known {
        [known.mass, known.damping, known.stiffness]
    } else if let Some([damping, stiffness]) = specimen(experiments, &channels)? {
        let own = tables.specimen_mass.max(1e-3 * mass[0]);
        [own, damping * own, stiffness * own]
    } else {
        [mass[0], 0.0, 0.0]
    };
    for (parameter, value) in Physical::SPECIMEN.into_iter().zip(carried) {
        physical[parameter] = value;
    }
    // On a bare table of one mass every a1 explains the data (see `identifiability`).
    let bare = !experiments.iter().any(|e| e.specimen)
        && mass.iter().all(|own| (own / mass[0] - 1.0).abs() < 0.03);
    if delay {
        physical[Physical::CommandDelay] = delay_of_command(&channels, bare);
    }
    let late = physical[Physical::CommandDelay] / channels[0].period;
    let (found, _) = actuator(&channels, late, ROUNDS, bare)?;
    for (parameter, value) in Physical::ACTUATOR.into_iter().zip(found) {
        physical[parameter] = value;
    }
    // What the filters make of the slow pole and zero may be far off: let them cancel at first.
    const SLOW: f64 = 0.01;
    physical[Physical::A0] = SLOW * physical[Physical::A1];
    physical[Physical::B0] = SLOW * physical[Physical::B1];
    Ok(Start {
        physical,
        mass,
        noise,
        singular_values: longest.1.unwrap_or_else(|| DVector::zeros(0)),
    })
}

fn predicted_channels(
    data: &ScaledRecording,
    known: Option<LinearSpecimen>,
) -> Result<(Channels, [f64; OUTPUTS], DVector<f64>), IdentificationError> {
    let mut measured: Vec<Vec<f64>> = (0..OUTPUTS)
        .map(|i| data.outputs.iter().map(|y| y[i] * data.scale[i]).collect())
        .collect();
    let used: Vec<usize> = (0..OUTPUTS).filter(|&i| data.measured[i]).collect();
    let outputs: Vec<&[f64]> = used.iter().map(|&i| measured[i].as_slice()).collect();
    let model = subspace::identify(
        &[&data.command],
        &outputs,
        data.period,
        subspace::Options {
            largest_order: 9,
            ..subspace::Options::default()
        },
    )?;
    let mut clean = measured.clone();
    let mut noise = [1.0; OUTPUTS];
    for (&i, prediction) in used.iter().zip(&model.predictions) {
        let square: f64 = measured[i]
            .iter()
            .zip(prediction)
            .map(|(y, m)| (y - m) * (y - m))
            .sum();
        noise[i] = (square / prediction.len() as f64).sqrt() / data.scale[i];
        clean[i].clone_from(prediction);
    }
    if let (Some(known), true, false) = (known, data.specimen, data.measured[3]) {
        // What a sensor on the known specimen would show.
        let (c, k) = (known.damping / known.mass, known.stiffness / known.mass);
        let carried = |acceleration: &[f64]| {
            let period = data.period;
            simulate(
                &[c, k],
                &[1.0, c, k],
                acceleration,
                period,
                Between::Straight,
            )
        };
        measured[3] = carried(&measured[1]);
        clean[3] = carried(&clean[1]);
    }
    let channels = Channels {
        period: data.period,
        command: data.command.clone(),
        measured,
        clean,
    };
    Ok((channels, noise, model.singular_values))
}

struct Tables {
    mass: Vec<f64>,
    damping: f64,
    stiffness: f64,
    specimen_mass: f64,
}

/// `F = m a + c dx/dt + k x + ms as` (Eq 2-5 with the specimen's inertia), filtered.
fn table(
    experiments: &[ScaledRecording],
    channels: &[Channels],
    known: Option<LinearSpecimen>,
) -> Result<Tables, IdentificationError> {
    // Columns: c, k, ms, then a mass and a constant an experiment.
    let count = 3 + 2 * channels.len();
    let mut cross = DMatrix::<f64>::zeros(count, count);
    let mut right = DVector::<f64>::zeros(count);
    let fit_specimen = known.is_none() && experiments.iter().any(|e| e.specimen);
    let carried_mass = known.map_or(0.0, |specimen| specimen.mass);
    for (index, (data, own)) in experiments.iter().zip(channels).enumerate() {
        let lag = equal_lags(CORNER, 2);
        let signals = |from: &[Vec<f64>]| {
            let smooth = |values: &[f64]| filter(values, own.period, &lag, Between::Straight);
            let x = smooth(&from[0]);
            [
                x[1].clone(),
                x[0].clone(),
                smooth(&from[3])[0].clone(),
                smooth(&from[1])[0].clone(),
                smooth(&from[2])[0].clone(),
            ]
        };
        let (measured, clean) = (signals(&own.measured), signals(&own.clean));
        let size: Vec<f64> = (0..5)
            .map(|i| mean_and_deviation(&measured[i]).1.max(1e-300))
            .collect();
        let row = |from: &[Vec<f64>; 5], k: usize| {
            let mut row = vec![0.0; count];
            row[0] = from[0][k];
            row[1] = from[1][k];
            row[2] = if data.specimen && fit_specimen {
                from[2][k]
            } else {
                0.0
            };
            row[3 + 2 * index] = from[3][k];
            row[4 + 2 * index] = size[4];
            row
        };
        for k in (0.2 / own.period) as usize..data.command.len() {
            let (phi, z) = (row(&measured, k), row(&clean, k));
            // Experiments weigh alike.
            let weight = 1.0 / (size[4] * size[4]);
            let carried = if data.specimen {
                carried_mass * measured[2][k]
            } else {
                0.0
            };
            for i in 0..count {
                right[i] += weight * z[i] * (measured[4][k] - carried);
                for j in 0..count {
                    cross[(i, j)] += weight * z[i] * phi[j];
                }
            }
        }
    }
    if !fit_specimen {
        cross[(2, 2)] = 1.0;
    }
    let scale: Vec<f64> = (0..count)
        .map(|i| cross[(i, i)].abs().max(f64::MIN_POSITIVE).sqrt())
        .collect();
    let scaled = DMatrix::from_fn(count, count, |i, j| cross[(i, j)] / (scale[i] * scale[j]));
    let target = DVector::from_fn(count, |i, _| right[i] / scale[i]);
    let solution = scaled
        .lu()
        .solve(&target)
        .filter(|s| s.iter().all(|v| v.is_finite()));
    let Some(solution) = solution else {
        return Err(IdentificationError::RankDeficient {
            what: "force, acceleration and displacement do not determine mass, damping and \
                   stiffness of the table: they move in proportion"
                .into(),
            remedy: "excite the table below and above its natural frequency".into(),
        });
    };
    let value = |i: usize| solution[i] / scale[i];
    let tables = Tables {
        mass: (0..channels.len())
            .map(|index| value(3 + 2 * index))
            .collect(),
        damping: value(0),
        stiffness: value(1),
        specimen_mass: value(2),
    };
    if let Some(mass) = tables.mass.iter().find(|mass| **mass <= 0.0) {
        return Err(IdentificationError::Unstable {
            what: format!("the estimated mass of the table is {mass:.4} kg"),
            remedy: "check the signs of actuator_force (positive towards positive displacement) \
                     and acceleration"
                .into(),
        });
    }
    Ok(tables)
}

/// `(s^2 + c/m s + k/m) as = (c/m s + k/m) a`: returns `[c/m, k/m]`.
fn specimen(
    experiments: &[ScaledRecording],
    channels: &[Channels],
) -> Result<Option<[f64; 2]>, IdentificationError> {
    let sets: Vec<Signals> = experiments
        .iter()
        .zip(channels)
        .filter(|(data, _)| data.specimen)
        .map(|(_, own)| Signals {
            output: own.signal(3),
            inputs: vec![own.signal(1)],
        })
        .collect();
    let Some(period) = channels.first().map(|own| own.period) else {
        return Ok(None);
    };
    if sets.is_empty() {
        return Ok(None);
    }
    let estimate = regress(
        &sets,
        &[vec![1, 0]],
        period,
        &equal_lags(0.25 * CORNER, 2),
        &[],
    )?;
    let d = stabilised(&estimate.denominator);
    Ok(Some([d[1], d[2]]))
}

/// The delay of the command with which the actuator's simulated force comes nearest to the
/// measured one on the first part of the recordings, s; near enough for the refinement to go on.
fn delay_of_command(channels: &[Channels], bare: bool) -> f64 {
    const LONGEST: f64 = 0.04;
    const STEP: f64 = 0.002;
    const PART: f64 = 10.0;
    let parts: Vec<Channels> = channels.iter().map(|own| own.first(PART)).collect();
    let period = parts[0].period;
    let step = (STEP / period).round().max(1.0) as usize;
    let count = (LONGEST / period) as usize / step;
    let errors: Vec<f64> = (0..=count)
        .into_par_iter()
        .map(|i| {
            actuator(&parts, (i * step) as f64, 2, bare).map_or(f64::INFINITY, |found| found.1)
        })
        .collect();
    let best = (0..=count)
        .min_by(|&a, &b| errors[a].total_cmp(&errors[b]))
        .unwrap_or(0);
    // The vertex of the parabola through it and its neighbours.
    let middle = best.clamp(1, count.max(2) - 1);
    let at = |i: usize| errors.get(i).copied().unwrap_or(f64::INFINITY);
    let (left, here, right) = (at(middle - 1), at(middle), at(middle + 1));
    let vertex = middle as f64 + 0.5 * (left - right) / (left - 2.0 * here + right);
    let late = match vertex.is_finite() && (vertex - best as f64).abs() <= 1.0 {
        true => vertex.max(0.0),
        false => best as f64,
    };
    late * step as f64 * period
}

/// `D F = b u + e dx/dt` (Eq 2-4) with a command that acts `late` samples late: returns
/// `[a2, a1, a0, b2, b1, b0, e2, e1, e0]` and the mean square of the error of the simulated force,
/// over its variance.
///
/// Refined instrumental variables: from the second round on the filter is the denominator found,
/// and the instrument of the force is simulated from command, acceleration and displacement.
fn actuator(
    channels: &[Channels],
    late: f64,
    rounds: usize,
    bare: bool,
) -> Result<([f64; 9], f64), IdentificationError> {
    let period = channels.first().map_or(1.0, |own| own.period);
    let powers = [vec![2, 1, 0], vec![1, 0], vec![1]];
    let known: &[(usize, f64)] = if bare {
        &[(1, 2.0 * CORNER * CORNER)]
    } else {
        &[]
    };
    let commands: Vec<Vec<f64>> = channels
        .iter()
        .map(|own| {
            // Of a sample the first part is under the command before: their mean, held.
            let (whole, part) = (late.floor(), late - late.floor());
            let at = |k: usize, back: usize| own.command[k.saturating_sub(whole as usize + back)];
            (0..own.command.len())
                .map(|k| (1.0 - part) * at(k, 0) + part * at(k, 1))
                .collect()
        })
        .collect();
    let mut forces: Vec<Vec<f64>> = channels.iter().map(|own| own.clean[2].clone()).collect();
    let mut denominator = equal_lags(CORNER, 3);
    let mut best = ([0.0; 9], f64::INFINITY);
    let mut round = 0;
    loop {
        let sets: Vec<Signals> = channels
            .iter()
            .zip(commands.iter().zip(&forces))
            .map(|(own, (command, force))| Signals {
                output: Signal {
                    instrument: force,
                    ..own.signal(2)
                },
                inputs: vec![
                    Signal::exact(command, Between::Held),
                    own.signal(1),
                    own.signal(0),
                ],
            })
            .collect();
        let estimate = regress(&sets, &powers, period, &denominator, known)?;
        let d = &estimate.denominator;
        let [b, a, x] = [0, 1, 2].map(|i| &estimate.numerators[i]);
        let force = |own: &Channels, command: &[f64], denominator: &[f64]| -> Vec<f64> {
            let part = |numerator: &[f64], input: &[f64], between| {
                simulate(numerator, denominator, input, period, between)
            };
            let parts = [
                part(b, command, Between::Held),
                part(a, &own.measured[1], Between::Straight),
                part(x, &own.measured[0], Between::Straight),
            ];
            (0..command.len())
                .map(|k| parts.iter().map(|part| part[k]).sum())
                .collect()
        };
        let pairs = channels.iter().zip(&commands);
        let own = stabilised(d);
        let error: f64 = pairs
            .clone()
            .map(|(data, command)| {
                quick_error(&data.measured[2], &force(data, command, &own), period)
            })
            .sum();
        if error < best.1 {
            best = (
                [d[1], d[2], d[3], b[0], b[1], b[2], a[0], a[1], x[0]],
                error,
            );
        }
        if round == rounds {
            return Ok(best);
        }
        // The slow pole would need minutes to settle: keep it out of filter and instrument.
        denominator = with_faster_poles(&stabilised(d), 5.0);
        forces = pairs
            .map(|(data, command)| force(data, command, &denominator))
            .collect();
        round += 1;
    }
}

/// Mean square of the difference above some hertz, over the variance of the measurement.
fn quick_error(measured: &[f64], model: &[f64], period: f64) -> f64 {
    const CORNER: f64 = 20.0;
    let error: Vec<f64> = measured.iter().zip(model).map(|(y, m)| y - m).collect();
    let slow = &filter(&error, period, &equal_lags(CORNER, 1), Between::Straight)[0];
    let settled = (1.0 / period) as usize;
    let pairs = error.iter().zip(slow).skip(settled);
    let square: f64 = pairs.map(|(e, s)| (e - s) * (e - s)).sum();
    square / (mean_and_deviation(measured).1.powi(2) * measured.len() as f64)
}

fn with_faster_poles(denominator: &[f64], least: f64) -> Vec<f64> {
    let mut polynomial = vec![nalgebra::Complex::new(1.0, 0.0)];
    for root in sysid::instrumental_variables::poles(denominator) {
        let root = nalgebra::Complex::new(root.re.min(-least), root.im);
        let mut next = polynomial.clone();
        next.push(nalgebra::Complex::new(0.0, 0.0));
        for (i, &c) in polynomial.iter().enumerate() {
            next[i + 1] -= root * c;
        }
        polynomial = next;
    }
    polynomial.iter().map(|c| c.re).collect()
}
