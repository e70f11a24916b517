use std::path::Path;
fn main() {
    for path in std::env::args().skip(1) {
        let start = std::time::Instant::now();
        let d = identification::rigs::Description::read(Path::new(&path)).unwrap();
        let m = d.measurement(&[]).unwrap();
        let r = identification::rigs::diagnose(&d, &m, true).unwrap();
        println!("{}: {} {:?} not confirmed {:?} unexplained {:.3} [{:.1?}]", r.name, r.verdict, r.named, r.not_confirmed, r.unexplained, start.elapsed());
        for p in [&r.as_described, &r.swapped] {
            println!("nominal {:.4} refit {:.4} ext {:.4} (fitted {:.4}) gain {:?} rivals {:?}", p.nominal_error, p.refitted_error, p.extended_error, p.fitted_error, p.gain_interval, p.rivals);
            for v in &p.parameters { println!("   {} {:.5e} ± {:.1e} {}", v.name, v.value, v.standard_error, v.unit); }
            for e in &p.effects { println!("  {} conf {:.3} share {:.3}", e.effect, e.confidence, e.share);
              for v in &e.parameters { println!("     {} {:.5e} ± {:.1e} {}", v.name, v.value, v.standard_error, v.unit); } }
        }
    }
}
