//! Controls of a live page that change parameters during the run.

use std::sync::Arc;

use fmi_master::Panel;
use fmi_system::System;
use serde::{Deserialize, Serialize};

use crate::report::number::significant;
use crate::report::{UnitSystem, Units};

/// Parameters that a page may change.
#[derive(Debug)]
pub struct Tuning {
    panel: Arc<Panel>,
    knobs: Vec<Knob>,
    seconds: f64,
}

/// A parameter as the page shows it.
#[derive(Debug, Clone, Serialize)]
struct Knob {
    variable: String,
    about: String,
    /// Unit shown and what one of it is in the variable's unit.
    unit: (String, f64),
    low: f64,
    high: f64,
    start: f64,
}

/// A change that a page asks for, in the variable's unit.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Wish {
    variable: String,
    value: f64,
}

impl Tuning {
    /// The parameters of `panel` in a run of `system`, in the units of `reader`; a change takes so many seconds.
    #[must_use]
    pub fn new(system: &System, panel: Arc<Panel>, seconds: f64, reader: UnitSystem) -> Self {
        let knobs = panel.tunables().iter().map(|own| {
            let found = system.variable(&own.variable);
            let found = found.map(|(component, at)| &component.fmu.description.variables[at]);
            let unit = found.and_then(|variable| variable.unit.as_deref());
            let unit = unit.unwrap_or_default();
            let units = Units::of(unit);
            let (mut factor, mut shown) = units.unit(reader);
            let laboratory = found.and_then(|variable| variable.display_unit.as_deref());
            if let (UnitSystem::Us, Some(own)) = (reader, laboratory)
                && let Ok(one) = units::convert(1.0, own, unit)
            {
                (factor, shown) = (one, own);
            }
            Knob {
                variable: own.variable.clone(),
                about: found.map_or(String::new(), |variable| variable.description.clone()),
                unit: (shown.to_string(), factor),
                low: own.low,
                high: own.high,
                start: own.start,
            }
        });
        let knobs = knobs.collect();
        Self {
            panel,
            knobs,
            seconds,
        }
    }

    /// What a page needs to draw the controls; without the right to use them it shows values alone.
    pub(super) fn controls(&self, may_change: bool) -> String {
        let controls = serde_json::json!({
            "may_change": may_change, "seconds": self.seconds, "knobs": self.knobs,
        });
        controls.to_string()
    }

    /// The present values, and the changes so far.
    pub(super) fn state(&self) -> serde_json::Value {
        serde_json::json!({"values": self.panel.values(), "changes": self.panel.changes()})
    }

    /// Asks for the change that a request's body holds; gives the answer's body.
    ///
    /// # Errors
    /// Why it is refused: the status and the reason.
    pub(super) fn ask(&self, body: &str) -> Result<String, (&'static str, String)> {
        let wish: Wish = serde_json::from_str(body).map_err(|error| {
            let expected = r#"expected {"variable": "INSTANCE.VARIABLE", "value": NUMBER}"#;
            ("400 Bad Request", format!("{error}; {expected}"))
        })?;
        let to = self.panel.ask(&wish.variable, wish.value);
        let to = to.map_err(|refused| ("409 Conflict", self.in_shown_units(&wish, &refused)))?;
        Ok(serde_json::json!({"variable": wish.variable, "to": to}).to_string())
    }

    /// A refusal with the numbers that the page shows.
    fn in_shown_units(&self, wish: &Wish, refused: &fmi_master::Refused) -> String {
        use fmi_master::Refused;
        let knob = self
            .knobs
            .iter()
            .find(|knob| knob.variable == wish.variable);
        let (
            Some(knob),
            Refused::Outside {
                value, low, high, ..
            },
        ) = (knob, refused)
        else {
            return refused.to_string();
        };
        let (unit, factor) = &knob.unit;
        let shown = |value: f64| significant(value / factor, 4);
        let text = format!(
            "`{}` = {} {unit} is outside of its bounds; expected {} to {} {unit}",
            knob.variable,
            shown(*value),
            shown(*low),
            shown(*high)
        );
        text.replace("  ", " ").trim_end().to_string()
    }
}
