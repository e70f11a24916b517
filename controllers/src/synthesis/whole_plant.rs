//! Loop shaping for a rig as it is found: the weight takes the oil column's resonance out of the loop
//! as well, lateness and hold are part of the shaped plant, and the crossover that was asked for is
//! the one that the sampled loop reaches.
//!
//! With `w` the target crossover, the plant's poles and zeros are parted by their size:
//!
//! - slower than `w / 30`: left alone, but for zeros that outnumber the poles. Where they leave one
//!   integration over, the weight has `(s + w/30)/s`, else `1/s`;
//! - up to `4 w`: taken out by the weight, mirrored into the left half plane. Zeros in the right half
//!   plane stay;
//! - faster ones stay in the shaped plant, and so does the lateness (Padé, second order).
//!
//! Poles at `5 w` make the weight proper. The shaped plant is stabilised robustly as in
//! [`loop_shaping`](super::loop_shaping), the stable part of the controller reduced to five states
//! at most, and the result written as the form of Eq 3-10 with further sections. What the phase of the
//! fast part costs in crossover is made good by asking for more, until the sampled loop crosses where
//! it should.

use nalgebra::{Complex, DMatrix};
use plant::identified::shake_table::ShakeTable;
use plant::linear::margins::{self, Margins};
use plant::linear::{StateSpace, TransferFunction};

use super::balanced::residualise;
use super::coprime::stabilise;
use super::{GAMMA_FACTOR, no_solution, polynomial};
use crate::loop_shaping::{LoopShaping, LoopShapingCoefficients, SECTIONS, Section};
use crate::pid::PidInput;
use crate::robustness::{Heard, LateRig, OpenLoop, Pushed};
use crate::{Controller, ModelError};

/// Poles and zeros slower than the crossover over this are left alone.
const SLOW: f64 = 30.0;
/// Those up to so many crossovers are taken out.
const FAST: f64 = 4.0;
/// Poles that make the weight proper, in crossovers.
const ROLL_OFF: f64 = 5.0;
/// Most states of the reduced controller beside its integrator: one of the form of Eq 3-10, two a
/// further section.
const STATES: usize = 1 + 2 * SECTIONS;
/// The crossover that is reached differs from the target by no more than this part of it.
const TOLERANCE: f64 = 0.02;

/// A rig to be shaped.
#[derive(Debug, Clone)]
pub struct Shaped<'a> {
    /// Actuator and table.
    pub rig: &'a ShakeTable,
    /// Lateness of what is measured, s.
    pub late: f64,
    /// One standard deviation of the measured displacement's white noise, m.
    pub noise: f64,
    /// Sampling period, s.
    pub period: f64,
}

/// A loop-shaping controller and what its sampled loop reaches.
#[derive(Debug, Clone)]
pub struct WholePlantDesign {
    /// Crossover that was asked for, rad/s.
    pub target: f64,
    /// Crossover that the sampled loop reaches, rad/s.
    pub reached: f64,
    /// Smallest bound that a controller of full order can reach for the shaped plant.
    pub gamma_min: f64,
    /// Margins of the sampled loop.
    pub margins: Margins,
    /// Largest magnitude of its sensitivity.
    pub peak_sensitivity: f64,
    /// The law.
    pub law: LoopShaping,
}

/// Poles, zeros and gain.
#[derive(Debug, Clone, Default)]
struct Factors {
    zeros: Vec<Complex<f64>>,
    poles: Vec<Complex<f64>>,
}

impl Factors {
    /// The transfer function, its magnitude at `s = j` set to one; time in `1/crossover`.
    fn scaled(&self, crossover: f64) -> TransferFunction {
        let scale = |roots: &[Complex<f64>]| -> Vec<Complex<f64>> {
            roots.iter().map(|root| root / crossover).collect()
        };
        let (numerator, denominator) = (
            polynomial(&scale(&self.zeros)),
            polynomial(&scale(&self.poles)),
        );
        let own = TransferFunction {
            numerator,
            denominator,
        };
        let size = own.evaluate(Complex::new(0.0, 1.0)).norm();
        TransferFunction {
            numerator: own.numerator.iter().map(|v| v / size).collect(),
            denominator: own.denominator,
        }
    }
}

