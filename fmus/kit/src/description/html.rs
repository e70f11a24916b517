//! `documentation/index.html`.

use std::fmt::Write;

use super::{Interface, causality, start, variability, xml::escape};

/// A page that says what the component is and lists its variables.
pub(super) fn text(interface: &Interface) -> String {
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{name}</title>\n\
         <style>body{{font:16px/1.5 sans-serif;max-width:70em;margin:2em auto;padding:0 1em}}\
         table{{border-collapse:collapse}}td,th{{border:1px solid #ccc;padding:.2em .6em;\
         text-align:left}}</style>\n</head>\n<body>\n<h1>{name}</h1>\n<p>{about} (version \
         {version})</p>\n",
        name = escape(interface.name),
        about = escape(interface.description),
        version = escape(interface.version),
    );
    page.push_str(&prose(interface.documentation));
    page.push_str(
        "<h2>Variables</h2>\n<table>\n<tr><th>Name</th><th>Meaning</th><th>Kind</th><th>Unit</th>\
         <th>Shown in</th><th>Start</th><th>Depends directly on</th></tr>\n",
    );
    for (row, dependencies) in interface.rows.iter().zip(interface.dependencies) {
        let variable = row.declaration;
        let on: Vec<_> = dependencies
            .iter()
            .map(|(on, _)| interface.rows[*on].declaration.name.as_str())
            .collect();
        let cells = [
            variable.name.clone(),
            variable.description.clone(),
            format!(
                "{} {}",
                variability(variable.variability),
                causality(variable.causality)
            ),
            variable.unit.unwrap_or_default().into(),
            variable.display_unit.unwrap_or_default().into(),
            start(row).unwrap_or_default(),
            on.join(", "),
        ];
        page.push_str("<tr>");
        for cell in cells {
            let _ = write!(page, "<td>{}</td>", escape(&cell));
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table>\n</body>\n</html>\n");
    page
}

/// The little of Markdown that the components' read-me files use: headings, paragraphs and blocks
/// between lines of three backticks. The first heading is left out, the page has its own.
fn prose(markdown: &str) -> String {
    let mut html = String::new();
    let mut paragraph = String::new();
    let close = |paragraph: &mut String, html: &mut String| {
        if !paragraph.is_empty() {
            let _ = writeln!(html, "<p>{}</p>", paragraph.trim_end());
            paragraph.clear();
        }
    };
    let mut verbatim = false;
    for line in markdown.lines() {
        if line.starts_with("```") {
            close(&mut paragraph, &mut html);
            verbatim = !verbatim;
            html.push_str(if verbatim { "<pre>" } else { "</pre>\n" });
        } else if verbatim {
            let _ = writeln!(html, "{}", escape(line));
        } else if let Some(heading) = line.strip_prefix("## ") {
            close(&mut paragraph, &mut html);
            let _ = writeln!(html, "<h2>{}</h2>", escape(heading));
        } else if line.trim().is_empty() || line.starts_with("# ") {
            close(&mut paragraph, &mut html);
        } else {
            // Words between backticks are code.
            for (i, part) in line.split('`').enumerate() {
                if i > 0 {
                    paragraph.push_str(if i % 2 == 1 { "<code>" } else { "</code>" });
                }
                paragraph.push_str(&escape(part));
            }
            paragraph.push('\n');
        }
    }
    close(&mut paragraph, &mut html);
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prose_becomes_paragraphs_code_and_blocks() {
        let text =
            "# Name\n\nOne `a < b`,\ntwo.\n\n```\nF = m a\n  & more\n```\n## Source\nA book.\n";
        let expected = "<p>One <code>a &lt; b</code>,\ntwo.</p>\n<pre>F = m a\n  &amp; more\n</pre>\n\
                        <h2>Source</h2>\n<p>A book.</p>\n";
        assert_eq!(prose(text), expected);
    }
}
