//! The pictures of a case.

use identification::data::{Channel, OUTPUT_NAMES};
use identification::diagnosis::case::Case;
use identification::diagnosis::rigs::shake_table::{Diagnosis, Validation};
use realfft::RealFftPlanner;

use super::co_simulation::Comparison;
use pages::report::{Abscissa, Axis, Panel, Series, Style, Units};

/// Pictures of errors against the state that are shown.
const STATES_SHOWN: usize = 6;
/// Colours of the nominal and of the extended model.
const BEFORE: usize = 2;
const AFTER: usize = 1;

/// Errors in time, in frequency, and against the state.
pub(super) struct Errors {
    pub time: Vec<Panel>,
    pub spectra: Vec<Panel>,
    pub state: Vec<Panel>,
}

/// Channels with errors on the validation record: place, whitened errors before and after.
fn channels(validation: &Validation) -> impl Iterator<Item = (usize, [Vec<f64>; 2])> {
    (0..OUTPUT_NAMES.len()).filter_map(|channel| {
        let pick = |errors: &[f64]| -> Vec<f64> {
            errors.iter().skip(channel).step_by(4).copied().collect()
        };
        let before = pick(&validation.before);
        // A missing channel has no errors.
        let is_live = before.iter().any(|error| *error != 0.0);
        is_live.then(|| (channel, [before, pick(&validation.after)]))
    })
}

/// Values of a series that a page shows.
const SHOWN: usize = 12_000;

/// The sensors' readings with those of both rigs in closed loop over them.
pub(super) fn overlays(case: &Case, found: &Comparison) -> Vec<Panel> {
    let period = 1.0 / case.nominal.sample_rate;
    let outputs = Channel::OUTPUTS.map(|channel| case.validation.channel(channel));
    let live = (0..).zip(outputs);
    let live = live.filter_map(|(i, measured)| Some((i, measured?)));
    live.map(|(i, measured)| {
        let line = |name: &str, values: &[f64], colour| {
            let line = Series::history(name, period, values).coloured(colour);
            line.thinned(SHOWN)
        };
        Panel {
            title: format!("{}, measured and co-simulated", words(i)),
            x: Axis::linear("time", Units::TIME),
            y: Axis::linear(&words(i), units(i)),
            series: vec![
                line("measured", measured, 0),
                line("nominal model", &found.before[i], BEFORE),
                line("extended model", &found.after[i], AFTER),
            ],
        }
    })
    .collect()
}

/// The sensors' readings less those of both rigs in closed loop, over time.
pub(super) fn closed_loop(case: &Case, found: &Comparison) -> Vec<Panel> {
    let period = 1.0 / case.nominal.sample_rate;
    let outputs = Channel::OUTPUTS.map(|channel| case.validation.channel(channel));
    let live = (0..).zip(outputs);
    let live = live.filter_map(|(i, measured)| Some((i, measured?)));
    live.map(|(i, measured)| {
        let error = |simulated: &[f64]| -> Vec<f64> {
            measured.iter().zip(simulated).map(|(m, s)| m - s).collect()
        };
        Panel {
            title: format!("{}, measured less co-simulated", words(i)),
            x: Axis::linear("time", Units::TIME),
            y: Axis::linear("error", units(i)),
            series: both(period, &error(&found.before[i]), &error(&found.after[i]))
                .into_iter()
                .chain([band(period, measured.len(), 2.0 * found.floor[i])])
                .rev()
                .collect(),
        }
    })
    .collect()
}

fn words(channel: usize) -> String {
    OUTPUT_NAMES[channel].replace('_', " ")
}

fn units(channel: usize) -> Units {
    match channel {
        0 => Units::DISPLACEMENT,
        2 => Units::FORCE,
        _ => Units::ACCELERATION,
    }
}

/// The extended model's errors, and the nominal one's, which lie below them when drawn in reverse.
fn both(period: f64, before: &[f64], after: &[f64]) -> [Series; 2] {
    [
        Series::history("extended model", period, after).coloured(AFTER),
        Series::history("nominal model", period, before).coloured(BEFORE),
    ]
}

