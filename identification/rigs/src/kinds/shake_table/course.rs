//! When an effect acts: from an instant on, or more and more.
//!
//! A model has an effect at one strength throughout. What it leaves over is followed along the change of its
//! residuals with that strength: the strength that the record asks for is a step or a line in time, if that takes
//! away much more than noise alone would.

use super::catalogue::ShakeTableModel;
use diagnosis::{ExtensibleModel, FLOOR, Point, Role, Scale, residuals};

/// The strength moves by this share for the derivative.
const SHARE: f64 = 0.05;
/// Pieces of a record between which a step may be.
const PIECES: usize = 200;
/// Pieces at both ends that a step leaves.
const ENDS: usize = 10;
/// Twice the log likelihood that a change must gain, in units of the residual's mean square. Noise alone passes it
/// in one of a million records, at the best of two hundred places.
const CLEAR: f64 = 45.0;
/// Share of the residual above noise that it takes away at least: a wrong form of an effect looks a little like a
/// change with the motion's level.
const MOST: f64 = 0.5;
/// Share of the larger strength that the smaller one has at most.
const ABSENT: f64 = 0.35;
/// Of two forms, a step is taken where it gains this many times as much as a line.
const STEP_RATHER: f64 = 1.1;

/// How an effect changes within a record.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Course {
    /// The effect.
    pub effect: String,
    /// The size that is told.
    pub parameter: String,
    /// Name of the record.
    pub record: String,
    /// When it changes, s from the record's start; absent where it drifts from its start to its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub onset_s: Option<f64>,
    /// Size before, or at the start, SI.
    pub before: f64,
    /// Size afterwards, or at the end, SI.
    pub after: f64,
    /// SI unit.
    pub unit: String,
    /// How much twice the log likelihood rises, in units of the residual's mean square.
    pub gain: f64,
}

/// Strengths in time, relative to that of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    /// Two, and the first piece that has the second.
    Step(usize, [f64; 2]),
    /// At the start and at the end.
    Line([f64; 2]),
}

/// The course of every effect at `point` in the records where its strength is not the same throughout.
pub fn courses(model: &ShakeTableModel, point: &Point) -> Vec<Course> {
    let places = 0..point.effects.len();
    let all = places.flat_map(|place| {
        let records = 0..model.records.len();
        records.filter_map(move |record| course(model, point, place, record))
    });
    all.collect()
}

fn course(model: &ShakeTableModel, point: &Point, place: usize, record: usize) -> Option<Course> {
    if !model.records[record].with_effects {
        return None;
    }
    let (index, internal) = &point.effects[place];
    let candidate = &ExtensibleModel::candidates(model)[*index];
    let has_strength = |i: &usize| {
        let parameter = &candidate.parameters[*i];
        matches!(parameter.role, Role::Size { .. }) && parameter.scale != Scale::Logarithmic
    };
    let sizes: Vec<usize> = (0..internal.len()).filter(has_strength).collect();
    let first = *sizes.first()?;
    let at = |strength: f64| -> Vec<f64> {
        let mut moved = internal.clone();
        sizes.iter().for_each(|i| moved[*i] *= strength);
        moved
    };
    let predictor = model.predictor(point)?;
    let own = residuals(model, &predictor, point, &[record])?;
    let mut stronger = point.clone();
    stronger.effects[place].1 = at(1.0 + SHARE);
    let moved = residuals(model, &predictor, &stronger, &[record])?;
    let slope: Vec<f64> = moved
        .iter()
        .zip(&own)
        .map(|(moved, own)| (moved - own) / SHARE)
        .collect();
    let samples = model.sample_count(record).max(1);
    let width = own.len() / samples;
    let (form, gain) = change(&own, &slope, width * samples.div_ceil(PIECES))?;
    let parameter = &candidate.parameters[first];
    let value = |strength: f64| {
        let coordinate = at(strength)[first];
        if coordinate == 0.0 && matches!(parameter.scale, Scale::Inverse(_)) {
            return parameter.bounds.1;
        }
        parameter.scale.to_value(coordinate)
    };
    let Role::Size { weak } = parameter.role else {
        return None;
    };
    let is_large = |value: f64| match parameter.scale {
        Scale::Inverse(_) => FLOOR * value <= weak,
        _ => value.abs() >= FLOOR * weak,
    };
    let (onset_s, [before, after]) = match form {
        Form::Step(piece, ends) => {
            let sample = (piece * samples.div_ceil(PIECES)) as f64;
            (Some(sample * model.period), ends)
        }
        Form::Line(ends) => (None, ends),
    };
    (is_large(value(before)) || is_large(value(after))).then(|| Course {
        effect: candidate.effect.to_string(),
        parameter: parameter.name.to_string(),
        record: model.records[record].name.clone(),
        onset_s,
        before: value(before),
        after: value(after),
        unit: parameter.unit.to_string(),
        gain,
    })
}

