//! Derivatives that a library gives, compared with differences of its own values.

use std::sync::Arc;

use super::Findings;
use super::calls::{instance, plan};
use fmi_import::{Causality, Fmu, Instance, Kind, Options, Variability, Variable};

/// Inputs and states by which is differentiated.
const KNOWNS: usize = 16;
/// Outputs and derivatives of states that are differentiated.
const UNKNOWNS: usize = 64;
/// Change of a value as a share of its size, or of 1.
const CHANGE: f64 = 1e-3;
/// Differences by this change and by half of it agree to this share, or tell nothing.
const SMOOTH: f64 = 1e-4;
/// Roundings that a value may have behind it.
const LOST: f64 = 1e4;
/// A derivative farther off, as a share of the largest of its kind, is wrong.
const WRONG: f64 = 1e-2;

/// Compares in initialization mode, where outputs follow what is set (FMI 2.0, section 4.2.4; FMI 3.0, section
/// 2.3.3). What cannot be set or read there is left out.
pub(super) fn check(findings: &mut Findings, fmu: &Arc<Fmu>, options: &Options) {
    let description = &fmu.description;
    if !description.directional_derivatives && !description.adjoint_derivatives {
        return;
    }
    let numbers = || {
        description.variables.iter().filter(|variable| {
            variable.kind == Kind::Float64
                && variable.variability == Variability::Continuous
                && variable.element.1 == 1
        })
    };
    let pairs = &description.state_pairs;
    let is_state = |it: &Variable| pairs.iter().any(|(state, _)| *state == it.reference);
    let is_rate = |it: &Variable| pairs.iter().any(|(_, rate)| *rate == it.reference);
    let knowns = numbers()
        .filter(|it| it.causality == Causality::Input || is_state(it))
        .take(KNOWNS);
    let unknowns: Vec<&Variable> = numbers()
        .filter(|it| !is_state(it) && (it.causality == Causality::Output || is_rate(it)))
        .take(UNKNOWNS)
        .collect();
    let Ok(mut instance) = instance(fmu, options) else {
        return;
    };
    let (_, stop) = plan(fmu);
    if unknowns.is_empty() || instance.enter_initialization(0.0, stop).is_err() {
        return;
    }
    let mut compared = 0;
    for known in knowns {
        let references: Vec<u32> = unknowns.iter().map(|it| it.reference).collect();
        let Some(differences) = differences(&mut instance, &references, known.reference) else {
            continue;
        };
        let mut claimed = vec![0.0; unknowns.len()];
        let outcome =
            instance.derivative((&references, &mut claimed), (&[known.reference], &[1.0]));
        match outcome {
            Ok(true) => {}
            Ok(false) => {
                let text = format!(
                    "it says that it gives derivatives, and gives none by `{}`",
                    known.name
                );
                findings.warning("library", text);
                return;
            }
            Err(error) => {
                let text = format!(
                    "it says that it gives derivatives; by `{}`: {} {}",
                    known.name, error.call, error.outcome
                );
                findings.error("library", text);
                return;
            }
        }
        for ((unknown, claimed), found) in unknowns.iter().zip(claimed).zip(differences) {
            let Some((found, uncertainty)) = found else {
                continue;
            };
            compared += 1;
            let tolerance = WRONG * claimed.abs().max(found.abs()) + uncertainty;
            if (claimed - found).abs() > tolerance {
                let text = format!(
                    "the derivative of `{}` by `{}` is given as {claimed:.6}, and differences of its values are \
                     {found:.6}",
                    unknown.name, known.name
                );
                findings.error("library", text);
            }
        }
    }
    if compared > 0 {
        findings.check(format!(
            "library: {compared} derivatives against differences"
        ));
    }
}

/// Central differences of all unknowns by one known, which gets its value back, each with its uncertainty by rounding;
/// none for an unknown that is not smooth there. None at all where the library refuses.
pub(super) fn differences(
    instance: &mut Instance,
    unknowns: &[u32],
    known: u32,
) -> Option<Vec<Option<(f64, f64)>>> {
    let mut origin = [0.0];
    instance.get(&Kind::Float64, &[known], &mut origin).ok()?;
    let step = CHANGE * origin[0].abs().max(1.0);
    let mut values = |by: f64| {
        let mut values = vec![0.0; unknowns.len()];
        let moved = [origin[0] + by];
        instance.set(&Kind::Float64, &[known], &moved).ok()?;
        let read = instance.get(&Kind::Float64, unknowns, &mut values);
        read.ok().map(|()| values)
    };
    let whole = (values(step)?, values(-step)?);
    let half = (values(0.5 * step)?, values(-0.5 * step)?);
    values(0.0)?;
    let all =
        (0..unknowns.len()).map(|i| smooth((whole.0[i], whole.1[i]), (half.0[i], half.1[i]), step));
    Some(all.collect())
}

/// A derivative and its uncertainty by rounding, from values at a change of `step` and of half of it to either side,
/// where both tell the same.
fn smooth(whole: (f64, f64), half: (f64, f64), step: f64) -> Option<(f64, f64)> {
    let coarse = (whole.0 - whole.1) / (2.0 * step);
    let fine = (half.0 - half.1) / step;
    let size = [whole.0, whole.1, half.0, half.1]
        .into_iter()
        .fold(0.0, |most: f64, value| most.max(value.abs()));
    let rounding = LOST * f64::EPSILON * size / step;
    let agree = (coarse - fine).abs() <= SMOOTH * fine.abs() + rounding;
    agree.then_some((fine, rounding))
}

#[cfg(test)]
mod tests {
    use super::smooth;

    fn of(f: impl Fn(f64) -> f64, at: f64) -> Option<(f64, f64)> {
        let step = 1e-3;
        smooth(
            (f(at + step), f(at - step)),
            (f(at + 0.5 * step), f(at - 0.5 * step)),
            step,
        )
    }

    #[test]
    fn differences_tell_a_derivative_only_where_they_agree() {
        assert!((of(|x| x * x, 3.0).unwrap().0 - 6.0).abs() < 1e-9);
        assert!((of(f64::sin, 0.4).unwrap().0 - 0.4_f64.cos()).abs() < 1e-6);
        assert_eq!(of(|_| 0.0, 1.0), Some((0.0, 0.0)));
        // A step beside the point.
        assert_eq!(of(|x| f64::from(x > 0.0007), 0.0), None);
        // Rounding hides what the derivative is.
        let (found, uncertainty) = of(|x| 1e9 + 1e-6 * x, 0.0).unwrap();
        assert!((found - 1e-6).abs() < uncertainty && uncertainty < 10.0);
    }
}
