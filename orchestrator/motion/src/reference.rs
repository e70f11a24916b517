//! References: displacement, velocity and acceleration played as given.

use std::path::Path;

use recordings::{Channel, DataError, read_text};

use super::accelerogram::{file_name, stem};
use super::csv_file::{CsvFile, Kind, rounded};
use super::error::MotionError;
use super::options::{Options, Scaling};
use super::playable::{Motion, peak};
use super::process::{check_options, check_stroke};
use units::{INCH, STANDARD_GRAVITY};

/// Reads a reference. Its numbers are played as they stand, unless `options.scaling` asks for
/// another size. Its time step must be `options.sample_time`, or divide it evenly (then every
/// n-th sample is played).
///
/// # Errors
/// A file that cannot be read (with file, line and column), a time step that does not fit, or a
/// motion beyond the stroke.
pub fn load_reference(path: &Path, options: &Options) -> Result<Motion, MotionError> {
    let name = stem(path);
    check_options(&name, options)?;
    let file = CsvFile::parse(path, read_text(path)?, Kind::Reference)?;
    let dt = file.sample_time()?;
    let mut columns = [
        file.column(Channel::Displacement)?,
        file.column(Channel::Velocity)?,
        file.column(Channel::Acceleration)?,
    ];
    let mut notes = vec![format!(
        "reference {}: {} points at {} s, played as given",
        file_name(path),
        columns[0].len(),
        rounded(dt)
    )];

    let every = (options.sample_time / dt).round();
    if every < 1.0 || (every * dt - options.sample_time).abs() > 1e-3 * options.sample_time {
        let reason = format!(
            "sampled at {} s; the controllers need {} s (or a whole fraction of it)",
            rounded(dt),
            options.sample_time
        );
        return Err(DataError::file(path, reason).into());
    }
    if every > 1.0 {
        for column in &mut columns {
            *column = column.iter().copied().step_by(every as usize).collect();
        }
        notes.push(format!(
            "every {every}th sample is played, {} s apart",
            options.sample_time
        ));
    }
    scale(&name, &mut columns, options.scaling, &mut notes)?;
    let [displacement, velocity, acceleration] = columns;
    for (of, rate, words) in [
        (
            &displacement,
            &velocity,
            "velocity from the slope of displacement",
        ),
        (
            &velocity,
            &acceleration,
            "acceleration from the slope of velocity",
        ),
    ] {
        let off = slope_mismatch(of, rate, options.sample_time);
        if off > 0.1 {
            notes.push(format!("note: {words} differs by {:.0} % rms", 100.0 * off));
        }
    }
    let motion = Motion {
        name,
        dt: options.sample_time,
        displacement,
        velocity,
        acceleration,
        notes,
        seed: None,
        across: None,
    };
    let factor = match options.scaling {
        Some(Scaling::Factor(factor)) => factor,
        _ => 1.0,
    };
    check_stroke(&motion, options.stroke, factor)?;
    Ok(motion)
}

fn scale(
    name: &str,
    columns: &mut [Vec<f64>; 3],
    scaling: Option<Scaling>,
    notes: &mut Vec<String>,
) -> Result<(), MotionError> {
    let Some(scaling) = scaling else {
        return Ok(());
    };
    let factor = scaling.factor(name, peak(&columns[2]), peak(&columns[0]))?;
    columns
        .iter_mut()
        .flatten()
        .for_each(|value| *value *= factor);
    notes.push(format!(
        "scaled by {factor:.4}: peak {:.3} g and {:.3} in ({:.2} mm)",
        peak(&columns[2]) / STANDARD_GRAVITY,
        peak(&columns[0]) / INCH,
        1e3 * peak(&columns[0])
    ));
    Ok(())
}

/// rms of (central difference of `of` minus `rate`) over rms of `rate`; 0 when `rate` is at rest.
fn slope_mismatch(of: &[f64], rate: &[f64], dt: f64) -> f64 {
    let (mut off, mut all) = (0.0, 0.0);
    for (around, rate) in of.windows(3).zip(rate.iter().skip(1)) {
        off += ((around[2] - around[0]) / (2.0 * dt) - rate).powi(2);
        all += rate * rate;
    }
    if all > 0.0 { (off / all).sqrt() } else { 0.0 }
}
