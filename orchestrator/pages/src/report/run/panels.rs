//! The plots of a run.

use plant::linear::log_space;
use sysid::frequency_response;

use super::{Run, SpecimenHistory};
use crate::report::{Abscissa, Axis, Panel, Series, Style, Units};
use motion::metrics::{HIGHEST_FREQUENCY, USUAL_DAMPING, fourier_amplitudes, pseudo_acceleration};

/// Colours of the reference, the table, an error and whatever stopped the run.
pub(super) const REFERENCE: usize = 0;
pub(super) const TABLE: usize = 1;
const ERROR: usize = 2;
const TRIP: usize = 6;
/// Frequencies of the response spectra, Hz.
const OSCILLATORS: (f64, f64, usize) = (0.1, 30.0, 90);
/// Segments (before overlap) into which a run is cut for averaging, and their most samples.
const SEGMENTS: usize = 6;
const LONGEST_SEGMENT: usize = 4096;

fn over_time(run: &Run, title: &str, label: &str, units: Units, mut series: Vec<Series>) -> Panel {
    series.extend(trip(run, &series));
    Panel {
        title: title.to_string(),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear(label, units),
        series,
    }
}

/// A stroke where the run was stopped, as high as what is drawn.
fn trip(run: &Run, drawn: &[Series]) -> Option<Series> {
    let (time, cause) = run.trip.as_ref()?;
    let values = drawn.iter().flat_map(|series| &series.values);
    let values = values.copied().filter(|value| value.is_finite());
    let (low, high) = values.fold((0.0_f64, 0.0_f64), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    let name = format!("stopped at {time:.3} s: {cause}");
    Some(Series::stroke(&name, [*time, low], [*time, high]).coloured(TRIP))
}

/// Displacement, velocity and acceleration with their references, and errors.
pub(super) fn histories(run: &Run) -> Vec<Panel> {
    let (motion, dt) = (run.motion, run.motion.dt);
    // A run that ended early shows what it did not come to, one that was asked to be shorter not.
    let asked = match run.ended {
        "complete" => run.acceleration.len().min(motion.len()),
        _ => motion.len(),
    };
    let both = |wanted: &[f64], found: &[f64]| {
        vec![
            Series::history("reference", dt, &wanted[..asked]).coloured(REFERENCE),
            Series::history("table", dt, found).coloured(TABLE),
        ]
    };
    let error = |wanted: &[f64], found: &[f64]| {
        let difference: Vec<f64> = wanted.iter().zip(found).map(|(r, y)| r - y).collect();
        vec![Series::history("error", dt, &difference).coloured(ERROR)]
    };
    vec![
        over_time(
            run,
            "Acceleration",
            "acceleration",
            Units::ACCELERATION,
            both(&motion.acceleration, run.acceleration),
        ),
        over_time(
            run,
            "Acceleration error (reference minus table)",
            "error",
            Units::ACCELERATION,
            error(&motion.acceleration, run.acceleration),
        ),
        over_time(
            run,
            "Displacement",
            "displacement",
            Units::DISPLACEMENT,
            both(&motion.displacement, run.displacement),
        ),
        over_time(
            run,
            "Displacement error (reference minus table)",
            "error",
            Units::DISPLACEMENT,
            error(&motion.displacement, run.displacement),
        ),
        over_time(
            run,
            "Velocity",
            "velocity",
            Units::VELOCITY,
            both(&motion.velocity, run.velocity),
        ),
    ]
}

/// Fourier amplitudes, response spectra, transfer function and coherence.
pub(super) fn frequency(run: &Run) -> Vec<Panel> {
    let dt = run.motion.dt;
    let played = run.acceleration.len().min(run.motion.len());
    let both = [
        ("reference", &run.motion.acceleration[..played], REFERENCE),
        ("table", &run.acceleration[..played], TABLE),
    ];
    let amplitudes = both.iter().map(|(name, history, colour)| {
        let (frequencies, values) = fourier_amplitudes(history, dt, HIGHEST_FREQUENCY);
        Series::line(name, Abscissa::At(frequencies.into()), values).coloured(*colour)
    });
    let axis = || Axis::logarithmic("frequency", Units::FREQUENCY);
    let mut panels = vec![Panel {
        title: "Fourier amplitude of acceleration, |2A/N|".to_string(),
        x: axis().between(0.1, HIGHEST_FREQUENCY),
        y: Axis::linear("amplitude", Units::ACCELERATION),
        series: amplitudes.collect(),
    }];
    let (low, high, count) = OSCILLATORS;
    let oscillators = log_space(low, high, count);
    let spectra = both.iter().map(|(name, history, colour)| {
        let values = pseudo_acceleration(history, dt, &oscillators, USUAL_DAMPING);
        let places = Abscissa::At(oscillators.clone().into());
        Series::line(name, places, values).coloured(*colour)
    });
    panels.push(Panel {
        title: "Response spectrum, 5 % damping (pseudo-acceleration)".to_string(),
        x: axis(),
        y: Axis::linear("pseudo-acceleration", Units::ACCELERATION),
        series: spectra.collect(),
    });
    panels.extend(transfer_function(run, played));
    panels
}

/// From the reference's to the table's acceleration; nothing where too little was played.
fn transfer_function(run: &Run, played: usize) -> Vec<Panel> {
    let segment = (played / SEGMENTS).min(LONGEST_SEGMENT) & !1;
    let (input, output) = (
        &run.motion.acceleration[..played],
        &run.acceleration[..played],
    );
    let Ok(found) = frequency_response::direct(input, output, run.motion.dt, segment) else {
        return Vec::new();
    };
    let lines = found.frequency.iter();
    let lines = lines.take_while(|frequency| **frequency <= HIGHEST_FREQUENCY);
    let shown = lines.count();
    let places = || Abscissa::At(found.frequency[..shown].into());
    let series = |values: Vec<f64>| vec![Series::line("table over reference", places(), values)];
    let of = |value: fn(&nalgebra::Complex<f64>) -> f64| {
        series(found.response[..shown].iter().map(value).collect())
    };
    let panel = |title: &str, y: Axis, series| Panel {
        title: title.to_string(),
        x: Axis::logarithmic("frequency", Units::FREQUENCY),
        y,
        series,
    };
    vec![
        panel(
            "Transfer function, gain (1 is perfect)",
            Axis::linear("gain", Units::NONE).between(0.0, 2.0),
            of(|response| response.norm()),
        ),
        panel(
            "Transfer function, phase (0 is perfect)",
            Axis::linear("phase", Units::DEGREE).between(-180.0, 180.0),
            of(|response| response.arg().to_degrees()),
        ),
        panel(
            "Coherence of reference and table",
            Axis::linear("coherence", Units::NONE).between(0.0, 1.05),
            series(found.coherence[..shown].to_vec()),
        ),
    ]
}

/// Drift, hysteresis and energy.
pub(super) fn specimen(run: &Run, specimen: &SpecimenHistory) -> Vec<Panel> {
    let dt = run.motion.dt;
    let SpecimenHistory { drift, force } = specimen;
    let history = |name: &str, values: &[f64]| vec![Series::history(name, dt, values)];
    let mut taken = 0.0;
    let pairs = drift.windows(2).zip(force.windows(2));
    let energy: Vec<f64> = std::iter::once(0.0)
        .chain(pairs.map(|(x, f)| {
            taken += 0.5 * (f[0] + f[1]) * (x[1] - x[0]);
            taken
        }))
        .collect();
    vec![
        over_time(
            run,
            "Drift of the specimen",
            "drift",
            Units::DISPLACEMENT,
            history("drift", drift),
        ),
        Panel {
            title: "Hysteresis: force of the specimen over its drift".to_string(),
            x: Axis::linear("drift", Units::DISPLACEMENT),
            y: Axis::linear("force", Units::FORCE),
            series: vec![
                Series::line(
                    "specimen",
                    Abscissa::At(drift.as_slice().into()),
                    force.clone(),
                )
                .styled(Style::Path),
            ],
        },
        over_time(
            run,
            "Energy taken by the specimen (stored and dissipated)",
            "energy",
            Units::ENERGY,
            history("energy", &energy),
        ),
    ]
}

/// Commands with their limits.
pub(super) fn valve(run: &Run) -> Panel {
    let dt = run.motion.dt;
    let mut series: Vec<Series> = run
        .commands
        .iter()
        .enumerate()
        .map(|(n, (name, values))| Series::history(name, dt, values).coloured(3 - n.min(2)))
        .collect();
    if let Some(limit) = run.valve_limit {
        let span = [0.0, run.acceleration.len() as f64 * dt];
        series.push(Series::level("limit", limit, span));
        series.push(Series::level("lower limit", -limit, span));
    }
    over_time(run, "Valve command", "command", Units::VOLTAGE, series)
}
