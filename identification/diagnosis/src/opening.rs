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
