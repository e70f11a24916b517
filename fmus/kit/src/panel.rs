//! A component with a variable of every type, for the kit's own tests: sound, or with one fault that the
//! checks of [`conformance`](crate::conformance) are there for.

use serde::{Deserialize, Serialize};

use crate::{
    component::{Component, ComponentResult},
    terminal::Terminal,
    variable::{Causality, Dependency, Enumeration, Item, Variable},
};

pub(crate) const SOUND: usize = 0;
pub(crate) const SILENT_DEPENDENCY: usize = 1;
pub(crate) const SILENT_INITIAL_DEPENDENCY: usize = 2;
pub(crate) const WRONG_PARTIAL: usize = 3;
pub(crate) const FORGETFUL: usize = 4;
pub(crate) const ALLOCATES: usize = 5;
pub(crate) const STARTS_ELSEWHERE: usize = 6;

const MODES: Enumeration = Enumeration {
    name: "Mode",
    items: &[
        Item {
            name: "slow",
            value: 1,
            description: "At half the gain",
        },
        Item {
            name: "fast",
            value: 4,
            description: "At the gain",
        },
    ],
};

/// `product = (gain + offsets[1]) a b`, `dlevel/dt = a`.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Panel<const FAULT: usize> {
    pub a: f64,
    pub b: f64,
    pub on: bool,
    pub gain: f64,
    pub count: i32,
    pub mode: i32,
    pub offsets: [f64; 2],
    pub inner: (f64, f64),
    product: f64,
    pub level: f64,
    starts: i32,
    #[serde(skip)]
    hidden: f64,
}

impl<const FAULT: usize> Default for Panel<FAULT> {
    fn default() -> Self {
        Self {
            a: 0.0,
            b: 0.0,
            on: false,
            gain: 2.0,
            count: 3,
            mode: 4,
            offsets: [0.0; 2],
            inner: (0.0, 7.0),
            product: 0.0,
            level: 0.0,
            starts: 0,
            hidden: 0.0,
        }
    }
}

pub(crate) const A: u32 = 1;
pub(crate) const ON: u32 = 3;
pub(crate) const COUNT: u32 = 5;
pub(crate) const MODE: u32 = 6;
pub(crate) const OFFSET_2: u32 = 8;
pub(crate) const INNER: u32 = 9;

impl<const FAULT: usize> Component for Panel<FAULT> {
    const NAME: &'static str = "Panel";
    const DESCRIPTION: &'static str = "Something of everything";
    const PARTIAL_DERIVATIVES: bool = true;
    const TERMINALS: &'static [Terminal] = &[
        Terminal::bus("ports", "signals", &[("first", "a"), ("second", "b")]),
        Terminal::plug("out", "signals", &[("first", "product")]),
    ];

    fn variables() -> Vec<Variable<Self>> {
        let mut known = vec!["a", "b"];
        let mut initially = vec!["a", "b", "gain", "offsets[1]"];
        if FAULT == SILENT_DEPENDENCY {
            known.pop();
        }
        if FAULT == SILENT_INITIAL_DEPENDENCY {
            initially.remove(2);
        }
        let mut table = vec![
            Variable::input("a", |s: &mut Self| &mut s.a).unit("m/s"),
            Variable::input("b", |s: &mut Self| &mut s.b).nominal(10.0),
            Variable::input("on", |s: &mut Self| &mut s.on),
            Variable::parameter("gain", |s: &mut Self| &mut s.gain).max(100.0),
            Variable::parameter("count", |s: &mut Self| &mut s.count).between(Some(1.0), Some(5.0)),
            Variable::choice("mode", MODES, |s: &mut Self| &mut s.mode),
        ];
        table.extend(Variable::array(
            "offsets",
            Causality::Parameter,
            2,
            |s: &mut Self| &mut s.offsets,
        ));
        table.extend([
            Variable::parameter_within("inner".into(), |s: &mut Self| &mut s.inner.1).tunable(),
            Variable::output("product", |s: &mut Self| &mut s.product)
                .depends_on(&known, Dependency::Dependent)
                .initially_depends_on(&initially),
            Variable::output("level", |s: &mut Self| &mut s.level).unit("m"),
        ]);
        table
    }

    fn initialize(&mut self) -> ComponentResult {
        self.level = 0.0;
        self.hidden = 0.0;
        if FAULT == STARTS_ELSEWHERE {
            self.starts += 1;
        }
        if self.gain < 0.0 {
            return Err("parameter `gain` is negative".into());
        }
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        self.product = (self.gain + self.offsets[0]) * self.a * self.b;
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        if FAULT == ALLOCATES {
            std::hint::black_box(vec![self.a]);
        }
        if FAULT == FORGETFUL {
            self.hidden += step_size * self.a;
        }
        self.level += step_size * (self.a + self.hidden);
        Ok(())
    }

    fn partial_derivative(&self, _unknown: &str, known: &str) -> f64 {
        let scale = if FAULT == WRONG_PARTIAL { 1.01 } else { 1.0 };
        scale * self.gain * if known == "a" { self.b } else { self.a }
    }
}
