//! Units, choices, and what the standard has no place for.

use std::fmt::Write as _;

use super::text::escape;
use super::{ANNOTATION, Experiment, Writer};

impl Writer<'_> {
    /// Enumerations and units.
    pub(super) fn definitions(&self) -> String {
        let mut text = String::new();
        if !self.enumerations.is_empty() {
            text += "  <ssd:Enumerations>\n";
            for (name, items) in &self.enumerations {
                let _ = write!(text, "    <ssc:Enumeration name=\"{name}\">");
                for item in items {
                    let _ = write!(
                        text,
                        "<ssc:Item name=\"{}\" value=\"{}\"/>",
                        escape(&item.name),
                        item.value
                    );
                }
                text += "</ssc:Enumeration>\n";
            }
            text += "  </ssd:Enumerations>\n";
        }
        if !self.units.is_empty() {
            text += "  <ssd:Units>\n";
            for (name, base) in &self.units {
                let _ = write!(
                    text,
                    "    <ssc:Unit name=\"{}\"><ssc:BaseUnit",
                    escape(name)
                );
                let names = ["kg", "m", "s", "A", "K", "mol", "cd"];
                for (name, exponent) in names.iter().zip(base.exponents) {
                    if exponent != 0 {
                        let _ = write!(text, " {name}=\"{exponent}\"");
                    }
                }
                if base.factor != 1.0 {
                    let _ = write!(text, " factor=\"{}\"", base.factor);
                }
                if base.offset != 0.0 {
                    let _ = write!(text, " offset=\"{}\"", base.offset);
                }
                text += "/></ssc:Unit>\n";
            }
            text += "  </ssd:Units>\n";
        }
        text
    }

    /// What the standard has no place for.
    pub(super) fn annotation(&self, experiment: &Experiment) -> String {
        let mut more = String::new();
        let name = |&(component, variable): &(usize, usize)| {
            escape(&self.system.variable_name(component, variable).to_string())
        };
        if let Some(end) = &self.system.end {
            let _ = write!(more, " endWhen=\"{}\"", name(&end.when));
            if let Some(cause) = &end.cause {
                let _ = write!(more, " endCause=\"{}\"", name(cause));
            }
            let _ = write!(more, " endAfter=\"{}\"", end.after);
        }
        if let Some(stop) = &self.system.stop {
            let _ = write!(more, " stop=\"{}\"", name(stop));
        }
        if let Some(sampling) = experiment.sampling {
            let _ = write!(more, " sampling=\"{sampling}\"");
        }
        format!(
            "  <ssd:Annotations><ssc:Annotation type=\"{ANNOTATION}\"><shakebench:Experiment \
             step=\"{}\" algorithm=\"{}\"{more}/></ssc:Annotation></ssd:Annotations>\n",
            experiment.step,
            escape(&experiment.algorithm),
        )
    }
}
