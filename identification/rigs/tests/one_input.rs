//! Command to displacement of rigs that are integrated here step by step, whose numbers are known.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use plant::sensors::channel::Noise;
use recordings::{Channel, Recording, mean_and_deviation};
use rigs::one_input::{OneInput, identify};

const PERIOD: f64 = 0.002;
const SAMPLES: usize = 20_000;
/// Steps of a sample.
const STEPS: usize = 40;

/// 0.15 m/(V s), a spool of 4 ms, a late command.
const GAIN: f64 = 0.15;
const LAG: f64 = 0.004;
const DELAY: f64 = 0.0033;

fn noise(seed: u64, channel: u64, sample: usize) -> f64 {
    Noise {
        seed,
        channel,
        sample: sample as u64,
    }
    .gaussian()
}

/// A reference with power to some 20 Hz, m.
fn reference(seed: u64) -> Vec<f64> {
    let (mut slow, mut quick) = (0.0, 0.0);
    (0..SAMPLES)
        .map(|k| {
            slow += 0.02 * (0.02 * noise(seed, 1, k) - slow);
            quick += 0.2 * (slow - quick);
            quick
        })
        .collect()
}

/// `LAG w' = GAIN u(t - DELAY) - w`, `x' = w` under `u = 20 V/m (r - x)`, with noise on what is
/// measured and `command_noise` (V) on what is recorded of the command.
fn valve_driven(command_noise: f64, with_reference: bool) -> Recording {
    let wanted = reference(3);
    let (mut x, mut w) = (0.0, 0.0);
    let mut commands: Vec<f64> = Vec::new();
    let mut columns = [Vec::new(), Vec::new()];
    let step = PERIOD / STEPS as f64;
    for (k, r) in wanted.iter().enumerate() {
        let measured: f64 = x + 2e-6 * noise(3, 2, k);
        let command = 60.0 * (r - measured);
        commands.push(command);
        columns[0].push(command + command_noise * noise(3, 4, k));
        columns[1].push(measured);
        for i in 0..STEPS {
            let late = k as f64 + (i as f64 + 0.5) / STEPS as f64 - DELAY / PERIOD;
            let u = if late < 0.0 {
                0.0
            } else {
                commands[late as usize]
            };
            // The lag in closed form over a step, the way by the trapezoidal rule.
            let next = GAIN * u + (w - GAIN * u) * (-step / LAG).exp();
            x += 0.5 * step * (w + next);
            w = next;
        }
    }
    let [command, displacement] = columns;
    let mut channels = vec![
        (Channel::ValveCommand, command),
        (Channel::Displacement, displacement),
    ];
    if with_reference {
        channels.push((Channel::Reference, wanted));
    }
    Recording::new("valve", PERIOD, channels).unwrap()
}

/// Gain and lag of `GAIN / (s (LAG s + 1))` in a model, with their standard errors.
fn gain_and_lag(found: &OneInput) -> [(f64, f64); 2] {
    let pole = found.model.denominator[1];
    let lead = found.model.numerator[0];
    let relative = found.standard_error[0] / pole;
    [
        (lead / pole, found.standard_error[1] / pole),
        (1.0 / pole, relative / pole),
    ]
}

#[test]
fn a_valve_driven_rig_is_found_in_closed_loop() {
    let found = identify(&[valve_driven(0.0, true)], 0.75).unwrap();
    let structure = found.structure;
    assert!(
        structure.integrates && structure.poles == 1,
        "{structure:?}"
    );
    let [gain, lag] = gain_and_lag(&found);
    assert!((gain.0 / GAIN - 1.0).abs() < 2e-3, "{gain:?}");
    assert!((lag.0 / LAG - 1.0).abs() < 0.02, "{lag:?}");
    assert!(
        (found.model.delay - DELAY).abs() < 5e-5,
        "{:?}",
        found.model
    );
    assert!(
        found.simulated_percent > 95.0,
        "{}",
        found.simulated_percent
    );
    assert!(found.check < 1.6 && found.mean_square < 1.6);
}

