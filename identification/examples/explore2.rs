//! Scratch.
use identification::case::*;
use identification::catalogue::*;
use identification::diagnosis::*;
use identification::predictor::*;
use std::time::Instant;

fn main() {
    let mut args = std::env::args().skip(1);
    let dir = args.next().unwrap();
    let verbose = args.next().is_some();
    let case = Case::read(std::path::Path::new(&dir)).unwrap();
    let n = &case.nominal;
    let h = 1.0 / n.sample_rate;
    let recs: Vec<&Record> = [Some(&case.identification), case.small.as_ref(), Some(&case.validation)].into_iter().flatten().collect();
    let records: Vec<ModelRecord> = recs.iter().map(|r| {
        let mut law = n.controller.unwrap().commands(&r.reference, &r.channels[0], &r.channels[1], h);
        let l = law.len(); law[l-1] = r.valve_command[l-1]; law[0] = r.valve_command[0];
        ModelRecord { with_effects: true, signals: Signals { command: law, channels: (0..r.len()).map(|k| [0,1,2,3].map(|i| r.channels[i][k])).collect() } } }).collect();
    let model = ShakeTableModel::new(n, n.noise, records);
    let t0 = Instant::now();
    let origin = Point { nuisance: vec![0.0; model.nuisance()], effects: vec![] };
    let at = [0, 1];
    let base = evaluate(&model, &origin, &at).unwrap();
    println!("origin cost {:.0} {:?}", base.cost, t0.elapsed());
    let jac = Jacobian::at(&model, &base, &at).unwrap();
    println!("jac {:?}", t0.elapsed());
    let m0 = fit(&model, &origin, &at, &jac, 8).unwrap();
    println!("M0 {:.1} {:?}", m0.cost, t0.elapsed());
    let mut all = vec![];
    for (i, c) in model.candidates().iter().enumerate() {
        for s in &c.starts {
            let t = Instant::now();
            let start = Point { nuisance: m0.point.nuisance.iter().map(|_| 0.0).collect(), effects: vec![(i, c.internal(s))] };
            if let Some(f) = fit(&model, &start, &at, &jac, 8) {
                if verbose { println!("   {:25} {:9.1} {:?} {:?}", c.effect, f.cost, c.values(&f.point.effects[0].1), t.elapsed()); }
                all.push((f.cost, i, f));
            } else { println!("   {} failed", c.effect); }
        }
    }
    println!("all {:?}", t0.elapsed());
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut seen = vec![];
    for (_, i, f) in &all {
        if seen.contains(i) { continue; }
        seen.push(*i);
        if seen.len() > 4 { break; }
        let (p, j) = polish(&model, f, &at, 4).unwrap();
        let cov = j.covariance(&model, &p).unwrap();
        let v = evaluate(&model, &p.point, &[2]).unwrap();
        println!(" {:25} {:.1} -> {:.1} prior {:.1} val chi2/N {:.4} fit chi2/N {:.4} {:?} se {:?}", model.candidates()[*i].effect, f.cost, p.cost, p.point.prior_cost(model.candidates()), v.residuals.iter().map(|x| x*x).sum::<f64>() / v.residuals.len() as f64, p.residuals.iter().map(|x| x*x).sum::<f64>() / p.residuals.len() as f64, model.candidates()[*i].values(&p.point.effects[0].1), (model.nuisance()..cov.nrows()).map(|k| cov[(k,k)].sqrt()).collect::<Vec<_>>());
    }
    println!("done {:?}", t0.elapsed());
}
