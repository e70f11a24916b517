//! Scratch: self-made cases.
use identification::case::*;
use identification::catalogue::*;
use identification::diagnosis::*;
use identification::predictor::*;
use plant::identified_rig::*;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
type R = rand_chacha::ChaCha8Rng;

fn reference(kind: usize, peak: f64, n: usize, h: f64, rng: &mut R) -> Vec<f64> {
    let mut r = vec![0.0; n];
    let tau = std::f64::consts::TAU;
    match kind {
        0 => {
            for i in 0..40 {
                let f = 0.15 * (60.0f64).powf(i as f64 / 39.0);
                let p: f64 = rng.random::<f64>() * tau;
                let a = 1.0 / (1.0 + f * f * 0.3);
                for k in 0..n {
                    r[k] += a * (tau * f * k as f64 * h + p).sin();
                }
            }
        }
        1 => {
            let mut phase = 0.0f64;
            for k in 0..n {
                let t = k as f64 / n as f64;
                let f = 0.2 * (60.0f64).powf(t);
                phase += tau * f * h;
                r[k] = phase.sin() / (1.0 + f * f * 0.2);
            }
        }
        2 => {
            let f = 0.4 + rng.random::<f64>();
            for k in 0..n {
                let c = (k as f64 * h * f) % 1.0;
                r[k] = if c < 0.25 {
                    4.0 * c
                } else if c < 0.75 {
                    2.0 - 4.0 * c
                } else {
                    4.0 * c - 4.0
                };
            }
            let mut y = 0.0;
            for k in 0..n {
                y += 0.05 * (r[k] - y);
                r[k] = y;
            }
        }
        _ => {
            let (mut a, mut v, mut d) = (0.0, 0.0, 0.0);
            for k in 0..n {
                let t = k as f64 * h;
                let env = (t / 2.0).min(1.0) * (-(t - 6.0).max(0.0) / 5.0).exp();
                let w: f64 = rng.sample(StandardNormal);
                a += 0.2 * (w * env - a);
                v += h * (a - 1.5 * v);
                d += h * (v - 1.5 * d);
                r[k] = d;
            }
        }
    }
    let ramp = 250;
    for k in 0..ramp {
        let w = k as f64 / ramp as f64;
        r[k] *= w * w * (3.0 - 2.0 * w);
    }
    let m = r.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    for x in &mut r {
        *x *= peak / m;
    }
    r
}

fn outside(
    kind: usize,
    s: f64,
    k: usize,
    st: &mut IdentifiedRigState,
    u: &mut f64,
    y: &mut [f64; 4],
    h: f64,
    m: f64,
) {
    let inch = 0.0254;
    let (x, v) = (st.continuous[3], st.continuous[4]);
    let lbf = 4.448;
    match kind {
        0 => st.continuous[4] -= h / m * s * 0.02 * lbf * (v / inch) * (v / inch).abs(), // quadratic damping
        1 => *u *= 1.0 - s * 0.15 * (x / inch) * (x / inch), // position dependent gain
        2 => *u *= 1.0 + s * 0.1 * (k as f64 * h / 20.0),    // gain drifting
        3 => y[0] += s * 0.03 * x * (x / inch) * (x / inch), // nonlinear LVDT
        4 => st.continuous[4] += h / m * s * 0.7 * lbf * (18.8 * k as f64 * h).sin(), // 3 Hz force
        5 => *u -= s * 0.1 * (*u / 0.3).tanh(),              // soft dead band
        6 => y[2] += s * 0.05 * m * y[1],                    // load cell crosstalk
        7 => {
            st.continuous[4] -=
                h / m * s * if v > 0.0 { 1.0 } else { 0.4 } * lbf * (v / 0.00254).tanh()
        } // asymmetric friction
        8 => st.continuous[6] -= h * s * 0.02 * st.continuous[6] * st.continuous[6].abs() / inch, // quadratic specimen damping
        9 => {
            if x > 0.2 * inch {
                st.continuous[4] -= h / m * s * 8.0 * lbf * (x / inch - 0.2)
            }
        } // one-sided spring
        10 => y[0] = (y[0] / (s * 0.004 * inch)).round() * s * 0.004 * inch, // quantised displacement
        _ => y[1] += s * 0.05 * y[1] * y[1].abs() / (50.0 * inch), // nonlinear accelerometer
    }
}

