//! Frequency responses as panels.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::Complex;
use plant::linear::{FrequencyResponse, log_space};
use units::constants::SAMPLING_PERIOD;

use pages::report::{Abscissa, Axis, Panel, Series, Units};

const POINTS: usize = 600;
/// Drawn from 0.01 Hz to the Nyquist frequency.
const FIRST_HZ: f64 = 0.01;

pub(super) fn response(value: impl Fn(f64) -> Complex<f64>) -> FrequencyResponse {
    let last = 0.499 / SAMPLING_PERIOD;
    FrequencyResponse::continuous(&log_space(TAU * FIRST_HZ, TAU * last, POINTS), |s| {
        value(s.im)
    })
}

pub(super) fn line(name: &str, response: &FrequencyResponse, values: Vec<f64>) -> Series {
    let places: Arc<[f64]> = response.omega.iter().map(|omega| omega / TAU).collect();
    Series::line(name, Abscissa::At(places), values)
}

pub(super) fn gain_panel(title: &str, series: Vec<Series>) -> Panel {
    panel(title, Axis::linear("gain", Units::DECIBEL), series)
}

pub(super) fn phase_panel(title: &str, series: Vec<Series>) -> Panel {
    panel(title, Axis::linear("phase", Units::DEGREE), series)
}

fn panel(title: &str, y: Axis, series: Vec<Series>) -> Panel {
    Panel {
        title: title.into(),
        x: Axis::logarithmic("frequency", Units::FREQUENCY),
        y,
        series,
    }
}
