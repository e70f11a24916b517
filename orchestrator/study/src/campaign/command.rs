//! The command that repeats a run.

use std::path::Path;

use fmi_import::FmiVersion;
use laboratory::run::experiment::{Request, is_file};
use motion::Scaling;

/// The command that carries a request out.
pub(super) fn command(request: &Request) -> String {
    let mut words = vec!["shakebench run".to_string(), quoted(&request.system)];
    let mut option = |name: &str, value: String| words.push(format!("--{name} {}", quoted(&value)));
    let path = |path: &Path| path.display().to_string();
    if !is_file(&request.system) {
        option("plant", request.plant.clone());
        option("specimen", request.specimen.clone());
        if let Some(structure) = &request.structure {
            option("structure", structure.clone());
        }
        if let Some(tuning) = request
            .tuning
            .and_then(|tuning| clap::ValueEnum::to_possible_value(&tuning))
        {
            option("tuning", tuning.get_name().to_string());
        }
        if let Some(model) = &request.control_model {
            option("control-model", path(model));
        }
    }
    match (&request.record, &request.reference) {
        (_, Some(reference)) => option("reference", path(reference)),
        (Some(record), None) => option("record", path(record)),
        (None, None) => option("seed", request.seed.to_string()),
    }
    match request.scaling {
        Some(Scaling::Factor(factor)) => option("scale", format!("{factor:?}")),
        Some(Scaling::PeakAcceleration(peak)) => option("pga", format!("{:?} m/s2", peak)),
        Some(Scaling::PeakDisplacement(peak)) => option("peak", format!("{peak:?} m")),
        Some(Scaling::Within { .. }) | None => {}
    }
    if request.fmi == FmiVersion::V2 {
        option("fmi", "2".to_string());
    }
    if let Some(algorithm) = request.algorithm {
        option("algorithm", algorithm.to_string());
    }
    if let Some(step) = request.step_s {
        option("step", format!("{step:?} s"));
    }
    if let Some(duration) = request.duration_s {
        option("duration", format!("{duration:?} s"));
    }
    for set in &request.set {
        option("set", set.clone());
    }
    words.join(" ")
}

/// A word as a shell takes it.
pub(super) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_string(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_master::Algorithm;
    use laboratory::systems::tuning::Tuning;

    #[test]
    fn a_command_has_the_options_that_its_request_needs() {
        let usual = Request {
            plant: "physical".into(),
            specimen: "linear".into(),
            seed: 7,
            ..Request::built_in("mpc")
        };
        let begin = "shakebench run mpc --plant physical --specimen linear";
        assert_eq!(command(&usual), format!("{begin} --seed 7"));
        let tuning = <Tuning as clap::ValueEnum>::value_variants()[0];
        let name = clap::ValueEnum::to_possible_value(&tuning).unwrap();
        let algorithm = <Algorithm as clap::ValueEnum>::value_variants()[0];
        let all = Request {
            structure: Some("shear building".into()),
            tuning: Some(tuning),
            control_model: Some("a model.toml".into()),
            record: Some("RSN1.AT2".into()),
            scaling: Some(Scaling::PeakAcceleration(2.5)),
            fmi: FmiVersion::V2,
            algorithm: Some(algorithm),
            step_s: Some(0.001),
            duration_s: Some(2.0),
            set: vec!["table.mass=2.0 kg".into(), "control.gain=3".into()],
            ..usual.clone()
        };
        assert_eq!(
            command(&all),
            format!(
                "{begin} --structure 'shear building' --tuning {} --control-model 'a model.toml' --record RSN1.AT2 \
                 --pga '2.5 m/s2' --fmi 2 --algorithm {algorithm} --step '0.001 s' --duration '2.0 s' \
                 --set 'table.mass=2.0 kg' --set control.gain=3",
                name.get_name()
            )
        );
        let scaled = |scaling| {
            let request = Request {
                reference: Some("r.csv".into()),
                record: Some("RSN1.AT2".into()),
                scaling: Some(scaling),
                ..usual.clone()
            };
            command(&request)
        };
        assert_eq!(
            scaled(Scaling::Factor(0.5)),
            format!("{begin} --reference r.csv --scale 0.5")
        );
        assert_eq!(
            scaled(Scaling::PeakDisplacement(0.25)),
            format!("{begin} --reference r.csv --peak '0.25 m'")
        );
        // A system file has plant and specimen itself.
        let file = Request {
            system: "own/rig.toml".into(),
            ..usual
        };
        assert_eq!(command(&file), "shakebench run own/rig.toml --seed 7");
    }

    #[test]
    fn words_are_quoted_where_a_shell_would_change_them() {
        for (word, shown) in [
            ("a-b_c./=:,+9", "a-b_c./=:,+9"),
            ("", "''"),
            ("a b", "'a b'"),
            ("it's", r"'it'\''s'"),
            ("ö", "'ö'"),
        ] {
            assert_eq!(quoted(word), shown);
        }
    }
}