fn make(
    nominal: &Nominal,
    rig: &IdentifiedRig,
    out: Option<(usize, f64)>,
    kind: usize,
    peak: f64,
    noise: f64,
    rng: &mut R,
    name: &str,
) -> Record {
    let h = 1.0 / nominal.sample_rate;
    let n = 10000;
    let law = nominal.controller.unwrap();
    let r = reference(kind, peak * 0.0254, n, h, rng);
    let plant = rig.sample(h, 4).unwrap();
    let mut st = IdentifiedRigState::default();
    let (mut vel, mut int, mut before, mut w) = (0.0, 0.0, 0.0, 0.0f64);
    let phi = (-std::f64::consts::TAU * 30.0 * h).exp();
    let mut rec = Record {
        name: name.into(),
        time: vec![],
        valve_command: vec![],
        channels: Default::default(),
        reference: r.clone(),
    };
    for k in 0..n {
        let mut y = plant.measure(&mut st, k as f64 * h);
        let mut dummy = 0.0;
        if let Some((o, s)) = out {
            if [3, 6, 10, 11].contains(&o) {
                outside(
                    o,
                    s,
                    k,
                    &mut st,
                    &mut dummy,
                    &mut y,
                    h,
                    rig.shake_table.table.mass,
                );
            }
        }
        for i in 0..4 {
            y[i] += noise * nominal.noise[i] * rng.sample::<f64, _>(StandardNormal);
        }
        if k == 0 {
            before = y[0];
        }
        vel += law.velocity_filter * ((y[0] - before) / h - vel);
        before = y[0];
        int += law.integral * (r[k] - y[0]) * h;
        let g = |i: isize| r[i.clamp(0, n as isize - 1) as usize];
        let i = k as isize;
        let u = law.proportional * (r[k] - y[0])
            + int
            + law.velocity_feedforward * (g(i + 1) - g(i - 1)) / (2.0 * h)
            + law.acceleration_feedforward * (g(i + 1) - 2.0 * r[k] + g(i - 1)) / (h * h)
            - law.velocity_feedback * vel
            - law.acceleration_feedback * y[1];
        let u = u.clamp(-law.limit, law.limit);
        rec.time.push(k as f64 * h);
        rec.valve_command
            .push(u + noise * nominal.command_noise * rng.sample::<f64, _>(StandardNormal));
        for i in 0..4 {
            rec.channels[i].push(y[i]);
        }
        w = phi * w
            + 0.004 * noise * (1.0 - phi * phi).sqrt() * rng.sample::<f64, _>(StandardNormal);
        let mut acted = u;
        if let Some((o, s)) = out {
            if ![3, 6, 10, 11].contains(&o) {
                outside(
                    o,
                    s,
                    k,
                    &mut st,
                    &mut acted,
                    &mut y,
                    h,
                    rig.shake_table.table.mass,
                );
            }
        }
        plant.step_disturbed(&mut st, acted, w);
    }
    rec
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (seed0, count, mode) = (
        args[0].parse::<u64>().unwrap(),
        args[1].parse::<u64>().unwrap(),
        args[2].as_str(),
    );
    let noise: f64 = args.get(3).map_or(1.0, |s| s.parse().unwrap());
    let mismatch: f64 = args.get(4).map_or(0.01, |s| s.parse().unwrap());
    let base = Case::read(std::path::Path::new(
        "/work/shared/hidden-effects/cases/dev-01",
    ))
    .unwrap();
    let mut nominal = base.nominal.clone();
    nominal.uncertainty = mismatch;
    let (mut right, mut wrong, mut silent) = (0, 0, 0);
    for seed in seed0..seed0 + count {
        let mut rng = R::seed_from_u64(seed);
        let dummy = ShakeTableModel::new(&nominal, nominal.noise, vec![]);
        let cands = catalogue(2.0, 0.002);
        let nuis: Vec<f64> = (0..15).map(|_| rng.sample(StandardNormal)).collect();
        let mut rig = dummy.rig_without_effects(&nuis);
        let mut truth: Vec<(String, Vec<f64>)> = vec![];
        let how_many = match mode {
            "one" => 1,
            "two" => 2,
            _ => 0,
        };
        while truth.len() < how_many {
            let i = if args.len() > 5 && truth.is_empty() {
                cands.iter().position(|c| c.0.effect == args[5]).unwrap()
            } else if mode == "one" {
                (seed as usize) % cands.len()
            } else {
                rng.random_range(0..cands.len())
            };
            let (c, apply) = &cands[i];
            if truth.iter().any(|t| t.0 == c.effect)
                || (how_many == 2 && c.effect == "specimen_absent")
            {
                continue;
            }
            let strong = |name: &str, weak: f64| -> f64 {
                match (c.effect, name) {
                    ("valve_null_bias", _)
                    | ("accelerometer_bias", _)
                    | ("added_payload", _)
                    | ("mains_hum", _)
                    | ("internal_leakage", _)
                    | ("coulomb_friction", _) => 10.0 * weak,
                    ("valve_dead_band", _) | ("valve_hysteresis", _) => 8.3 * weak,
                    ("valve_flow_gain", _)
                    | ("valve_asymmetric_gain", _)
                    | ("command_delay", _)
                    | ("accelerometer_delay", _)
                    | ("displacement_scale", _)
                    | ("degradation", _) => 5.0 * weak,
                    ("valve_spool_lag", "frequency") => weak / 5.0,
                    ("valve_flow_saturation", _) => weak / 3.2,
                    ("valve_spool_saturation", _) => weak / 2.0,
                    ("supply_pressure_droop", "loss_per_volt") => 4.0 * weak,
                    ("stribeck_friction", "stribeck_force") => 3.75 * weak,
                    ("stribeck_friction", _) => 5.0 * weak,
                    ("oil_column_compliance", _) => 8.0 * weak,
                    ("viscous_damping", _) => 16.0 * weak,
                    ("cubic_stiffness", _) => 15.0 * weak,
                    ("foundation_compliance", "frequency") => weak / 3.0,
                    ("accelerometer_scale", _) | ("load_cell_scale", _) => 6.6 * weak,
                    ("accelerometer_tilt", _) => 12.0 * weak,
                    ("displacement_lag", _) => weak / 6.6,
                    ("load_cell_bias", _) => 13.0 * weak,
                    ("specimen_yielding", "yield_displacement") => weak / 3.4,
                    ("specimen_stiffness", _) => 5.8 * weak,
                    ("specimen_damping", _) => 6.0 * weak,
                    ("specimen_second_mode", "frequency") => weak / 3.0,
                    ("specimen_degradation", "loss") => 5.0 * weak,
                    ("specimen_uplift", "uplift_displacement") => weak / 4.0,
                    _ => 5.0 * weak,
                }
            };
            let p: Vec<f64> = c
                .parameters
                .iter()
                .map(|q| match q.role {
                    Role::Size { weak } => {
                        let s = strong(q.name, weak);
                        let t = 0.15 + 0.85 * rng.random::<f64>();
                        let v = weak * (s / weak).powf(t);
                        if q.bounds.0 < 0.0
                            && c.effect != "specimen_damping"
                            && rng.random::<bool>()
                        {
                            -v
                        } else {
                            v
                        }
                    }
                    Role::Shape { typical, .. } => typical,
                })
                .collect();
            apply(&mut rig, &p);
            truth.push((c.effect.to_string(), p));
        }
        let out = if mode == "outside" {
            let k = (seed as usize) % 12;
            let s = 0.4 * 6.0f64.powf(rng.random::<f64>());
            truth.push((format!("outside {k}"), vec![s]));
            Some((k, s))
        } else {
            None
        };
        let kinds = [rng.random_range(0..4), rng.random_range(0..4)];
        let (p1, p2) = (
            0.6 + 0.5 * rng.random::<f64>(),
            0.5 + 0.6 * rng.random::<f64>(),
        );
        let mut noisy = nominal.clone();
        for s in &mut noisy.noise {
            *s *= noise;
        }
        noisy.command_noise *= noise;
        let id = make(
            &nominal,
            &rig,
            out,
            kinds[0],
            p1,
            noise,
            &mut rng,
            "identification",
        );
        let small = make(&nominal, &rig, out, kinds[0], 0.2, noise, &mut rng, "small");
        let val = make(
            &nominal,
            &rig,
            out,
            kinds[1],
            p2,
            noise,
            &mut rng,
            "validation",
        );
        let h = 1.0 / nominal.sample_rate;
        let recs = [&id, &small, &val];
        let records = recs
            .iter()
            .map(|r| {
                let mut law = nominal.controller.unwrap().commands(
                    &r.reference,
                    &r.channels[0],
                    &r.channels[1],
                    h,
                );
                let l = law.len();
                law[l - 1] = r.valve_command[l - 1];
                law[0] = r.valve_command[0];
                ModelRecord {
                    name: r.name.clone(),
                    with_effects: true,
                    signals: Signals {
                        command: law,
                        channels: (0..r.len())
                            .map(|k| [0, 1, 2, 3].map(|i| r.channels[i][k]))
                            .collect(),
                    },
                }
            })
            .collect();
        let model = ShakeTableModel::new(&noisy, noisy.noise, records);
        let t0 = std::time::Instant::now();
        let Some(j) = judge(&model, &[0, 1], &[2], args.len() > 6) else {
            println!("{seed} FAILED {truth:?}");
            silent += 1;
            continue;
        };
        let mut want: Vec<String> = truth
            .iter()
            .map(|t| t.0.replace("stribeck", "coulomb"))
            .collect();
        want.sort();
        let mut got: Vec<String> = j
            .effects
            .iter()
            .map(|e| e.effect.replace("stribeck", "coulomb"))
            .collect();
        got.sort();
        let outcome = match (j.verdict, mode) {
            (Verdict::Unexplained, "outside") => "right",
            (Verdict::Adequate, "none") => "right",
            (Verdict::Named, "outside" | "none") => "WRONG",
            (Verdict::Named, _) => {
                if got == want {
                    "right"
                } else if got.iter().all(|g| want.contains(g)) {
                    "silent"
                } else {
                    "WRONG"
                }
            }
            _ => "silent",
        };
        match outcome {
            "right" => right += 1,
            "WRONG" => wrong += 1,
            _ => silent += 1,
        }
        println!(
            "{seed} {outcome:6} {:?} kinds {kinds:?} {truth:?}",
            j.verdict
        );
        for e in &j.effects {
            println!(
                "        {} conf {:.3} {}",
                e.effect,
                e.confidence,
                e.parameters
                    .iter()
                    .map(|p| format!("{} {:.5} +- {:.5}; ", p.name, p.value, p.standard_error))
                    .collect::<String>()
            );
        }
        if outcome != "right" {
            println!("        alternatives {:?}", j.alternatives);
        }
        println!(
            "        worst {:.2} {} | {:.2} {}  time {:?}",
            j.tests[0].deviate,
            j.tests[0].what,
            j.tests[1].deviate,
            j.tests[1].what,
            t0.elapsed()
        );
    }
    println!("{mode}: right {right} wrong {wrong} silent {silent}");
}
