//! Files of a diagnosis of an FMU: a system with the effects around the model, the record that
//! drives it, and curves.

use std::io::{self, Write};
use std::path::Path;
use units::vocabulary;

use identification::diagnosis::rigs::INTERVAL_95;
use identification::diagnosis::rigs::foreign::{ForeignDiagnosis, ForeignModel, Signal};
use plant::signal_path::SignalEffects;
use toml::{Table, Value};

use super::file_fault;
use super::simulator::{Alone, is_file};
use crate::error::Error;
use units::Unit;

/// File with the inputs of the first record that contains held-out data.
pub(super) const INPUTS: &str = "inputs.csv";
/// File with measured and simulated outputs.
pub(super) const TRACES: &str = "traces.csv";
/// Component on the path of a signal.
pub(super) const PATH: &str = "SignalPath";

/// Place of the record that the extended model plays.
pub(super) fn shown(subject: &ForeignModel<'_>) -> usize {
    let mut all = subject.trials.iter();
    all.position(|trial| trial.left_out.contains(&true))
        .unwrap_or(0)
}

/// A header with the unit where the grammar of units knows it.
pub(in crate::diagnosis) fn head(signal: &Signal) -> String {
    match Unit::parse(&signal.unit) {
        Ok(_) if !signal.unit.is_empty() => format!("{} [{}]", signal.name, signal.unit),
        _ => signal.name.clone(),
    }
}

/// A name that a component can have, and that none has.
fn component(signal: &Signal, taken: &mut Vec<String>) -> String {
    let letters = signal.name.chars().map(|c| match c {
        c if c.is_ascii_alphanumeric() || c == '_' => c,
        _ => '_',
    });
    let mut name = format!("{}_path", letters.collect::<String>());
    while taken.contains(&name) {
        name += "_";
    }
    taken.push(name.clone());
    name
}

fn path(effects: &SignalEffects, period: f64) -> Value {
    let none = SignalEffects::NONE;
    let all = [
        ("delay", effects.delay, none.delay),
        ("lag", effects.lag, none.lag),
        (vocabulary::RATE_LIMIT, effects.rate_limit, none.rate_limit),
        ("play", effects.play, none.play),
        (vocabulary::DEAD_BAND, effects.dead_band, none.dead_band),
        ("asymmetry", effects.asymmetry, none.asymmetry),
        ("gain", effects.gain, none.gain),
        ("offset", effects.offset, none.offset),
        ("saturation", effects.saturation, none.saturation),
    ];
    let mut parameters = Table::new();
    parameters.insert("period".into(), Value::Float(period));
    for (name, value, without) in all {
        if value != without {
            parameters.insert(name.into(), Value::Float(value));
        }
    }
    let mut own = Table::new();
    own.insert("fmu".into(), PATH.into());
    own.insert("period".into(), Value::Float(period));
    own.insert("parameters".into(), Value::Table(parameters));
    Value::Table(own)
}

