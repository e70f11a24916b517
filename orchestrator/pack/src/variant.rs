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
}
