//! An FMU of this project with other start values: the same library, its own description.

use std::{ops::Range, path::Path};

use fmu_kit::resources::{START_VALUES, variant_token};
use roxmltree::{Document, Node};

use super::annotation::escape;
use super::archive::{Entries, archive_bytes, read_archive, write_archive};
use super::error::{PackError, VariantFault, file_error};

/// A parameter that starts differently.
#[derive(Debug, Clone, PartialEq)]
pub struct StartValue {
    /// The parameter's name.
    pub name: String,
    /// Its new start value, SI; of an enumeration the number of the choice.
    pub value: f64,
    /// What is added to its description, such as a standard error; may be empty.
    pub note: String,
}

/// Writes `out`, the FMU `original` with other start values and another model name.
///
/// The library finds the values in the FMU's resources, so every importer sees them without
/// setting anything. The variant has its own token.
///
/// # Errors
/// The original is not an FMU of this project, or one of the names is not a Float64 or enumeration
/// parameter of it.
pub fn write_variant(
    original: &Path,
    out: &Path,
    model_name: &str,
    start_values: &[StartValue],
) -> Result<(), PackError> {
    let entries = variant(original, Some(model_name), start_values)?;
    write_archive(out, &entries, None)
}

/// The bytes of the FMU `original` with other start values.
///
/// # Errors
/// As [`write_variant`].
pub fn variant_bytes(original: &Path, start_values: &[StartValue]) -> Result<Vec<u8>, PackError> {
    let entries = variant(original, None, start_values)?;
    archive_bytes(&entries).map_err(file_error(original))
}

fn variant(
    original: &Path,
    model_name: Option<&str>,
    start_values: &[StartValue],
) -> Result<Entries, PackError> {
    let fail = |problem: VariantFault| PackError::Variant {
        path: original.into(),
        problem,
    };
    let mut entries = read_archive(original)?;
    let resource = format!("resources/{START_VALUES}");
    if entries.contains_key(&resource) {
        return Err(fail(VariantFault::Variant));
    }
    let description = entries
        .get("modelDescription.xml")
        .and_then(|text| String::from_utf8(text.clone()).ok())
        .ok_or_else(|| fail(VariantFault::NoDescription))?;
    let lines = start_values
        .iter()
        .map(|start| format!("{},{}\n", start.name, start.value));
    let table: String = lines.collect();
    let changed = change(&description, model_name, start_values, &table).map_err(fail)?;
    entries.insert("modelDescription.xml".into(), changed.into_bytes());
    entries.insert(resource, table.into_bytes());
    Ok(entries)
}

/// The bytes of the FMU `original` with a further file in its resources.
///
/// # Errors
/// When the original cannot be read.
pub fn with_resource(original: &Path, name: &str, content: Vec<u8>) -> Result<Vec<u8>, PackError> {
    let mut entries = read_archive(original)?;
    entries.insert(format!("resources/{name}"), content);
    archive_bytes(&entries).map_err(file_error(original))
}

