//! The pictures of one loop: Bode with its margins, Nyquist, sensitivity.

use std::f64::consts::TAU;

use controllers::loops::Time;
use plant::linear::FrequencyResponse;

use super::figures::{Figures, LoopFigures};
use super::loops::NamedLoop;
use super::panels::{gain_panel, line, phase_panel, response};
use pages::report::{Abscissa, Axis, Panel, Section, Series, Style, Units};

/// Colours of the loop in continuous time, as sampled, and of its margins.
const CONTINUOUS: usize = 1;
const SAMPLED: usize = 2;
const MARGIN: usize = 6;
/// What the Nyquist plot shows of the plane.
const NYQUIST: [[f64; 2]; 2] = [[-3.0, 1.5], [-2.0, 2.0]];

/// Phases in degrees without jumps, in the turn that holds -180 degrees: between -360 and 0 at
/// `omega` (rad/s), the crossover where there is one.
pub(super) fn phase(response: &FrequencyResponse, omega: Option<f64>) -> Vec<f64> {
    let mut phase = response.phase_deg();
    let middle = response.omega.get(response.omega.len() / 2).copied();
    let at = omega.or(middle).unwrap_or(1.0);
    let place = response.omega.partition_point(|own| *own < at);
    if let Some(here) = phase.get(place.min(phase.len().saturating_sub(1))) {
        let turns = (here / 360.0).ceil() * 360.0;
        phase.iter_mut().for_each(|value| *value -= turns);
    }
    phase
}

/// Phases of what begins at a phase of zero, as a closed loop does.
pub(super) fn closed_phase(response: &FrequencyResponse) -> Vec<f64> {
    let mut phase = response.phase_deg();
    let turns = phase.first().map_or(0.0, |first| (first / 360.0).round());
    phase.iter_mut().for_each(|value| *value -= 360.0 * turns);
    phase
}

/// Everything of one loop.
pub(super) fn section(one: &NamedLoop, figures: &LoopFigures) -> Section {
    let open = [Time::Continuous, Time::Sampled]
        .map(|time| response(|omega| one.rig_loop.open(time, omega)));
    let closed = [Time::Continuous, Time::Sampled]
        .map(|time| response(|omega| one.rig_loop.closed(time, omega)));
    let figure = one.name.figure();
    let figure = figure.map_or(String::new(), |figure| format!(" ({figure})"));
    Section {
        heading: one.name.to_string(),
        text: vec![
            format!("{}{figure}.", one.name.about()),
            words(&figures.sampled),
        ],
        panels: vec![
            gain(&open, &figures.sampled),
            phases(&open, figures),
            nyquist(&open),
            gain_panel("Closed loop, gain", pair(&closed, |r, _| r.gain_db())),
            sensitivity(&open),
        ],
        ..Section::default()
    }
}

/// The margins in a sentence.
fn words(sampled: &Figures) -> String {
    if !sampled.stable {
        return "As sampled at 500 Hz it is unstable.".into();
    }
    let at = |omega: f64| format!("{:.2} Hz ({omega:.3} rad/s)", omega / TAU);
    let mut parts = Vec::new();
    if let (Some(margin), Some(omega)) = (sampled.phase_margin_deg, sampled.crossover_rad_s) {
        parts.push(format!("phase margin {margin:.1}° at {}", at(omega)));
    }
    if let (Some(margin), Some(omega)) = (sampled.gain_margin_db, sampled.phase_crossover_rad_s) {
        parts.push(format!("gain margin {margin:.1} dB at {}", at(omega)));
    }
    if let Some(bandwidth) = sampled.bandwidth_hz {
        parts.push(format!(
            "bandwidth {bandwidth:.2} Hz ({:.3} rad/s)",
            TAU * bandwidth
        ));
    }
    format!("As sampled at 500 Hz: {}.", parts.join(", "))
}

fn pair(
    both: &[FrequencyResponse; 2],
    values: impl Fn(&FrequencyResponse, usize) -> Vec<f64>,
) -> Vec<Series> {
    let [a, b] = both;
    vec![
        line("continuous", a, values(a, 0)).coloured(CONTINUOUS),
        line("500 Hz", b, values(b, 1))
            .styled(Style::Dashed)
            .coloured(SAMPLED),
    ]
}

fn ends(response: &FrequencyResponse) -> [f64; 2] {
    let end = |omega: Option<&f64>| omega.map_or(1.0, |omega| omega / TAU);
    [end(response.omega.first()), end(response.omega.last())]
}

