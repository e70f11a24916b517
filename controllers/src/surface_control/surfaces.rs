//! Surfaces one behind the other, with differences or with lags.

use nalgebra::SVector;

use super::Parameters;
use crate::Motion;
use crate::preview::feedback::ALL;

/// What the surfaces remember.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct SurfaceMemory {
    /// Of the oil's force (N) and of the spool (V): what was wanted at the sample before, or what the lag
    /// gives; absent before the first.
    wanted: [Option<f64>; 2],
}

/// What is wanted and its rate: by a difference, or both by a lag of `time` (s).
fn with_rate(memory: &mut Option<f64>, wanted: f64, lag: Option<f64>, period: f64) -> (f64, f64) {
    let before = memory.unwrap_or(wanted);
    match lag {
        None => {
            *memory = Some(wanted);
            (wanted, (wanted - before) / period)
        }
        Some(time) => {
            let filtered = wanted + (before - wanted) * (-period / time).exp();
            *memory = Some(filtered);
            (filtered, (wanted - filtered) / time)
        }
    }
}

/// Command (V) from the estimated states and disturbances.
pub(super) fn command(
    p: &Parameters,
    is_filtered: bool,
    found: &SVector<f64, ALL>,
    reference: &Motion,
    memory: &mut SurfaceMemory,
) -> f64 {
    let (own, table) = (&p.rig.hydraulics, &p.rig.table);
    let [spool, _, oil, x, v, force, offset] = [0, 1, 2, 3, 4, 5, 6].map(|i| found[i]);
    let [k1, k2, k3] = p.reaching_rates;
    let lags = p.filter_times.map(|time| is_filtered.then_some(time));
    let rate = v - reference.velocity;
    let surface = rate + p.surface_rate * (x - reference.displacement);
    let wanted = table.mass * (reference.acceleration - p.surface_rate * rate - k1 * surface)
        + (table.damping + own.seal_damping) * v
        + table.stiffness * x
        - force;
    let (wanted, change) = with_rate(&mut memory.wanted[0], wanted, lags[0], p.period);
    let opening = (change + own.oil_stiffness * v + own.leakage_rate * oil - k2 * (oil - wanted))
        / own.force_rate;
    let (opening, change) = with_rate(&mut memory.wanted[1], opening, lags[1], p.period);
    spool + own.spool_lag * (change - k3 * (spool - opening)) - offset
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_gives_the_rate_of_a_ramp_and_a_difference_gives_it_at_once() {
        let (mut lagged, mut differed) = (None, None);
        let (period, time) = (0.002, 0.01);
        for k in 0..200 {
            let ramp = 7.0 * period * f64::from(k);
            let (value, rate) = with_rate(&mut lagged, ramp, Some(time), period);
            let (same, exact) = with_rate(&mut differed, ramp, None, period);
            assert_eq!(same, ramp);
            if k == 1 {
                assert!((exact - 7.0).abs() < 1e-9 && rate < 6.0);
            }
            if k == 199 {
                // A lag trails a ramp by its time constant, here less half a period nearly.
                assert!((rate - 7.0).abs() < 0.8, "{rate}");
                assert!((ramp - value - time * rate).abs() < 1e-9);
            }
        }
    }
}
