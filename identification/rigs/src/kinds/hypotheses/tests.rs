//! Expressions against the effects of the catalogues that they repeat, and mistakes in files.

use std::path::Path;

use super::{Hypotheses, extended};
use crate::kinds::{Description, KINDS, Rig, RigRecording, Values, of_kind};
use recordings::{Channel, Recording};

fn parsed(text: &str) -> Hypotheses {
    toml::from_str(text).unwrap()
}

fn command(k: usize, period: f64) -> f64 {
    let t = k as f64 * period;
    3e-3 * (8.0 * t).sin() + 1e-3 * (31.0 * t).sin()
}

/// A record of zeros under a command of two tones.
fn recording(rig: &dyn Rig, period: f64) -> RigRecording {
    let n = 600;
    let zeros = vec![0.0; n];
    let size = if rig.inputs()[0].unit() == "m" {
        1.0
    } else {
        1e3
    };
    let first: Vec<f64> = (0..n).map(|k| size * command(k, period)).collect();
    let mut channels = vec![(rig.inputs()[0], first.clone()), (rig.output(), zeros)];
    if rig.inputs().contains(&Channel::Velocity) {
        let speed = super::running::rate(&first, period);
        channels.push((Channel::Velocity, speed));
    }
    let recording = Recording::new("record", period, channels).unwrap();
    RigRecording::new(recording, rig.inputs(), rig.output())
}

fn off(rig: &dyn Rig) -> Vec<f64> {
    rig.effects()
        .into_iter()
        .flat_map(|effect| effect.off)
        .collect()
}

/// What the catalogue's effect and the user's own put out, and what the rig does without both.
fn outputs(
    kind: &str,
    nominal: &[f64],
    (effect, catalogue): (&str, &[f64]),
    text: &str,
    own: &[f64],
) -> [Vec<f64>; 3] {
    let base = of_kind(kind).unwrap();
    let rig = extended(base, &parsed(text), Path::new("none.toml")).unwrap();
    let recording = recording(base, 0.005);
    let simulated = |effects: Vec<f64>| {
        let values = Values {
            nominal: nominal.to_vec(),
            effects,
            session: vec![0.0; base.session().len()],
        };
        let mut out = vec![0.0; recording.len()];
        rig.simulate(&recording, &values, &mut out);
        out
    };
    let without = off(rig);
    let mut with_catalogue = Vec::new();
    for one in rig.effects() {
        let is_own = one.candidate.effect == effect;
        with_catalogue.extend(if is_own { catalogue.to_vec() } else { one.off });
    }
    let mut with_own = without.clone();
    let first = with_own.len() - own.len();
    with_own[first..].copy_from_slice(own);
    [
        simulated(with_catalogue),
        simulated(with_own),
        simulated(without),
    ]
}