impl Shaped<'_> {
    /// The controller whose sampled loop crosses at `crossover` rad/s.
    ///
    /// # Errors
    /// A crossover that the rig's lateness or resonances do not allow, with what was reached.
    pub fn design(&self, crossover: f64) -> Result<WholePlantDesign, ModelError> {
        ModelError::require_positive("crossover", crossover)?;
        self.rig.validate()?;
        let late_rig = LateRig::new(&self.rig.state_space(), self.late, self.period)?;
        let mut asked = crossover;
        let mut best: Option<f64> = None;
        let mut reason = String::new();
        for _ in 0..12 {
            let (law, gamma_min) = match self.shape(asked) {
                Ok(found) => found,
                Err(error) => {
                    reason = format!(" ({error})");
                    break;
                }
            };
            let open = self.open_loop(&late_rig, &law);
            let Some(reached) = open.first_crossover() else {
                break;
            };
            if best.is_none_or(|own| (own - crossover).abs() > (reached - crossover).abs()) {
                best = Some(reached);
            }
            if (reached / crossover - 1.0).abs() < TOLERANCE {
                return self.finished(crossover, reached, gamma_min, law, &late_rig, &open);
            }
            asked *= (crossover / reached).clamp(0.5, 2.0);
        }
        let most = best.map_or(String::new(), |best| {
            format!("; the nearest crossover reached is {best:.3}")
        });
        Err(no_solution(format!(
            "no controller crosses at {crossover:.4} rad/s{most}{reason}"
        )))
    }

    /// The fastest controller whose sampled loop keeps a gain margin of 6 dB and a phase margin of
    /// 45 degrees, and which makes no more than a hundredth of the valve's range (root mean square)
    /// of the measurement's noise: crossovers are tried from the inverse of the lateness downwards.
    ///
    /// # Errors
    /// No such controller down to a fiftieth of that.
    pub fn fastest(&self) -> Result<WholePlantDesign, ModelError> {
        const GAIN_MARGIN_DB: f64 = 6.0;
        const PHASE_MARGIN_DEG: f64 = 45.0;
        const NOISE_PART: f64 = 0.01;
        let most = 1.0 / (self.late + 1.5 * self.period).max(4.0 * self.period);
        let mut crossover = most;
        let mut last = None;
        while crossover > most / 50.0 {
            match self.design(crossover) {
                Ok(design) => {
                    let margins = &design.margins;
                    let holds = margins.gain_margin_db.is_none_or(|m| m >= GAIN_MARGIN_DB)
                        && margins
                            .phase_margin_deg
                            .is_none_or(|m| m >= PHASE_MARGIN_DEG)
                        && design.law.noise_gain(self.period) * self.noise
                            <= NOISE_PART * design.law.limit;
                    if holds {
                        return Ok(design);
                    }
                }
                Err(error) => last = Some(error),
            }
            crossover *= 0.95;
        }
        let reason = last.map_or(String::new(), |error| format!(" ({error})"));
        Err(no_solution(format!(
            "no crossover from {most:.3} to {:.3} rad/s keeps 6 dB, 45 degrees and low noise at \
             the valve{reason}",
            most / 50.0
        )))
    }

    fn finished(
        &self,
        target: f64,
        reached: f64,
        gamma_min: f64,
        law: LoopShaping,
        late_rig: &LateRig,
        open: &OpenLoop,
    ) -> Result<WholePlantDesign, ModelError> {
        let mut running = law;
        let mut command = |heard: &Heard| {
            let input = PidInput {
                reference: 0.0,
                measured: heard.motion.displacement,
            };
            running.step(&input, self.period)
        };
        if !Pushed::new(late_rig, &mut command, 6.0).is_stable() {
            return Err(no_solution(format!(
                "at {target:.4} rad/s the reduced controller does not stabilise the sampled loop"
            )));
        }
        Ok(WholePlantDesign {
            target,
            reached,
            gamma_min,
            margins: open.margins(),
            peak_sensitivity: open.peak_sensitivity(),
            law,
        })
    }

    /// The sampled loop, from its transfer functions.
    fn open_loop(&self, rig: &LateRig, law: &LoopShaping) -> OpenLoop {
        let last = margins::nyquist(self.period);
        let omega = plant::linear::log_space(0.3, 0.999 * last, 500);
        let values = omega
            .iter()
            .map(|&omega| law.response(omega, self.period) * rig.responses(omega)[0])
            .collect();
        OpenLoop { omega, values }
    }

    /// A controller for the nominal crossover `w` (rad/s), and `gamma_min`.
    fn shape(&self, w: f64) -> Result<(LoopShaping, f64), ModelError> {
        let plant = self.rig.voltage_to_displacement();
        let trimmed = TransferFunction::new(&plant.numerator, &plant.denominator)?;
        let (poles, zeros) = (trimmed.poles(), trimmed.zeros());
        let mirrored = |root: &Complex<f64>| Complex::new(-root.re.abs(), root.im);
        let is_slow = |root: &&Complex<f64>| root.norm() < w / SLOW;
        let mut slow = poles.iter().filter(is_slow).count() as i64
            - zeros.iter().filter(is_slow).count() as i64;
        let origin = Complex::new(0.0, 0.0);
        let mut weight = Factors {
            zeros: Vec::new(),
            poles: vec![origin],
        };
        let mut shaped = Factors {
            zeros: zeros.clone(),
            poles: poles.clone(),
        };
        shaped.poles.push(origin);
        // Slow zeros that are too many are taken out as well.
        for zero in zeros.iter().filter(is_slow).filter(|zero| zero.re < 0.0) {
            if slow < 0 {
                weight.poles.push(*zero);
                shaped.poles.push(*zero);
                slow += 1;
            }
        }
        match slow {
            0 => {}
            1 => {
                let corner = Complex::new(-w / SLOW, 0.0);
                weight.zeros.push(corner);
                shaped.zeros.push(corner);
            }
            _ => {
                return Err(no_solution(format!(
                    "below {:.3} rad/s the plant has {slow} more poles than zeros; the synthesis \
                     needs none or one",
                    w / SLOW
                )));
            }
        }
        let middle = |root: &&Complex<f64>| root.norm() >= w / SLOW && root.norm() <= FAST * w;
        for pole in poles.iter().filter(middle) {
            weight.zeros.push(mirrored(pole));
            shaped.zeros.push(mirrored(pole));
        }
        for zero in zeros.iter().filter(middle).filter(|zero| zero.re < 0.0) {
            weight.poles.push(*zero);
            shaped.poles.push(*zero);
        }
        while weight.poles.len() < weight.zeros.len() {
            let roll_off = Complex::new(-ROLL_OFF * w, 0.0);
            weight.poles.push(roll_off);
            shaped.poles.push(roll_off);
        }
        cancel(&mut shaped);
        // Padé: (1 - T s/2 + T² s²/12) / (1 + T s/2 + T² s²/12), hold included.
        let late = self.late + 0.5 * self.period;
        for sign in [1.0, -1.0] {
            let root = Complex::new(-3.0, sign * 3f64.sqrt()) / late;
            shaped.poles.push(root);
            shaped.zeros.push(Complex::new(-root.re, root.im));
        }
        let robust = stabilise(&shaped.scaled(w).to_state_space()?, GAMMA_FACTOR)?;
        let law = controller(&weight.scaled(w), &robust.controller, w)?;
        // The weight's own gain: that of the plant at the crossover.
        let at = Complex::new(0.0, w);
        let gain = 1.0 / trimmed.evaluate(at).norm();
        let mut law = law;
        law.coefficients.gain *= gain;
        law.validate()?;
        Ok((law, robust.gamma_min))
    }
}

