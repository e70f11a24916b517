//! The figures of a run as text.

use super::axes::{self, Axis};
use super::summary::{Summary, asked};
use fmi_master::Record;
use motion::metrics::Tracking;
use motion::metrics::laboratory::{LEAST_COHERENCE, Laboratory};
use motion::{Motion, peak};
use pages::report::columns::aligned;
use pages::report::number::significant;
use pages::report::{Cell, UnitSystem, Units};

/// Length of the coupling steps: of each, or of the shortest and the longest.
pub(super) fn steps_in_words(summary: &Summary) -> String {
    let milliseconds = |seconds: f64| {
        let text = significant(1e3 * seconds, 3);
        match text.contains('.') && !text.contains('e') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
            false => text,
        }
    };
    match &summary.variable_step {
        Some(taken) if taken.shortest_s < taken.longest_s => format!(
            "{} to {} ms",
            milliseconds(taken.shortest_s),
            milliseconds(taken.longest_s)
        ),
        _ => format!("{} ms", milliseconds(summary.step_s)),
    }
}

/// The figures of a run as tables for people.
pub fn text(summary: &Summary, record: &Record, motion: &Motion, system: UnitSystem) -> String {
    let mut text = match motion.is_empty() {
        true => format!("{}\n", summary.system),
        false => format!("{} on {}\n", summary.system, summary.motion.name),
    };
    for note in &motion.notes {
        text += &format!("  {note}\n");
    }
    if let Some(across) = &motion.across {
        text += &format!("along y: {}\n", across.name);
        for note in &across.notes {
            text += &format!("  {note}\n");
        }
    }
    for (name, seed) in &summary.seeds {
        text += &format!("  seed of the noise of `{name}`: {seed}\n");
    }
    text += &format!(
        "\n{} steps of {} (FMI {}, {}), {} times real time, {}\n\n",
        summary.steps,
        steps_in_words(summary),
        summary.fmi,
        summary.algorithm,
        significant(summary.real_time_factor, 2),
        summary.ended.word(),
    );
    if let Some(taken) = &summary.variable_step {
        text += &format!(
            "steps chosen for an error of {} % each: {} were repeated; the largest accepted error \
             is estimated at {} %{}\n\n",
            taken.tolerance_percent,
            taken.repeated,
            significant(taken.worst_percent, 2),
            match &taken.worst_signal {
                Some(signal) => format!(" (`{signal}`)"),
                None => String::new(),
            },
        );
    }
    if let Some(error) = &summary.coupling_error {
        text += &format!(
            "error of the coupling, estimated: at most {:.3} % of the peak of a signal (`{}`)\n\n",
            error.percent, error.signal
        );
    }
    if let Some(kept) = &summary.real_time {
        text += &format!(
            "real time: {} of {} steps missed their deadline, by {:.2} ms at most; steps began \
             {:.0} us late (median), 99 of 100 less than {:.0} us\n\n",
            kept.missed,
            kept.deadlines,
            1e3 * kept.worst_s,
            1e6 * kept.jitter_median_s,
            1e6 * kept.jitter_p99_s,
        );
    }
    if let Some(both) = axes::motions(motion).filter(|_| !summary.axes.is_empty()) {
        for (axis, motion) in summary.axes.iter().zip(both) {
            text += &along(axis, motion, record.len(), system);
        }
        return text;
    }
    let Some(tracking) = &summary.tracking else {
        return text;
    };
    let asked = asked(record, motion);
    let (motion, heading) = match &asked {
        Some(asked) => (asked, "structure"),
        None => (motion, "reference"),
    };
    text + &followed(tracking, motion, heading, record.len(), system)
}

/// How an axis followed its motion, or moved while it was to rest.
fn along(axis: &Axis, motion: &Motion, played: usize, system: UnitSystem) -> String {
    let mut text = format!("along {}: {}\n\n", axis.axis, axis.motion.name);
    if let Some(tracking) = &axis.tracking {
        text += &followed(tracking, motion, "reference", played, system);
        text += "\n";
    }
    if let Some(cross) = &axis.at_rest {
        let pair = |name: &str, percent: f64, peak, units| {
            let cells = [
                format!("{percent:.4} %"),
                Cell::Quantity(peak, units, 4).text(system),
            ];
            let mut row = vec![name.to_string()];
            row.extend(cells);
            row
        };
        text += &aligned(&[
            ["to rest", "RMS over the other axis' peak", "peak"]
                .map(String::from)
                .to_vec(),
            pair(
                "displacement",
                cross.displacement_percent,
                cross.peak_displacement_m,
                Units::DISPLACEMENT,
            ),
            pair(
                "acceleration",
                cross.acceleration_percent,
                cross.peak_acceleration_m_s2,
                Units::ACCELERATION,
            ),
        ]);
        text += "\n";
    }
    text
}

