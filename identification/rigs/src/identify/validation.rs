//! How well the parts of the model follow measurements that were not fitted.
//!
//! As in Fig 2-7, force and accelerations are simulated from the command, held to the path by the
//! measured displacement alone (the thesis feeds the actuator the measured velocity); as in
//! Fig 2-10, the displacement is simulated from the measured force, with initial state and offset
//! fitted on the stretch itself.

use nalgebra::{DMatrix, DVector, dmatrix};
use plant::identified::coupled::Rig;
use plant::linear::StateSpace;

use crate::identify::model::{RigModel, ScaledRecording};
use crate::identify::parameters::{OUTPUTS, Own, PhysicalValues};
use recordings::{OUTPUT_NAMES, fit_percent};

/// Fit of one channel of one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelFit {
    /// The recording.
    pub recording: String,
    /// The channel.
    pub channel: &'static str,
    /// `100 (1 - ||y - m|| / ||y - mean||)` of the simulation.
    pub simulated: f64,
    /// The same of the one-step prediction.
    pub predicted: f64,
    /// Time of the first sample compared, s.
    pub start: f64,
    /// The measurement on the validation part, SI.
    pub measured: Vec<f64>,
    /// The simulation, SI.
    pub model: Vec<f64>,
}

/// Fits of all channels on the stretch after the fitted part.
pub(crate) fn fits(whole: &RigModel, fitted: &RigModel, parameters: &[f64]) -> Vec<ChannelFit> {
    let mut fits = Vec::new();
    for (index, data) in whole.experiments.iter().enumerate() {
        let first = fitted.experiments[index].command.len();
        if data.command.len() < first + 100 {
            continue;
        }
        let payload = parameters[Own::Payload.of(index)];
        let rig = PhysicalValues::of(parameters).rig(payload, data.specimen);
        let channels = Channels::new(data, first);
        let held = whole.held_by_displacement(index, parameters);
        let predictions = whole.one_step_predictions(index, parameters);
        for i in (0..OUTPUTS).filter(|&i| data.measured[i]) {
            let simulated = match i {
                0 => table(&rig, &channels, data.measured[3]),
                _ => held.as_ref().map(|outputs| outputs[i][first..].to_vec()),
            };
            let measured = channels.outputs[i].clone();
            let predicted = predictions
                .as_ref()
                .map_or(f64::NAN, |p| fit_percent(&measured, &p[i][first..]));
            fits.push(ChannelFit {
                recording: data.name.clone(),
                channel: OUTPUT_NAMES[i],
                simulated: simulated
                    .as_ref()
                    .map_or(f64::NAN, |m| fit_percent(&measured, m)),
                predicted,
                start: first as f64 * data.period,
                model: simulated.unwrap_or_default(),
                measured,
            });
        }
    }
    fits
}

/// A stretch in SI units.
struct Channels {
    period: f64,
    outputs: Vec<Vec<f64>>,
}

impl Channels {
    fn new(data: &ScaledRecording, first: usize) -> Self {
        Self {
            period: data.period,
            outputs: (0..OUTPUTS)
                .map(|i| {
                    let rest = data.outputs[first..].iter();
                    rest.map(|y| y[i] * data.scale[i]).collect()
                })
                .collect(),
        }
    }
}

/// Simulates `system` from one input that runs straight between samples; initial state and offset
/// by least squares on `measured`.
fn simulate(system: &StateSpace, input: &[f64], measured: &[f64], period: f64) -> Option<Vec<f64>> {
    let n = system.order();
    let mut a = DMatrix::zeros(n + 2, n + 2);
    a.view_mut((0, 0), (n, n)).copy_from(&system.a);
    a.view_mut((0, n), (n, 1)).copy_from(&system.b);
    a[(n, n + 1)] = 1.0 / period;
    let transition = (a * period).exp();
    let (held, slope) = (
        transition.view((0, n), (n, 1)).column(0).into_owned(),
        transition.view((0, n + 1), (n, 1)).column(0).into_owned(),
    );
    let a = transition.view((0, 0), (n, n)).into_owned();
    let mut state = DVector::zeros(n);
    let mut free = DMatrix::<f64>::identity(n, n);
    let mut forced = Vec::with_capacity(measured.len());
    let mut basis = DMatrix::zeros(measured.len(), n + 1);
    for k in 0..measured.len() {
        forced.push(system.c.row(0).tr_dot(&state));
        basis
            .view_mut((k, 0), (1, n))
            .copy_from(&(system.c.row(0) * &free));
        basis[(k, n)] = 1.0;
        let next = input.get(k + 1).unwrap_or(&input[k]);
        state = &a * &state + &held * input[k] + &slope * (next - input[k]);
        free = &a * free;
    }
    let target = DVector::from_fn(measured.len(), |k, _| measured[k] - forced[k]);
    let normal = basis.tr_mul(&basis).svd(true, true);
    let coordinates = normal.solve(&basis.tr_mul(&target), 1e-14).ok()?;
    let correction = basis * coordinates;
    let model: Vec<f64> = forced
        .iter()
        .zip(correction.iter())
        .map(|(f, c)| f + c)
        .collect();
    model.iter().all(|value| value.is_finite()).then_some(model)
}

/// Displacement from force, and from the specimen's acceleration where it was measured (Fig 2-10).
fn table(rig: &Rig, channels: &Channels, carried: bool) -> Option<Vec<f64>> {
    let table = rig.shake_table.table;
    let measured_mass = rig.specimen.filter(|_| carried).map_or(0.0, |own| own.mass);
    let force: Vec<f64> = channels.outputs[2]
        .iter()
        .zip(&channels.outputs[3])
        .map(|(force, acceleration)| force - measured_mass * acceleration)
        .collect();
    let (m, c, k) = (table.mass, table.damping, table.stiffness);
    let system = match rig.specimen.filter(|_| !carried) {
        None => StateSpace {
            a: dmatrix![0.0, 1.0; -k / m, -c / m],
            b: dmatrix![0.0; 1.0 / m],
            c: dmatrix![1.0, 0.0],
            d: DMatrix::zeros(1, 1),
        },
        // Table, then the specimen's drift, whose mass times acceleration is -(ks d + cs d').
        Some(own) => {
            let (ms, cs, ks) = (own.mass, own.damping, own.stiffness);
            StateSpace {
                a: dmatrix![
                    0.0, 1.0, 0.0, 0.0;
                    -k / m, -c / m, ks / m, cs / m;
                    0.0, 0.0, 0.0, 1.0;
                    k / m, c / m, -ks / m - ks / ms, -cs / m - cs / ms
                ],
                b: dmatrix![0.0; 1.0 / m; 0.0; -1.0 / m],
                c: dmatrix![1.0, 0.0, 0.0, 0.0],
                d: DMatrix::zeros(1, 1),
            }
        }
    };
    simulate(&system, &force, &channels.outputs[0], channels.period)
}
