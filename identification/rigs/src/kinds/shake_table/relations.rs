//! The five relations of a healthy rig, each checked from the recordings alone in the frequency
//! domain, against the noise of the sensors that it uses.

use nalgebra::Complex;
use plant::specimens::linear::LinearSpecimen;
use realfft::RealFftPlanner;

use crate::case::Nominal;
use recordings::{Channel, Recording};

/// Band in which the relations are checked, Hz.
const BAND: (f64, f64) = (0.5, 15.0);
/// Upper end of the band in which signs and units are checked, Hz: lags and delays of the
/// catalogue are small there.
const SLOW: f64 = 3.0;

/// A relation and its error.
#[derive(Debug, Clone, PartialEq)]
pub struct Relation {
    /// R1 to R5 and what it joins.
    pub name: &'static str,
    /// Root mean square error in units of the error from sensor noise.
    pub ratio: f64,
    /// Error below 3 Hz over the size of what it is an error of, where that is a channel; of R1 over the error
    /// with the command reversed.
    pub relative: Option<f64>,
}

const VALVE: &str = "R1 valve and actuator";
const EQUILIBRIUM: &str = "R2 equilibrium of the table";
const KINEMATICS: &str = "R4 kinematics";

/// Most of the displacement that a pitching table adds to its acceleration, 1/s^2: what moves at 1 Hz.
const MOST_PITCH: f64 = 39.5;

/// Relative difference below which the specimen's channel shows nothing, or the table.
const LOOKS_ABSENT: f64 = 0.2;

/// What shows that columns and nominal model do not belong together: signs, units, another rig.
/// The limits lie beyond anything that an effect of the catalogue does.
pub fn misfit(relations: &[Relation]) -> Option<String> {
    relations.iter().find_map(|relation| {
        let (limit, what, of) = match relation.name {
            VALVE => (
                3.0,
                "the force follows the reversed command",
                "that with the command reversed",
            ),
            KINEMATICS => (
                0.8,
                "acceleration and displacement are not from one motion",
                "the signal",
            ),
            EQUILIBRIUM => (1.2, "forces do not balance the moving mass", "the signal"),
            _ => return None,
        };
        let relative = relation.relative.filter(|relative| *relative > limit)?;
        Some(format!(
            "the nominal model does not fit the columns: {what} ({}, error {relative:.2} times \
             {of} below {SLOW} Hz); check units, signs and which rig this is",
            relation.name
        ))
    })
}

