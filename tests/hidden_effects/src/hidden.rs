//! What is hidden in a rig.

use crate::catalogue::Effect;
use crate::form::Form;
use crate::outside::Outside;

/// What is hidden, ready to simulate; neutral by default.
#[derive(Debug, Clone, Default)]
pub struct Hidden {
    /// Effects of the catalogue with values in inch, pound-force, second, volt.
    pub effects: Vec<Effect>,
    /// Something outside the catalogue and its size.
    pub outside: Option<(Outside, f64)>,
    /// Details of their forms, unknown to the laboratory.
    pub form: Form,
}

impl Hidden {
    pub(crate) fn get(&self, name: &str, index: usize) -> Option<f64> {
        let effect = self.effects.iter().find(|e| e.entry.name == name)?;
        effect.values.get(index).copied()
    }

    pub(crate) fn value(&self, name: &str) -> f64 {
        self.get(name, 0).unwrap_or(0.0)
    }

    pub(crate) fn holds(&self, name: &str) -> bool {
        self.effects.iter().any(|e| e.entry.name == name)
    }

    pub(crate) fn outside(&self, kind: Outside) -> Option<f64> {
        self.outside
            .filter(|(k, _)| *k == kind)
            .map(|(_, size)| size)
    }
}