/// That an own effect does what the catalogue's does, within a share of what it changes.
fn agree(all: [Vec<f64>; 3], within: f64) {
    let [catalogue, own, without] = all;
    let most = |a: &[f64], b: &[f64]| {
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let (change, differ) = (most(&catalogue, &without), most(&catalogue, &own));
    assert!(change > 1e-6, "{change}");
    assert!(differ <= within * change, "{differ} of {change}");
}

const LOOP: [f64; 11] = [40.0, 0.004, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5];
const OSCILLATOR: [f64; 4] = [10.0, 40.0, 9000.0, 0.0];

#[test]
fn an_overlap_at_the_valve_is_that_of_the_catalogue() {
    let text = r#"
[overlap]
at = "valve"
value = "sign(u) * max(abs(u) - b, 0)"
sentence = "the valve overlaps by {b}"
parameters.b = { start = 0.1, range = [0, 1], unit = "mm" }
"#;
    let all = outputs(
        "closed_loop_actuator",
        &LOOP,
        ("dead_band", &[2e-4]),
        text,
        &[0.2],
    );
    agree(all, 1e-9);
}

#[test]
fn play_with_a_memory_and_a_late_command_are_those_of_the_catalogue() {
    let text = r#"
[linkage]
at = "output"
value = "p"
sentence = "the linkage has play"
parameters.gap = { start = 0.1, range = [0, 1], unit = "mm" }
memory.p = { start = "u", next = "max(min(p, u + gap / 2), u - gap / 2)" }
"#;
    let all = outputs(
        "closed_loop_actuator",
        &LOOP,
        ("free_play", &[4e-4]),
        text,
        &[0.4],
    );
    agree(all, 1e-9);
    let text = r#"
[transport]
at = "command"
value = "delay(u, time)"
sentence = "the command is late"
parameters.time = { start = 5, range = [0, 50], unit = "ms" }
"#;
    let all = outputs(
        "closed_loop_actuator",
        &LOOP,
        ("delay", &[0.0125]),
        text,
        &[12.5],
    );
    agree(all, 1e-2);
}

#[test]
fn forces_on_a_mass_are_those_of_the_catalogue() {
    let text = r#"
[drag]
at = "force"
value = "-c * v * abs(v)"
sentence = "drag"
parameters.c = { start = 100, range = [0, 1e4], unit = "N s2/m2" }
"#;
    let all = outputs(
        "oscillator",
        &OSCILLATOR,
        ("quadratic_damping", &[2e3]),
        text,
        &[2e3],
    );
    agree(all, 1e-9);
    // z' = k v (1 - (b sgn(v z) + g) |z / k|).
    let text = r#"
[rope]
at = "force"
value = "-z"
sentence = "a rope with friction"
parameters.k = { start = 1000, range = [0, 1e4], unit = "N/m" }
parameters.b = { start = 100, range = [1, 1e4], unit = "1/m" }
memory.z = { rate = "v * (k - b * (1 + sign(v * z)) * abs(z))" }
"#;
    let hysteresis = [2e3, 400.0, 400.0, 1.0];
    let all = outputs(
        "oscillator",
        &OSCILLATOR,
        ("hysteresis", &hysteresis),
        text,
        &[400.0, 2e3],
    );
    agree(all, 5e-3);
    let text = r#"
[drag]
at = "force"
value = "-c * v * abs(v)"
sentence = "drag"
parameters.c = { start = 100, range = [0, 1e4], unit = "N s2/m2" }
"#;
    let axis = [2.0, 30.0, 1.0, 0.0, 40.0, 0.0];
    let all = outputs(
        "linear_axis",
        &axis,
        ("quadratic_drag", &[50.0]),
        text,
        &[50.0],
    );
    agree(all, 0.05);
}

#[test]
fn a_lag_is_exact_for_a_ramp_however_short_it_is() {
    let text = r#"
[lag]
at = "output"
value = "z"
sentence = "a lag"
parameters.time = { start = 5, range = [0, 500], unit = "ms" }
memory.z = { start = "u", rate = "(u - z) / time" }
"#;
    let rig = extended(
        of_kind("closed_loop_actuator").unwrap(),
        &parsed(text),
        Path::new(""),
    )
    .unwrap();
    let own = super::compiled::Compiled::new("lag", &parsed(text)["lag"], rig).err();
    assert!(own.is_some_and(|wrong| wrong.what.contains("has an effect of this name")));
    let base = of_kind("closed_loop_actuator").unwrap();
    let compiled = super::compiled::Compiled::new("lag", &parsed(text)["lag"], base);
    let Ok(compiled) = compiled else { panic!() };
    let recording = recording(base, 0.005);
    for time in [1e-6, 1e-3, 0.02] {
        let mut running = super::Running::new(&compiled, &[1e3 * time], &LOOP, &recording);
        let ramp: Vec<f64> = (0..200).map(|k| 0.3 * 0.005 * f64::from(k)).collect();
        let lagged = running.along(&ramp, &[]);
        for (k, y) in lagged.iter().enumerate() {
            let t = 0.005 * k as f64;
            let exact = 0.3 * (t - time * (1.0 - (-t / time).exp()));
            assert!(
                (y - exact).abs() < 1e-9,
                "{time} s, sample {k}: {y} {exact}"
            );
        }
    }
}

#[test]
fn a_device_adds_its_force_for_its_motion() {
    let text = r#"
[detent]
at = "force"
value = "a * sin(2 * pi * x / pitch)"
sentence = "magnets hold the piston"
parameters.a = { start = 10, range = [-100, 100], unit = "N" }
parameters.pitch = { start = 2, range = [1, 4], unit = "mm" }
"#;
    let base = of_kind("controlled_damper").unwrap();
    let rig = extended(base, &parsed(text), Path::new("")).unwrap();
    let recording = recording(base, 0.005);
    let mut effects = off(rig);
    let last = effects.len();
    effects[last - 2..].copy_from_slice(&[20.0, 2.0]);
    let values = Values {
        nominal: vec![100.0, 0.0, 0.0],
        effects,
        session: vec![0.0; base.session().len()],
    };
    let mut out = vec![0.0; recording.len()];
    rig.simulate(&recording, &values, &mut out);
    let speeds = recording.input(Channel::Velocity);
    for (k, force) in out.iter().enumerate() {
        let x = command(k, 0.005);
        let exact = 100.0 * speeds[k] + 20.0 * (std::f64::consts::TAU * x / 2e-3).sin();
        assert!((force - exact).abs() < 1e-9, "{force} {exact}");
    }
}

const SCALE: &str = r#"
[scale]
at = "output"
value = "u * (1 + a)"
sentence = "the transducer shows {a} more"
parameters.a = { start = 0.1, range = [-0.5, 0.5], unit = "1" }
"#;

#[test]
fn all_but_the_effects_of_a_kind_stays_as_it_is() {
    for base in KINDS {
        let rig = extended(base, &parsed(SCALE), Path::new("")).unwrap();
        let facts = |of: &dyn Rig| {
            let columns = (of.inputs(), of.optional(), of.output(), of.also());
            let parameters = (of.parameters(), of.about_parameters(), of.defaults());
            let is = [
                of.is_hysteretic(),
                of.is_path(),
                of.begins_anew(),
                of.is_scaled(),
            ];
            let search = (of.session(), of.screened(), of.said_by(), of.causes());
            let rest = (of.kind(), of.limits(), of.places());
            (columns, parameters, is, search, rest)
        };
        assert_eq!(facts(rig), facts(base));
        let names = |of: &dyn Rig| -> Vec<&str> {
            let all = of.effects().into_iter();
            all.map(|effect| effect.candidate.effect).collect()
        };
        assert_eq!(names(rig), [names(base), vec!["scale"]].concat());
    }
}

/// `x' = 40/s (r - x)`, integrated in a hundred steps per sample.
#[test]
fn a_loop_with_an_own_effect_is_estimated_from_its_equation() {
    let base = of_kind("closed_loop_actuator").unwrap();
    let rig = extended(base, &parsed(SCALE), Path::new("")).unwrap();
    let (period, steps) = (0.005, 100);
    let mut x = 0.0;
    let [mut commands, mut shown] = [Vec::new(), Vec::new()];
    for k in 0..1200 {
        commands.push(command(k, period));
        shown.push(x);
        for i in 0..steps {
            let share = (f64::from(i) + 0.5) / f64::from(steps);
            let now = (1.0 - share) * command(k, period) + share * command(k + 1, period);
            x += period / f64::from(steps) * 40.0 * (now - x);
        }
    }
    let channels = vec![(rig.inputs()[0], commands), (rig.output(), shown)];
    let recording = Recording::new("record", period, channels).unwrap();
    let recording = RigRecording::new(recording, rig.inputs(), rig.output());
    let places: Vec<usize> = (0..1200).collect();
    let stated = [&[25.0], &LOOP[1..]].concat();
    let found = rig.estimated(&recording, &places, &stated).unwrap();
    assert!((found[0] / 40.0 - 1.0).abs() < 0.02, "{found:?}");
    assert!((found[2] - 1.0).abs() < 0.01, "{found:?}");
    // The lag of the command is not in the equation.
    assert_eq!(found[1], LOOP[1]);
}

#[test]
fn mistakes_are_told_by_line_and_remedy() {
    let good = r#"
[mine]
at = "input"
value = "u + a * du"
sentence = "the drive leads by {a}"

[mine.parameters]
a = { start = 0.01, range = [0, 0.1], unit = "s" }
"#;
    let folder = std::env::temp_dir().join(format!("hypotheses-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("mine.toml");
    let base = of_kind("closed_loop_actuator").unwrap();
    let error = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let read = super::read(&path);
        let made = read.and_then(|all| extended(base, &all, &path).map(|_| ()));
        made.err()
            .map_or_else(String::new, |error| error.to_string())
    };
    assert_eq!(error(good), "");
    for (old, new, expected) in [
        (
            "at = \"input\"",
            "at = \"specimen\"",
            "line 3, `mine.at`: `specimen` is not a place of the kind closed_loop_actuator: expected `input`, `output`, `valve` or `command`",
        ),
        (
            "a * du",
            "a * dv",
            "line 4, `mine.value`: `u + a * dv` at character 9: `dv` is unknown; did you mean",
        ),
        (
            "a * du",
            "a * v",
            "line 4, `mine.value`: `u + a * v` `v` has no value at `input`: `u` is the signal",
        ),
        (
            "u + a * du",
            "a * du",
            "line 4, `mine.value`: `a * du` is 0 where its sizes are 0 and `u` is 1: expected 1",
        ),
        (
            "[0, 0.1]",
            "[0.1, 0]",
            "line 8, `mine.parameters.a.range`: [0.1, 0]: expected the smallest",
        ),
        (
            "start = 0.01",
            "start = 0.2",
            "line 8, `mine.parameters.a.start`: [0.2]: expected one value or more within [0, 0.1]",
        ),
        (
            "unit = \"s\"",
            "unit = \"flop\"",
            "line 8, `mine.parameters.a.unit`: `flop`",
        ),
        (
            "[0, 0.1]",
            "[0.001, 0.1]",
            "`mine.parameters`: has no size: expected a parameter whose range holds 0",
        ),
        (
            "[mine]",
            "[dead_band]",
            "line 2, `dead_band`: the kind closed_loop_actuator has an effect of this name",
        ),
        (
            "[mine.parameters]",
            "[mine.parameter]",
            "unknown field `parameter`",
        ),
    ] {
        let text = if old == "[mine]" {
            good.replace("mine", "dead_band")
        } else {
            good.replace(old, new)
        };
        let found = error(&text);
        assert!(
            found.contains(expected) && found.contains("mine.toml"),
            "{found}\n{expected}"
        );
    }
    assert!(error("").contains("no effect: expected a table"));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_description_makes_its_rig_once_and_anew_with_other_effects() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, effect: &str| {
        let path = folder.path().join(name);
        let text = format!(
            "[{effect}]\nat = \"input\"\nvalue = \"u + a * du\"\nsentence = \"it leads by {{a}}\"\n\
             parameters.a = {{ start = 0.01, range = [0, 0.1], unit = \"s\" }}\n"
        );
        std::fs::write(&path, text).unwrap();
        path
    };
    let text = r#"
name = "axis"
kind = "linear_axis"
data = []
columns = {}
nominal = {}
left_out = { second_half = true }
"#;
    let bare = Description::parse(Path::new("axis.toml"), text).unwrap();
    let one = bare
        .clone()
        .with_effects(&write("one.toml", "one"))
        .unwrap();
    let rig = one.rig().unwrap();
    // A copy shares what its original made.
    assert!(std::ptr::eq(rig, one.clone().rig().unwrap()));
    let has = |rig: &dyn Rig, name: &str| {
        let mut all = rig.effects().into_iter();
        all.any(|effect| effect.candidate.effect == name)
    };
    let both = one.with_effects(&write("two.toml", "two")).unwrap();
    let both = both.rig().unwrap();
    assert!(has(rig, "one") && !has(rig, "two"));
    assert!(has(both, "one") && has(both, "two"));
    assert!(!has(bare.rig().unwrap(), "one"));
}
