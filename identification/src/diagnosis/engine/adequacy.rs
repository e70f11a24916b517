//! Is what is left over noise? Every test gives a normal deviate; the largest one decides.

use realfft::RealFftPlanner;

/// One look at the residuals of one record.
#[derive(Debug, Clone, PartialEq)]
pub struct Test {
    /// What was looked at.
    pub what: String,
    /// Normal deviate under "only noise is left".
    pub deviate: f64,
}

/// Edges of the frequency bands as shares of the sampling rate.
const BANDS: [f64; 11] = [
    0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.128, 0.256, 0.5,
];

/// Normal deviate of a sum of squares of `count` standard normal values (Wilson and Hilferty).
pub fn chi_square_deviate(sum: f64, count: f64) -> f64 {
    if count < 1.0 {
        return 0.0;
    }
    let v = 2.0 / (9.0 * count);
    ((sum / count).cbrt() - (1.0 - v)) / v.sqrt()
}

/// Looks at whitened residuals, `channels` a sample, with the channels' names; `regressors` are
/// functions of state and command that a wrong model leaves traces of.
pub fn tests(
    record: &str,
    residuals: &[f64],
    channels: &[&str],
    regressors: &[(String, Vec<f64>)],
) -> Vec<Test> {
    let width = channels.len();
    let n = residuals.len() / width.max(1);
    let mut tests = Vec::new();
    if n < 64 {
        return tests;
    }
    let mut planner = RealFftPlanner::<f64>::new();
    let transform = planner.plan_fft_forward(n);
    for (c, channel) in channels.iter().enumerate() {
        let series: Vec<f64> = residuals.iter().skip(c).step_by(width).copied().collect();
        let energy: f64 = series.iter().map(|r| r * r).sum();
        if energy == 0.0 {
            continue;
        }
        tests.push(Test {
            what: format!("{record}: {channel}, mean square {:.3}", energy / n as f64),
            deviate: chi_square_deviate(energy, n as f64),
        });
        let sum: f64 = series.iter().sum();
        tests.push(Test {
            what: format!("{record}: {channel}, mean"),
            deviate: (sum / (n as f64).sqrt()).abs(),
        });
        let mut time = series.clone();
        let mut spectrum = transform.make_output_vec();
        if transform.process(&mut time, &mut spectrum).is_ok() {
            let mut low = 1;
            for edge in BANDS {
                let high = ((edge * n as f64).round() as usize).min(spectrum.len() - 1);
                if high < low + 2 {
                    continue;
                }
                let power: f64 = spectrum[low..high].iter().map(|z| z.norm_sqr()).sum();
                tests.push(Test {
                    what: format!("{record}: {channel}, below {edge} of the sampling rate"),
                    deviate: chi_square_deviate(2.0 * power / n as f64, 2.0 * (high - low) as f64),
                });
                low = high;
            }
        }
        for (name, regressor) in regressors {
            let size: f64 = regressor.iter().map(|g| g * g).sum();
            let along: f64 = regressor.iter().zip(&series).map(|(g, r)| g * r).sum();
            if size > 0.0 {
                tests.push(Test {
                    what: format!("{record}: {channel} against {name}"),
                    deviate: (along / size.sqrt()).abs(),
                });
            }
        }
    }
    let block = (n / 40).max(16) * width;
    for (i, part) in residuals.chunks_exact(block).enumerate() {
        let energy: f64 = part.iter().map(|r| r * r).sum();
        let live = part.iter().filter(|r| **r != 0.0).count();
        tests.push(Test {
            what: format!("{record}: part {} of 40", i + 1),
            deviate: chi_square_deviate(energy, live as f64),
        });
    }
    tests
}
