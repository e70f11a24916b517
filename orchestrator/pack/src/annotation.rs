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