/// The description with the values of some attributes replaced.
fn change(
    description: &str,
    model_name: Option<&str>,
    start_values: &[StartValue],
    table: &str,
) -> Result<String, VariantFault> {
    let document = Document::parse(description)?;
    let root = document.root_element();
    let mut changes: Vec<(Range<usize>, String)> = Vec::new();
    let mut replace = |node: Node, attribute: &'static str, value: String| {
        let found = node.attribute_node(attribute);
        let place = found.ok_or(VariantFault::NoAttribute(attribute))?;
        changes.push((place.range_value(), escape(&value)));
        Ok::<(), VariantFault>(())
    };
    if let Some(name) = model_name {
        replace(root, "modelName", name.into())?;
    }
    let name = if root.has_attribute("guid") {
        "guid"
    } else {
        "instantiationToken"
    };
    let token = root.attribute(name).ok_or(VariantFault::NoToken)?;
    replace(root, name, variant_token(token, table))?;
    for start in start_values {
        let variable = root
            .descendants()
            .filter(|node| node.attribute("causality") == Some("parameter"))
            .find(|node| node.attribute("name") == Some(&start.name))
            .ok_or_else(|| VariantFault::NotAParameter(start.name.clone()))?;
        // In FMI 2.0 type and start value stand in an element of their own.
        let typed = variable.first_element_child().unwrap_or(variable);
        let fits = match typed.tag_name().name() {
            "Real" | "Float64" => start.value.is_finite(),
            "Enumeration" => start.value.fract() == 0.0,
            _ => false,
        };
        if !fits {
            return Err(VariantFault::Type {
                name: start.name.clone(),
                value: start.value,
            });
        }
        replace(typed, "start", start.value.to_string())?;
        if !start.note.is_empty() {
            let about = variable.attribute("description").unwrap_or_default();
            replace(variable, "description", format!("{about} ({})", start.note))?;
        }
    }
    changes.sort_by_key(|(range, _)| std::cmp::Reverse(range.start));
    let mut text = description.to_string();
    for (range, value) in changes {
        text.replace_range(range, &value);
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resource_is_added_to_what_an_archive_holds() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("One.fmu");
        let before: Entries = [
            ("modelDescription.xml".to_string(), b"<a/>".to_vec()),
            ("resources/motion.csv".to_string(), b"old".to_vec()),
        ]
        .into();
        crate::write_archive(&path, &before, None).unwrap();
        let bytes = with_resource(&path, "motion.csv", b"time\n".to_vec()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        let after = with_resource(&path, "more/notes.txt", Vec::new()).unwrap();
        std::fs::write(&path, after).unwrap();
        let mut wanted = before;
        wanted.insert("resources/motion.csv".to_string(), b"time\n".to_vec());
        wanted.insert("resources/more/notes.txt".to_string(), Vec::new());
        assert_eq!(read_archive(&path).unwrap(), wanted);
        let gone = with_resource(&folder.path().join("Gone.fmu"), "a", Vec::new()).unwrap_err();
        assert!(gone.to_string().contains("Gone.fmu"), "{gone}");
    }

    /// One description in both versions of FMI, with a Real, an enumeration and a Boolean.
    const DESCRIPTIONS: [&str; 2] = [
        r#"<fmiModelDescription fmiVersion="2.0" modelName="One" guid="{1}"><ModelVariables>
<ScalarVariable name="mass" causality="parameter" description="moving mass"><Real start="2" unit="kg"/></ScalarVariable>
<ScalarVariable name="law" causality="parameter"><Enumeration start="1"/></ScalarVariable>
<ScalarVariable name="on" causality="parameter"><Boolean start="true"/></ScalarVariable>
<ScalarVariable name="x" causality="output"><Real start="7"/></ScalarVariable>
</ModelVariables></fmiModelDescription>"#,
        r#"<fmiModelDescription fmiVersion="3.0" modelName="One" instantiationToken="{1}"><ModelVariables>
<Float64 name="mass" causality="parameter" description="moving mass" start="2" unit="kg"/>
<Enumeration name="law" causality="parameter" start="1"/>
<Boolean name="on" causality="parameter" start="true"/>
<Float64 name="x" causality="output" start="7"/>
</ModelVariables></fmiModelDescription>"#,
    ];

    fn start(name: &str, value: f64, note: &str) -> StartValue {
        StartValue {
            name: name.into(),
            value,
            note: note.into(),
        }
    }

    fn original(folder: &Path, description: &str) -> std::path::PathBuf {
        let path = folder.join("One.fmu");
        let entries: Entries = [("modelDescription.xml".to_string(), description.into())].into();
        crate::write_archive(&path, &entries, None).unwrap();
        path
    }

    #[test]
    fn a_variant_has_its_own_name_token_values_and_notes() {
        for description in DESCRIPTIONS {
            let folder = tempfile::tempdir().unwrap();
            let path = original(folder.path(), description);
            let out = folder.path().join("Two.fmu");
            let values = [
                start("mass", 2.5, "estimated <here>"),
                start("law", 3.0, ""),
            ];
            write_variant(&path, &out, "Two & more", &values).unwrap();
            let entries = read_archive(&out).unwrap();
            let table = "mass,2.5\nlaw,3\n";
            assert_eq!(entries["resources/start_values.csv"], table.as_bytes());
            let token = variant_token("{1}", table);
            assert_ne!(token, "{1}");
            let expected = description
                .replace("modelName=\"One\"", "modelName=\"Two &amp; more\"")
                .replace("{1}", &token)
                .replace("start=\"2\"", "start=\"2.5\"")
                .replace("start=\"1\"", "start=\"3\"")
                .replace("moving mass", "moving mass (estimated &lt;here&gt;)");
            assert_eq!(
                String::from_utf8_lossy(&entries["modelDescription.xml"]),
                expected
            );
            // In memory the name stays.
            let bytes = variant_bytes(&path, &values).unwrap();
            std::fs::write(&out, bytes).unwrap();
            let entries = read_archive(&out).unwrap();
            let expected = expected.replace("Two &amp; more", "One");
            assert_eq!(
                String::from_utf8_lossy(&entries["modelDescription.xml"]),
                expected
            );
            let again = variant_bytes(&out, &[]).unwrap_err().to_string();
            assert!(again.contains("is a variant itself"), "{again}");
        }
    }

    #[test]
    fn values_that_a_variable_cannot_start_with_are_refused() {
        for description in DESCRIPTIONS {
            let folder = tempfile::tempdir().unwrap();
            let path = original(folder.path(), description);
            for (own, expected) in [
                (start("x", 1.0, ""), "`x` is not a parameter of it"),
                (start("other", 1.0, ""), "`other` is not a parameter of it"),
                (
                    start("on", 1.0, ""),
                    "`on` = 1 is neither Float64 nor an enumeration",
                ),
                (start("law", 1.5, ""), "`law` = 1.5 is neither"),
                (start("mass", f64::NAN, ""), "`mass` = NaN is neither"),
                (
                    start("law", 1.0, "why"),
                    "an attribute `description` is missing",
                ),
            ] {
                let told = variant_bytes(&path, &[own]).unwrap_err().to_string();
                assert!(
                    told.contains("One.fmu") && told.contains(expected),
                    "{told}"
                );
            }
            let without = description
                .replace("guid=", "other=")
                .replace("instantiationToken=", "other=");
            let told = variant_bytes(&original(folder.path(), &without), &[]).unwrap_err();
            assert!(told.to_string().contains("the token is missing"), "{told}");
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("None.fmu");
        crate::write_archive(&path, &Entries::new(), None).unwrap();
        let told = variant_bytes(&path, &[]).unwrap_err().to_string();
        assert!(told.contains("no readable modelDescription.xml"), "{told}");
    }
}
