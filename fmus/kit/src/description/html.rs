//! `documentation/index.html`.

use std::fmt::Write;

use super::{causality, start, variability, xml::escape};
use crate::{component::Component, model::Model};

/// A page that says what the component is and lists its variables.
pub fn html<C: Component>(model: &Model<C>) -> String {
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{name}</title>\n\
         <style>body{{font:16px/1.5 sans-serif;max-width:70em;margin:2em auto;padding:0 1em}}\
         table{{border-collapse:collapse}}td,th{{border:1px solid #ccc;padding:.2em .6em;\
         text-align:left}}</style>\n</head>\n<body>\n<h1>{name}</h1>\n<p>{about} (version \
         {version})</p>\n",
        name = escape(C::NAME),
        about = escape(C::DESCRIPTION),
        version = escape(C::VERSION),
    );
    for paragraph in C::DOCUMENTATION
        .split("\n\n")
        .filter(|p| !p.trim().is_empty())
    {
        let _ = writeln!(
            page,
            "<p>{}</p>",
            escape(paragraph.trim()).replace("&#10;", "\n")
        );
    }
    page.push_str(
        "<h2>Variables</h2>\n<table>\n<tr><th>Name</th><th>Meaning</th><th>Kind</th><th>Unit</th>\
         <th>Shown in</th><th>Start</th><th>Depends directly on</th></tr>\n",
    );
    for (index, variable) in model.variables.iter().enumerate() {
        let on: Vec<_> = model.dependencies[index]
            .iter()
            .map(|(on, _)| model.variables[*on].name.as_str())
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
            start(variable).unwrap_or_default(),
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
