//! What a load cell reads of a device in its gap: there no force acts, and the force that is shown is the cell's zero.

use super::RigRecording;
use super::named_value::NamedValue;
use recordings::{Channel, mean_and_deviation};

/// Levels into which the range of the force is cut, and those together that a gap fills.
const LEVELS: usize = 160;
const FILLED: usize = 3;
/// Travel over them, times what others of the middle half are passed in, from which on they are a gap.
const LOOSE: f64 = 4.0;
/// Samples that tell.
const FEWEST: usize = 400;

/// The zero of the load cell, N, by the level on which a device of `displacement` travels through its gap: the mean of
/// both directions, between which friction in the gap is. None of a recording where the device is never loose.
pub(super) fn zero_in_the_gap(
    recordings: &[RigRecording],
    displacement: Channel,
) -> Option<NamedValue> {
    let levels = recordings
        .iter()
        .map(|one| levels(one.input(displacement), one.output()));
    let levels: Vec<[f64; 2]> = levels.collect::<Option<_>>()?;
    if levels.is_empty() {
        return None;
    }
    let zeros: Vec<f64> = levels.iter().map(|[up, down]| 0.5 * (up + down)).collect();
    let (zero, scatter) = mean_and_deviation(&zeros);
    let count = zeros.len() as f64;
    let apart = levels.iter().map(|[up, down]| 0.25 * (up - down).abs());
    Some(NamedValue {
        name: "load_cell_zero".into(),
        value: zero,
        unit: "N".into(),
        standard_error: (apart.sum::<f64>() / count).hypot(scatter / count.sqrt()),
    })
}

/// The level of the gap, N, in either direction.
fn levels(displacement: &[f64], force: &[f64]) -> Option<[f64; 2]> {
    let known = |k: &usize| force[k - 1].is_finite() && force[*k].is_finite();
    let places: Vec<usize> = (1..force.len().min(displacement.len()))
        .filter(known)
        .collect();
    if places.len() < FEWEST {
        return None;
    }
    let (low, high) = force
        .iter()
        .filter(|f| f.is_finite())
        .fold((f64::MAX, f64::MIN), |(low, high), f| {
            (low.min(*f), high.max(*f))
        });
    let width = (high - low) / LEVELS as f64;
    let level = |direction: f64| {
        let mut travel = [0.0; LEVELS];
        for &k in &places {
            let way = direction * (displacement[k] - displacement[k - 1]);
            let own = 0.5 * (force[k] + force[k - 1]);
            // A gap is crossed without a force that changes, and sliding is at either end.
            let at = ((own - low) / width) as usize;
            if way > 0.0 && at < LEVELS {
                travel[at] += way;
            }
        }
        let middle = LEVELS / 4..3 * LEVELS / 4;
        let filled = |at: usize| travel[at..at + FILLED].iter().sum::<f64>();
        let mut usual: Vec<f64> = middle.clone().map(filled).collect();
        usual.sort_by(f64::total_cmp);
        let most = middle.max_by(|a, b| filled(*a).total_cmp(&filled(*b)))?;
        let is_loose = filled(most) > LOOSE * usual[usual.len() / 2];
        let middle_of = |at: usize| low + (at as f64 + 0.5) * width;
        let sum = (most..most + FILLED).map(|at| travel[at] * middle_of(at));
        is_loose.then(|| sum.sum::<f64>() / filled(most))
    };
    Some([level(1.0)?, level(-1.0)?])
}

#[cfg(test)]
mod tests {
    use super::super::measured::Measured;
    use super::super::parts::InParts;
    use super::super::{Measurement, of_kind};
    use super::*;
    use recordings::Recording;

    const FORCE: Channel = Channel::Other {
        name: "force",
        unit: "N",
    };

    /// A device of 10 kN, 4 kN/mm and a gap, mm, moved by 20 mm; its load cell reads 700 N too much, and 150 N rub in the gap.
    fn recorded(gap: f64) -> RigRecording {
        let displacement: Vec<f64> = (0..4000)
            .map(|k| 20.0 * (0.005 * f64::from(k)).sin())
            .collect();
        let (mut held, mut before) = (0.0f64, 0.0);
        let force: Vec<f64> = displacement
            .iter()
            .map(|x| {
                let way: f64 = x - before;
                before = *x;
                // What bends the spring, with the gap in its middle.
                held = (held + way).clamp(-2.5 - 0.5 * gap, 2.5 + 0.5 * gap);
                let bent = held - held.clamp(-0.5 * gap, 0.5 * gap);
                4e3 * bent + 150.0 * way.signum() + 700.0
            })
            .collect();
        let displacement = displacement.iter().map(|x| 1e-3 * x).collect();
        let channels = vec![(Channel::Displacement, displacement), (FORCE, force)];
        let recording = Recording::new("loose", 1e-3, channels).unwrap();
        RigRecording::new(recording, &[Channel::Displacement], FORCE)
    }

    #[test]
    fn the_zero_is_what_the_load_cell_reads_in_the_gap() {
        let zero = |all: &[RigRecording]| zero_in_the_gap(all, Channel::Displacement);
        let found = zero(&[recorded(4.0)]).unwrap();
        assert_eq!((&*found.name, &*found.unit), ("load_cell_zero", "N"));
        // A level is 129 N.
        assert!((found.value - 700.0).abs() < 70.0, "{found:?}");
        assert!((40.0..110.0).contains(&found.standard_error), "{found:?}");
        assert!(zero(&[recorded(0.0)]).is_none());
        assert!(zero(&[recorded(4.0), recorded(0.0)]).is_none());
        assert!(zero(&[]).is_none());
    }

    #[test]
    fn a_zero_that_is_read_is_a_cause_unless_it_is_as_stated_and_no_fit_tells_it() {
        let rig = of_kind("hysteretic_device").unwrap();
        let judged = |gap: f64, stated: f64| {
            let measurement = Measurement {
                recordings: vec![recorded(gap)],
            };
            let nominal = rig.parameters().iter().map(|(name, _)| match *name {
                "load_cell_zero" => (stated, 100.0),
                _ => (1e4, 1e3),
            });
            let measured = Measured::new(rig, &measurement, nominal.collect());
            let causes = measured.contradictions();
            let causes: Vec<(f64, bool)> = causes
                .iter()
                .map(|own| (own.stated, own.is_clear()))
                .collect();
            (causes, measured.is_read("load_cell_zero"))
        };
        assert_eq!(judged(4.0, 0.0), (vec![(0.0, true)], true));
        assert_eq!(judged(4.0, 700.0), (Vec::new(), true));
        assert_eq!(judged(0.0, 0.0), (Vec::new(), false));
    }
}