#[test]
fn noise_on_the_recorded_command_leaves_no_bias_or_is_told() {
    for part in [0.01, 0.05] {
        let clean = valve_driven(0.0, true);
        let (_, size) = mean_and_deviation(clean.samples(Channel::ValveCommand));
        let found = identify(&[valve_driven(part * size, true)], 0.75).unwrap();
        let [gain, _] = gain_and_lag(&found);
        println!("{part}: {:.2} standard errors", (gain.0 - GAIN) / gain.1);
        assert!((gain.0 - GAIN).abs() < 2.0 * gain.1, "{part}: {gain:?}");
        // Without the reference the bias is there, and said.
        let blind = identify(&[valve_driven(part * size, false)], 0.75).unwrap();
        let said = blind.warnings.join("\n");
        assert!(said.contains("no `reference` is recorded"), "{said}");
    }
}

/// 1.02 / ((0.003 s + 1)(s/50 + 1)), 4.5 ms late, at 1 kHz, with `noise_of_reference` (m) on what is recorded of it.
fn press(noise_of_reference: f64) -> Recording {
    let period = 0.001;
    let wanted = reference(5);
    let (mut u, mut x) = (0.0f64, 0.0f64);
    let step = period / STEPS as f64;
    let mut shown = Vec::new();
    for k in 0..wanted.len() {
        shown.push(x + 1e-6 * noise(5, 2, k));
        for i in 0..STEPS {
            let late = k as f64 + (i as f64 + 0.5) / STEPS as f64 - 4.5;
            let before = late.floor().max(0.0) as usize;
            let share = (late - before as f64).clamp(0.0, 1.0);
            let r = wanted[before] * (1.0 - share) + wanted[before + 1] * share;
            u += step / 0.003 * (1.02 * r - u);
            x += step * 50.0 * (u - x);
        }
    }
    let recorded = wanted.iter().enumerate();
    let recorded = recorded.map(|(k, r)| r + noise_of_reference * noise(5, 3, k));
    let channels = vec![
        (Channel::Reference, recorded.collect()),
        (Channel::Displacement, shown),
    ];
    Recording::new("press", period, channels).unwrap()
}

#[test]
fn a_little_noise_on_a_reference_is_measured_and_not_warned_of() {
    let (_, size) = mean_and_deviation(&reference(5));
    let part = 0.1 * size;
    let found = identify(&[press(part)], 0.75).unwrap();
    assert!(
        (found.noise[0] / part - 1.0).abs() < 0.05,
        "{:?}",
        found.noise
    );
    let g0 = found.model.response(1e-3, found.period).re;
    assert!((g0 / 1.02 - 1.0).abs() < 2e-3, "{g0}");
    let [warning] = &found.warnings[..] else {
        panic!("{:?}", found.warnings)
    };
    assert!(warning.starts_with("command and displacement alone do not determine mass"));
}

#[test]
fn a_rig_with_a_loop_of_its_own_is_found_from_reference_and_displacement() {
    let period = 0.001;
    let found = identify(&[press(0.0)], 0.75).unwrap();
    assert_eq!(found.input, Channel::Reference);
    assert!(!found.structure.integrates);
    let g0 = found.model.response(1e-3, period).re;
    assert!((g0 / 1.02 - 1.0).abs() < 2e-3, "{g0}");
    let mut poles: Vec<f64> = found.model.poles().iter().map(|p| -p.re).collect();
    poles.sort_by(f64::total_cmp);
    assert!((poles[0] / 50.0 - 1.0).abs() < 0.01, "{poles:?}");
    assert!(
        found.simulated_percent > 99.0,
        "{}",
        found.simulated_percent
    );
}

