//! A frame with a device, against motions integrated here: absolute displacements, the classical Runge-Kutta
//! method with steps of 0.1 ms, friction as one more state, a base that moves by a closed form.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

use diagnosis::{Observer, Verdict};
use rigs::kinds::{Description, ExtendedRig, diagnose};

const PERIOD: f64 = 0.01;
const FINE: usize = 100;

/// A building of two floors; SI.
struct Building {
    masses: [f64; 2],
    springs: [f64; 2],
    dashpots: [f64; 2],
    friction: [f64; 2],
    /// Of the device.
    yields_at: f64,
    over: f64,
    creep: f64,
    sharpness: f64,
    /// Toward the middle, over a width.
    centring: (f64, f64),
    push: f64,
}

/// Displacement and velocity of the base, which begins smoothly.
fn base(t: f64, tone: f64) -> [f64; 2] {
    let at = |t: f64| {
        let grown = 1.0 - (-(t / 0.7).powi(3)).exp();
        let slow = (TAU * tone * t).sin() * (TAU * 0.11 * t).cos();
        grown * (0.02 * slow + 0.003 * (TAU * 2.7 * tone * t + 1.0).sin())
    };
    let d = 1e-5;
    [at(t), (at(t + d) - at(t - d)) / (2.0 * d)]
}

impl Building {
    /// Floors, their velocities, shares of friction of both storeys and of the device; and the device's force.
    fn rates(&self, t: f64, tone: f64, s: &[f64; 7]) -> ([f64; 7], f64) {
        let [x, y, vx, vy, p, q, z] = *s;
        let [g, vg] = base(t, tone);
        let (low, high, slide) = (x - g, y - x, vx - vg);
        let pull = self.centring.0 * low / (low.abs() + self.centring.1);
        let first = self.springs[0] * low + self.dashpots[0] * slide + self.friction[0] * p + pull;
        let second = self.springs[1] * high + self.dashpots[1] * (vy - vx) + self.friction[1] * q;
        let device = self.yields_at * z;
        let dahl = |v: f64, z: f64| (v - v.abs() * z) / self.over;
        let held = match (self.creep > 0.0, z * slide > 0.0) {
            (false, _) => slide.abs() * z,
            (true, true) => slide.abs() * z * z.abs().powf(self.sharpness),
            (true, false) => 0.0,
        };
        let rates = [
            vx,
            vy,
            (self.push - first - device + second) / self.masses[0],
            -second / self.masses[1],
            dahl(slide, p),
            dahl(vy - vx, q),
            (slide - held) / self.over - self.creep * z,
        ];
        (rates, device)
    }

    /// Rows of base, drifts and force.
    fn shaken(&self, tone: f64, samples: usize) -> Vec<[f64; 4]> {
        let h = PERIOD / FINE as f64;
        let mut s = [0.0; 7];
        let [g, vg] = base(0.0, tone);
        [s[0], s[1], s[2], s[3]] = [g, g, vg, vg];
        let mut rows = Vec::new();
        for k in 0..samples * FINE {
            let t = k as f64 * h;
            let (a, device) = self.rates(t, tone, &s);
            if k % FINE == 0 {
                let [g, _] = base(t, tone);
                rows.push([g, s[0] - g, s[1] - s[0], device]);
            }
            let ahead = |by: f64, d: &[f64; 7]| std::array::from_fn(|i| s[i] + by * d[i]);
            let (b, _) = self.rates(t + 0.5 * h, tone, &ahead(0.5 * h, &a));
            let (c, _) = self.rates(t + 0.5 * h, tone, &ahead(0.5 * h, &b));
            let (d, _) = self.rates(t + h, tone, &ahead(h, &c));
            for i in 0..7 {
                s[i] += h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
            }
        }
        rows
    }
}

const COLUMNS: &str = r#"
columns.time = { column = "t", unit = "s" }
columns.displacement = { column = "table", unit = "mm" }
columns.command = { column = "volts", unit = "V" }
columns.drift = { column = "drift", unit = "mm" }
columns.force = { column = "force", unit = "N" }
"#;