/// The extended model as a system that `run` plays and `export` makes an SSP of.
///
/// # Errors
/// A path that has no absolute one.
pub(super) fn system(
    alone: &Alone,
    model: &Path,
    subject: &ForeignModel<'_>,
    found: &ForeignDiagnosis,
) -> Result<String, Error> {
    let trial = &subject.trials[shown(subject)];
    let mut file = alone.file.clone();
    file.name = format!("{}, extended", subject.name);
    file.description = found.found.named.join(", ");
    file.own_tables.clear();
    file.connections.clear();
    let absolute = match is_file(model) {
        true => std::path::absolute(model).map_err(|error| file_fault(model, error))?,
        false => model.to_path_buf(),
    };
    if let Some(own) = file.components.get_mut(&alone.component) {
        own.fmu = absolute.display().to_string();
        for (place, value) in &found.extension.parameters {
            own.set(&subject.parameters[*place].name, *value);
        }
    }
    let mut all: Table = toml::from_str(&file.to_toml()).unwrap_or_default();
    let mut components = match all.remove("components") {
        Some(Value::Table(components)) => components,
        _ => Table::new(),
    };
    let mut taken: Vec<String> = components.keys().cloned().collect();
    let mut links = Vec::new();
    for (input, effects) in subject.inputs.iter().zip(&found.extension.inputs) {
        let (from, to) = (
            format!("record.{}", input.name),
            format!("{}.{}", alone.component, input.name),
        );
        if *effects == SignalEffects::NONE {
            links.push(format!("{from} -> {to}"));
        } else {
            let name = component(input, &mut taken);
            links.push(format!("{from} -> {name}.u"));
            links.push(format!("{name}.y -> {to}"));
            components.insert(name, path(effects, trial.step));
        }
    }
    for (output, effects) in subject.outputs.iter().zip(&found.extension.outputs) {
        if *effects != SignalEffects::NONE {
            let name = component(output, &mut taken);
            links.push(format!("{}.{} -> {name}.u", alone.component, output.name));
            components.insert(name, path(effects, trial.step * trial.stride as f64));
        }
    }
    all.insert("components".into(), Value::Table(components));
    let links = links.into_iter().map(Value::from).collect();
    all.insert("connections".into(), Value::Array(links));
    if !subject.inputs.is_empty() {
        let mut table = Table::new();
        table.insert("file".into(), INPUTS.into());
        table.insert("between".into(), "hold".into());
        let mut tables = Table::new();
        tables.insert("record".into(), Value::Table(table));
        all.insert("tables".into(), Value::Table(tables));
    }
    let steps = trial.samples().saturating_sub(1) * trial.stride;
    let mut experiment = Table::new();
    experiment.insert("step".into(), Value::Float(trial.step));
    experiment.insert("sampling".into(), Value::Float(trial.step));
    experiment.insert("duration".into(), Value::Float(steps as f64 * trial.step));
    all.insert("experiment".into(), Value::Table(experiment));
    let mut text = format!(
        "# {} with the effects around it, on the record {}. In the model's units:\n",
        subject.name, trial.name
    );
    for (effect, values) in &found.found.confirmed.effects {
        for value in values {
            let (of, amount, half) = (&value.name, value.value, INTERVAL_95 * value.standard_error);
            text += &format!(
                "#   {effect}: {of} {amount:.6e} ± {half:.1e} {}\n",
                value.unit
            );
        }
    }
    text += "# shakebench run extended_model.toml; shakebench export extended_model.toml --ssp MODEL.ssp\n";
    // Tables of texts and finite numbers alone are always TOML.
    Ok(text + &toml::to_string_pretty(&all).unwrap_or_default())
}

/// The inputs of the record that the extended model plays.
///
/// # Errors
/// A disk that is full, and the like.
pub(super) fn inputs(subject: &ForeignModel<'_>, file: &mut dyn Write) -> io::Result<()> {
    let trial = &subject.trials[shown(subject)];
    let heads = subject.inputs.iter().map(head);
    let mut csv = csv::Writer::from_writer(file);
    csv.write_record(std::iter::once("time [s]".to_owned()).chain(heads))?;
    let steps = trial.samples().saturating_sub(1) * trial.stride + 1;
    for k in 0..steps {
        let own = trial.inputs.iter().map(|input| input[k].to_string());
        let time = k as f64 * trial.step;
        csv.write_record(std::iter::once(time.to_string()).chain(own))?;
    }
    csv.flush()
}

/// Measured and simulated outputs of every record, one sample per row.
///
/// # Errors
/// A disk that is full, and the like.
pub(super) fn traces(
    subject: &ForeignModel<'_>,
    found: &ForeignDiagnosis,
    file: &mut dyn Write,
) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(file);
    let mut heads = vec![
        "record".to_owned(),
        "time [s]".to_owned(),
        "left_out".to_owned(),
    ];
    for output in &subject.outputs {
        heads
            .extend(["measured", "nominal", "extended"].map(|of| format!("{of} {}", head(output))));
    }
    csv.write_record(&heads)?;
    for (t, trial) in subject.trials.iter().enumerate() {
        let period = trial.step * trial.stride as f64;
        for k in 0..trial.samples() {
            let mut row = vec![
                trial.name.clone(),
                (k as f64 * period).to_string(),
                u8::from(trial.left_out[k]).to_string(),
            ];
            for j in 0..subject.outputs.len() {
                let measured = trial.outputs[j][k];
                row.push(if measured.is_finite() {
                    measured.to_string()
                } else {
                    String::new()
                });
                row.extend([&found.nominal, &found.extended].map(|of| of[t][j][k].to_string()));
            }
            csv.write_record(&row)?;
        }
    }
    csv.flush()
}

#[cfg(test)]
pub(super) mod tests {
    use identification::diagnosis::rigs::foreign::{Extension, Parameter, Trial};

    use super::super::simulator;
    use super::*;
    use fmi_system::{Setting, SystemFile};

    fn signal(name: &str, unit: &str) -> Signal {
        Signal {
            name: name.into(),
            unit: unit.into(),
        }
    }

    #[test]
    fn heads_have_units_that_are_known_and_components_names_of_their_own() {
        assert_eq!(head(&signal("force", "kN")), "force [kN]");
        assert_eq!(head(&signal("force", "")), "force");
        assert_eq!(head(&signal("force", "no unit!")), "force");
        let mut taken = vec!["a_b_path".to_string()];
        assert_eq!(component(&signal("a.b", ""), &mut taken), "a_b_path_");
        assert_eq!(component(&signal("a[b", ""), &mut taken), "a_b_path__");
        assert_eq!(component(&signal("x1", ""), &mut taken), "x1_path");
        assert_eq!(taken.len(), 4);
    }

