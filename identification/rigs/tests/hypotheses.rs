//! Effects of the user's own: found by the diagnosis, written into the extended model and read again.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fmt::Write;
use std::path::Path;

use diagnosis::{Observer, Verdict};
use rigs::kinds::{Description, ExtendedRig, diagnose};

/// kg, N s/m, N/m; N and m of a detent that no catalogue has.
const RIG: [f64; 3] = [10.0, 60.0, 9000.0];
const DETENT: [f64; 2] = [8.0, 6e-3];

/// A record in mm and N of a mass on a spring with magnets along its way, by Verlet's method.
fn record(path: &Path, size: f64, shift: f64) {
    let [mass, damping, stiffness] = RIG;
    let [force, pitch] = DETENT;
    let (steps, period) = (20, 0.005);
    let h = period / f64::from(steps);
    let shaker = |t: f64| -> f64 {
        let tones = [1.1, 1.9, 2.7, 3.6, 4.7, 5.9, 7.3];
        let all = tones.iter().enumerate();
        all.map(|(i, f)| size * (std::f64::consts::TAU * f * t + shift * (i * i) as f64).sin())
            .sum()
    };
    let (mut x, mut v) = (0.0_f64, 0.0_f64);
    let mut text = String::from("t_s,F_N,x_mm\n");
    for k in 0..3000 {
        let t = f64::from(k) * period;
        let noise = 0.004 * (f64::from(k) * 91.7).sin() * (f64::from(k) * 13.31).cos();
        writeln!(text, "{t:.4},{:.5},{:.5}", shaker(t), 1e3 * x + noise).unwrap();
        for i in 0..steps {
            let t = t + (f64::from(i) + 0.5) * h;
            let half = x + 0.5 * h * v;
            let pull =
                shaker(t) - stiffness * half - force * (std::f64::consts::TAU * half / pitch).sin();
            let brake = 0.5 * h * damping / mass;
            v = (v * (1.0 - brake) + h * pull / mass) / (1.0 + brake);
            x = half + 0.5 * h * v;
        }
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn an_effect_that_no_catalogue_has_is_found_written_and_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    record(&path("monday.csv"), 12.0, 0.7);
    record(&path("tuesday.csv"), 9.0, 1.9);
    let rig = r#"name = "Rail"
kind = "oscillator"
data = ["monday.csv"]
columns.time = { column = "t_s", unit = "s" }
columns.force = { column = "F_N", unit = "N" }
columns.displacement = { column = "x_mm", unit = "mm" }
nominal.mass = { value = 10.0, plus_minus = 0.2, unit = "kg" }
nominal.damping = { value = 55.0, plus_minus = 10.0, unit = "N s/m" }
nominal.stiffness = { value = 9000.0, plus_minus = 400.0, unit = "N/m" }
left_out.second_half = true
"#;
    let mine = r#"[magnets]
at = "force"
value = "-holding * sin(2 * pi * x / pitch)"
sentence = "magnets along the rail hold the mass with {holding} every {pitch}"

[magnets.parameters]
holding = { start = [2, 6], range = [0, 50], unit = "N" }
pitch = { start = [5, 7], range = [3, 12], unit = "mm" }
"#;
    std::fs::write(path("rig.toml"), rig).unwrap();
    std::fs::write(path("mine.toml"), mine).unwrap();
    let description = Description::read(&path("rig.toml")).unwrap();
    let measurement = description.measurement(&[]).unwrap();
    let without = diagnose(&description, &measurement, Observer::none()).unwrap();
    let description = description.with_effects(&path("mine.toml")).unwrap();
    let found = diagnose(&description, &measurement, Observer::none()).unwrap();
    println!("{}\n{}", without.sentence(), found.sentence());
    assert_eq!(found.verdict, Verdict::Named, "{:?}", found.set_aside);
    assert_eq!(found.named, ["magnets"]);
    let values = &found.confirmed.effects[0].1;
    let is_near = |i: usize, truth: f64| (values[i].value / truth - 1.0).abs() < 0.02;
    assert!(
        is_near(0, DETENT[0]) && is_near(1, 1e3 * DETENT[1]),
        "{values:?}"
    );
    assert!(found.confirmed.error < 0.01, "{}", found.confirmed.error);
    assert!(without.confirmed.error > 3.0 * found.confirmed.error);
    let sentence = found.sentence();
    assert!(
        sentence.contains("shows that magnets along the rail hold the mass with 8.0"),
        "{sentence}"
    );
    // The model alone says what the effect is: neither description nor file of effects is there any more.
    let model = ExtendedRig::new(&description, &measurement, &found).unwrap();
    std::fs::write(path("model.toml"), model.to_toml().unwrap()).unwrap();
    std::fs::remove_file(path("mine.toml")).unwrap();
    let model = ExtendedRig::read(&path("model.toml")).unwrap();
    let scored = model.validate(&[path("tuesday.csv")]).unwrap();
    println!("{scored:?}");
    assert!(scored[0].extended_percent < 1.0, "{scored:?}");
    assert!(
        scored[0].nominal_percent > 4.0 * scored[0].extended_percent,
        "{scored:?}"
    );
}
