//! Fits that carry their derivatives, against those that take them in each iteration.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::sync::atomic::{AtomicUsize, Ordering};

use strangers::dice::Dice;
use sysid::nonlinear::{Coordinate, Derivatives, Effort, Residuals, WHOLE, minimise_with};

/// Sums of exponentials and a constant over time, their errors against a record, and how often they were computed.
struct Decays {
    record: Vec<f64>,
    count: AtomicUsize,
}

fn decays(values: &[f64], k: usize) -> f64 {
    let t = k as f64 / 100.0;
    let parts = values[1..].chunks_exact(2);
    values[0] + parts.map(|own| own[0] * (-own[1] * t).exp()).sum::<f64>()
}

impl Residuals for Decays {
    fn residuals(&self, values: &[f64]) -> Option<Vec<f64>> {
        self.count.fetch_add(1, Ordering::Relaxed);
        let all = self.record.iter().enumerate();
        Some(all.map(|(k, y)| (decays(values, k) - y) / 1e-3).collect())
    }
}

const TRUTH: [f64; 7] = [0.3, 1.0, 0.2, 0.6, 1.8, -1.2, 14.0];

/// Cost, values and number of simulations of a fit from a tenth beside the truth.
fn fit(derivatives: Derivatives) -> (f64, Vec<f64>, usize) {
    let dice = &mut Dice::new(5, 1);
    let record = (0..1000).map(|k| decays(&TRUTH, k) + 1e-3 * dice.gauss());
    let model = Decays {
        record: record.collect(),
        count: AtomicUsize::new(0),
    };
    let coordinates = TRUTH.map(|own| Coordinate {
        start: own * dice.between(0.9, 1.1),
        scale: 0.1 * own.abs(),
        free: true,
        bounds: (f64::NEG_INFINITY, f64::INFINITY),
    });
    let effort = Effort {
        derivatives,
        ..WHOLE
    };
    let found = minimise_with(&model, &coordinates, effort).unwrap();
    assert!(found.converged);
    (found.cost, found.values, model.count.into_inner())
}

#[test]
fn carried_derivatives_end_at_the_same_fit_with_fewer_simulations() {
    let (cost, taken, most) = fit(Derivatives::Taken);
    // A thousand residuals of unit variance less seven parameters.
    assert!(
        (cost - 0.5 * 993.0).abs() < 3.0 * (0.5_f64 * 993.0).sqrt(),
        "{cost}"
    );
    let (own, carried, count) = fit(Derivatives::Carried);
    assert!((own - cost).abs() < 0.1, "{own} {cost}");
    assert!(3 * count < 2 * most, "{count} of {most}");
    // The record's own curve, which is what the data determine.
    for k in 0..1000 {
        let difference = decays(&carried, k) - decays(&taken, k);
        assert!(difference.abs() < 1e-4, "{k}: {difference}");
    }
}