/// A band of `half` to either side of zero, as its outline.
fn band(period: f64, length: usize, half: f64) -> Series {
    let end = period * length.saturating_sub(1) as f64;
    Series::line(
        "twice the noise floor",
        Abscissa::At(vec![0.0, end, end, 0.0, 0.0].into()),
        vec![half, half, -half, -half, half],
    )
    .styled(Style::Path)
    .coloured(0)
}

/// One-step errors on the validation record.
pub(super) fn errors(case: &Case, diagnosis: &Diagnosis) -> Errors {
    let Validation {
        period, samples, ..
    } = &diagnosis.validation;
    let displacement: Vec<f64> = samples.channels.iter().map(|row| row[0]).collect();
    let mut states = vec![
        ("command", Units::VOLTAGE, samples.command.clone()),
        ("velocity", Units::VELOCITY, slope(&displacement, *period)),
        ("displacement", Units::DISPLACEMENT, displacement),
    ];
    if let Some(specimen) = case.nominal.specimen {
        // Its spring holds the mass: -m a = k d, but for damping.
        let acceleration = samples.channels.iter().map(|row| row[3]);
        let drift: Vec<f64> = acceleration
            .map(|a| -specimen.mass * a / specimen.stiffness)
            .collect();
        states.push(("drift of the specimen", Units::DISPLACEMENT, drift));
    }
    // A missing channel is no state.
    states.retain(|(_, _, values)| values.iter().any(|value| *value != 0.0));
    let y = || Axis::linear("error, noise floors", Units::NONE);
    let [mut time, mut spectra] = [Vec::new(), Vec::new()];
    let mut ranked: Vec<(f64, Panel)> = Vec::new();
    for (channel, [before, after]) in channels(&diagnosis.validation) {
        let title = words(channel);
        let mut series = vec![band(*period, before.len(), 2.0)];
        series.extend(both(*period, &before, &after).into_iter().rev());
        time.push(Panel {
            title: title.clone(),
            x: Axis::linear("time", Units::TIME),
            y: y(),
            series,
        });
        spectra.push(Panel {
            title: title.clone(),
            x: Axis::logarithmic("frequency", Units::FREQUENCY),
            y: Axis::logarithmic("error, noise floors", Units::NONE),
            series: vec![
                spectrum("nominal model", &before, *period).coloured(BEFORE),
                spectrum("extended model", &after, *period).coloured(AFTER),
            ],
        });
        for (state, units, values) in &states {
            let line = binned("nominal model", values, &before).coloured(BEFORE);
            let bend: f64 = line.values.iter().map(|mean| mean * mean).sum();
            ranked.push((
                bend,
                Panel {
                    title: format!("{title} against {state}"),
                    x: Axis::linear(state, units.clone()),
                    y: y(),
                    series: vec![
                        line,
                        binned("extended model", values, &after).coloured(AFTER),
                    ],
                },
            ));
        }
    }
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let state = ranked.into_iter().map(|(_, panel)| panel);
    Errors {
        time,
        spectra,
        state: state.take(STATES_SHOWN).collect(),
    }
}

/// Slope over a tenth of a second, where the noise of single samples is small.
fn slope(values: &[f64], period: f64) -> Vec<f64> {
    let half = (0.05 / period).round().max(1.0) as usize;
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(half), (k + half).min(last));
            (values[to] - values[from]) / (period * (to - from).max(1) as f64)
        })
        .collect()
}

/// Mean errors in bins of equally many samples, by the state.
fn binned(name: &str, state: &[f64], errors: &[f64]) -> Series {
    const BINS: usize = 40;
    let mut pairs: Vec<(f64, f64)> = state.iter().copied().zip(errors.iter().copied()).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mean = |values: &mut dyn Iterator<Item = f64>, n: usize| values.sum::<f64>() / n as f64;
    let (places, means): (Vec<f64>, Vec<f64>) = pairs
        .chunks(pairs.len().div_ceil(BINS).max(1))
        .map(|bin| {
            let place = mean(&mut bin.iter().map(|pair| pair.0), bin.len());
            (place, mean(&mut bin.iter().map(|pair| pair.1), bin.len()))
        })
        .unzip();
    Series::line(name, Abscissa::At(places.into()), means).styled(Style::Line)
}

