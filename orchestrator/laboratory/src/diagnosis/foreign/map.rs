//! Which column of the data is which input or output of a model, and which parameters may have drifted.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use identification::diagnosis::rigs::{LeftOut, Quantity};
use serde::Deserialize;

use crate::diagnosis::file_fault;
use crate::error::Error;
use fmi_import::{Causality, Description, Fmu, Kind};
use fmi_system::{Between, Setting};

/// A map as people write it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Map {
    /// What the model is called in the report.
    #[serde(default)]
    pub name: Option<String>,
    /// The column of the time; absent: `time` or `t`.
    #[serde(default)]
    pub time: Option<Named>,
    /// Time between samples of data without a column of it.
    #[serde(default)]
    pub time_step: Option<Quantity>,
    /// Step of the model; absent: the time between samples.
    #[serde(default)]
    pub step: Option<Quantity>,
    /// What inputs are between samples, where the model steps more often.
    #[serde(default)]
    pub between: Between,
    /// Inputs of the model by name, with their columns.
    #[serde(default)]
    pub inputs: BTreeMap<String, Named>,
    /// Outputs of the model by name, with their columns.
    pub outputs: BTreeMap<String, Named>,
    /// Parameters that may have drifted.
    #[serde(default)]
    pub parameters: BTreeMap<String, Stated>,
    /// Start values, as in a system file.
    #[serde(default)]
    pub start: BTreeMap<String, Setting>,
    /// What is not fitted; absent: the second half of every file.
    #[serde(default)]
    pub left_out: Option<LeftOut>,
}

/// A column: its header, or its header and unit.
#[derive(Debug, Clone, Deserialize)]
#[serde(
    untagged,
    expecting = "expected \"header\", or { column = \"header\", unit = \"kN\" }"
)]
pub(super) enum Named {
    /// By its header, with or without the unit.
    Header(String),
    /// With its unit.
    Column(Column),
}

/// A column with its unit.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Column {
    pub column: String,
    #[serde(default)]
    pub unit: Option<String>,
}

impl Named {
    pub(super) fn parts(&self) -> (&str, Option<&str>) {
        match self {
            Self::Header(header) => (header, None),
            Self::Column(column) => (&column.column, column.unit.as_deref()),
        }
    }
}

/// What is known of a parameter.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Stated {
    /// Its value; absent: what the model starts with.
    #[serde(default)]
    pub value: Option<Setting>,
    /// One standard deviation, in the model's unit.
    #[serde(default)]
    pub plus_minus: f64,
}

impl Map {
    /// Reads a map.
    ///
    /// # Errors
    /// A file that cannot be read or is not a map, with line and column; one without an output.
    pub(super) fn read(path: &Path) -> Result<Self, Error> {
        let text =
            identification::data::read_written(path).map_err(|error| file_fault(path, error))?;
        let map: Self = toml::from_str(&text)
            .map_err(|error| file_fault(path, format!("not a map of a model: {error}")))?;
        if map.outputs.is_empty() {
            return Err(file_fault(
                path,
                "[outputs] is empty: expected at least one output of the model with its column",
            ));
        }
        Ok(map)
    }
}

/// Parameters that a template lists at most.
const LISTED: usize = 60;