fn gain(open: &[FrequencyResponse; 2], sampled: &Figures) -> Panel {
    let mut series = pair(open, |response, _| response.gain_db());
    series.push(Series::level("0 dB", 0.0, ends(&open[1])));
    if let (Some(margin), Some(omega)) = (sampled.gain_margin_db, sampled.phase_crossover_rad_s) {
        let name = format!("gain margin {margin:.1} dB");
        let at = omega / TAU;
        series.push(Series::stroke(&name, [at, 0.0], [at, -margin]).coloured(MARGIN));
    }
    gain_panel("Open loop, gain", series)
}

fn phases(open: &[FrequencyResponse; 2], figures: &LoopFigures) -> Panel {
    let both = [&figures.continuous, &figures.sampled];
    let mut series = pair(open, |response, n| phase(response, both[n].crossover_rad_s));
    series.push(Series::level("-180°", -180.0, ends(&open[1])));
    let sampled = &figures.sampled;
    if let (Some(margin), Some(omega)) = (sampled.phase_margin_deg, sampled.crossover_rad_s) {
        let name = format!("phase margin {margin:.1}°");
        let at = omega / TAU;
        series.push(Series::stroke(&name, [at, -180.0], [at, -180.0 + margin]).coloured(MARGIN));
    }
    phase_panel("Open loop, phase", series)
}

/// The open loop in the complex plane, with the point -1 and the unit circle.
fn nyquist(open: &[FrequencyResponse; 2]) -> Panel {
    let path = |name: &str, places: Vec<f64>, values: Vec<f64>| {
        Series::line(name, Abscissa::At(places.into()), values).styled(Style::Path)
    };
    let curve = |name: &str, response: &FrequencyResponse, colour| {
        // Far away there is nothing to see, and a pole at zero goes very far.
        let near = response.value.iter().map(|value| {
            if value.norm() < 20.0 {
                (value.re, value.im)
            } else {
                (f64::NAN, f64::NAN)
            }
        });
        let (re, im): (Vec<f64>, Vec<f64>) = near.filter(|(re, _)| re.is_finite()).unzip();
        path(name, re, im).coloured(colour)
    };
    let circle = (0..=180).map(|n| {
        let (sine, cosine) = (TAU * f64::from(n) / 180.0).sin_cos();
        (cosine, sine)
    });
    let (x, y): (Vec<f64>, Vec<f64>) = circle.unzip();
    let [re, im] = NYQUIST;
    Panel {
        title: "Nyquist plot of the open loop".into(),
        x: Axis::linear("real part", Units::NONE).between(re[0], re[1]),
        y: Axis::linear("imaginary part", Units::NONE).between(im[0], im[1]),
        series: vec![
            path("unit circle", x, y).coloured(0),
            curve("continuous", &open[0], CONTINUOUS),
            curve("500 Hz", &open[1], SAMPLED),
            Series::line("-1", Abscissa::At([-1.0].into()), vec![0.0])
                .styled(Style::Points)
                .coloured(MARGIN),
        ],
    }
}

/// `1 / (1 + L)`: the response of the loop to disturbances and errors of the plant.
fn sensitivity(open: &[FrequencyResponse; 2]) -> Panel {
    let db = |response: &FrequencyResponse| -> Vec<f64> {
        let values = response.value.iter();
        values
            .map(|open| -20.0 * (1.0 + open).norm().log10())
            .collect()
    };
    let peak = db(&open[1])
        .into_iter()
        .filter(|value| value.is_finite())
        .fold(f64::NEG_INFINITY, f64::max);
    let mut series = pair(open, |response, _| db(response));
    series.push(Series::level("0 dB", 0.0, ends(&open[1])));
    gain_panel(
        &format!("Sensitivity, 1/(1 + L); its peak at 500 Hz is {peak:.1} dB"),
        series,
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;
    use plant::linear::log_space;

    use super::*;

    /// Three lags: from 0 to -270 degrees, whatever the turn that the argument begins in.
    #[test]
    fn phase_is_in_the_turn_of_minus_180_degrees() {
        let omega = log_space(0.01, 100.0, 400);
        for sign in [1.0, -1.0] {
            let response = FrequencyResponse::continuous(&omega, |s| {
                Complex::new(sign, 0.0) / (s + 1.0).powi(3)
            });
            let found = phase(&response, Some(1.0));
            let expected = if sign > 0.0 { -135.0 } else { -315.0 };
            let place = omega.partition_point(|own| *own < 1.0);
            assert!((found[place] - expected).abs() < 3.0, "{}", found[place]);
        }
    }
}
