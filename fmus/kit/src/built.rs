//! What a component builds from its settings.

use std::fmt;

/// What follows from the settings alone, kept from step to step: gains, factored matrices, a
/// solver. It is not a state: a copy builds its own when it is first asked, and a saved state
/// leaves it out (`#[serde(skip)]`).
pub struct Built<S, T>(Option<Box<(S, T)>>);

impl<S: PartialEq + Copy, T> Built<S, T> {
    /// What `build` makes of these settings, made anew only where they changed.
    ///
    /// # Errors
    /// That of `build`.
    pub fn of<E>(
        &mut self,
        settings: &S,
        build: impl FnOnce(&S) -> Result<T, E>,
    ) -> Result<&mut T, E> {
        let built = match self.0.take().filter(|built| built.0 == *settings) {
            Some(built) => built,
            None => Box::new((*settings, build(settings)?)),
        };
        Ok(&mut self.0.insert(built).1)
    }
}

impl<S, T> Default for Built<S, T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<S, T> Clone for Built<S, T> {
    fn clone(&self) -> Self {
        Self(None)
    }

    fn clone_from(&mut self, _source: &Self) {}
}

impl<S, T> fmt::Debug for Built<S, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Built").field(&self.0.is_some()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_made_anew_only_where_the_settings_changed_and_by_each_copy() {
        let mut times = 0;
        let mut of = |built: &mut Built<f64, f64>, settings: f64| {
            let build = |s: &f64| {
                times += 1;
                Ok::<_, ()>(2.0 * s)
            };
            (*built.of(&settings, build).unwrap(), times)
        };
        let mut built = Built::default();
        assert_eq!(of(&mut built, 3.0), (6.0, 1));
        assert_eq!(of(&mut built, 3.0), (6.0, 1));
        assert_eq!(of(&mut built, 4.0), (8.0, 2));
        assert_eq!(of(&mut built.clone(), 4.0), (8.0, 3));
        assert_eq!(of(&mut built, 4.0), (8.0, 3));
    }
}
