//! Values of parameters.

use super::text::{connector_name, escape};
use fmi_import::{Datum, Kind};
use fmi_system::{Component, Value};

/// A value as an element of a parameter set.
pub(super) fn typed(kind: &Kind, value: &Value) -> String {
    match (kind, value) {
        (Kind::Boolean, Value::Number(number)) => {
            format!("<ssv:Boolean value=\"{}\"/>", *number != 0.0)
        }
        // By its number: not every reader knows the names of choices.
        (Kind::Enumeration(_), Value::Number(number)) => {
            format!("<ssv:Integer value=\"{number}\"/>")
        }
        (Kind::Float64 | Kind::Float32, Value::Number(number)) => {
            format!("<ssv:Real value=\"{number}\"/>")
        }
        (_, Value::Number(number)) => format!("<ssv:Integer value=\"{number}\"/>"),
        (_, Value::Signed(number)) => format!("<ssv:Integer value=\"{number}\"/>"),
        (_, Value::Unsigned(number)) => format!("<ssv:Integer value=\"{number}\"/>"),
        (Kind::Binary, Value::Text(text)) => format!("<ssv:Binary value=\"{text}\"/>"),
        (_, Value::Text(text)) => format!("<ssv:String value=\"{}\"/>", escape(text)),
    }
}

/// An array's values, as of SSP 2.0.
pub(super) fn array(part: &Component, first: usize) -> String {
    let variables = &part.fmu.description.variables;
    let variable = &variables[first];
    let size = variable.element.1;
    let given = part.given();
    let data: Vec<Datum> = (first..first + size)
        .map(|position| part.start_value(&given, position))
        .collect();
    let kind = match variable.kind {
        Kind::Boolean => "Boolean",
        Kind::Float64 | Kind::Float32 => "Real",
        Kind::String => "String",
        Kind::Binary => "Binary",
        _ => "Integer",
    };
    let inner = match variable.kind {
        Kind::String | Kind::Binary => {
            let all = data
                .iter()
                .map(|datum| format!("<ssv:Value value=\"{}\"/>", escape(&datum.to_string())));
            format!("<ssv:{kind}>{}</ssv:{kind}>", all.collect::<String>())
        }
        _ => {
            let all: Vec<String> = data
                .iter()
                .map(|datum| match variable.kind {
                    Kind::Boolean => (datum.number() != 0.0).to_string(),
                    _ => datum.to_string(),
                })
                .collect();
            format!("<ssv:{kind} value=\"{}\"/>", all.join(" "))
        }
    };
    format!(
        "              <ssv:Parameter name=\"{}\">{inner}<ssc:Dimension size=\"{size}\"/>\
         </ssv:Parameter>\n",
        escape(&connector_name(part, first))
    )
}