/// The change of strength that explains most of `residuals`, whose derivative by the strength is `slope`, and what
/// it gains; none where the strength stays.
fn change(residuals: &[f64], slope: &[f64], piece: usize) -> Option<(Form, f64)> {
    // Of every piece: information on the strength, and what the residuals ask of it.
    let pieces: Vec<[f64; 2]> = residuals
        .chunks(piece)
        .zip(slope.chunks(piece))
        .map(|(own, slope)| {
            let squares: f64 = slope.iter().map(|d| d * d).sum();
            let along: f64 = own.iter().zip(slope).map(|(e, d)| -e * d).sum();
            [squares, along]
        })
        .collect();
    let count = pieces.len();
    let mean_square = residuals.iter().map(|e| e * e).sum::<f64>() / residuals.len().max(1) as f64;
    let unit = mean_square.max(1.0);
    let sum = |pieces: &[[f64; 2]]| {
        pieces
            .iter()
            .fold([0.0; 2], |sum, own| [sum[0] + own[0], sum[1] + own[1]])
    };
    let gain_of = |[information, along]: [f64; 2]| {
        if information > 0.0 {
            along * along / information
        } else {
            0.0
        }
    };
    let all = sum(&pieces);
    let constant = gain_of(all);
    let mut best: Option<(Form, f64)> = None;
    for split in ENDS..count.saturating_sub(ENDS) {
        let (early, late) = (sum(&pieces[..split]), sum(&pieces[split..]));
        let gain = (gain_of(early) + gain_of(late) - constant) / unit;
        if early[0] > 0.0 && late[0] > 0.0 && best.as_ref().is_none_or(|(_, known)| gain > *known) {
            let ends = [early, late].map(|[information, along]| 1.0 + along / information);
            best = Some((Form::Step(split, ends), gain));
        }
    }
    // A line through time: two normal equations.
    let mut normal = [0.0; 3];
    let mut right = [0.0; 2];
    for (i, [information, along]) in pieces.iter().enumerate() {
        let t = (i as f64 + 0.5) / count.max(1) as f64;
        normal[0] += information;
        normal[1] += information * t;
        normal[2] += information * t * t;
        right[0] += along;
        right[1] += along * t;
    }
    let determinant = normal[0] * normal[2] - normal[1] * normal[1];
    if determinant > 0.0 {
        let level = (normal[2] * right[0] - normal[1] * right[1]) / determinant;
        let rise = (normal[0] * right[1] - normal[1] * right[0]) / determinant;
        let gain = (level * right[0] + rise * right[1] - constant) / unit;
        if best
            .as_ref()
            .is_none_or(|(_, step)| gain * STEP_RATHER > *step)
        {
            best = Some((Form::Line([1.0 + level, 1.0 + level + rise]), gain));
        }
    }
    let excess = (unit - 1.0) * residuals.len() as f64;
    best.filter(|(form, gain)| {
        let (Form::Step(_, ends) | Form::Line(ends)) = form;
        let [weak, strong] = match ends.map(f64::abs) {
            [a, b] if a < b => [a, b],
            [a, b] => [b, a],
        };
        *gain > CLEAR && gain * unit > MOST * excess && weak < ABSENT * strong
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Residuals of a model of strength one where the truth has `strength` at the time from 0 to 1.
    fn found(strength: impl Fn(f64) -> f64) -> Option<(Form, f64)> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let n = 20_000;
        let mut slope = Vec::new();
        let mut residuals = Vec::new();
        for k in 0..n {
            let wave = 0.3 * (0.07 * f64::from(k)).sin();
            let noise: f64 = StandardNormal.sample(&mut random);
            slope.push(-wave);
            residuals.push(noise + (strength(f64::from(k) / f64::from(n)) - 1.0) * wave);
        }
        change(&residuals, &slope, 100)
    }

    #[test]
    fn a_strength_that_stays_has_no_course() {
        assert_eq!(found(|_| 1.0), None);
        assert_eq!(found(|_| 0.8), None);
    }

    #[test]
    fn a_step_is_found_where_it_is() {
        let (form, gain) = found(|t| if t < 0.6 { 0.0 } else { 2.0 }).unwrap();
        let Form::Step(piece, [before, after]) = form else {
            panic!("{form:?}");
        };
        assert!(piece.abs_diff(120) <= 3, "{piece}");
        assert!(
            before.abs() < 0.15 && (after - 2.0).abs() < 0.15,
            "{form:?}"
        );
        assert!(gain > 500.0, "{gain}");
    }

    #[test]
    fn a_drift_is_a_line() {
        let (form, _) = found(|t| 0.2 + 1.8 * t).unwrap();
        let Form::Line([start, end]) = form else {
            panic!("{form:?}");
        };
        assert!(
            (start - 0.2).abs() < 0.2 && (end - 2.0).abs() < 0.2,
            "{form:?}"
        );
    }
}
