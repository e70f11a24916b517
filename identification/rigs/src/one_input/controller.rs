//! The gain of a controller whose reference, command and displacement were recorded.

use nalgebra::Complex;

use crate::closed_loop::bands::Bands;
use recordings::{Channel, Recording};

/// Longest delay of the reference (s), and the steps in which it is looked for.
const LONGEST: f64 = 0.1;
const STEPS: usize = 400;
/// Share of the command beyond which it is not a gain times the error.
const MOST: f64 = 0.35;

/// `u = C (r(t - D) - y)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Controller {
    /// C, V/m.
    pub gain: f64,
    /// D, s.
    pub delay: f64,
    /// What of the command is not this, as a share of its size, where the reference explains it.
    pub left: f64,
}

impl Controller {
    /// By least squares over the bands of all recordings; none where they lack a channel or the command is
    /// not a gain times the error.
    pub(super) fn of(recordings: &[Recording], band: (f64, f64)) -> Option<Self> {
        let mut lines: Vec<(f64, [Complex<f64>; 3])> = Vec::new();
        for recording in recordings {
            let channel = |of| recording.channel(of);
            let reference = channel(Channel::Reference)?;
            let channels = [
                channel(Channel::ValveCommand)?,
                channel(Channel::Displacement)?,
                reference,
            ];
            let period = recording.period();
            let bands = Bands::new(&recording.name, &[reference], &channels, period, band).ok()?;
            for own in &bands.bands {
                let value = |i: usize| own.projected(i) * bands.scale[i];
                lines.push((own.middle(), [0, 1, 2].map(value)));
            }
        }
        let size: f64 = lines.iter().map(|own| own.1[0].norm_sqr()).sum();
        let at = |delay: f64| {
            let (mut along, mut square) = (0.0, 0.0);
            for (omega, [u, y, r]) in &lines {
                let error = r * Complex::new(0.0, -omega * delay).exp() - y;
                along += (error.conj() * u).re;
                square += error.norm_sqr();
            }
            let gain = along / square;
            let left = (1.0 - gain * along / size).max(0.0).sqrt();
            Self { gain, delay, left }
        };
        let all = (0..=STEPS).map(|i| at(LONGEST * i as f64 / STEPS as f64));
        let best = all.min_by(|a, b| a.left.total_cmp(&b.left))?;
        (best.left < MOST).then_some(best)
    }

    /// For a reader.
    pub(super) fn sentence(&self) -> String {
        format!(
            "the recorded valve_command is {:.3} V/mm times the reference ({:.1} ms late) less the displacement, \
             but for {:.0} % of it: for another proportional gain multiply `loop_gain` and `feedforward` of the \
             model file by the ratio of the gains",
            1e-3 * self.gain,
            1e3 * self.delay,
            100.0 * self.left
        )
    }
}
