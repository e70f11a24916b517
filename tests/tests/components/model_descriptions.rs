//! The published interfaces in `modelDescription/` are what the code says.

use std::{collections::BTreeSet, fs, path::PathBuf};

use pack::{model_descriptions, workspace_root};

/// Set to 1, the files are written instead of compared.
const REGENERATE: &str = "SHAKEBENCH_REGENERATE";

#[test]
fn published_model_descriptions_are_those_of_the_components() {
    let root = workspace_root().unwrap().join("modelDescription");
    let descriptions = model_descriptions().unwrap();
    let regenerate = std::env::var(REGENERATE).is_ok_and(|value| value == "1");
    let mut different = Vec::new();
    for (place, text) in &descriptions {
        let file = root.join(place);
        if regenerate {
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(&file, text).unwrap();
        }
        // A checkout may have changed the ends of lines.
        let published = fs::read_to_string(&file)
            .unwrap_or_default()
            .replace("\r\n", "\n");
        if published != *text {
            different.push(file);
        }
    }
    let wanted: BTreeSet<PathBuf> = descriptions
        .iter()
        .map(|(place, _)| root.join(place))
        .collect();
    for folder in ["fmi2", "fmi3"] {
        for entry in fs::read_dir(root.join(folder)).into_iter().flatten() {
            let file = entry.unwrap().path();
            if file.extension().is_some_and(|e| e == "xml") && !wanted.contains(&file) {
                if regenerate {
                    fs::remove_file(&file).unwrap();
                } else {
                    different.push(file);
                }
            }
        }
    }
    assert!(
        different.is_empty(),
        "code and published interface differ in {different:#?}; if the change is meant, regenerate \
         with `{REGENERATE}=1 cargo test --release -p acceptance --test components model_descriptions`"
    );
}