/// Root of the averaged periodogram (Hann, 2 s, half overlapped); white noise of size one gives 1.
fn spectrum(name: &str, errors: &[f64], period: f64) -> Series {
    let length = ((2.0 / period) as usize).min(errors.len()) & !1;
    let window: Vec<f64> = (0..length)
        .map(|k| {
            (std::f64::consts::PI * k as f64 / length as f64)
                .sin()
                .powi(2)
        })
        .collect();
    let weight: f64 = window.iter().map(|w| w * w).sum();
    let mut power = vec![0.0; length / 2 + 1];
    let mut count = 0.0;
    if length >= 4 {
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let mut lines = transform.make_output_vec();
        for start in (0..=errors.len() - length).step_by(length / 2) {
            let mut piece: Vec<f64> = errors[start..start + length]
                .iter()
                .zip(&window)
                .map(|(error, weight)| error * weight)
                .collect();
            if transform.process(&mut piece, &mut lines).is_ok() {
                count += 1.0;
                for (sum, line) in power.iter_mut().zip(&lines) {
                    *sum += line.norm_sqr() / weight;
                }
            }
        }
    }
    let frequency = (1..power.len())
        .map(|k| k as f64 / (length as f64 * period))
        .collect();
    let root = power
        .iter()
        .skip(1)
        .map(|sum| (sum / f64::max(count, 1.0)).sqrt());
    Series::line(name, Abscissa::At(frequency), root.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(series: &Series) -> Vec<f64> {
        match &series.abscissa {
            Abscissa::At(places) => places.to_vec(),
            Abscissa::Even { start, step } => (0..series.values.len())
                .map(|n| start + n as f64 * step)
                .collect(),
        }
    }

    #[test]
    fn a_slope_is_taken_over_a_tenth_of_a_second() {
        let line: Vec<f64> = (0..100).map(|n| 3.0 * 0.01 * f64::from(n)).collect();
        for slope in slope(&line, 0.01) {
            assert!((slope - 3.0).abs() < 1e-9, "{slope}");
        }
        let step: Vec<f64> = (0..100).map(|n| f64::from(u8::from(n >= 50))).collect();
        let found = slope(&step, 0.01);
        // Ten steps wide, ten per second high.
        assert_eq!(found.iter().filter(|own| **own > 0.0).count(), 10);
        assert!((found[50] - 10.0).abs() < 1e-9);
        assert_eq!(slope(&[1.0], 0.01), [0.0]);
    }

    #[test]
    fn errors_are_averaged_in_bins_of_the_state() {
        let state: Vec<f64> = (0..80).rev().map(f64::from).collect();
        let errors: Vec<f64> = state.iter().map(|x| 2.0 * x + 1.0).collect();
        let own = binned("model", &state, &errors);
        assert_eq!(own.values.len(), 40);
        assert_eq!((places(&own)[0], own.values[0]), (0.5, 2.0));
        assert_eq!((places(&own)[39], own.values[39]), (78.5, 158.0));
        assert!(binned("none", &[], &[]).values.is_empty());
    }

    /// Noise of size one gives 1 on average; a sine is where its frequency is.
    #[test]
    fn a_spectrum_shows_noise_as_one_and_a_sine_at_its_frequency() {
        let period = 0.01;
        let mut state = 1_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let noise: Vec<f64> = (0..20_000)
            .map(|_| 12.0_f64.sqrt() * (uniform() - 0.5))
            .collect();
        let own = spectrum("noise", &noise, period);
        let square = own.values.iter().map(|own| own * own).sum::<f64>() / own.values.len() as f64;
        assert!((square - 1.0).abs() < 0.05, "{square}");
        assert_eq!((places(&own)[0], own.values.len()), (0.5, 100));
        let sine: Vec<f64> = (0..2000)
            .map(|n| (std::f64::consts::TAU * 5.0 * 0.01 * f64::from(n)).sin())
            .collect();
        let own = spectrum("sine", &sine, period);
        let most = (0..own.values.len()).max_by(|a, b| own.values[*a].total_cmp(&own.values[*b]));
        assert!((places(&own)[most.unwrap()] - 5.0).abs() < 1e-9);
        // All of the record counts: what sounds in its last tenth alone has a tenth of the power.
        let mut late = sine.clone();
        late[..1800].fill(0.0);
        let power = |values: &[f64]| -> f64 {
            let own = spectrum("sine", values, period).values;
            own.iter().map(|value| value * value).sum()
        };
        let part = power(&late) / power(&sine);
        assert!((part - 0.1).abs() < 0.03, "{part}");
        assert!(
            spectrum("short", &[1.0, 2.0], period)
                .values
                .iter()
                .all(|own| *own == 0.0)
        );
    }

    #[test]
    fn a_band_is_an_outline_and_channels_have_words_and_units() {
        let own = band(0.5, 5, 2.0);
        assert_eq!(places(&own), [0.0, 2.0, 2.0, 0.0, 0.0]);
        assert_eq!(own.values, [2.0, 2.0, -2.0, -2.0, 2.0]);
        let all: Vec<String> = (0..OUTPUT_NAMES.len()).map(words).collect();
        assert_eq!(all[0], "displacement");
        assert!(all.iter().all(|own| !own.contains('_')));
        let names = [0, 1, 2, 3].map(|n| units(n).si.to_string());
        assert_eq!(names, ["mm", "g", "kN", "g"]);
    }

    #[test]
    fn readings_of_both_rigs_are_shown_over_and_less_what_was_measured() {
        let text = include_str!("../../systems/plant/servohydraulic-model.toml");
        let mut nominal = identification::diagnosis::case::Nominal::parse(text).unwrap();
        nominal.sample_rate = 250.0;
        let measured = [1e-3, 3e-3, -2e-3];
        let channels = vec![
            (Channel::ValveCommand, vec![0.0; 3]),
            (Channel::Displacement, measured.to_vec()),
            (Channel::ActuatorForce, vec![5.0; 3]),
        ];
        let record = identification::data::Recording::new("v", 0.004, channels).unwrap();
        let case = Case {
            nominal,
            identification: record.clone(),
            validation: record,
            small: None,
            baseline: None,
        };
        let played = |part: f64| {
            let own = |value: f64| vec![part * value; 3];
            [own(1e-3), own(9.0), own(4.0), own(9.0)]
        };
        let gain = serde_json::json!({
            "before_nrmse": 0.5, "after_nrmse": 0.1, "noise_floor_nrmse": 0.04, "interval_95": [0.6, 0.9],
            "record": "validation", "before_ratio": 5.0, "after_ratio": 1.25, "channels": {},
        });
        let found = Comparison {
            before: played(1.0),
            after: played(2.0),
            floor: [1e-5, 9.0, 0.25, 9.0],
            gain: serde_json::from_value(gain).unwrap(),
        };
        // Channels that were not recorded are left out.
        let off = closed_loop(&case, &found);
        let titles: Vec<&str> = off.iter().map(|own| &*own.title).collect();
        let told = ["displacement", "actuator force"]
            .map(|own| format!("{own}, measured less co-simulated"));
        assert_eq!(titles, told);
        let names: Vec<&str> = off[0].series.iter().map(|own| &*own.name).collect();
        assert_eq!(
            names,
            ["twice the noise floor", "nominal model", "extended model"]
        );
        let expected = [[0.0, 2e-3, -3e-3], [-1e-3, 1e-3, -4e-3]];
        for (series, expected) in off[0].series[1..].iter().zip(expected) {
            for (value, expected) in series.values.iter().zip(expected) {
                assert!((value - expected).abs() < 1e-15, "{}", series.name);
            }
            assert_eq!(places(series), [0.0, 0.004, 0.008]);
        }
        assert_eq!(places(&off[1].series[0])[1], 0.008);
        assert_eq!(off[1].series[0].values[..3], [0.5, 0.5, -0.5]);
        assert_eq!(off[1].series[2].values, [-3.0; 3]);
        let over = overlays(&case, &found);
        assert_eq!(over[1].title, "actuator force, measured and co-simulated");
        let values = over[1].series.iter().map(|own| &own.values[..]);
        assert_eq!(values.collect::<Vec<_>>(), [[5.0; 3], [4.0; 3], [8.0; 3]]);
        assert_eq!(&*over[1].y.units.si, "kN");
    }
}