/// Takes out pairs of a pole and a zero that are the same.
fn cancel(factors: &mut Factors) {
    let Factors { zeros, poles } = factors;
    poles.retain(|pole| {
        let same = |zero: &Complex<f64>| (zero - pole).norm() <= 1e-9 * pole.norm();
        match zeros.iter().position(same) {
            Some(found) => {
                zeros.remove(found);
                false
            }
            None => true,
        }
    });
}

/// `W K` of reduced order as a law; `weight` and `robust` in time of `1/w`.
fn controller(
    weight: &TransferFunction,
    robust: &StateSpace,
    w: f64,
) -> Result<LoopShaping, ModelError> {
    // W = rest + rate/s, the numerator of the rest over s being without remainder.
    let mut others = weight.denominator.clone();
    others.pop();
    let last = |p: &[f64]| p.last().copied().unwrap_or(0.0);
    let rate = last(&weight.numerator) / last(&others);
    let mut rest = weight.numerator.clone();
    while rest.len() < others.len() {
        rest.insert(0, 0.0);
    }
    let offset = rest.len() - others.len();
    for (slot, value) in rest[offset..].iter_mut().zip(&others) {
        *slot -= rate * value;
    }
    rest.pop();
    let rest = TransferFunction::new(&rest, &others)?.to_state_space()?;

    let (n, m) = (robust.order(), rest.order());
    let Some(inverse) = robust.a.clone().try_inverse() else {
        return Err(no_solution("the robust controller integrates".into()));
    };
    // (K(s) - K(0))/s = C A^-1 (s - A)^-1 B.
    let to_rate = &robust.c * inverse;
    let integral = -rate * (&to_rate * &robust.b)[(0, 0)];
    let mut a = DMatrix::zeros(n + m, n + m);
    a.view_mut((0, 0), (n, n)).copy_from(&robust.a);
    a.view_mut((n, 0), (m, n)).copy_from(&(&rest.b * &robust.c));
    a.view_mut((n, n), (m, m)).copy_from(&rest.a);
    let mut b = DMatrix::zeros(n + m, 1);
    b.rows_mut(0, n).copy_from(&robust.b);
    let mut c = DMatrix::zeros(1, n + m);
    c.columns_mut(0, n)
        .copy_from(&(&robust.c * rest.d[(0, 0)] + to_rate * rate));
    c.columns_mut(n, m).copy_from(&rest.c);
    let stable = StateSpace::new(a, b, c, DMatrix::zeros(1, 1))?;
    let mut order = stable.order().min(STATES);
    if order.is_multiple_of(2) {
        order -= 1;
    }
    let (small, _) = residualise(&stable, order)?;
    law(&small, integral, w)
}