#[test]
fn a_nonlinear_rig_that_was_swept_is_not_given_a_drift_below_its_sweep() {
    // A loop whose valve has a dead band, or that saturates softly; its static gain is one.
    type Valve = fn(f64) -> f64;
    let valves: [(&str, Valve); 2] = [
        ("dead band", |e| 45.0 * (e - e.clamp(-2e-4, 2e-4))),
        ("soft", |e| 54.0 * e / (1.0 + e.abs() / 0.004).sqrt()),
    ];
    let phase = |t: f64| std::f64::consts::TAU * (2.0 * t + 0.2 * t * t);
    for (name, valve) in valves {
        let (mut u, mut x) = (0.0, 0.0);
        let step = PERIOD / STEPS as f64;
        let (mut wanted, mut shown) = (Vec::new(), Vec::new());
        for k in 0..SAMPLES {
            let t = k as f64 * PERIOD;
            wanted.push(0.004 * phase(t).sin());
            shown.push(x + 2e-6 * noise(7, 2, k));
            for i in 0..STEPS {
                let late = (t + (i as f64 + 0.5) * step - DELAY).max(0.0);
                u += step / 0.003 * (valve(0.004 * phase(late).sin() - x) - u);
                x += step * u;
            }
        }
        let channels = vec![(Channel::Reference, wanted), (Channel::Displacement, shown)];
        let found = identify(&[Recording::new(name, PERIOD, channels).unwrap()], 0.75).unwrap();
        let below = found.model.response(0.1, PERIOD);
        println!("{name}: {:?}, {below:.3} at 0.1 rad/s", found.structure);
        assert!((below - 1.0).norm() < 0.15, "{name}: {below}");
        assert!(found.mean_square > 2.0 && !found.warnings.is_empty());
    }
}

#[test]
fn recordings_without_a_command_are_refused() {
    let channels = vec![(Channel::Displacement, reference(1))];
    let blind = Recording::new("blind", PERIOD, channels).unwrap();
    let said = |all: &[Recording]| identify(all, 0.75).unwrap_err().to_string();
    let alone = said(std::slice::from_ref(&blind));
    assert!(
        alone.contains("valve_command") && alone.contains("reference"),
        "{alone}"
    );
    // Of several the one that has none is named; what is in one of two only is not in all.
    let whole = valve_driven(0.0, true);
    let driven = whole.clone().without(Channel::Reference);
    let second = said(&[driven.clone(), blind]);
    assert!(second.contains("blind"), "{second}");
    let different = said(&[driven, whole.without(Channel::ValveCommand)]);
    assert!(different.contains("different commands"), "{different}");
}

/// A table on a spring, `x' = 0.08 (u + d) - 2 x`, under `u = gain (r(t - 20 ms) - x)`, with a slow
/// disturbance `d` that the loop works against; noise of 2 um on what is measured.
fn table_on_a_spring(gain: f64, seed: u64) -> Recording {
    let wanted = reference(seed);
    let delay = (0.02 / PERIOD) as usize;
    let step = PERIOD / STEPS as f64;
    let (mut x, mut d) = (0.0, 0.0);
    let [mut command, mut displacement] = [Vec::new(), Vec::new()];
    for k in 0..SAMPLES {
        let measured = x + 2e-6 * noise(seed, 2, k);
        let u = gain * (wanted[k.saturating_sub(delay)] - measured);
        d += 0.01 * (0.8 * noise(seed, 3, k) - d);
        command.push(u);
        displacement.push(measured);
        for _ in 0..STEPS {
            x += step * (0.08 * (u + d) - 2.0 * x);
        }
    }
    let channels = vec![
        (Channel::Reference, wanted),
        (Channel::ValveCommand, command),
        (Channel::Displacement, displacement),
    ];
    Recording::new("table", PERIOD, channels).unwrap()
}

