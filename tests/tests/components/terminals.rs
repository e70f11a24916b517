//! Terminals: ports that tools connect as a whole have to fit each other.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;

use acceptance::python::run_script;
use fmi_import::{Causality, Fmu};
use pack::{FmiVersion, all_fmus};
use roxmltree::Document;

/// A terminal of a component: members with causality and unit of their variables.
struct Terminal {
    component: String,
    name: String,
    kind: String,
    is_plug: bool,
    members: BTreeMap<String, (Causality, Option<String>)>,
}

fn terminals() -> Vec<Terminal> {
    let mut all = Vec::new();
    for fmu in all_fmus().unwrap() {
        if fmu.version != FmiVersion::V3 {
            continue;
        }
        let description = &Fmu::open(&fmu.path).unwrap().description;
        let mut archive = zip::ZipArchive::new(File::open(&fmu.path).unwrap()).unwrap();
        let mut text = String::new();
        let mut file = archive
            .by_name("terminalsAndIcons/terminalsAndIcons.xml")
            .unwrap();
        file.read_to_string(&mut text).unwrap();
        let document = Document::parse(&text).unwrap();
        for node in document
            .descendants()
            .filter(|n| n.has_tag_name("Terminal"))
        {
            let member = |node: roxmltree::Node| {
                let variable = node.attribute("variableName").unwrap();
                let found = description.variables.iter().find(|v| v.name == variable);
                let found = found.unwrap_or_else(|| panic!("{}: no `{variable}`", fmu.name));
                let name = node.attribute("memberName").unwrap().to_string();
                (name, (found.causality, found.unit.clone()))
            };
            let members = node.children().filter(|n| n.is_element()).map(member);
            all.push(Terminal {
                component: fmu.name.clone(),
                name: node.attribute("name").unwrap().into(),
                kind: node.attribute("terminalKind").unwrap().into(),
                is_plug: node.attribute("matchingRule") == Some("plug"),
                members: members.collect(),
            });
        }
    }
    all
}

#[test]
fn every_terminal_has_a_partner_that_takes_what_it_gives() {
    let all = terminals();
    assert!(all.len() > 40, "{}", all.len());
    for own in &all {
        let mut partners = all.iter().filter(|other| {
            let is_other = (&other.component, &other.name) != (&own.component, &own.name);
            is_other && other.kind == own.kind && fits(own, other)
        });
        // The reference comes from whoever plays the motion.
        let is_open = own.kind == "reference";
        assert!(
            is_open || partners.next().is_some(),
            "nothing fits `{}` of {}",
            own.name,
            own.component
        );
        for other in all.iter().filter(|other| other.kind == own.kind) {
            for (member, (_, unit)) in &own.members {
                if let Some((_, theirs)) = other.members.get(member) {
                    assert_eq!(
                        unit, theirs,
                        "`{member}` of {} and {}",
                        own.component, other.component
                    );
                }
            }
            let same = own.members.keys().eq(other.members.keys());
            assert!(
                !own.is_plug || same,
                "plugs of kind `{}` differ: {} and {}",
                own.kind,
                own.component,
                other.component
            );
        }
    }
}

/// Whether members of one name are an output here and an input there, or the other way round.
fn fits(own: &Terminal, other: &Terminal) -> bool {
    let mut shared = own.members.iter().filter_map(|(name, (here, _))| {
        let (there, _) = other.members.get(name)?;
        Some((*here, *there))
    });
    let opposite = |pair| {
        let (output, input) = (Causality::Output, Causality::Input);
        pair == (output, input) || pair == (input, output)
    };
    shared.clone().next().is_some() && shared.all(opposite)
}

#[test]
fn descriptions_and_terminals_are_valid_by_the_schemas_of_the_standard() {
    let paths = all_fmus().unwrap().into_iter().map(|fmu| fmu.path);
    let said = run_script("schemas.py", paths);
    let checked = said.lines().filter(|line| line.starts_with("ok ")).count();
    assert_eq!(checked, all_fmus().unwrap().len(), "{said}");
}
