//! A description to fill in, made from what a kind knows of itself.

use std::fmt::Write;

use super::Rig;
use recordings::Channel;

/// Characters of a line.
const WIDTH: usize = 100;

/// A commented description of a rig of this kind. Its numbers are `nan`, which a description must
/// not keep.
pub fn template(rig: &dyn Rig) -> String {
    let mut text = String::new();
    let mut line = |line: String| {
        text += &line;
        text.push('\n');
    };
    let kind = rig.kind();
    line(format!(
        "# A rig of kind {kind}. Replace every `nan` and every name in <>; then run"
    ));
    line("# shakebench diagnose THIS_FILE.toml --out results".into());
    line("name = \"<what it is called>\"".into());
    line(format!("kind = \"{kind}\""));
    line("# CSV files, relative to this one, or given with --data.".into());
    line("data = [\"<record.csv>\"]".into());
    line("# Time between samples, where the files have no column of times:".into());
    line("# time_step = { value = 1.0, unit = \"ms\" }".into());
    line(String::new());
    line("# Columns by their header, with the unit of their numbers; other columns are".into());
    line(
        "# ignored. For another file of the same rig with other names, use --columns MAP.toml"
            .into(),
    );
    line("[columns]".into());
    let mut column = |channel: Channel, comment: &str, note: &str| {
        let (name, unit) = (channel.name(), channel.unit());
        line(format!(
            "{comment}{name} = {{ column = \"<{name}>\", unit = \"{unit}\" }}{note}"
        ));
    };
    column(Channel::Time, "", "");
    for input in rig.inputs() {
        column(*input, "", "");
    }
    column(rig.output(), "", "  # what is simulated and compared");
    for also in rig.also() {
        column(*also, "# ", "  # compared as well, where there is one");
    }
    for (channel, _) in rig.optional() {
        column(*channel, "# ", "  # where there is one");
    }
    line(String::new());
    line(
        "# The nominal model of the rig: value, one standard deviation (without it the value is"
            .into(),
    );
    line("# exact), unit of both.".into());
    line("[nominal]".into());
    let parameters = rig.parameters().iter().zip(rig.about_parameters());
    for (((name, unit), about), default) in parameters.zip(rig.defaults()) {
        line(format!("# {}", about.trim()));
        line(match default {
            Some(value) => {
                format!("# {name} = {{ value = {value:?}, plus_minus = 0.0, unit = \"{unit}\" }}")
            }
            None => format!("{name} = {{ value = nan, plus_minus = nan, unit = \"{unit}\" }}"),
        });
    }
    line(String::new());
    line("# Held-out data, which are predicted and not fitted; one of these three.".into());
    line("[left_out]".into());
    line("second_half = true".into());
    line("# every_second_block = { value = 2.0, unit = \"s\" }  # for a sweep".into());
    line("# files = [\"<record_2.csv>\"]".into());
    line(String::new());
    if rig.begins_anew() {
        line(
            "# Such a rig has no restoring force, so model errors accumulate. The model is \
            compared"
                .into(),
        );
        line("# in windows, each of which starts from known outputs.".into());
        line("[windows]".into());
        line("length = { value = 0.5, unit = \"s\" }".into());
        line("known = { value = 0.02, unit = \"s\" }".into());
        line(String::new());
    }
    line("# Effects in the search:".into());
    for effect in rig.effects() {
        let words = effect.about.split_whitespace();
        let mut now = format!("# {}:", effect.candidate.effect);
        for word in words {
            if now.chars().count() + 1 + word.chars().count() > WIDTH {
                line(std::mem::replace(&mut now, "#    ".into()));
            }
            let _ = write!(now, " {word}");
        }
        line(now);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::{Description, KINDS, like};
    use super::*;

    #[test]
    fn every_kind_has_a_template_that_is_refused_until_it_is_filled_in() {
        let folder = std::env::temp_dir().join(format!("template-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for rig in KINDS {
            let text = template(rig);
            assert!(
                text.lines().all(|line| line.chars().count() <= WIDTH + 20),
                "{text}"
            );
            let path = folder.join(format!("{}.toml", rig.kind()));
            std::fs::write(&path, &text).unwrap();
            let description = Description::read(&path).unwrap();
            let refused = description.nominal(rig).unwrap_err().to_string();
            assert!(refused.contains("is not a number"), "{refused}");
            std::fs::write(&path, text.replace("nan", "1.0")).unwrap();
            Description::read(&path).unwrap().nominal(rig).unwrap();
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_kind_is_found_by_a_word_of_its_name() {
        for (word, kind) in [
            ("actuator", "closed_loop_actuator"),
            ("drive", "positioning_drive"),
            ("Hysteretic device", "hysteretic_device"),
            ("material", "cyclic_material"),
            ("oscillator", "oscillator"),
            ("axis", "linear_axis"),
        ] {
            assert_eq!(like(word).map(Rig::kind), Some(kind));
        }
        assert!(like("i").is_none() && like("").is_none() && like("robot").is_none());
    }
}
