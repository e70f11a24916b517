//! How well the parts of the model follow measurements that were not fitted.
//!
//! As in Fig 2-7 and 2-10, each part is simulated from its own measured inputs: the actuator from
//! command and displacement, the table from force and specimen acceleration, the specimen from
//! the table's acceleration. Initial state and offset are fitted on the stretch itself; nothing
//! else is.

use nalgebra::{DMatrix, DVector};
use plant::linear::StateSpace;
use plant::rig::Rig;

use crate::data::fit_percent;
use crate::rig_model::{DELAY, Experiment, OUTPUT_NAMES, OUTPUTS, RigModel, rig_from};

/// Fit of one channel of one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelFit {
    /// The recording.
    pub recording: String,
    /// The channel.
    pub channel: &'static str,
    /// `100 (1 - ||y - m|| / ||y - mean||)` of the part simulated from its measured inputs.
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
pub(crate) fn fits(
    whole: &RigModel,
    fitted: &RigModel,
    parameters: &[f64],
    identifiable: bool,
) -> Vec<ChannelFit> {
    let mut fits = Vec::new();
    for (index, data) in whole.experiments.iter().enumerate() {
        let first = fitted.experiments[index].command.len();
        if data.command.len() < first + 100 {
            continue;
        }
        let rig = rig_from(parameters, parameters[whole.nuisance(index)], data.specimen);
        let channels = Channels::new(data, first, parameters[DELAY]);
        let predictions = whole.one_step_predictions(index, parameters);
        for i in (0..OUTPUTS).filter(|&i| data.measured[i]) {
            let simulated = match i {
                0 | 1 => table(&rig, &channels).map(|both| both[i].clone()),
                2 if identifiable => actuator(&rig, &channels),
                2 => None,
                _ => specimen(&rig, &channels),
            };
            let measured = channels.outputs[i].clone();
            let predicted = predictions
                .as_ref()
                .map_or(f64::NAN, |p| fit_percent(&measured, &p[i][first..]));
            fits.push(ChannelFit {
                recording: data.name.clone(),
                channel: OUTPUT_NAMES[i],
                simulated: simulated.as_ref().map_or(f64::NAN, |m| fit_percent(&measured, m)),
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
    command: Vec<f64>,
    outputs: Vec<Vec<f64>>,
}

impl Channels {
    fn new(data: &Experiment, first: usize, delay: f64) -> Self {
        let late = delay / data.period;
        let command = (first..data.command.len())
            .map(|k| {
                let back = |n: usize| data.command[k.saturating_sub(n)];
                let whole = late.floor() as usize;
                let part = late - late.floor();
                (1.0 - part) * back(whole) + part * back(whole + 1)
            })
            .collect();
        Self {
            period: data.period,
            command,
            outputs: (0..OUTPUTS)
                .map(|i| {
                    let rest = data.outputs[first..].iter();
                    rest.map(|y| y[i] * data.scale[i]).collect()
                })
                .collect(),
        }
    }
}

/// Simulates `system` (one output) from `inputs`, the first `held` of them held and the others
/// straight between samples; initial state and offset by least squares on `measured`.
fn simulate(
    system: &StateSpace,
    inputs: &[&[f64]],
    held: usize,
    measured: &[f64],
    period: f64,
) -> Option<Vec<f64>> {
    let (n, m) = (system.order(), inputs.len());
    // Straight inputs: two more states each, the input and its slope.
    let straight = m - held;
    let mut a = DMatrix::zeros(n + m + straight, n + m + straight);
    a.view_mut((0, 0), (n, n)).copy_from(&system.a);
    a.view_mut((0, n), (n, m)).copy_from(&system.b);
    for j in 0..straight {
        a[(n + held + j, n + m + j)] = 1.0 / period;
    }
    let transition = (a * period).exp();
    let mut state = DVector::zeros(n);
    let mut free = DMatrix::<f64>::identity(n, n);
    let a = transition.view((0, 0), (n, n)).into_owned();
    let mut forced = Vec::with_capacity(measured.len());
    let mut basis = DMatrix::zeros(measured.len(), n + 1);
    for k in 0..measured.len() {
        let mut value = system.c.row(0).tr_dot(&state);
        for j in 0..m {
            value += system.d[(0, j)] * inputs[j][k];
        }
        forced.push(value);
        let response = system.c.row(0) * &free;
        basis.view_mut((k, 0), (1, n)).copy_from(&response);
        basis[(k, n)] = 1.0;
        let mut next = &a * &state;
        for j in 0..m {
            next += transition.view((0, n + j), (n, 1)) * inputs[j][k];
            if j >= held {
                let slope = inputs[j][(k + 1).min(measured.len() - 1)] - inputs[j][k];
                next += transition.view((0, n + m + j - held), (n, 1)) * slope;
            }
        }
        state = next;
        free = &a * free;
    }
    let lengths: Vec<f64> = (0..=n).map(|j| basis.column(j).norm().max(1e-300)).collect();
    let mut scaled = basis.clone();
    for (j, length) in lengths.iter().enumerate() {
        scaled.column_mut(j).scale_mut(1.0 / length);
    }
    let target = DVector::from_fn(measured.len(), |k, _| measured[k] - forced[k]);
    let normal = scaled.tr_mul(&scaled);
    let coordinates = normal
        .svd(true, true)
        .solve(&scaled.tr_mul(&target), 1e-12)
        .ok()?;
    let correction = scaled * coordinates;
    let model: Vec<f64> = forced.iter().zip(correction.iter()).map(|(f, c)| f + c).collect();
    model.iter().all(|value| value.is_finite()).then_some(model)
}

/// Force from command and displacement (Fig 2-7): velocity is the derivative of the displacement,
/// so `e(s) s / D(s)` is proper and takes the displacement itself.
fn actuator(rig: &Rig, channels: &Channels) -> Option<Vec<f64>> {
    let actuator = rig.shake_table.actuator;
    let [a2, a1, a0] = actuator.denominator;
    let [e2, e1, e0] = actuator.velocity_to_force;
    let mut system = actuator.state_space();
    // (e2 s^3 + e1 s^2 + e0 s) / D = e2 + (...)/D.
    system.d[(0, 1)] = e2;
    for (i, value) in [e1 - e2 * a2, e0 - e2 * a1, -e2 * a0].into_iter().enumerate() {
        system.b[(i, 1)] = value;
    }
    let inputs = [channels.command.as_slice(), channels.outputs[0].as_slice()];
    simulate(&system, &inputs, 1, &channels.outputs[2], channels.period)
}

/// Displacement and acceleration from force and specimen acceleration (Fig 2-10).
fn table(rig: &Rig, channels: &Channels) -> Option<[Vec<f64>; 2]> {
    let table = rig.shake_table.table;
    let specimen = rig.specimen.map_or(0.0, |specimen| specimen.mass);
    let force: Vec<f64> = channels.outputs[2]
        .iter()
        .zip(&channels.outputs[3])
        .map(|(force, carried)| force - specimen * carried)
        .collect();
    let dynamics = nalgebra::dmatrix![
        0.0, 1.0;
        -table.stiffness / table.mass, -table.damping / table.mass
    ];
    let mut system = StateSpace {
        c: nalgebra::dmatrix![1.0, 0.0],
        d: DMatrix::zeros(1, 1),
        b: nalgebra::dmatrix![0.0; 1.0 / table.mass],
        a: dynamics,
    };
    let x = simulate(&system, &[&force], 0, &channels.outputs[0], channels.period)?;
    system.c = system.a.rows(1, 1).into_owned();
    system.d[(0, 0)] = 1.0 / table.mass;
    let a = simulate(&system, &[&force], 0, &channels.outputs[1], channels.period)?;
    Some([x, a])
}

/// The specimen's acceleration from the table's.
fn specimen(rig: &Rig, channels: &Channels) -> Option<Vec<f64>> {
    let specimen = rig.specimen?;
    let (c, k) = (specimen.damping / specimen.mass, specimen.stiffness / specimen.mass);
    let system = StateSpace {
        a: nalgebra::dmatrix![0.0, 1.0; -k, -c],
        b: nalgebra::dmatrix![0.0; -1.0],
        c: nalgebra::dmatrix![-k, -c],
        d: DMatrix::zeros(1, 1),
    };
    simulate(&system, &[&channels.outputs[1]], 0, &channels.outputs[3], channels.period)
}
