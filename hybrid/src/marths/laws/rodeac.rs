//! Robust decentralised adaptive compensation: M. E. Quiroz, C. Galmez and G. A. Fermandois, Frontiers
//! in Built Environment 10 (2024) 1394952.
//!
//! Each actuator alone has a filter of four taps on its target. Recursive least squares fit the
//! same taps from measured strokes to commands, both behind a low-pass.

use super::Law;
use crate::marths::Pair;

const TAPS: usize = 4;
const FORGETTING: f64 = 1.0;

/// Butterworth low-pass of order 4, 20 Hz at 1024 samples a second, by the bilinear transform.
const LOW_PASS: ([f64; 5], [f64; 4]) = (
    [
        1.213_433_306_582_026e-5,
        4.853_733_226_328_104e-5,
        7.280_599_839_492_156e-5,
        4.853_733_226_328_104e-5,
        1.213_433_306_582_026e-5,
    ],
    [
        -3.679_418_254_290_458_5,
        5.088_644_606_369_255,
        -3.134_517_189_896_432,
        0.725_484_987_146_688_9,
    ],
);

const TAPS_AT_START: [[f64; TAPS]; 2] = [
    [
        5.414_703_531_415_922,
        1.962_806_653_915_435,
        -1.504_825_259_667_864_8,
        -4.957_763_803_987_514,
    ],
    [
        6.058_172_628_218_169,
        2.199_815_746_544_868_7,
        -1.674_597_634_216_496_3,
        -5.538_499_858_188_244,
    ],
];

/// Covariance at the start as the published program uses it, 1/mm^2. It was calibrated in 1/m^2; the
/// larger one is what lets the law adapt.
const COVARIANCE_AT_START: [[[f64; TAPS]; TAPS]; 2] = [
    [
        [
            83906.42815747605,
            -45046.00810957712,
            -27999.32600478411,
            -10761.293403738875,
        ],
        [
            -45046.00810957712,
            106712.78321277935,
            -33590.12199030656,
            -27999.85520077352,
        ],
        [
            -27999.32600478411,
            -33590.12199030656,
            106712.89471242572,
            -45046.64880621686,
        ],
        [
            -10761.293403738875,
            -27999.85520077352,
            -45046.64880621686,
            83907.59945955544,
        ],
    ],
    [
        [
            64773.00944011183,
            -51448.243763745406,
            -21629.930497948848,
            8337.191457832922,
        ],
        [
            -51448.243763745406,
            104560.93549403193,
            -31474.353558888834,
            -21630.104009299863,
        ],
        [
            -21629.930497948848,
            -31474.353558888834,
            104561.22622571289,
            -51448.70807688673,
        ],
        [
            8337.191457832922,
            -21630.104009299863,
            -51448.70807688673,
            64773.647579071796,
        ],
    ],
];

/// Square metres over square millimetres.
const METRES: f64 = 1e6;

/// A linear filter whose newest input may come last.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
struct LowPass {
    inputs: [f64; TAPS],
    outputs: [f64; TAPS],
}

impl LowPass {
    /// The output without what the newest input adds.
    fn pending(&self) -> f64 {
        let (ahead, back) = LOW_PASS;
        let of =
            |taps: &[f64], past: &[f64]| -> f64 { taps.iter().zip(past).map(|(a, b)| a * b).sum() };
        of(&ahead[1..], &self.inputs) - of(&back, &self.outputs)
    }

    fn push(&mut self, input: f64) -> f64 {
        let output = LOW_PASS.0[0] * input + self.pending();
        for (past, new) in [(&mut self.inputs, input), (&mut self.outputs, output)] {
            past.rotate_right(1);
            past[0] = new;
        }
        output
    }
}

/// The law of one actuator.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Channel {
    taps: [f64; TAPS],
    covariance: [[f64; TAPS]; TAPS],
    measured: LowPass,
    command: LowPass,
    strokes: [f64; TAPS],
    targets: [f64; TAPS],
}

fn dot(a: &[f64; TAPS], b: &[f64; TAPS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Channel {
    fn of(actuator: usize) -> Self {
        Self {
            taps: TAPS_AT_START[actuator],
            covariance: COVARIANCE_AT_START[actuator].map(|row| row.map(|p| METRES * p)),
            measured: LowPass::default(),
            command: LowPass::default(),
            strokes: [0.0; TAPS],
            targets: [0.0; TAPS],
        }
    }

    fn step(&mut self, target: f64, measured: f64) -> f64 {
        self.targets.rotate_right(1);
        self.targets[0] = target;
        self.strokes.rotate_right(1);
        self.strokes[0] = self.measured.push(measured);
        let (x, r) = (&self.strokes, &self.targets);
        let along: [f64; TAPS] = std::array::from_fn(|i| dot(&self.covariance[i], x));
        let scale = 1.0 / (FORGETTING + dot(&along, x));
        let gain = along.map(|a| a * scale);
        // The new taps act on this command, and the error holds this command behind the filter.
        let error = self.command.pending() - dot(&self.taps, x);
        let by_gain = dot(&gain, r);
        let command = (dot(&self.taps, r) + by_gain * error) / (1.0 - LOW_PASS.0[0] * by_gain);
        let error = self.command.push(command) - dot(&self.taps, x);
        for i in 0..TAPS {
            self.taps[i] += gain[i] * error;
            for j in 0..TAPS {
                self.covariance[i][j] = (self.covariance[i][j] - gain[i] * along[j]) / FORGETTING;
            }
        }
        command
    }
}

/// The benchmark's sample law.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct DecentralisedAdaptive {
    channels: [Channel; 2],
}

impl Default for DecentralisedAdaptive {
    fn default() -> Self {
        Self {
            channels: [0, 1].map(Channel::of),
        }
    }
}

impl Law for DecentralisedAdaptive {
    fn step(&mut self, target: Pair, measured: Pair) -> Pair {
        let [first, second] = &mut self.channels;
        [
            first.step(target[0], measured[0]),
            second.step(target[1], measured[1]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_low_pass_has_unit_gain_at_rest_and_half_power_at_its_corner() {
        let mut filter = LowPass::default();
        let mut last = 0.0;
        for _ in 0..2000 {
            last = filter.push(1.0);
        }
        assert!((last - 1.0).abs() < 1e-9);
        let mut filter = LowPass::default();
        let mut square = 0.0;
        for k in 0..20_480 {
            let t = f64::from(k) / 1024.0;
            let out = filter.push((std::f64::consts::TAU * 20.0 * t).sin());
            if k >= 10_240 {
                square += out * out;
            }
        }
        assert!((square / 10_240.0 - 0.25).abs() < 1e-6, "{square}");
    }

    /// Where the strokes are the commands and all agree with the taps, nothing is learned.
    #[test]
    fn without_an_error_the_taps_stay() {
        let mut channel = Channel::of(0);
        channel.taps = [1.0, 0.0, 0.0, 0.0];
        let mut last = 0.0;
        for k in 0..500 {
            let target = 1e-3 * (0.02 * f64::from(k)).sin();
            last = channel.step(target, target);
            assert!((last - target).abs() < 1e-12);
        }
        assert!((channel.taps[0] - 1.0).abs() < 1e-6 && last.is_finite());
    }
}
