//! Fits that would lose the motion over a whole record: over its begin first, then over more and more.

use super::least_squares::{Free, SimulatedModel, Solution, least_squares, solution};
use super::model::{Candidate, Point};

/// The begin of every block of a model's records.
struct Opening<'a, M> {
    model: &'a M,
    /// The share of a block's samples.
    share: f64,
}

impl<M: SimulatedModel> SimulatedModel for Opening<'_, M> {
    fn nuisance(&self) -> usize {
        self.model.nuisance()
    }

    fn candidates(&self) -> &[Candidate] {
        self.model.candidates()
    }

    fn moved(&self, point: &Point, step: &[f64]) -> Point {
        self.model.moved(point, step)
    }

    fn blocks(&self) -> usize {
        self.model.blocks()
    }

    fn block_of(&self, i: usize) -> Option<usize> {
        self.model.block_of(i)
    }

    fn samples(&self, record: usize, block: usize) -> usize {
        (self.share * self.model.samples(record, block) as f64).ceil() as usize
    }

    fn errors(&self, point: &Point, record: usize, block: usize) -> Vec<f64> {
        let count = self.samples(record, block);
        self.model.first_errors(point, record, block, count)
    }

    fn folds(&self, record: usize) -> [usize; 2] {
        self.model.folds(record)
    }

    fn screen(&self, record: usize) -> usize {
        self.model.screen(record)
    }

    fn prior_width(&self) -> f64 {
        self.model.prior_width()
    }

    fn held(&self) -> Self {
        Self {
            model: self.model,
            share: self.share,
        }
    }

    fn record_name(&self, record: usize) -> &str {
        self.model.record_name(record)
    }
}

/// Share of a record that a fit which would lose the motion sees first, and by what factor more after each fit.
const FIRST: f64 = 1.0 / 64.0;
const MORE: f64 = 1.25;

/// Fits the one of `starts` that is nearest to the begin of `record`, first to that and then to more and more of it:
/// over a short time the motion is not lost.
pub fn opened<M: SimulatedModel>(
    model: &M,
    starts: &[&Point],
    record: usize,
    iterations: usize,
) -> Option<Solution> {
    let begin = Opening {
        model,
        share: FIRST,
    };
    let looked = starts
        .iter()
        .filter_map(|start| solution(&begin, start, record));
    let nearest = looked.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    let mut point = nearest.point;
    let mut share = FIRST;
    while share < 1.0 {
        let opening = Opening { model, share };
        point = least_squares(&opening, &point, record, &Free::All, iterations)?.point;
        share *= MORE;
    }
    least_squares(model, &point, record, &Free::All, iterations)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two blocks of a tone of one frequency, from 10 rad/s on, and of an amplitude each.
    struct Tones;

    const SAMPLES: usize = 2000;

    fn tone(point: &[f64], block: usize, k: usize) -> f64 {
        let t = 0.01 * k as f64;
        point[1 + block] * ((10.0 + point[0]) * t).sin()
    }

    impl SimulatedModel for Tones {
        fn nuisance(&self) -> usize {
            3
        }
        fn candidates(&self) -> &[Candidate] {
            &[]
        }
        fn blocks(&self) -> usize {
            2
        }
        fn block_of(&self, i: usize) -> Option<usize> {
            i.checked_sub(1)
        }
        fn samples(&self, _: usize, block: usize) -> usize {
            SAMPLES / (1 + block)
        }
        fn errors(&self, point: &Point, record: usize, block: usize) -> Vec<f64> {
            let all = 0..self.samples(record, block);
            all.map(|k| tone(&TRUTH, block, k) - tone(&point.nuisance, block, k))
                .collect()
        }
        fn folds(&self, _: usize) -> [usize; 2] {
            [0, 0]
        }
        fn screen(&self, record: usize) -> usize {
            record
        }
        fn held(&self) -> Self {
            Self
        }
        fn record_name(&self, _: usize) -> &str {
            "tones"
        }
    }

    const TRUTH: [f64; 3] = [1.5, 2.0, -1.0];

    #[test]
    fn a_tone_that_a_fit_to_all_of_it_loses_is_followed_from_its_begin() {
        let start = |nuisance: [f64; 3]| Point {
            nuisance: nuisance.to_vec(),
            effects: Vec::new(),
        };
        let near = start([0.3, 1.5, -0.5]);
        // Over 20 s the phases are a dozen radians apart.
        let lost = least_squares(&Tones, &near, 0, &Free::All, 12).unwrap();
        assert!(
            (lost.point.nuisance[0] - 1.5).abs() > 0.2,
            "{:?}",
            lost.point
        );
        let far = start([9.0, -4.0, 3.0]);
        for starts in [[&near, &far], [&far, &near]] {
            let found = opened(&Tones, &starts, 0, 12).unwrap();
            for (own, truth) in found.point.nuisance.iter().zip(TRUTH) {
                assert!((own - truth).abs() < 0.02, "{:?}", found.point);
            }
        }
        assert!(opened(&Tones, &[], 0, 12).is_none());
    }

    #[test]
    fn the_begin_of_a_record_is_a_share_of_each_block() {
        let opening = Opening {
            model: &Tones,
            share: 0.0101,
        };
        assert_eq!(
            (opening.nuisance(), opening.blocks(), opening.screen(7)),
            (3, 2, 7)
        );
        assert_eq!(
            [0, 1, 2].map(|i| opening.block_of(i)),
            [None, Some(0), Some(1)]
        );
        assert_eq!(
            (opening.record_name(0), opening.prior_width()),
            ("tones", Tones.prior_width())
        );
        let samples = [0, 1].map(|block| opening.samples(0, block));
        assert_eq!(samples, [21, 11]);
        let point = Point {
            nuisance: vec![0.0, 1.0, 1.0],
            effects: Vec::new(),
        };
        for block in [0, 1] {
            let all = Tones.errors(&point, 0, block);
            assert_eq!(opening.errors(&point, 0, block), all[..samples[block]]);
        }
    }
}
