//! Crossover, stability margins and bandwidth of a loop, from its frequency response.

use std::f64::consts::PI;

use nalgebra::Complex;

use super::log_space;

/// What a loop of negative feedback shows at the frequencies where it is critical.
///
/// A loop may cross a gain of one or a phase of -180 degrees more than once: the margins are the
/// smallest in magnitude, and the crossover is the frequency of that phase margin. A negative gain
/// margin says by how much the gain may be lowered (as with a plant that is unstable by itself).
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Margins {
    /// Where the gain is one, rad/s.
    pub crossover: Option<f64>,
    /// Phase above -180 degrees at the crossover, degrees.
    pub phase_margin_deg: Option<f64>,
    /// Where the phase is -180 degrees, rad/s.
    pub phase_crossover: Option<f64>,
    /// Gain below one at the phase crossover, dB.
    pub gain_margin_db: Option<f64>,
}

/// Points of the grid on which crossings are sought, per decade.
const POINTS_PER_DECADE: f64 = 200.0;

/// A fall of this many decibels ends the bandwidth.
pub const BANDWIDTH_DROP_DB: f64 = 3.0;

/// Margins of the open loop `response(omega)` between the angular frequencies `first` and `last`
/// (rad/s). Crossings are bracketed on a logarithmic grid and refined by bisection to rounding.
///
/// A sampled loop is searched up to its Nyquist frequency, where its response is real: a
/// crossing of -180 degrees at that very end counts.
pub fn margins(response: impl Fn(f64) -> Complex<f64>, first: f64, last: f64) -> Margins {
    let grid = sampled(&response, first, last);
    let mut found = Margins::default();
    for omega in crossings(&grid, &response) {
        let margin = (-response(omega)).arg().to_degrees();
        if found
            .phase_margin_deg
            .is_none_or(|best| margin.abs() < best.abs())
        {
            found.crossover = Some(omega);
            found.phase_margin_deg = Some(margin);
        }
    }
    for pair in grid.windows(2) {
        let [(low, before), (high, after)] = [pair[0], pair[1]];
        if before.im * after.im < 0.0 && before.re.min(after.re) < 0.0 {
            let omega = bisect(low, high, |omega| response(omega).im);
            take_gain_margin(&mut found, omega, response(omega));
        }
    }
    if let Some(&(_, end)) = grid.last()
        && end.im.abs() <= 1e-9 * end.re.abs()
    {
        take_gain_margin(&mut found, last, end);
    }
    found
}

/// Every angular frequency (rad/s) between `first` and `last` at which the gain of the open loop
/// crosses one, ascending.
pub fn crossovers(response: impl Fn(f64) -> Complex<f64>, first: f64, last: f64) -> Vec<f64> {
    crossings(&sampled(&response, first, last), &response)
}

fn crossings(grid: &[(f64, Complex<f64>)], response: &impl Fn(f64) -> Complex<f64>) -> Vec<f64> {
    let above = |value: Complex<f64>| value.norm() - 1.0;
    grid.windows(2)
        .filter(|pair| above(pair[0].1) * above(pair[1].1) < 0.0)
        .map(|pair| bisect(pair[0].0, pair[1].0, |omega| above(response(omega))))
        .collect()
}

fn take_gain_margin(found: &mut Margins, omega: f64, value: Complex<f64>) {
    if value.re >= 0.0 {
        return;
    }
    let margin = -20.0 * value.norm().log10();
    if found
        .gain_margin_db
        .is_none_or(|best| margin.abs() < best.abs())
    {
        found.phase_crossover = Some(omega);
        found.gain_margin_db = Some(margin);
    }
}

