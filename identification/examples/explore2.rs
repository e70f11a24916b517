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
    let search = Search { model: &model, records: vec![0, 1], verbose };
    let found = search.run().unwrap();
    let b = found.best.as_ref().unwrap_or(&found.nominal);
    let v = evaluate(&model, &b.fit.point, &[2]).unwrap();
    let c = model.candidates();
    let mut tests = vec![];
    for rec in 0..3 {
        let v = evaluate(&model, &b.fit.point, &[rec]).unwrap();
        let reg = model.regressors(rec);
        tests.extend(adequacy::tests(recs[rec].name.as_str(), &v.residuals, &["x", "a", "F", "as"], &reg));
    }
    tests.sort_by(|a, b| b.deviate.total_cmp(&a.deviate));
    for t in tests.iter().take(4) { println!("    {:.2} {}", t.deviate, t.what); }
    println!("{} {:?} {} fit {:.4} val {:.4} prior {:.1} {:?}", dir, b.effects().iter().map(|i| c[*i].effect).collect::<Vec<_>>(), b.score, b.mean_square(), v.residuals.iter().map(|x| x*x).sum::<f64>() / v.residuals.len() as f64, b.fit.point.prior_cost(c), t0.elapsed());
}
