//! Dry friction by the name of its cause, whatever the law that describes how it passes through rest.

use super::sentence::amount;
use diagnosis::NamedEffect;
use plant::identified::effects::{self, quantity::laboratory_unit};
use units::vocabulary::COULOMB_FRICTION;

/// The law whose contact gives way before it slides, and its bump.
const PRESLIDING: &str = "presliding_friction";
const BUMP: [&str; 2] = ["stribeck_force", "stribeck_velocity"];
/// The cause if there is a bump.
const WITH_BUMP: &str = "stribeck_friction";

/// The cause of an effect that is another law of the same cause, by the effect's name alone.
pub fn cause(effect: &'static str) -> &'static str {
    if effect == PRESLIDING {
        COULOMB_FRICTION
    } else {
        effect
    }
}

/// `effect` by the name of its cause: friction that gives way before it slides is Coulomb's or, if its bump
/// matters, Stribeck's; how it gives way is a detail of its form.
pub fn by_cause(mut effect: NamedEffect) -> NamedEffect {
    if effect.effect != PRESLIDING {
        return effect;
    }
    let weak = effects::find(PRESLIDING).and_then(|own| {
        let mut parameters = own.estimated();
        let bump = parameters.find(|p| p.name == BUMP[0])?;
        match bump.role {
            effects::Role::Size { weak, .. } => Some(weak),
            _ => None,
        }
    });
    let mut parameters = effect.parameters.iter();
    let bump = parameters.find(|p| p.name == BUMP[0]).map(|p| p.value);
    let matters = |(bump, weak): (f64, f64)| bump > diagnosis::FLOOR * weak;
    if bump.zip(weak).is_some_and(matters) {
        effect.effect = WITH_BUMP;
    } else {
        effect.effect = COULOMB_FRICTION;
        let is_bump = |name: &str| BUMP.contains(&name);
        effect.parameters.retain(|p| !is_bump(&p.name));
    }
    effect
}

/// What the reader of `effects` should know of how friction gives way.
pub fn note(effects: &[NamedEffect]) -> Option<String> {
    let own = effects.iter().find(|own| own.effect == PRESLIDING)?;
    let mut parameters = own.parameters.iter();
    let way = parameters.find(|p| p.name == "presliding_displacement")?;
    Some(format!(
        "the friction gives way over {} before it slides; the extended model has it as `{PRESLIDING}`",
        amount(way, laboratory_unit(way.unit))
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use diagnosis::ParameterEstimate;

    fn named(bump: f64) -> NamedEffect {
        let values = [
            ("coulomb_force", 8.6, false),
            ("presliding_displacement", 1.5e-4, true),
            ("stribeck_force", bump, false),
            ("stribeck_velocity", 0.013, true),
        ];
        NamedEffect {
            effect: PRESLIDING,
            parameters: values
                .map(|(name, value, is_shape)| ParameterEstimate {
                    name: name.into(),
                    value,
                    unit: "1",
                    standard_error: 0.01,
                    is_shape,
                })
                .into(),
            confidence: 0.95,
        }
    }

    #[test]
    fn friction_has_the_name_of_its_cause() {
        let names = |effect: &NamedEffect| -> Vec<String> {
            effect.parameters.iter().map(|p| p.name.clone()).collect()
        };
        let plain = by_cause(named(0.1));
        assert_eq!(plain.effect, "coulomb_friction");
        assert_eq!(names(&plain), ["coulomb_force", "presliding_displacement"]);
        let with_bump = by_cause(named(4.4));
        assert_eq!(with_bump.effect, "stribeck_friction");
        assert_eq!(with_bump.parameters.len(), 4);
        let mut other = named(4.4);
        other.effect = "valve_dead_band";
        assert_eq!(by_cause(other.clone()), other);
    }
}