/// The lowest angular frequency (rad/s) above `first` at which the gain of the closed loop
/// `response(omega)` falls by [`BANDWIDTH_DROP_DB`] from its value at `lowest`; `None` where it
/// does not fall so far below `last`.
pub fn bandwidth(
    response: impl Fn(f64) -> Complex<f64>,
    lowest: f64,
    first: f64,
    last: f64,
) -> Option<f64> {
    let threshold = response(lowest).norm() * 10f64.powf(-BANDWIDTH_DROP_DB / 20.0);
    let above = |omega: f64| response(omega).norm() - threshold;
    grid(first, last)
        .windows(2)
        .find(|pair| above(pair[0]) >= 0.0 && above(pair[1]) < 0.0)
        .map(|pair| bisect(pair[0], pair[1], above))
}

/// Nyquist frequency of a sampling period (s), rad/s.
pub fn nyquist(period: f64) -> f64 {
    PI / period
}

fn grid(first: f64, last: f64) -> Vec<f64> {
    let count = ((last / first).log10() * POINTS_PER_DECADE).ceil().max(2.0) as usize;
    let mut grid = log_space(first, last, count);
    if let Some(end) = grid.last_mut() {
        *end = last;
    }
    grid
}

fn sampled(
    response: &impl Fn(f64) -> Complex<f64>,
    first: f64,
    last: f64,
) -> Vec<(f64, Complex<f64>)> {
    grid(first, last)
        .into_iter()
        .map(|omega| (omega, response(omega)))
        .collect()
}

