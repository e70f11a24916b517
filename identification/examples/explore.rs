//! Scratch.
use identification::case::*;
use plant::identified_rig::*;
fn main() {
    let mut args = std::env::args().skip(1);
    let dir = args.next().unwrap();
    let case = Case::read(std::path::Path::new(&dir)).unwrap();
    let n = &case.nominal;
    let h = 1.0 / n.sample_rate;
    for r in [Some(&case.identification), Some(&case.validation), case.small.as_ref()].into_iter().flatten() {
        let law = n.controller.unwrap().commands(&r.reference, &r.channels[0], &r.channels[1], h);
        let d: Vec<f64> = law.iter().zip(&r.valve_command).map(|(a, b)| a - b).collect();
        let sd = (d.iter().map(|x| x * x).sum::<f64>() / d.len() as f64).sqrt();
        println!("{} n {} R5 sd {:.5} first {:?} last {:?}", r.name, r.len(), sd, &d[..4], &d[d.len() - 4..]);
        let rms = |v: &[f64]| (v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64).sqrt();
        let peak = |v: &[f64]| v.iter().fold(0.0f64, |a, x| a.max(x.abs()));
        println!("  u rms {:.3} peak {:.3} x peak {:.3} in a {:.1} F {:.2} as {:.1}", rms(&r.valve_command), peak(&r.valve_command), peak(&r.channels[0])/0.0254, peak(&r.channels[1])/0.0254, peak(&r.channels[2])/4.448, peak(&r.channels[3])/0.0254);
        let rig = IdentifiedRig { shake_table: n.shake_table, specimen: n.specimen, ..Default::default() };
        let t0 = std::time::Instant::now();
        for command in [&r.valve_command, &law] {
            let s = rig.sample(h, 1).unwrap();
            let mut st = IdentifiedRigState::default();
            let mut sum = [0.0; 4];
            for k in 0..r.len() {
                let y = s.measure(&mut st, k as f64 * h);
                for i in 0..4 { sum[i] += ((r.channels[i][k] - y[i]) / n.noise[i]).powi(2); }
                s.step(&mut st, command[k]);
            }
            println!("  open loop rms/sigma {:?} {:?}", sum.map(|s| (s / r.len() as f64).sqrt()), t0.elapsed() / 2);
        }
    }
}
