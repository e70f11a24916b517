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

    /// Is told of the end of a round.
    fn round(&mut self, _taken: &Self::Hypothesis, _lost: &[Self::Hypothesis]) {}

    /// `current` without the effect that no longer pays, if there is one. The outer none where
    /// nothing can be fitted.
    fn reduced(&mut self, current: &Self::Hypothesis) -> Option<Option<Self::Hypothesis>>;
}

/// What a search found.
pub struct Found<H> {
    /// The nominal model.
    pub nominal: H,
    /// The best model with effects, if any pays.
    pub best: Option<H>,
    /// What came after the one taken in the last round, best first.
    pub others: Vec<H>,
}

/// Forward as long as an effect pays, then backward as long as one does not.
pub fn search<S: Selection>(selection: &mut S) -> Option<Found<S::Hypothesis>> {
    let nominal = selection.nominal()?;
    let mut best: Option<S::Hypothesis> = None;
    let mut others = Vec::new();
    loop {
        let current = best.as_ref().unwrap_or(&nominal);
        if selection.effects(current) >= selection.most_effects() {
            break;
        }
        let mut level = selection.extensions(current, &others)?.into_iter();
        let Some(taken) = level.next() else { break };
        others = level.collect();
        selection.round(&taken, &others);
        best = Some(taken);
    }
    while let Some(current) = &best {
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