/// The system `small + integral/s` in time of `1/w` as a law.
fn law(small: &StateSpace, integral: f64, w: f64) -> Result<LoopShaping, ModelError> {
    let direct = small.d[(0, 0)];
    let n = small.order();
    let mut a = DMatrix::zeros(n + 1, n + 1);
    a.view_mut((0, 0), (n, n)).copy_from(&small.a);
    let mut b = DMatrix::zeros(n + 1, 1);
    b.rows_mut(0, n).copy_from(&small.b);
    b[(n, 0)] = 1.0;
    let mut c = DMatrix::zeros(1, n + 1);
    c.columns_mut(0, n).copy_from(&small.c);
    c[(0, n)] = integral;
    if direct.abs() < 1e-9 * integral.abs() {
        return Err(no_solution(
            "the controller has no direct feedthrough".into(),
        ));
    }
    let zeros = (&a - &b * &c / direct).complex_eigenvalues();
    let zeros: Vec<Complex<f64>> = zeros.iter().map(|zero| zero * w).collect();
    let poles: Vec<Complex<f64>> = small
        .a
        .complex_eigenvalues()
        .iter()
        .map(|pole| pole * w)
        .collect();
    let real = |root: &&Complex<f64>| root.im.abs() <= 1e-9 * root.norm();
    let slowest = poles.iter().filter(real).map(|pole| -pole.re);
    let Some(pole) = slowest.min_by(f64::total_cmp) else {
        return Err(no_solution("the controller has no real pole".into()));
    };
    let mut found = false;
    let others: Vec<Complex<f64>> = poles
        .iter()
        .filter(|own| {
            let this = !found && own.im.abs() <= 1e-9 * own.norm() && -own.re == pole;
            found |= this;
            !this
        })
        .copied()
        .collect();
    let (mut above, below) = (quadratics(&zeros), quadratics(&others));
    if above.is_empty() || above.len() != below.len() + 1 {
        return Err(no_solution(
            "zeros and poles cannot be paired to sections".into(),
        ));
    }
    let [rate, constant] = above.remove(0);
    let mut sections = [Section::default(); SECTIONS];
    let mut gain = direct;
    for (slot, (z, p)) in sections.iter_mut().zip(above.iter().zip(&below)) {
        *slot = Section {
            b2: 1.0 / z[1],
            b1: z[0] / z[1],
            a2: 1.0 / p[1],
            a1: p[0] / p[1],
        };
        gain *= z[1] / p[1];
    }
    Ok(LoopShaping {
        sections,
        ..LoopShaping::new(LoopShapingCoefficients {
            gain,
            numerator_rate: rate,
            numerator_constant: constant,
            pole,
        })
    })
}

