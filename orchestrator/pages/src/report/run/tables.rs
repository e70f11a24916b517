//! The tables of a run.

use super::Run;
use crate::report::{Cell, Table, Units};
use motion::metrics::Tracking;
use motion::metrics::laboratory::{LEAST_COHERENCE, Laboratory};
use motion::peak;

/// Peaks and errors, over what was played.
pub(super) fn tracking(run: &Run, tracking: &Tracking) -> Table {
    let played = run.acceleration.len().min(run.motion.len());
    let length = |value| Cell::Quantity(value, Units::DISPLACEMENT, 4);
    let acceleration = |value| Cell::Quantity(value, Units::ACCELERATION, 4);
    let percent = |value| Cell::Quantity(value, Units::PERCENT, 3);
    let none = || Cell::Text(String::new());
    Table::of(
        "Errors in percent are relative to the peak of the reference.",
        ["", "reference", "table", "largest error", "RMS error"],
        [
            [
                "displacement, peak".into(),
                length(peak(&run.motion.displacement[..played])),
                length(tracking.peak_displacement),
                length(tracking.peak_displacement_error),
                percent(tracking.displacement_percent),
            ],
            [
                "acceleration, peak".into(),
                acceleration(peak(&run.motion.acceleration[..played])),
                acceleration(tracking.peak_acceleration),
                acceleration(tracking.peak_acceleration_error),
                percent(tracking.time_domain_percent),
            ],
            [
                "acceleration, Fourier amplitudes to 25 Hz".into(),
                none(),
                none(),
                none(),
                percent(tracking.frequency_domain_percent),
            ],
            [
                "acceleration, correlation".into(),
                none(),
                Cell::Number(tracking.correlation, 5),
                none(),
                none(),
            ],
        ],
    )
}

/// Response spectra and transfer function, a row for each band.
pub(super) fn bands(own: &Laboratory) -> Table {
    let percent = |value| Cell::Quantity(value, Units::PERCENT, 3);
    let rows = own.spectrum_deviations().enumerate();
    Table::of(
        "Response spectrum at 5 % damping, at least 24 oscillators an octave: how far the table's is from \
         the reference's, and the natural frequency of the largest error. \
         Transfer function from the reference's to the table's acceleration, each frequency \
         weighted by the reference's power. The phase delay is the phase lag over the frequency; it is \
         left out if the coherence is below 0.9, since a resonance or noise then sets the phase.",
        [
            "band, Hz",
            "spectrum, largest",
            "at, Hz",
            "spectrum, mean",
            "gain",
            "phase delay, ms",
            "coherence",
        ],
        rows.map(|(n, spectrum)| {
            let [from, to] = spectrum.band_hz;
            let band = own.coherence.as_ref().and_then(|bands| bands.get(n));
            let number = |value: Option<f64>, digits| {
                value.map_or("-".into(), |value| Cell::Number(value, digits))
            };
            [
                format!("{from} to {to}").into(),
                percent(spectrum.largest),
                Cell::Number(spectrum.largest_at_hz, 3),
                percent(spectrum.mean),
                number(band.map(|band| band.gain), 4),
                number(
                    band.filter(|band| band.coherence >= LEAST_COHERENCE)
                        .map(|band| 1e3 * band.delay_s),
                    3,
                ),
                number(band.map(|band| band.coherence), 4),
            ]
        }),
    )
}

/// The strong part of the motion and its energy.
pub(super) fn strong_part(own: &Laboratory) -> Table {
    Table::of(
        "Significant duration: from 5 to 95 % of the reference's Arias intensity.",
        ["", "value"],
        [
            [
                "significant duration".into(),
                Cell::Quantity(own.significant_duration_s, Units::TIME, 3),
            ],
            [
                "normalised RMS acceleration error over it".into(),
                Cell::Quantity(own.significant_duration_percent, Units::PERCENT, 3),
            ],
            ["peak ratio".into(), Cell::Number(own.peak_ratio, 4)],
            ["Arias ratio".into(), Cell::Number(own.arias_ratio, 4)],
        ],
    )
}

/// Settings, parameters that differ from their defaults, and components.
pub(super) fn what_was_run(run: &Run) -> Vec<Table> {
    let motion = run.motion;
    let played = run.acceleration.len().saturating_sub(1) as f64 * motion.dt;
    let mut rows = vec![
        [Cell::from("ended"), run.ended.into()],
        [
            "duration of the motion".into(),
            Cell::Quantity(run.duration, Units::TIME, 5),
        ],
        [
            "duration of the run".into(),
            Cell::Quantity(played, Units::TIME, 5),
        ],
        [
            "sample time".into(),
            Cell::Quantity(1e3 * motion.dt, Units::same("ms"), 3),
        ],
    ];
    if let Some(seed) = motion.seed {
        rows.push(["seed of the motion".into(), seed.to_string().into()]);
    }
    let settings = run.settings.iter();
    rows.extend(settings.map(|(name, value)| [name.as_str().into(), value.clone()]));
    let mut tables = vec![Table::of("", ["", ""], rows)];
    if !run.changed.is_empty() {
        let rows = run.changed.iter();
        tables.push(Table::of(
            "Values that differ from their component's default",
            ["parameter", "value", "default"],
            rows.map(|one| {
                [
                    one.name.as_str().into(),
                    one.value.clone(),
                    one.default.clone(),
                ]
            }),
        ));
    }
    if !run.components.is_empty() {
        tables.push(components(run));
    }
    tables
}

fn components(run: &Run) -> Table {
    let sum: f64 = run.components.iter().filter_map(|one| one.time).sum();
    let rows = run.components.iter().map(|one| {
        let [time, share] = match one.time {
            Some(time) => [
                Cell::Quantity(1e3 * time, Units::same("ms"), 3),
                Cell::Quantity(100.0 * time / sum.max(1e-300), Units::PERCENT, 2),
            ],
            None => [Cell::from(""), Cell::from("")],
        };
        [
            one.name.as_str().into(),
            one.model.as_str().into(),
            time,
            share,
        ]
    });
    Table::of(
        "Components, and the time that their steps took",
        ["component", "FMU", "time in its steps", "share"],
        rows,
    )
}