/// Peaks and errors of a table that followed `motion`, of which so many samples were played.
fn followed(
    tracking: &Tracking,
    motion: &Motion,
    heading: &str,
    samples: usize,
    system: UnitSystem,
) -> String {
    let mut text = String::new();
    let played = samples.min(motion.len());
    let row = |name: &str, cells: [String; 3]| {
        let mut row = vec![name.to_string()];
        row.extend(cells);
        row
    };
    let length = |value| Cell::Quantity(value, Units::DISPLACEMENT, 4).text(system);
    let acceleration = |value| Cell::Quantity(value, Units::ACCELERATION, 4).text(system);
    let percent = |value: f64| format!("{value:.4} %");
    text += &aligned(&[
        row("", [heading.into(), "table".into(), "largest error".into()]),
        row(
            "displacement, peak",
            [
                length(peak(&motion.displacement[..played])),
                length(tracking.peak_displacement),
                length(tracking.peak_displacement_error),
            ],
        ),
        row(
            "acceleration, peak",
            [
                acceleration(peak(&motion.acceleration[..played])),
                acceleration(tracking.peak_acceleration),
                acceleration(tracking.peak_acceleration_error),
            ],
        ),
    ]);
    text += "\n";
    let pair = |name: &str, value: String| vec![name.to_string(), value];
    text += &aligned(&[
        pair(
            "normalised RMS acceleration error",
            percent(tracking.time_domain_percent),
        ),
        pair(
            "Fourier amplitude error, acceleration",
            percent(tracking.frequency_domain_percent),
        ),
        pair(
            "normalised RMS displacement error",
            percent(tracking.displacement_percent),
        ),
        pair("delay of the table", milliseconds(tracking.delay, 1)),
    ]);
    if let Some(own) = &tracking.laboratory {
        text += "\n";
        text += &aligned(&bands(own));
        text += "\n";
        text += &aligned(&[
            pair(
                "error over the significant duration, acceleration",
                format!(
                    "{} of {:.2} s",
                    percent(own.significant_duration_percent),
                    own.significant_duration_s
                ),
            ),
            pair("peak ratio", format!("{:.4}", own.peak_ratio)),
            pair("Arias ratio", format!("{:.4}", own.arias_ratio)),
        ]);
    }
    text
}

/// A delay in seconds as milliseconds; a rounded zero has no sign.
fn milliseconds(delay: f64, decimals: usize) -> String {
    let unit = 10_f64.powi(decimals as i32);
    // Adding zero makes -0 a 0.
    let rounded = (1e3 * delay * unit).round() / unit + 0.0;
    format!("{rounded:.decimals$} ms")
}

/// Response spectra and transfer function, a row for each band.
fn bands(own: &Laboratory) -> Vec<Vec<String>> {
    let head = [
        "band",
        "response spectrum, largest",
        "at",
        "mean",
        "gain",
        "delay",
        "coherence",
    ];
    let mut rows = vec![head.map(str::to_string).to_vec()];
    for (n, spectrum) in own.spectrum_deviations().enumerate() {
        let [from, to] = spectrum.band_hz;
        let mut row = vec![
            format!("{from} to {to} Hz"),
            format!("{:.2} %", spectrum.largest),
            format!("{:.3} Hz", spectrum.largest_at_hz),
            format!("{:.2} %", spectrum.mean),
        ];
        row.extend(
            match own.coherence.as_ref().and_then(|bands| bands.get(n)) {
                Some(band) => [
                    format!("{:.4}", band.gain),
                    match band.coherence >= LEAST_COHERENCE {
                        true => milliseconds(band.delay_s, 2),
                        false => "-".to_string(),
                    },
                    format!("{:.4}", band.coherence),
                ],
                None => ["-", "-", "-"].map(str::to_string),
            },
        );
        rows.push(row);
    }
    rows
}