fn error(measured: impl Iterator<Item = f64> + Clone, simulated: &[f64]) -> f64 {
    let count = simulated.len() as f64;
    let mean = measured.clone().sum::<f64>() / count;
    let size: f64 = measured.clone().map(|m| (m - mean).powi(2)).sum();
    let off: f64 = measured.zip(simulated).map(|(m, s)| (m - s).powi(2)).sum();
    (off / size).sqrt()
}

const BUILDING: Building = Building {
    masses: [1600.0, 3000.0],
    springs: [31e3, 370e3],
    dashpots: [300.0, 500.0],
    friction: [60.0, 40.0],
    yields_at: 80.0 + 290.0 * 3.0,
    over: 4e-4,
    creep: 13.0,
    sharpness: 4.0,
    centring: (70.0, 1e-3),
    push: 20.0,
};

/// A written model of that building; `device` and `effects` are those of the device.
fn written(folder: &Path, columns: &str, device: &str, effects: &str) -> ExtendedRig {
    let nominal = format!(
        r#"
mass = {{ value = 1600, unit = "kg" }}
stiffness = {{ value = 31, unit = "kN/m" }}
damping = {{ value = 300, unit = "N s/m" }}
friction = {{ value = 60, unit = "N" }}
upper_mass = {{ value = 3000, unit = "kg" }}
upper_stiffness = {{ value = 370, unit = "kN/m" }}
upper_damping = {{ value = 500, unit = "N s/m" }}
build_up = {{ value = 0.4, unit = "mm" }}
offset = {{ value = 20, unit = "N" }}
{device}"#
    );
    let tables = ["described", "refitted", "nominal"].map(|name| format!("[{name}]{nominal}"));
    let model = format!(
        "name = \"Frame\"\nkind = \"frame\"\n{columns}\
         columns.upper_drift = {{ column = \"upper\", unit = \"mm\" }}\n{}{effects}\
         [effects.upper_friction]\nforce = {{ value = 40, unit = \"N\" }}\n\
         [effects.centring]\nforce = {{ value = 70, unit = \"N\" }}\n\
         width = {{ value = 1, unit = \"mm\" }}\n",
        tables.concat()
    );
    let path = folder.join("model.toml");
    std::fs::write(&path, model).unwrap();
    ExtendedRig::read(&path).unwrap()
}

/// Whether `model` predicts the columns from a file of the table's motion and of what `given` writes of a row.
fn predicts(
    model: &ExtendedRig,
    folder: &Path,
    given: impl Fn(&[f64; 4]) -> String,
    expected: &[(&str, usize, f64)],
) {
    let rows = BUILDING.shaken(0.6, 1500);
    let mut text = String::from("t,table,volts,drift,upper,force\n");
    for (k, row) in rows.iter().enumerate() {
        let (t, table) = (k as f64 * PERIOD, 1e3 * row[0]);
        writeln!(text, "{t:.2},{table:.7},{}", given(row)).unwrap();
    }
    let file = folder.join("later.csv");
    std::fs::write(&file, text).unwrap();
    let found = model.predict(&file, false).unwrap();
    assert_eq!(found.columns.len(), expected.len());
    for (column, (name, place, unit)) in found.columns.iter().zip(expected) {
        assert_eq!(column.channel, *name);
        let own = error(rows.iter().map(|row| unit * row[*place]), &column.rows);
        assert!(own < 0.02, "{name}: {own}");
    }
}

#[test]
fn a_written_model_predicts_drifts_and_force_from_table_and_voltage_alone() {
    let folder = tempfile::tempdir().unwrap();
    let model = written(
        folder.path(),
        COLUMNS,
        "device_friction = { value = 80, unit = \"N\" }\n\
         friction_by_command = { value = 290, unit = \"N/V\" }\n",
        "[effects.device_creep]\nrate = { value = 13, unit = \"1/s\" }\n\
         exponent = { value = 4, unit = \"1\" }\n",
    );
    let expected = [
        ("drift", 1, 1e3),
        ("upper_drift", 2, 1e3),
        ("force", 3, 1.0),
    ];
    predicts(&model, folder.path(), |_| "3,,,".to_owned(), &expected);
}

