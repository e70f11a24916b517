//! The list of effects: sound in itself, and the page that tells of it.

use std::fmt::Write as _;
use std::path::Path;

use plant::identified::effects::{self, Basis, Effects, Parameter, Role, Variable};
use plant::sensors::instrumentation::Instrumentation;

const PEAK: f64 = 3.0;
const PERIOD: f64 = 0.002;

#[test]
fn every_effect_is_described_soundly() {
    let names: Vec<&str> = effects::all().map(|effect| effect.name).collect();
    for effect in effects::all() {
        let name = effect.name;
        assert_eq!(names.iter().filter(|n| **n == name).count(), 1, "{name}");
        assert!(!effect.equation.is_empty(), "{name}");
        let told = effect.estimated().filter(|p| {
            let gaps = matches!(p.role, Role::Size { .. });
            gaps && !(name == "mains_hum" && p.name == "quadrature")
        });
        let (told, gaps) = (told.count(), effect.sentence.matches("{}").count());
        assert_eq!(told, gaps, "{name}: sizes and gaps of its sentence");
        for other in effect.confounded_with.iter().chain(&effect.contains) {
            assert!(names.contains(other), "{name}: {other}");
        }
        for values in effect.examples(PEAK) {
            assert_eq!(values.len(), effect.estimated().count(), "{name}");
            for (value, parameter) in values.iter().zip(effect.estimated()) {
                let (low, high) = parameter.bounds_on(PEAK, PERIOD);
                let within = (low..=high).contains(value);
                assert!(within, "{name}.{}: {value}", parameter.name);
            }
        }
        for parameter in effect.parameters {
            let has_place = parameter.field.is_some() || parameter.variable == Variable::None;
            assert!(has_place, "{name}.{}", parameter.name);
        }
    }
}

#[test]
fn an_effect_is_on_when_applied_and_off_again_when_turned_off() {
    for effect in effects::all() {
        let (mut on_rig, mut on_sensors) = (Effects::default(), Instrumentation::default());
        assert!(!effect.is_on(&on_rig, &on_sensors), "{}", effect.name);
        for values in effect.examples(PEAK) {
            effect.apply(&mut on_rig, &mut on_sensors, &values);
            on_rig.validate().expect("values that can be simulated");
            assert!(effect.is_on(&on_rig, &on_sensors), "{}", effect.name);
        }
        effect.turn_off(&mut on_rig, &mut on_sensors);
        assert!(!effect.is_on(&on_rig, &on_sensors), "{}", effect.name);
    }
}

/// The unit in which a parameter is told: the laboratory's, but forms are plain numbers.
fn unit(parameter: &Parameter) -> &'static str {
    match parameter.role {
        Role::Shape { .. } if parameter.quantity.si == "1" => "1",
        _ => parameter.quantity.laboratory,
    }
}

/// Three digits of a value in that unit.
fn number(parameter: &Parameter, value: f64) -> String {
    let quantity = parameter.quantity.si;
    let factor = units::convert(1.0, quantity, unit(parameter)).expect("a unit of the list");
    let value = factor * value;
    let digits = (2.0 - value.abs().log10().floor()).clamp(0.0, 8.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        return text.trim_end_matches('0').trim_end_matches('.').to_string();
    }
    text
}

fn range(parameter: &Parameter) -> String {
    let name = Some(unit(parameter)).filter(|unit| *unit != "1");
    let name = name.map_or(String::new(), |unit| format!(" {unit}"));
    let number = |value: f64| number(parameter, value);
    let (low, high) = parameter.bounds;
    let (of, tried) = match parameter.basis {
        Basis::Memory => (name, "up to 29 samples".to_string()),
        Basis::PeakCommand => {
            let of = " of the peak command".to_string();
            (of.clone(), format!("{low} to {high}{of}"))
        }
        Basis::Absolute => {
            let tried = format!("{} to {}{name}", number(low), number(high));
            (name, tried)
        }
    };
    match parameter.role {
        Role::Size { weak, .. } if parameter.basis == Basis::PeakCommand => {
            format!("size, weak at {weak}{of}, tried {tried}")
        }
        Role::Size { weak, .. } => format!("size, weak at {}{of}, tried {tried}", number(weak)),
        Role::Shape { typical, .. } => {
            format!("form, usually {}{of}, tried {tried}", number(typical))
        }
        Role::Given => "not estimated".into(),
    }
}

fn page() -> String {
    let mut text = String::from(
        "# Effects\n\n\
         What the identified rig can lack against a real one. Each is off by default, a parameter of\n\
         an FMU as `effect.parameter`, and a candidate of `shakebench diagnose`. `u` is the valve\n\
         command, `u_s` the spool, `u_f` the flow in volts of an ideal valve, `F` the actuator's\n\
         force, `x`, `v`, `a` the table's motion, `d` the specimen's drift. This page is made from\n\
         the list in `plant/src/identified/effects`.\n\n\
         | effect | component | equation | parameters | not told from |\n|---|---|---|---|---|\n",
    );
    for effect in effects::all() {
        let parameters: Vec<String> = effect
            .parameters
            .iter()
            .map(|p| format!("{}: {}", p.name, range(p)))
            .collect();
        let _ = writeln!(
            text,
            "| {} | {} | `{}` | {} | {} |",
            effect.name,
            effect.component.name(),
            effect.equation.replace('|', "\\|"),
            parameters.join("; "),
            effect.confounded_with.join(", ")
        );
    }
    text
}

#[test]
fn the_page_of_effects_is_that_of_the_list() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/effects.md");
    let page = page();
    if std::env::var("SHAKEBENCH_REGENERATE").is_ok_and(|value| value == "1") {
        std::fs::write(&file, &page).expect("a page that can be written");
    }
    let published = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(
        published.replace("\r\n", "\n") == page,
        "docs/effects.md differs; regenerate it with `SHAKEBENCH_REGENERATE=1 cargo test -p plant \
         --test effects`"
    );
}