/// The relations that the columns of `recording` allow, on the nominal model.
pub fn relations(recording: &Recording, nominal: &Nominal) -> Vec<Relation> {
    let n = recording.len();
    let period = 1.0 / nominal.sample_rate;
    let mut planner = RealFftPlanner::<f64>::new();
    let transform = planner.plan_fft_forward(n);
    let spectrum = |values: &[f64]| -> Option<Vec<Complex<f64>>> {
        if values.len() != n {
            return None;
        }
        // Hann window: records do not end where they began.
        let mut windowed: Vec<f64> = values
            .iter()
            .enumerate()
            .map(|(k, value)| {
                let turn = std::f64::consts::TAU * k as f64 / n as f64;
                value * (1.0 - turn.cos()) * (2.0f64 / 3.0).sqrt()
            })
            .collect();
        let mut out = transform.make_output_vec();
        transform.process(&mut windowed, &mut out).ok()?;
        Some(out.iter().map(|z| Complex::new(z.re, z.im)).collect())
    };
    let [x, a, f, specimen_acceleration] = Channel::OUTPUTS.map(|c| spectrum(recording.samples(c)));
    // Differences are taken before the window, which would leak low frequencies into them.
    let difference = |at: &dyn Fn(&[f64], usize) -> f64| {
        let x = recording.samples(Channel::Displacement);
        if x.len() != n || n < 3 {
            return None;
        }
        let inner = |k: usize| k.clamp(1, n.saturating_sub(2).max(1));
        let values: Vec<f64> = (0..n).map(|k| at(x, inner(k))).collect();
        spectrum(&values)
    };
    let velocity = difference(&|x, k| (x[k + 1] - x[k - 1]) / (2.0 * period));
    let second = difference(&|x, k| (x[k + 1] - 2.0 * x[k] + x[k - 1]) / (period * period));
    let command = recording.samples(Channel::ValveCommand);
    let u = spectrum(command);
    let bin = nominal.sample_rate / n as f64;
    let bins = ((BAND.0 / bin) as usize).max(1)..((BAND.1 / bin) as usize).min(n / 2);
    let [sx, sa, sf, ss] = nominal.noise;
    let table = nominal.shake_table.table;
    let mass = nominal.specimen.map_or(0.0, |specimen| specimen.mass);
    let omega = |k: usize| std::f64::consts::TAU * bin * k as f64;

    // What differences make of a derivative.
    let of_velocity = |s: Complex<f64>| (s * period).sinh() / period;
    let of_second = |s: Complex<f64>| ((s * period).cosh() - 1.0) * 2.0 / (period * period);

    // Mean over the band of |error|² over its variance.
    let ratio = |error: &dyn Fn(usize, Complex<f64>) -> (Complex<f64>, f64)| {
        let sum: f64 = bins
            .clone()
            .map(|k| {
                let (value, variance) = error(k, Complex::new(0.0, omega(k)));
                value.norm_sqr() / (n as f64 * variance)
            })
            .sum();
        (sum / bins.len().max(1) as f64).sqrt()
    };
    let slow = bins.start..((SLOW / bin) as usize).clamp(bins.start, bins.end);
    let relative = |error: &dyn Fn(usize, Complex<f64>) -> (Complex<f64>, f64),
                    size: &[Complex<f64>]| {
        let (mut wrong, mut whole) = (0.0, 0.0);
        for k in slow.clone() {
            wrong += error(k, Complex::new(0.0, omega(k))).0.norm_sqr();
            whole += size[k].norm_sqr();
        }
        (whole > 0.0).then(|| (wrong / whole).sqrt())
    };
    let mut all = Vec::new();
    if let (Some(u), Some(velocity), Some(f)) = (&u, &velocity, &f) {
        let (g1, g2) = (
            nominal.shake_table.actuator.g1(),
            nominal.shake_table.actuator.g2(),
        );
        let error = |sign: f64, k: usize, s: Complex<f64>| {
            // The command is held over a sample.
            let held = (1.0 - (-s * period).exp()) / (s * period);
            let of_x = g2.evaluate(s) * s;
            let moved = g2.evaluate(s) * s / of_velocity(s) * velocity[k];
            let error = f[k] - g1.evaluate(s) * held * u[k] * sign - moved;
            let of_u = (g1.evaluate(s) * nominal.command_noise).norm_sqr();
            (error, sf * sf + of_x.norm_sqr() * sx * sx + of_u)
        };
        let reversed: Vec<Complex<f64>> = (0..f.len())
            .map(|k| error(-1.0, k, Complex::new(0.0, omega(k.max(1)))).0)
            .collect();
        let as_it_is = |k: usize, s: Complex<f64>| error(1.0, k, s);
        all.push(Relation {
            name: VALVE,
            ratio: ratio(&as_it_is),
            relative: relative(&as_it_is, &reversed),
        });
    }
    if let (Some(x), Some(v), Some(a), Some(f), Some(specimen)) =
        (&x, &velocity, &a, &f, &specimen_acceleration)
    {
        let error = |k: usize, s: Complex<f64>| {
            let of_x = s * table.damping + table.stiffness;
            let wall = v[k] * table.damping + x[k] * table.stiffness;
            let error = f[k] - specimen[k] * mass - a[k] * table.mass - wall;
            let inertia = (table.mass * sa).powi(2) + (mass * ss).powi(2);
            (error, sf * sf + inertia + of_x.norm_sqr() * sx * sx)
        };
        // An absent specimen is an effect, not a sign of wrong columns: its channel then shows
        // nothing or the table.
        let follows = |share: f64| {
            let off = |k: usize, _: Complex<f64>| (specimen[k] - a[k] * share, 1.0);
            relative(&off, a).is_some_and(|off| off < LOOKS_ABSENT)
        };
        let absent = follows(0.0) || follows(1.0);
        let without = |k: usize, s: Complex<f64>| {
            let (error, variance) = error(k, s);
            (error + specimen[k] * mass, variance)
        };
        all.push(Relation {
            name: EQUILIBRIUM,
            ratio: ratio(&error),
            relative: if absent {
                relative(&without, f)
            } else {
                relative(&error, f)
            },
        });
    }
    if let (
        Some(LinearSpecimen {
            mass,
            damping,
            stiffness,
        }),
        Some(a),
        Some(specimen),
    ) = (nominal.specimen, &a, &specimen_acceleration)
    {
        all.push(Relation {
            name: "R3 specimen",
            ratio: ratio(&|k, s| {
                let spring = s * damping + stiffness;
                let passed = spring / (s * s * mass + spring);
                let error = specimen[k] - passed * a[k];
                (error, ss * ss + passed.norm_sqr() * sa * sa)
            }),
            relative: None,
        });
    }
    if let (Some(x), Some(second), Some(a)) = (&x, &second, &a) {
        let error = |k: usize, s: Complex<f64>| {
            let variance = sa * sa + (s * s).norm_sqr() * sx * sx;
            (a[k] - s * s / of_second(s) * second[k], variance)
        };
        // Gravity on an accelerometer of a table that pitches is an effect, not a sign of wrong columns.
        let (mut along, mut size) = (0.0, 0.0);
        for k in slow.clone() {
            along += (error(k, Complex::new(0.0, omega(k))).0 * x[k].conj()).re;
            size += x[k].norm_sqr();
        }
        let pitch = (along / size.max(f64::MIN_POSITIVE)).clamp(-MOST_PITCH, MOST_PITCH);
        let level = |k: usize, s: Complex<f64>| (error(k, s).0 - x[k] * pitch, 1.0);
        all.push(Relation {
            name: KINEMATICS,
            ratio: ratio(&error),
            relative: relative(&level, a),
        });
    }
    if let Some(law) = nominal.controller {
        let [reference, x, a] = [
            Channel::Reference,
            Channel::Displacement,
            Channel::Acceleration,
        ]
        .map(|channel| recording.samples(channel));
        let commands = law.commands(reference, x, a, period);
        if commands.len() == n && n > 2 && nominal.command_noise > 0.0 {
            // The ends are left out: differences of the reference want neighbours.
            let inner = 1..n - 1;
            let count = inner.len() as f64;
            let sum: f64 = inner.map(|k| (command[k] - commands[k]).powi(2)).sum();
            all.push(Relation {
                name: "R5 the controller's law",
                ratio: (sum / count).sqrt() / nominal.command_noise,
                relative: None,
            });
        }
    }
    all
}