#[test]
fn a_recorded_force_of_a_device_acts_as_it_was_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let columns = COLUMNS
        .replace("columns.force", "columns.device_force")
        .replace(
            "columns.command = { column = \"volts\", unit = \"V\" }\n",
            "",
        );
    let model = written(folder.path(), &columns, "", "");
    let expected = [("drift", 1, 1e3), ("upper_drift", 2, 1e3)];
    let given = |row: &[f64; 4]| format!(",,,{:.4}", row[3]);
    predicts(&model, folder.path(), given, &expected);
}

fn description(folder: &Path, late: usize) -> Description {
    let mut files = Vec::new();
    for (i, (tone, volts)) in [(0.6, 0.0), (0.6, 3.0), (0.85, 1.5)]
        .into_iter()
        .enumerate()
    {
        let building = Building {
            masses: [1600.0, 1.0],
            springs: [31e3, 0.0],
            dashpots: [900.0, 0.0],
            friction: [0.0, 0.0],
            yields_at: 80.0 + 100.0 * volts,
            over: 4e-4,
            creep: 0.0,
            sharpness: 0.0,
            centring: (0.0, 1.0),
            push: 0.0,
        };
        let rows = building.shaken(tone, 1000);
        let mut text = String::from("t,table,volts,drift,force\n");
        for (k, row) in rows.iter().enumerate() {
            // Noises that do not repeat each other.
            let noise = |by: f64| (k as f64 * by).sin() * (k as f64 * 13.31 * by).cos();
            let force = rows[k.saturating_sub(late)][3] + 2.0 * noise(31.7);
            let drift = 1e3 * row[1] + 0.02 * noise(91.7);
            let (t, table) = (k as f64 * PERIOD, 1e3 * row[0]);
            writeln!(text, "{t:.2},{table:.6},{volts},{drift:.5},{force:.4}").unwrap();
        }
        let name = format!("motion_{i}.csv");
        std::fs::write(folder.join(&name), text).unwrap();
        files.push(format!("\"{name}\""));
    }
    let text = format!(
        "name = \"Frame\"\nkind = \"frame\"\ndata = [{}]\n{COLUMNS}\
         left_out.files = [\"motion_2.csv\"]\n[nominal]\n\
         mass = {{ value = 1600, unit = \"kg\" }}\n\
         stiffness = {{ value = 28, plus_minus = 5, unit = \"kN/m\" }}\n\
         damping = {{ value = 500, plus_minus = 400, unit = \"N s/m\" }}\n\
         device_friction = {{ value = 50, plus_minus = 40, unit = \"N\" }}\n\
         friction_by_command = {{ value = 60, plus_minus = 50, unit = \"N/V\" }}\n\
         build_up = {{ value = 0.6, plus_minus = 0.5, unit = \"mm\" }}\n",
        files.join(", ")
    );
    let path = folder.join("frame.toml");
    std::fs::write(&path, text).unwrap();
    Description::read(&path).unwrap()
}

#[test]
fn another_motion_and_voltage_are_predicted_and_a_late_force_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let description = description(folder.path(), 2);
    let measurement = description.measurement(&[]).unwrap();
    let found = diagnose(&description, &measurement, Observer::none()).unwrap();
    assert_eq!(found.verdict, Verdict::Named, "{:?}", found.named);
    assert_eq!(found.named, ["force_delay"]);
    assert_eq!(found.output, "drift and force");
    let delay = &found.confirmed.effects[0].1[0];
    assert!((delay.value - 0.02).abs() < 5e-4, "{delay:?}");
    assert!(found.confirmed.error < 0.03, "{}", found.confirmed.error);
    for (name, value) in [("stiffness", 31e3), ("friction_by_command", 100.0)] {
        let mut own = found.confirmed.parameters.iter();
        let own = own.find(|own| own.name == name).unwrap();
        assert!((own.value / value - 1.0).abs() < 0.03, "{own:?}");
    }
    for name in ["drift", "force"] {
        let start = format!("error of {name} on the held-out data: ");
        let own = found
            .findings
            .iter()
            .find_map(|own| own.strip_prefix(&start));
        let percent: f64 = own.unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!(percent < 3.0, "{name}: {percent}");
    }
}
