//! Version and build in a `modelDescription.xml`, as each version of FMI has a place for them.

use roxmltree::Document;

use crate::program::VERSION;
use fmi_import::FmiVersion;

/// Name of the annotation of FMI 2.0, and of the element in both.
const TOOL: &str = "Shakebench";
/// Type of the annotation of FMI 3.0.
const TYPE: &str = "org.shakebench";

/// The description with an annotation that says version and build.
pub(super) fn annotated(text: &str, version: FmiVersion, revision: Option<&str>) -> String {
    let build = revision.map_or(String::new(), |revision| {
        format!(" build=\"{}\"", escape(revision))
    });
    let said = format!("<Release version=\"{VERSION}\"{build}/>");
    let (before, annotation) = match version {
        FmiVersion::V2 => (
            "  <ModelVariables",
            format!(
                "  <VendorAnnotations>\n    <Tool name=\"{TOOL}\">\n      {said}\n    </Tool>\n  \
                 </VendorAnnotations>\n"
            ),
        ),
        FmiVersion::V3 => (
            "</fmiModelDescription>",
            format!(
                "  <Annotations>\n    <Annotation type=\"{TYPE}\">\n      {said}\n    \
                 </Annotation>\n  </Annotations>\n"
            ),
        ),
    };
    text.replacen(before, &format!("{annotation}{before}"), 1)
}

/// The build that a description's annotation names.
pub fn build_of(document: &Document) -> Option<String> {
    let release = document
        .descendants()
        .find(|node| node.has_tag_name("Release"))?;
    release.attribute("build").map(str::to_string)
}

pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::*;

    #[test]
    fn a_description_says_by_which_build_it_was_made() {
        let text = "<fmiModelDescription>\n  <ModelVariables/>\n</fmiModelDescription>\n";
        for version in [FmiVersion::V2, FmiVersion::V3] {
            for build in [Some("1a2b & <\"dirty\">"), None] {
                let said = annotated(text, version, build);
                let document = Document::parse(&said).unwrap();
                assert_eq!(build_of(&document).as_deref(), build, "{said}");
                let mut all = document.descendants();
                let release = all.find(|node| node.has_tag_name("Release")).unwrap();
                assert_eq!(release.attribute("version"), Some(VERSION));
                assert!(said.contains("  <ModelVariables/>"), "{said}");
            }
        }
        assert_eq!(build_of(&Document::parse(text).unwrap()), None);
    }
}