/// `[c1, c0]` of the factors `s² + c1 s + c0` with these roots (an even number, complex ones in
/// pairs), the slowest first.
fn quadratics(roots: &[Complex<f64>]) -> Vec<[f64; 2]> {
    let is_real = |root: &Complex<f64>| root.im.abs() <= 1e-9 * root.norm();
    let mut found: Vec<[f64; 2]> = roots
        .iter()
        .filter(|root| !is_real(root) && root.im > 0.0)
        .map(|root| [-2.0 * root.re, root.norm_sqr()])
        .collect();
    let mut reals: Vec<f64> = roots.iter().filter(|r| is_real(r)).map(|r| r.re).collect();
    reals.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    for pair in reals.chunks_exact(2) {
        found.push([-(pair[0] + pair[1]), pair[0] * pair[1]]);
    }
    found.sort_by(|a, b| a[1].abs().total_cmp(&b[1].abs()));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loops::{LinearLaw, Loop, Time};
    use plant::identified::coupled::Rig;
    use units::constants::SAMPLING_PERIOD;

    #[test]
    fn the_crossover_that_is_asked_for_is_reached() {
        let thesis = ShakeTable::default();
        for (late, targets) in [(0.0, [15.0, 26.0, 65.0]), (0.002, [15.0, 26.0, 50.0])] {
            let shaped = Shaped {
                rig: &thesis,
                late,
                noise: 0.0,
                period: SAMPLING_PERIOD,
            };
            for target in targets {
                let design = shaped.design(target).unwrap();
                println!("{late} {target}: {design:?}");
                // Independent of the design's own loop: the code, pushed.
                let rig = LateRig::new(&thesis.state_space(), late, SAMPLING_PERIOD).unwrap();
                let mut law = design.law;
                let mut command = |heard: &Heard| {
                    let input = PidInput {
                        reference: 0.0,
                        measured: heard.motion.displacement,
                    };
                    law.step(&input, SAMPLING_PERIOD)
                };
                let run = Pushed::new(&rig, &mut command, 20.0);
                assert!(run.is_stable(), "{late} {target}");
                let reached = run.open_loop(2.0).first_crossover().unwrap();
                if late == 0.0 {
                    let law = LinearLaw::shaped(&design.law, SAMPLING_PERIOD).unwrap();
                    let rig_loop = Loop::new(&Rig::default(), law);
                    for omega in [3.0, 40.0, 300.0] {
                        let (a, b) = (
                            rig_loop.open(Time::Sampled, omega),
                            run.open_loop(2.0).at(omega),
                        );
                        assert!((a / b - 1.0).norm() < 0.01, "{omega}: {a} {b}");
                    }
                    assert!(rig_loop.is_stable(Time::Sampled));
                }
                assert!((reached / target - 1.0).abs() < 0.03, "{target} {reached}");
            }
        }
    }

    #[test]
    fn the_fastest_keeps_its_margins_and_what_is_too_fast_is_refused() {
        let rig = ShakeTable::default();
        let shaped = Shaped {
            rig: &rig,
            late: 0.002,
            noise: 1.27e-5,
            period: SAMPLING_PERIOD,
        };
        let design = shaped.fastest().unwrap();
        // Half a thousandth of an inch of noise, and a tenth of a volt.
        assert!(design.law.noise_gain(SAMPLING_PERIOD) * 1.27e-5 <= 0.1);
        println!("{design:?}");
        assert!(design.margins.gain_margin_db.unwrap() >= 6.0);
        assert!(design.margins.phase_margin_deg.unwrap() >= 45.0);
        assert!(design.reached > 25.0, "{}", design.reached);
        let error = shaped.design(2000.0).unwrap_err().to_string();
        assert!(error.contains("no controller crosses at 2000"), "{error}");
    }

    /// A dead time takes of what a loop can bear, the more the longer it is against the crossover.
    #[test]
    fn measurements_that_are_later_leave_less_robustness() {
        let rig = ShakeTable::default();
        let gamma = |late: f64| {
            let shaped = Shaped {
                rig: &rig,
                late,
                noise: 0.0,
                period: SAMPLING_PERIOD,
            };
            shaped.shape(30.0).unwrap().1
        };
        let found = [0.0, 0.005, 0.010, 0.020].map(gamma);
        for pair in found.windows(2) {
            assert!(pair[1] > 1.05 * pair[0], "{found:?}");
        }
        // An integrator alone bears sqrt(2), whatever it crosses at.
        assert!(found[0] > std::f64::consts::SQRT_2);
    }
}
