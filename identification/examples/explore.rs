//! Scratch.
use identification::case::*;
use identification::predictor::*;
use plant::identified_rig::*;
use nalgebra::{DMatrix, DVector};

fn build(n: &Nominal, p: &[f64]) -> IdentifiedRig {
    let mut t = n.shake_table; let mut s = n.specimen;
    let u = n.uncertainty;
    for i in 0..3 { t.actuator.denominator[i] *= 1.0 + u*p[i]; t.actuator.voltage_to_force[i] *= 1.0 + u*p[3+i]; t.actuator.velocity_to_force[i] *= 1.0+u*p[6+i]; }
    t.table.mass *= 1.0+u*p[9]; t.table.damping *= 1.0+u*p[10]; t.table.stiffness *= 1.0+u*p[11];
    if let Some(s) = &mut s { s.mass *= 1.0+u*p[12]; s.damping *= 1.0+u*p[13]; s.stiffness *= 1.0+u*p[14]; }
    IdentifiedRig { shake_table: t, specimen: s, ..Default::default() }
}
fn main() {
    let mut args = std::env::args().skip(1);
    let dir = args.next().unwrap();
    let extra = args.next().unwrap_or_default();
    let case = Case::read(std::path::Path::new(&dir)).unwrap();
    let n = &case.nominal;
    let h = 1.0 / n.sample_rate;
    let recs: Vec<&Record> = [Some(&case.identification), case.small.as_ref(), Some(&case.validation)].into_iter().flatten().collect();
    let sig: Vec<Signals> = recs.iter().map(|r| { 
        let mut law = n.controller.unwrap().commands(&r.reference, &r.channels[0], &r.channels[1], h);
        let l = law.len(); law[l-1] = r.valve_command[l-1]; law[0] = r.valve_command[0];
        Signals { command: law, channels: (0..r.len()).map(|k| [0,1,2,3].map(|i| r.channels[i][k])).collect() } }).collect();
    // extra params: name:start
    let ex: Vec<(String, f64)> = extra.split(',').filter(|s| !s.is_empty()).map(|s| { let (a, b) = s.split_once(':').unwrap(); (a.to_string(), b.parse().unwrap()) }).collect();
    let in_ = 0.0254; let lbf = 4.4482216152605;
    let make = |p: &[f64]| {
        let mut rig = build(n, p);
        for (i, (name, _)) in ex.iter().enumerate() {
            let v = p[15 + i];
            let e = &mut rig.effects;
            match name.as_str() {
                "db" => e.valve.dead_band = v,
                "fc" => e.friction.coulomb_force = v * lbf,
                "vs" => e.friction.transition_velocity = v.exp() * in_,
                "nb" => e.valve.null_bias = v,
                "fg" => e.valve.flow_gain = v,
                "pm" => e.table.added_mass = v,
                "dy" => e.specimen.yield_displacement = v.max(0.01) * in_,
                "al" => e.specimen.yield_post_ratio = v,
                "ny" => e.specimen.yield_exponent = v.max(0.2),
                "tilt" => rig.sensors.accelerometer_tilt = v / in_,
                "sm" => e.specimen.second_mode_frequency = v,
                "sd" => e.specimen.second_mode_damping_ratio = v,
                "ms" => e.specimen.second_mode_mass_share = v,
                "lk" => e.hydraulics.leakage = v / lbf,
                "st" => e.hydraulics.stall_force = v * lbf,
                "ad" => rig.sensors.accelerometer_delay = v,
                _ => panic!("{name}"),
            }
        }
        rig
    };
    for q in [8.3e-3] {
    let mut pred = Predictor::design(&build(n, &[0.0;15]), h, n.noise, Disturbance { sigma: q, phi: 0.0 }).unwrap();
    let np = 15 + ex.len();
    let run = |p: &[f64]| -> Vec<Vec<f64>> { let s = pred.sample(&make(p)).unwrap(); sig.iter().map(|g| { let mut o = vec![0.0; 4 * g.command.len()]; if !pred.innovations(&s, g, &mut o) { println!("nonfinite"); } o }).collect() };
    let mut p = vec![0.0; np];
    for (i, (_, v)) in ex.iter().enumerate() { p[15 + i] = *v; }
    let report = |r: &Vec<Vec<f64>>| { for (g, rec) in r.iter().zip(&recs) { 
        let mut s = [0.0; 4]; let mut ac = [0.0; 4]; for k in 0..g.len()/4 { for i in 0..4 { s[i] += g[4*k+i].powi(2); if k > 0 { ac[i] += g[4*k+i]*g[4*k-4+i]; } } }
        let nn = (g.len()/4) as f64;
        println!("   {:15} {:?} ac {:?}", rec.name, s.map(|s| ((s/nn)*1e4).round()/1e4), [0,1,2,3].map(|i| (ac[i]/s[i]*1e4).round()/1e4)); } };
    println!("q {q}"); 
    let mut r = run(&p);
    report(&r);
    for _ in 0..6 {
        let cost = |r: &Vec<Vec<f64>>, p: &[f64]| r[..2].iter().flatten().map(|x| x*x).sum::<f64>() + p[..15].iter().map(|x| x*x).sum::<f64>();
        let c0 = cost(&r, &p);
        let cols: Vec<Vec<Vec<f64>>> = (0..np).map(|i| { let mut pp = p.clone(); let d = if i < 15 { 0.01 } else { 1e-4 * p[i].abs().max(1e-4) }; pp[i] += d; let mut rr = run(&pp); for (a, b) in rr.iter_mut().zip(&r) { for (x, y) in a.iter_mut().zip(b) { *x = (*x - y) / d; } } rr }).collect();
        let mut hm = DMatrix::<f64>::zeros(np, np); let mut gv = DVector::<f64>::zeros(np);
        for i in 0..np { for j in 0..=i { let v: f64 = (0..2).map(|k| cols[i][k].iter().zip(&cols[j][k]).map(|(a, b)| a*b).sum::<f64>()).sum(); hm[(i,j)] = v; hm[(j,i)] = v; }
            gv[i] = -(0..2).map(|k| cols[i][k].iter().zip(&r[k]).map(|(a, b)| a*b).sum::<f64>()).sum::<f64>(); }
        for i in 0..15 { hm[(i,i)] += 1.0; gv[i] -= p[i]; }
        let cov = hm.clone().try_inverse().unwrap();
        let d = hm.lu().solve(&gv).unwrap();
        let mut step = (3.0 / d.rows(0, 15).amax()).min(1.0);
        loop { let pn: Vec<f64> = (0..np).map(|i| p[i] + step * d[i]).collect(); let rn = run(&pn); if cost(&rn, &pn) < c0 || step < 0.05 { p = pn; r = rn; break; } step *= 0.4; }
        println!("  cost {c0:.1} -> {:.1} step {step} extra {:?} se {:?}", cost(&r, &p), &p[15..], (15..np).map(|i| cov[(i,i)].sqrt()).collect::<Vec<_>>());
        if (c0 - cost(&r, &p)).abs() < 0.1 { break; }
    }
    report(&r);
    for (sg, tau) in [(0.0045,0.004),(0.004,0.004),(0.004,0.005),(0.0042,0.0045),(0.005,0.003),(0.0045,0.003),(0.004,0.006),(0.0035,0.006)] {
        let phi = if tau == 0.0 { 0.0 } else { (-h / tau as f64).exp() };
        let pred = Predictor::design(&make(&p), h, n.noise, Disturbance { sigma: sg, phi }).unwrap();
        let s = pred.sample(&make(&p)).unwrap();
        let rr: Vec<Vec<f64>> = sig.iter().map(|g| { let mut o = vec![0.0; 4 * g.command.len()]; pred.innovations(&s, g, &mut o); o }).collect();
        let ll: Vec<f64> = rr.iter().map(|o| { o.iter().map(|x| x*x).sum::<f64>() + o.len() as f64 / 4.0 * pred.log_determinant }).collect();
        println!("  sg {sg} tau {tau} -2ll {:?} {:.1}", ll.iter().map(|x| x.round()).collect::<Vec<_>>(), ll.iter().sum::<f64>());
        report(&rr);
    }
    println!("  nuis {:?}", p[..15].iter().map(|x| (x*100.0).round()/100.0).collect::<Vec<_>>());
    }
}
