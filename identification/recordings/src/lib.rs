//! Measured data: one type, [`Recording`], and one reader of the files that laboratories keep.

mod channel;
pub mod clipping;
mod error;
mod even_base;
mod faults;
mod identification_error;
mod mat;
mod number;
mod reader;
mod recording;
mod rounded_stamps;
mod sheet;
mod text;

pub use channel::{Channel, OUTPUT_NAMES};
pub use error::DataError;
pub use faults::Finding;
pub use identification_error::IdentificationError;
pub use reader::{Called, Named, Pick, columns_called, known_column, named_columns};
pub use recording::{Recording, TimeBase};
pub use rounded_stamps::RoundedStamps;
pub use sheet::{Sheet, Wanted, is_called, name_and_unit};
pub use text::{Text, decode, read_bytes, read_text, read_written, why};

/// Mean, and root mean square about it.
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count;
    (mean, square.sqrt())
}

/// `100 (1 - ||y - m|| / ||y - mean(y)||)`, per cent.
pub fn fit_percent(measured: &[f64], model: &[f64]) -> f64 {
    let (mean, _) = mean_and_deviation(measured);
    let error: f64 = measured
        .iter()
        .zip(model)
        .map(|(y, m)| (y - m) * (y - m))
        .sum();
    let size: f64 = measured.iter().map(|y| (y - mean) * (y - mean)).sum();
    100.0 * (1.0 - (error / size).sqrt())
}

fn is_constant(values: &[f64]) -> bool {
    let (mean, deviation) = mean_and_deviation(values);
    deviation <= 1e-12 * mean.abs() || deviation == 0.0
}