#[test]
fn a_table_that_follows_its_reference_is_identified_with_its_loop_and_the_controllers_gain() {
    let found = identify(&[table_on_a_spring(900.0, 11)], 0.75).unwrap();
    assert_eq!(found.input, Channel::Reference);
    let own = found.controller.unwrap();
    assert!((own.gain / 900.0 - 1.0).abs() < 0.01, "{own:?}");
    assert!((own.delay - 0.02).abs() < 5e-4, "{own:?}");
    let loop_gain = 0.08 * 900.0;
    let steady = found.model.response(0.5, PERIOD).norm();
    assert!(
        (steady / (loop_gain / (loop_gain + 2.0)) - 1.0).abs() < 0.02,
        "{steady}"
    );
}

/// Time, reference and displacement in SI.
fn written(recording: &Recording, file: &std::path::Path) {
    let mut text = String::from("time [s],reference [m],displacement [m]\n");
    let channels = [Channel::Reference, Channel::Displacement].map(|own| recording.samples(own));
    for (k, (r, x)) in channels[0].iter().zip(channels[1]).enumerate() {
        text += &format!("{:.4},{r:.9},{x:.9}\n", k as f64 * PERIOD);
    }
    std::fs::write(file, text).unwrap();
}

#[test]
fn the_file_of_a_loop_predicts_other_records_as_it_stands_and_another_gain_by_its_ratio() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let first = table_on_a_spring(900.0, 21);
    written(&first, &file("one.csv"));
    written(&table_on_a_spring(900.0, 22), &file("two.csv"));
    written(&table_on_a_spring(450.0, 23), &file("lower.csv"));
    let named = |channel: Channel, unit: &str| recordings::Named {
        channel,
        head: format!("{} [{unit}]", channel.name()),
        unit: unit.into(),
    };
    let columns = [
        named(Channel::Time, "s"),
        named(Channel::Reference, "m"),
        named(Channel::Displacement, "m"),
    ];
    let found = identify(&[first.without(Channel::ValveCommand)], 0.75).unwrap();
    let text = found
        .to_toml("table", &[file("one.csv")], &columns)
        .unwrap();
    std::fs::write(file("model.toml"), &text).unwrap();
    let error = |model: &str, data: &str| {
        let model = rigs::kinds::ExtendedRig::read(&file(model)).unwrap();
        model.validate(&[file(data)]).unwrap()[0].extended_percent
    };
    let same = error("model.toml", "two.csv");
    let before = error("model.toml", "lower.csv");
    let mut table: toml::Table = text.parse().unwrap();
    let gain = &mut table["nominal"]["loop_gain"]["value"];
    *gain = (0.5 * gain.as_float().unwrap()).into();
    std::fs::write(file("lower.toml"), table.to_string()).unwrap();
    let scaled = error("lower.toml", "lower.csv");
    println!("{same} {before} {scaled}");
    // The disturbance alone is what no model of the reference explains.
    assert!(same < 6.0, "{same}");
    assert!(scaled < 0.6 * before && scaled < 10.0, "{scaled}, {before}");
}

#[test]
fn what_a_dead_band_leaves_is_said_first_with_where_it_is() {
    // x' = 45/s (e beyond 0.2 mm) on noise of 1 mm.
    let wanted = reference(31);
    let (mut x, mut shown) = (0.0, Vec::new());
    let step = PERIOD / STEPS as f64;
    for (k, r) in wanted.iter().enumerate() {
        shown.push(x + 1e-6 * noise(31, 2, k));
        for _ in 0..STEPS {
            let e: f64 = r - x;
            x += step * 45.0 * (e - e.clamp(-8e-4, 8e-4));
        }
    }
    let channels = vec![(Channel::Reference, wanted), (Channel::Displacement, shown)];
    let found = identify(&[Recording::new("play", PERIOD, channels).unwrap()], 0.75).unwrap();
    let first = &found.warnings[0];
    println!("{first}");
    assert!(
        first.contains("% of the displacement") && first.contains("Hz"),
        "{first}"
    );
    let Some((quiet, lively)) = found.explained.by_size else {
        panic!("{:?}", found.explained)
    };
    assert!(quiet > 1.3 * lively, "{quiet} {lively}");
}
