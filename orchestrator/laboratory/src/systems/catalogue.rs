//! The controllers that come with the program, and the rules that tune them: to add one, add its line here.

use controllers::acceleration_tracking::AccelerationTracking;
use controllers::tuning::suite::Member;
use serde::de::Error as _;
use serde::de::value::Error as UnknownRule;

use super::rule::Rule;
use super::tuning::Rules;

/// A part of a built-in system.
pub(super) struct Part {
    pub name: &'static str,
    /// TOML.
    pub text: &'static str,
}

macro_rules! part {
    ($folder:literal, $name:literal) => {
        Part {
            name: $name,
            text: include_str!(concat!("../../systems/", $folder, $name, ".toml")),
        }
    };
}
pub(super) use part;

/// Controllers: the names of the built-in systems.
pub(super) const CONTROLLERS: &[Part] = &[
    part!("", "displacement-pid"),
    part!("", "three-variable"),
    part!("", "loop-shaping"),
    part!("", "sliding-mode"),
    part!("", "mpc"),
    part!("", "three-variable-compensated"),
    part!("", "mpc-compensated"),
    part!("", "lqg"),
    part!("", "preview"),
    part!("", "acceleration-tracking"),
    part!("", "dual-loop"),
    part!("", "multi-metric"),
    part!("", "minimal-control-synthesis"),
    part!("", "multiple-surface"),
    part!("", "dynamic-surface"),
    part!("", "receding-horizon"),
    part!("", "adaptive-inverse"),
    part!("", "adaptive-preview"),
    part!("", "adaptive-mpc"),
];

/// The rule of the aids of operators. It goes before the others, which then have a stabilised rig.
pub(super) const OPERATOR_AIDS: &str = "operator-aids";

/// Rules by the name that a component's `tuning` gives.
const RULES: &[(&str, Rule)] = &[
    ("adaptive-inverse", Rules::adaptive_inverse),
    ("dual-loop", |rules, own| {
        rules.acceleration_tracking(own, AccelerationTracking::dual_loop)
    }),
    ("displacement-pid", |rules, own| {
        rules.member(own, Member::DisplacementPid)
    }),
    ("force-pid", Rules::force_pid),
    (
        "linear-quadratic-gaussian",
        Rules::linear_quadratic_gaussian,
    ),
    ("loop-shaping", |rules, own| {
        rules.member(own, Member::LoopShaping)
    }),
    (
        "minimal-control-synthesis",
        Rules::minimal_control_synthesis,
    ),
    ("model-predictive", Rules::model_predictive),
    ("multi-metric", Rules::multi_metric),
    (OPERATOR_AIDS, Rules::operator_aids),
    ("preview", Rules::preview),
    ("sliding-mode", Rules::sliding_mode),
    ("surface-control", Rules::surface_control),
    ("three-variable", |rules, own| {
        rules.member(own, Member::ThreeVariable)
    }),
    ("trajectory-tracking", |rules, own| {
        rules.acceleration_tracking(own, AccelerationTracking::trajectory)
    }),
    ("under-prediction", Rules::under_prediction),
];

/// The rule that a system file names.
///
/// # Errors
/// No such rule, with those that there are.
pub(super) fn rule(name: &str) -> Result<Rule, UnknownRule> {
    let found = RULES.iter().find(|(own, _)| *own == name);
    found.map(|(_, rule)| *rule).ok_or_else(|| {
        let known: Vec<String> = RULES.iter().map(|(own, _)| format!("`{own}`")).collect();
        let known = known.join(", ");
        UnknownRule::custom(format!("unknown variant `{name}`, expected one of {known}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_system::SystemFile;

    #[test]
    fn every_rule_that_a_built_in_system_names_is_there() {
        for part in CONTROLLERS {
            let file = SystemFile::parse(part.name, part.text).unwrap();
            for name in file
                .components
                .values()
                .filter_map(|own| own.tuning.as_deref())
            {
                assert!(rule(name).is_ok(), "{}: {name}", part.name);
            }
        }
        let refused = rule("preview-control").unwrap_err().to_string();
        assert!(
            refused.contains("`preview-control`") && refused.contains("`preview`"),
            "{refused}"
        );
    }
}