/// A commented map of `fmu` to fill in.
pub(super) fn template(fmu: &Fmu) -> String {
    let description = &fmu.description;
    let mut text = format!(
        "# Map of {}: which column of the data is which input and output of the model.\n\
         # shakebench diagnose --fmu {} --map THIS.toml DATA.csv\n\
         # A column is \"header\", with the unit in the header (`force [kN]`), or\n\
         # {{ column = \"header\", unit = \"kN\" }}; without a unit it is in the model's unit.\n\
         # Delete the lines of inputs and outputs that were not measured.\n\n\
         # time = {{ column = \"t\", unit = \"ms\" }}      # otherwise `time` or `t`\n\
         # time_step = {{ value = 2.0, unit = \"ms\" }}   # for data without a time\n\
         # step = {{ value = 0.5, unit = \"ms\" }}        # of the model, if shorter\n\
         # between = \"hold\"                           # inputs between samples then; or \"linear\"\n\
         # left_out = {{ second_half = true }}          # or {{ files = [\"b.csv\"] }}\n",
        description.model_name,
        fmu.file_name(),
    );
    let variables = |causality: Causality| {
        let all = description.of(causality).map(|i| &description.variables[i]);
        all.filter(|v| matches!(v.kind, Kind::Float64 | Kind::Float32))
    };
    for (heading, causality) in [("inputs", Causality::Input), ("outputs", Causality::Output)] {
        _ = write!(text, "\n[{heading}]\n");
        for variable in variables(causality) {
            let unit = variable.unit.as_deref().unwrap_or_default();
            let name = toml::Value::String(variable.name.clone());
            _ = writeln!(text, "{name} = {name}  # {unit} {}", variable.description);
        }
    }
    text += "\n# Parameters that may have drifted, with one standard deviation where it is known, in the\n\
             # model's unit: `stiffness = { plus_minus = 50.0 }` or `stiffness = {}`\n[parameters]\n";
    let settable = |description: &Description| {
        let own = variables(Causality::Parameter).filter(|v| v.is_settable && !v.is_structural);
        let own = own.map(|v| (v.name.clone(), v.start.clone(), v.unit.clone()));
        let count = description.of(Causality::Parameter).count();
        (own.take(LISTED).collect::<Vec<_>>(), count)
    };
    let (parameters, count) = settable(description);
    for (name, start, unit) in &parameters {
        let name = toml::Value::String(name.clone());
        let (start, unit) = (
            start.as_deref().unwrap_or("-"),
            unit.as_deref().unwrap_or(""),
        );
        _ = writeln!(text, "# {name} = {{}}  # {start} {unit}");
    }
    if count > parameters.len() {
        _ = writeln!(text, "# and others: shakebench info {}", fmu.file_name());
    }
    text += "\n# Other start values of the model, as in a system file: `x0 = 0.01`\n[start]\n";
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;

    #[test]
    fn a_template_lists_inputs_outputs_and_parameters() {
        let variables = made::real(1, "u", "input", r#"start="0" unit="N""#)
            + &made::real(2, "y", "output", r#"unit="m""#)
            + &made::real(
                3,
                "stiffness",
                "parameter",
                r#"variability="fixed" start="5" unit="N/m""#,
            )
            + r#"<Boolean name="on" valueReference="4" causality="parameter" variability="fixed" start="true"/>"#
            + &made::real(
                5,
                "constant",
                "calculatedParameter",
                r#"variability="fixed""#,
            );
        let text = template(&made::fmu("Spring", &variables));
        expected::compare(env!("CARGO_MANIFEST_DIR"), "map.txt", &text);
        // What a template gives is a map.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.toml");
        std::fs::write(&path, &text).unwrap();
        let map = Map::read(&path).unwrap();
        assert_eq!(map.inputs["u"].parts(), ("u", None));
        assert!(map.parameters.is_empty() && map.start.is_empty());
        std::fs::write(&path, "[outputs]\n").unwrap();
        let told = Map::read(&path).unwrap_err().to_string();
        assert!(told.contains("[outputs] is empty"), "{told}");
        std::fs::write(
            &path,
            "[outputs]\ny = { column = \"force\", unit = \"kN\" }\n",
        )
        .unwrap();
        assert_eq!(
            Map::read(&path).unwrap().outputs["y"].parts(),
            ("force", Some("kN"))
        );
        std::fs::write(&path, "[outputs]\ny = 3\n").unwrap();
        let told = Map::read(&path).unwrap_err().to_string();
        assert!(told.contains("not a map of a model"), "{told}");
    }

    #[test]
    fn a_template_lists_the_first_parameters_only() {
        let fixed = |n: usize| {
            made::real(
                n as u32,
                &format!("p{n}"),
                "parameter",
                r#"variability="fixed" start="1""#,
            )
        };
        let text = |count: usize| {
            let variables: String = (1..=count).map(fixed).collect();
            template(&made::fmu("Many", &variables))
        };
        assert!(!text(LISTED).contains("and others"));
        let more = text(LISTED + 1);
        assert!(
            more.contains("# and others: shakebench info Many.fmu") && !more.contains("\"p61\""),
            "{more}"
        );
    }
}
