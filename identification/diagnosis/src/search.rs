//! The search for the set of effects: forward, one effect a round, then backward.
//!
//! What makes an effect pay differs with the noise: a [`Selection`] says it.

/// Which extensions of a model are tried, and whether they pay.
pub trait Selection {
    /// A fitted model.
    type Hypothesis;

    /// The nominal model, its uncertain parameters estimated; none where it cannot be simulated.
    fn nominal(&self) -> Option<Self::Hypothesis>;

    /// Number of effects.
    fn effects(&self, hypothesis: &Self::Hypothesis) -> usize;

    /// Effects in one model at most.
    fn most_effects(&self) -> usize;

    /// Models with one more effect than `current` that pay, best first; `lost` are those that came
    /// after `current` in the last round. None where nothing can be fitted.
    fn extensions(
        &mut self,
        current: &Self::Hypothesis,
        lost: &[Self::Hypothesis],
    ) -> Option<Vec<Self::Hypothesis>>;

    /// Whether the search ends with what it has.
    fn is_over(&self) -> bool {
        false
    }

    /// Is told of the end of a round.
    fn round(&mut self, _taken: &Self::Hypothesis, _lost: &[Self::Hypothesis]) {}

    /// `current` without the effect that no longer pays, if there is one. The outer none where
    /// nothing can be fitted.
    fn reduced(&mut self, current: &Self::Hypothesis) -> Option<Option<Self::Hypothesis>>;
}

/// What a search found.
#[derive(Clone)]
pub struct Found<H> {
    /// The nominal model.
    pub nominal: H,
    /// The best model with effects, if any pays.
    pub best: Option<H>,
    /// What came after the one taken in the last round, best first.
    pub others: Vec<H>,
}

/// Forward from the nominal model as long as an effect pays, then backward as long as one does not.
pub fn search<S: Selection>(selection: &mut S) -> Option<Found<S::Hypothesis>> {
    let nominal = selection.nominal()?;
    let found = Found {
        nominal,
        best: None,
        others: Vec::new(),
    };
    resumed(selection, found)
}

/// As [`search`], from what an earlier one `found`.
pub fn resumed<S: Selection>(
    selection: &mut S,
    found: Found<S::Hypothesis>,
) -> Option<Found<S::Hypothesis>> {
    let Found {
        nominal,
        mut best,
        mut others,
    } = found;
    loop {
        let current = best.as_ref().unwrap_or(&nominal);
        if selection.effects(current) >= selection.most_effects() || selection.is_over() {
            break;
        }
        let mut level = selection.extensions(current, &others)?.into_iter();
        let Some(taken) = level.next() else { break };
        others = level.collect();
        selection.round(&taken, &others);
        best = Some(taken);
    }
    while let Some(current) = best.as_ref().filter(|_| !selection.is_over()) {
        match selection.reduced(current)? {
            Some(smaller) => best = Some(smaller),
            None => break,
        }
    }
    Some(Found {
        nominal,
        best,
        others,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sets of numbers; a set is the better the more of `worth` it collects.
    struct Collector {
        worth: Vec<f64>,
        /// Number that pays only as long as this other one is missing.
        stands_in: (usize, usize),
        rounds: usize,
        /// Number that is only tried where another is there.
        seen_late: usize,
    }

    impl Collector {
        fn value(&self, set: &[usize]) -> f64 {
            let (poor, better) = self.stands_in;
            let counts = |i: &usize| *i != poor || !set.contains(&better);
            set.iter()
                .filter(|i| counts(i))
                .map(|&i| self.worth[i])
                .sum()
        }
    }

    impl Selection for Collector {
        type Hypothesis = Vec<usize>;

        fn nominal(&self) -> Option<Vec<usize>> {
            Some(Vec::new())
        }

        fn effects(&self, set: &Vec<usize>) -> usize {
            set.len()
        }

        fn most_effects(&self) -> usize {
            3
        }

        fn extensions(
            &mut self,
            current: &Vec<usize>,
            _: &[Vec<usize>],
        ) -> Option<Vec<Vec<usize>>> {
            let tried = |i: &usize| *i != self.seen_late || !current.is_empty();
            let new = (0..self.worth.len()).filter(|i| !current.contains(i) && tried(i));
            let mut all: Vec<Vec<usize>> = new
                .map(|i| current.iter().copied().chain([i]).collect())
                .filter(|set: &Vec<usize>| self.value(set) > self.value(current))
                .collect();
            all.sort_by(|a, b| self.value(b).total_cmp(&self.value(a)));
            Some(all)
        }

        fn round(&mut self, _: &Vec<usize>, _: &[Vec<usize>]) {
            self.rounds += 1;
        }

        fn reduced(&mut self, current: &Vec<usize>) -> Option<Option<Vec<usize>>> {
            let without = (0..current.len()).map(|i| {
                let mut set = current.clone();
                set.remove(i);
                set
            });
            let mut idle = without.filter(|set| self.value(set) >= self.value(current));
            Some(idle.next())
        }
    }

    #[test]
    fn what_a_later_effect_makes_needless_goes() {
        // 0 is taken first; 1, once there, stands for it and more.
        let mut collector = Collector {
            worth: vec![3.0, 5.0, 1.0, 0.0],
            stands_in: (0, 1),
            rounds: 0,
            seen_late: 1,
        };
        let found = search(&mut collector).unwrap();
        assert_eq!(collector.rounds, 3);
        assert_eq!(found.nominal, Vec::<usize>::new());
        assert_eq!(found.best, Some(vec![1, 2]));
    }

    #[test]
    fn nothing_is_taken_where_nothing_pays() {
        let mut collector = Collector {
            worth: vec![0.0, -1.0],
            stands_in: (5, 5),
            rounds: 0,
            seen_late: 5,
        };
        let found = search(&mut collector).unwrap();
        assert!(found.best.is_none() && found.others.is_empty());
    }
}