    #[test]
    fn a_path_has_the_effects_that_differ_from_none() {
        let effects = SignalEffects {
            delay: 0.004,
            gain: 1.5,
            ..SignalEffects::NONE
        };
        let text = toml::to_string(&path(&effects, 0.002)).unwrap();
        assert_eq!(
            text,
            "fmu = \"SignalPath\"\nperiod = 0.002\n\n[parameters]\ndelay = 0.004\ngain = 1.5\nperiod = 0.002\n"
        );
        let none = toml::to_string(&path(&SignalEffects::NONE, 0.002)).unwrap();
        assert!(none.ends_with("[parameters]\nperiod = 0.002\n"), "{none}");
    }

    /// `y = 3 u` with two records, of which the second is held out in part.
    pub(in crate::diagnosis::foreign) fn subject(alone: &Alone) -> ForeignModel<'_> {
        let trial = |name: &str, left_out: [bool; 4]| Trial {
            name: name.into(),
            step: 0.01,
            stride: 5,
            inputs: vec![vec![0.0; 16]],
            outputs: vec![vec![1.0, 2.0, 3.0, 4.0]],
            left_out: left_out.to_vec(),
        };
        ForeignModel {
            name: "gain".into(),
            simulator: alone,
            inputs: vec![signal("u", "V")],
            outputs: vec![signal("y", "m")],
            parameters: vec![Parameter {
                name: "gain".into(),
                unit: String::new(),
                value: 1.0,
                plus_minus: 0.1,
            }],
            trials: vec![
                trial("fitted", [false; 4]),
                trial("held out", [false, false, true, true]),
            ],
        }
    }

    /// A diagnosis that found these effects on input and output, and another gain.
    pub(in crate::diagnosis::foreign) fn found(
        inputs: SignalEffects,
        outputs: SignalEffects,
    ) -> ForeignDiagnosis {
        let played = |values: [f64; 4]| vec![vec![vec![0.0; 4]], vec![values.to_vec()]];
        ForeignDiagnosis {
            found: crate::made::rig_diagnosis("fmu"),
            equivalents: Vec::new(),
            notes: Vec::new(),
            extension: Extension {
                inputs: vec![inputs],
                outputs: vec![outputs],
                parameters: vec![(0, 1.25)],
            },
            nominal: played([0.5; 4]),
            extended: played([1.0, 2.0, 3.0, 3.75]),
            predictable: 0.0,
        }
    }

    /// The extended model with these effects on the input and the output.
    fn extended(inputs: SignalEffects, outputs: SignalEffects) -> SystemFile {
        let alone = simulator::tests::alone();
        let subject = subject(&alone);
        let found = found(inputs, outputs);
        assert_eq!(shown(&subject), 1);
        let text = system(&alone, Path::new("Gain"), &subject, &found).unwrap();
        assert!(text.starts_with("# gain with the effects around it, on the record held out."));
        SystemFile::parse("extended", &text).unwrap()
    }

    fn links(file: &SystemFile) -> Vec<String> {
        file.connections.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn an_extended_model_has_paths_where_there_are_effects_and_only_there() {
        let late = SignalEffects {
            delay: 0.02,
            ..SignalEffects::NONE
        };
        let bare = extended(SignalEffects::NONE, SignalEffects::NONE);
        assert_eq!(links(&bare), ["record.u -> own.u"]);
        let names: Vec<&String> = bare.components.keys().collect();
        assert_eq!(names, ["own"]);
        assert_eq!(
            bare.components["own"].parameters["gain"],
            Setting::Number(1.25)
        );
        // Three samples of five steps.
        assert_eq!(bare.duration().unwrap(), Some(15.0 * 0.01));
        assert_eq!(bare.step().unwrap(), Some(0.01));
        let before = extended(late, SignalEffects::NONE);
        assert_eq!(
            links(&before),
            ["record.u -> u_path.u", "u_path.y -> own.u"]
        );
        let path = &before.components["u_path"];
        assert_eq!(
            (&*path.fmu, &path.parameters["delay"]),
            (PATH, &Setting::Number(0.02))
        );
        assert_eq!(path.parameters["period"], Setting::Number(0.01));
        let behind = extended(SignalEffects::NONE, late);
        assert_eq!(links(&behind), ["record.u -> own.u", "own.y -> y_path.u"]);
        // Outputs are sampled as they were measured.
        assert_eq!(
            behind.components["y_path"].parameters["period"],
            Setting::Number(0.05)
        );
    }
}
