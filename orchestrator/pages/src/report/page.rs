//! The page of a report, as a file.

use std::path::{Path, PathBuf};

use super::{Report, UnitSystem, html};

/// File with the report of a command.
pub const FILE: &str = "report.html";

/// The template of a page is at fault.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct PageError {
    /// The file that the page was to become.
    path: PathBuf,
    /// What is wrong.
    source: minijinja::Error,
}

/// The text of the page that becomes the file `path`, as [`html`].
///
/// # Errors
/// Only a fault of the template itself, by that file.
pub fn render(
    report: &Report,
    units: Option<UnitSystem>,
    path: &Path,
) -> Result<String, PageError> {
    html(report, units).map_err(|source| PageError {
        path: path.to_path_buf(),
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_its_title_and_is_the_report_in_the_units_asked_for() {
        let report = Report {
            title: "Run of 3 < 4 tables".into(),
            summary: "The run is complete.".into(),
            ..Report::default()
        };
        let page = |units| render(&report, units, Path::new(FILE)).unwrap();
        let text = page(None);
        assert!(text.starts_with("<!"), "{}", &text[..40]);
        assert!(text.contains("<title>Run of 3 &lt; 4 tables</title>"));
        assert!(text.contains("The run is complete."));
        assert_eq!(text, html(&report, None).unwrap());
        let in_si = page(Some(UnitSystem::Si));
        assert!(in_si != text && in_si != page(Some(UnitSystem::Us)));
    }

    #[test]
    fn a_fault_of_the_template_names_the_page() {
        let fault = PageError {
            path: "out/report.html".into(),
            source: minijinja::Error::new(minijinja::ErrorKind::UndefinedError, "no `title`"),
        };
        assert_eq!(
            fault.to_string(),
            "out/report.html: undefined value: no `title`"
        );
    }
}