fn bisect(mut low: f64, mut high: f64, value: impl Fn(f64) -> f64) -> f64 {
    let rising = value(high) > 0.0;
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if (value(middle) > 0.0) == rising {
            high = middle;
        } else {
            low = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_of_a_triple_lag_have_their_closed_form() {
        // k / (s + 1)^3: phase -180 degrees at sqrt(3), where the gain is k / 8; gain one where
        // (1 + w^2)^(3/2) = k.
        let k: f64 = 4.0;
        let response = |omega: f64| k / (Complex::new(1.0, omega)).powi(3);
        let found = margins(response, 1e-3, 1e3);
        let crossover = (k.powf(2.0 / 3.0) - 1.0).sqrt();
        assert!((found.crossover.unwrap() - crossover).abs() < 1e-12);
        let phase_margin = 180.0 - 3.0 * crossover.atan().to_degrees();
        assert!((found.phase_margin_deg.unwrap() - phase_margin).abs() < 1e-10);
        assert!((found.phase_crossover.unwrap() - 3f64.sqrt()).abs() < 1e-12);
        assert!((found.gain_margin_db.unwrap() - 20.0 * 2f64.log10()).abs() < 1e-10);
    }

    #[test]
    fn an_integrator_has_no_gain_margin_and_its_crossover_as_bandwidth() {
        let response = |omega: f64| 7.0 / Complex::new(0.0, omega);
        let found = margins(response, 1e-3, 1e4);
        assert!((found.crossover.unwrap() - 7.0).abs() < 1e-12);
        assert!((found.phase_margin_deg.unwrap() - 90.0).abs() < 1e-10);
        assert_eq!(found.gain_margin_db, None);
        // |7 / (jw + 7)| = 10^(-3/20).
        let expected = 7.0 * (10f64.powf(0.3) - 1.0).sqrt();
        let closed = |omega: f64| 7.0 / Complex::new(7.0, omega);
        assert!((bandwidth(closed, 1e-6, 1e-6, 1e4).unwrap() - expected).abs() < 1e-9);
        assert!(bandwidth(closed, 1e-6, 1e-6, 1.0).is_none());
    }

    #[test]
    fn a_sampled_integrator_meets_minus_one_at_its_nyquist_frequency() {
        let (gain, period) = (300.0, 0.002);
        let response = |omega: f64| gain * period / (Complex::new(0.0, omega * period).exp() - 1.0);
        let found = margins(response, 1e-2, nyquist(period));
        // L(-1) = -gain h / 2.
        let expected = -20.0 * (gain * period / 2.0).log10();
        assert!((found.gain_margin_db.unwrap() - expected).abs() < 1e-9);
    }

    #[test]
    fn of_several_crossovers_the_one_with_the_least_phase_margin_counts() {
        // g w0² / (s (s² + 2 zeta w0 s + w0²)) has a gain of one where W = w² solves
        // W³ - (2 - 4 zeta²) w0² W² + w0⁴ W - g² w0⁴ = 0: made to cross at 2, 3 and sqrt(12) rad/s.
        let [a, b, c] = [4.0, 9.0, 12.0_f64];
        let (sum, pairs, product) = (a + b + c, a * b + b * c + c * a, a * b * c);
        let square = pairs.sqrt();
        let zeta = ((2.0 - sum / square) / 4.0).sqrt();
        let gain = (product / pairs).sqrt();
        let response = |omega: f64| {
            let s = Complex::new(0.0, omega);
            gain * square / (s * (s * s + s * (2.0 * zeta * square.sqrt()) + square))
        };
        let all = crossovers(response, 1e-2, 1e2);
        assert_eq!(all.len(), 3);
        for (got, expected) in all.iter().zip([a, b, c].map(f64::sqrt)) {
            assert!((got - expected).abs() < 1e-9, "{got} {expected}");
        }
        let margin = |w: f64| {
            let lag = (2.0 * zeta * square.sqrt() * w).atan2(square - w * w);
            90.0 - lag.to_degrees()
        };
        let found = margins(response, 1e-2, 1e2);
        assert!((found.crossover.unwrap() - c.sqrt()).abs() < 1e-9);
        assert!((found.phase_margin_deg.unwrap() - margin(c.sqrt())).abs() < 1e-9);
        // With a lead that makes up for the resonance, the first crossover has the least margin.
        let with_lead = |omega: f64| {
            let turn = Complex::from_polar(1.0, 1.1 * (omega - 2.0) - 0.9);
            response(omega) * turn
        };
        let found = margins(with_lead, 1e-2, 3.9);
        assert!((found.crossover.unwrap() - 2.0).abs() < 1e-9);
        let expected = margin(2.0) - 0.9_f64.to_degrees();
        assert!((found.phase_margin_deg.unwrap() - expected).abs() < 1e-9);
    }

    #[test]
    fn of_two_phase_crossovers_the_nearer_gain_margin_counts() {
        // k (s + 1)² / (s³ (s/p + 1)²) is at -180 degrees where w² - (p - 1) w + p = 0: its gain may
        // neither fall below the one nor rise above the other.
        let p: f64 = 20.0;
        let root = ((p - 1.0) * (p - 1.0) - 4.0 * p).sqrt();
        let [low, high] = [(p - 1.0 - root) / 2.0, (p - 1.0 + root) / 2.0];
        let magnitude = |w: f64| (1.0 + w * w) / (w.powi(3) * (1.0 + (w / p).powi(2)));
        for (k, nearer) in [(1.5 / magnitude(low), low), (0.5 / magnitude(high), high)] {
            let response = |omega: f64| {
                let s = Complex::new(0.0, omega);
                k * (s + 1.0).powi(2) / (s.powi(3) * (s / p + 1.0).powi(2))
            };
            let found = margins(response, 1e-2, 1e3);
            assert!((found.phase_crossover.unwrap() - nearer).abs() < 1e-6 * nearer);
            let expected = -20.0 * (k * magnitude(nearer)).log10();
            assert!((found.gain_margin_db.unwrap() - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn the_bandwidth_ends_at_the_first_fall() {
        // A notch falls by 3 dB before its frequency and comes back behind it.
        let (w0, zeta) = (10.0, 0.4);
        let response = |omega: f64| {
            let x = w0 * w0 - omega * omega;
            Complex::new(x, 0.0) / Complex::new(x, 2.0 * zeta * w0 * omega)
        };
        // |x| = y / sqrt(10^0.3 - 1).
        let own = zeta / (10f64.powf(0.3) - 1.0).sqrt();
        let expected = w0 * ((1.0 + own * own).sqrt() - own);
        let got = bandwidth(response, 1e-6, 1e-2, 1e3).unwrap();
        assert!((got - expected).abs() < 1e-9, "{got} {expected}");
    }
}
