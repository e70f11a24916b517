#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! A component that fails on demand and has variables of every type. It is no product and is not
//! packed among them.

use fmu_kit::{
    Causality, Component, ComponentResult, Dependency::Dependent, Enumeration, Item, Variable,
};
use serde::{Deserialize, Serialize};

const FAULT: Enumeration = Enumeration {
    name: "Fault",
    items: &[
        Item {
            name: "none",
            value: 0,
            description: "Works",
        },
        Item {
            name: "panic_in_step",
            value: 1,
            description: "Panics in a step",
        },
        Item {
            name: "error_in_step",
            value: 2,
            description: "Refuses a step",
        },
        Item {
            name: "nan",
            value: 3,
            description: "Its output is not a number",
        },
        Item {
            name: "panic_in_outputs",
            value: 4,
            description: "Panics when outputs are read",
        },
        Item {
            name: "refuse",
            value: 5,
            description: "Cannot be initialized",
        },
    ],
};

/// Counts its steps, scales its input and fails when told to.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Faulty {
    fault: i32,
    fault_after: i32,
    gain: f64,
    level: f64,
    taps: [f64; 3],
    offset: i32,
    enabled: bool,
    label: String,
    value: f64,
    sum: f64,
    count: i32,
    active: bool,
}

impl Component for Faulty {
    const NAME: &'static str = "Faulty";
    const DESCRIPTION: &'static str = "Fails on demand <\"&'>";

    fn variables() -> Vec<Variable<Self>> {
        let mut table = fmu_kit::table! { Self, s:
            parameter("fault_after", s.fault_after, "Steps that work before the fault").min(0.0);
            parameter("gain", s.gain, "Tunable gain").tunable().min(-5.0).max(5.0);
            input("level", s.level, "Scaled by the gain; 100 % = full & \"loud\"", "V").min(-10.0).max(10.0);
            input("offset", s.offset, "Added to the count").min(-3.0).max(3.0);
            input("enabled", s.enabled, "Copied to `active`");
            input("label", s.label, "Copied to `echo`");
            output("value", s.value, "Gain times level", "V")
                .depends_on(&["level"], Dependent).initially_depends_on(&["level", "gain"]);
            output("sum", s.sum, "Sum of the taps, a step later");
            output("count", s.count, "Steps done");
            output("active", s.active, "Whether enabled").depends_on(&["enabled"], Dependent);
            output("echo", s.label, "The label").depends_on(&["label"], Dependent);
        };
        table.push(
            Variable::<Self>::choice("fault", FAULT, |s| &mut s.fault).about("What goes wrong"),
        );
        table.extend(Variable::<Self>::array("tap", Causality::Input, 3, |s| {
            &mut s.taps
        }));
        table
    }

    fn initialize(&mut self) -> ComponentResult {
        if self.fault == 5 {
            return Err("parameter `fault` is 5 (refuse), expected another".into());
        }
        self.count = 0;
        self.sum = 0.0;
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        let failing = self.count >= self.fault_after && self.count > 0;
        self.active = self.enabled;
        self.value = if self.fault == 3 && failing {
            f64::NAN
        } else {
            self.gain * self.level
        };
        assert!(
            self.fault != 4 || !failing,
            "outputs fail at 100 % on demand"
        );
    }

    fn step(&mut self, _time: f64, _step_size: f64) -> ComponentResult {
        if self.count >= self.fault_after {
            assert!(self.fault != 1, "step fails at 100 % on demand");
            if self.fault == 2 {
                return Err("refused on demand".into());
            }
        }
        self.sum = self.taps.iter().sum();
        self.count += 1;
        Ok(())
    }
}

fmu_kit::export!(Faulty);
