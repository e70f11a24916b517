//! Margins, bandwidth and stability of a loop, continuous and as sampled.

use controllers::loops::{Loop, Time};
use serde::Serialize;
use units::constants::SAMPLING_PERIOD;

use super::loops::{LoopName, NamedLoop};

/// Lowest frequency that is looked at, rad/s: a decade below the slow zero of the plant.
const LOWEST: f64 = 1e-3;
/// Lower edge of the band of the motions, rad/s: 0.25 Hz.
const BAND: f64 = std::f64::consts::TAU * 0.25;

/// Margins of a loop.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// Whether every closed-loop pole decays.
    pub stable: bool,
    /// That of the phase margin.
    pub crossover_rad_s: Option<f64>,
    /// All crossovers, ascending; the margin is smallest at the one above.
    pub crossovers_rad_s: Vec<f64>,
    /// The smallest in magnitude.
    pub phase_margin_deg: Option<f64>,
    /// That of the gain margin.
    pub phase_crossover_rad_s: Option<f64>,
    /// The smallest in magnitude.
    pub gain_margin_db: Option<f64>,
    /// Where the closed loop has fallen by 3 dB, sought from the band of the motions upwards; absent
    /// where the loop is unstable or does not fall so far below the Nyquist frequency.
    pub bandwidth_hz: Option<f64>,
    /// The same sought from frequency zero upwards: feedforward beside feedback can leave a dip
    /// far below the band.
    pub bandwidth_from_zero_hz: Option<f64>,
    /// The closed-loop pole nearest to instability (or farthest in it): real and imaginary part,
    /// in 1/s, as sampled in the z plane.
    pub critical_pole: [f64; 2],
}

/// A loop's figures.
#[derive(Debug, Clone, Serialize)]
pub struct LoopFigures {
    /// The loop.
    pub name: LoopName,
    /// In continuous time.
    #[serde(flatten)]
    pub continuous: Figures,
    /// As sampled.
    pub sampled: Figures,
    /// s.
    pub sampling_period_s: f64,
    /// What the reader should know; may be empty.
    pub note: String,
}

impl LoopFigures {
    /// Of a loop.
    pub(super) fn of(one: &NamedLoop) -> Self {
        let [continuous, sampled] =
            [Time::Continuous, Time::Sampled].map(|time| figures(&one.rig_loop, time));
        let mut note = String::new();
        if continuous.stable && !sampled.stable {
            let [re, im] = sampled.critical_pole;
            note = format!(
                "stable in continuous time only; sampled at {} Hz it is unstable (a pole at |z| = {:.2})",
                1.0 / SAMPLING_PERIOD,
                re.hypot(im)
            );
        } else if !continuous.stable {
            note = "unstable".to_string();
        }
        Self {
            name: one.name,
            continuous,
            sampled,
            sampling_period_s: SAMPLING_PERIOD,
            note,
        }
    }
}

fn figures(rig_loop: &Loop, time: Time) -> Figures {
    let margins = rig_loop.margins(time, LOWEST);
    let poles = rig_loop.closed_loop_poles(time);
    let growth = |pole: &nalgebra::Complex<f64>| match time {
        Time::Continuous => pole.re,
        Time::Sampled => pole.norm(),
    };
    let critical = poles.iter().max_by(|a, b| growth(a).total_cmp(&growth(b)));
    let stable = rig_loop.is_stable(time);
    let bandwidth = |from| {
        let found = stable
            .then(|| rig_loop.bandwidth(time, LOWEST, from))
            .flatten();
        found.map(|omega| omega / std::f64::consts::TAU)
    };
    Figures {
        stable,
        crossover_rad_s: margins.crossover,
        crossovers_rad_s: rig_loop.crossovers(time, LOWEST),
        phase_margin_deg: margins.phase_margin_deg,
        phase_crossover_rad_s: margins.phase_crossover,
        gain_margin_db: margins.gain_margin_db,
        bandwidth_hz: bandwidth(BAND),
        bandwidth_from_zero_hz: bandwidth(LOWEST),
        critical_pole: critical.map_or([0.0; 2], |pole| [pole.re, pole.im]),
    }
}
