#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! A component that uses what FMI 3.0 offers beyond scalars and steps, and refuses an importer that gets it
//! wrong. It exists for the tests and is not packed.
//!
//! `level` rises at `rate` and falls by 1 where it reaches 1: an event within a step, at which the output
//! clock `wrapped` ticks and the step returns early. The event takes two passes: the first counts in
//! `wraps`, the second in `settled`. Every 0.37 s there is a time event, announced, which no step may pass.
//! The clock `sample` ticks every 0.15 s and keeps `level` in `sampled`; `take` ticks when another clock
//! triggers it, keeps the input `offer` in `taken` and counts in `takes`. `echo` is `packet` backwards. `scaled` is the product
//! of `gains` and `v`, arrays of `n` elements. In the middle of each step the importer is told so.

use fmu_kit::extended::{Advance, Extended, Importer, Pass, Place};
use fmu_kit::{Causality, Component, ComponentResult, Variable, variable::Variability};
use serde::{Deserialize, Serialize};

/// Time between time events, s.
const BEAT: f64 = 0.37;

/// See the crate.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Eventful {
    rate: f64,
    level: f64,
    wraps: i32,
    settled: i32,
    beats: i32,
    updates: i32,
    samples: i32,
    packet: Vec<u8>,
    echo: Vec<u8>,
    n: u64,
    gains: Vec<f64>,
    v: Vec<f64>,
    scaled: Vec<f64>,
    sample: bool,
    wrapped: bool,
    take: bool,
    offer: Vec<f64>,
    taken: Vec<f64>,
    takes: Vec<f64>,
    sampled: Vec<f64>,
    /// The event of a wrap is in its first or second pass.
    is_wrapping: bool,
    is_settling: bool,
}

impl Default for Eventful {
    fn default() -> Self {
        Self {
            rate: 0.7,
            level: 0.0,
            wraps: 0,
            settled: 0,
            beats: 0,
            updates: 0,
            samples: 0,
            packet: vec![0x00, 0xff],
            echo: Vec::new(),
            n: 2,
            gains: vec![1.0; 2],
            v: vec![0.0; 2],
            scaled: vec![0.0; 2],
            sample: false,
            wrapped: false,
            take: false,
            offer: vec![0.0],
            taken: vec![0.0],
            takes: vec![0.0],
            sampled: vec![0.0],
            is_wrapping: false,
            is_settling: false,
        }
    }
}

impl Component for Eventful {
    const NAME: &'static str = "Eventful";
    const DESCRIPTION: &'static str = "Clocks, events, binaries and sized arrays";

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("rate", s.rate, "Slope of the level", "s-1");
            output("level", s.level, "Rises to 1 and begins again");
            output("wraps", s.wraps, "Wraps, counted in the first pass of their events");
            output("settled", s.settled, "Wraps, counted in the second pass of their events");
            output("beats", s.beats, "Time events");
            output("updates", s.updates, "Calls of the importer within steps");
            output("samples", s.samples, "Ticks of `sample`");
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        self.echo = self.packet.iter().rev().copied().collect();
        let pairs = self.gains.iter().zip(&self.v);
        self.scaled = pairs.map(|(gain, v)| gain * v).collect();
    }

    fn step(&mut self, time: f64, step_size: f64) -> ComponentResult {
        self.step_alone(time, step_size)
    }
}

impl Eventful {
    fn next_beat(&self) -> f64 {
        BEAT * f64::from(self.beats + 1)
    }
}

impl Extended for Eventful {
    const ABILITIES: &'static str = "hasEventMode=\"true\" mightReturnEarlyFromDoStep=\"true\" \
        providesIntermediateUpdate=\"true\" canReturnEarlyAfterIntermediateUpdate=\"true\"";
    const VARIABLES: &'static str = r#"
    <UInt64 name="n" valueReference="101" causality="structuralParameter" variability="fixed" start="2"/>
    <Float64 name="gains" valueReference="102" causality="parameter" variability="fixed" start="1 1"><Dimension valueReference="101"/></Float64>
    <Float64 name="v" valueReference="103" causality="input" start="0 0"><Dimension valueReference="101"/></Float64>
    <Float64 name="scaled" valueReference="104" causality="output"><Dimension valueReference="101"/></Float64>
    <Binary name="packet" valueReference="105" causality="input" variability="discrete"><Start value="00ff"/></Binary>
    <Binary name="echo" valueReference="106" causality="output" variability="discrete"/>
    <Clock name="sample" valueReference="107" causality="input" intervalVariability="constant" intervalDecimal="0.15"/>
    <Clock name="wrapped" valueReference="108" causality="output" intervalVariability="triggered"/>
    <Clock name="take" valueReference="109" causality="input" intervalVariability="triggered"/>
    <Float64 name="offer" valueReference="110" causality="input" variability="discrete" clocks="109" start="0"/>
    <Float64 name="taken" valueReference="111" causality="output" variability="discrete" clocks="109"/>
    <Float64 name="sampled" valueReference="112" causality="output" variability="discrete" clocks="107"/>
    <Float64 name="takes" valueReference="113" causality="output" variability="discrete" clocks="109"/>
  "#;
    const STRUCTURE: [&'static str; 2] = [
        r#"
    <Output valueReference="104" dependencies="103"/>
    <Output valueReference="106" dependencies="105"/>
    <Output valueReference="108" dependencies=""/>
    <Output valueReference="111" dependencies="109 110"/>
    <Output valueReference="112" dependencies="107"/>
    <Output valueReference="113" dependencies="109"/>"#,
        r#"
    <InitialUnknown valueReference="104" dependencies="102 103"/>
    <InitialUnknown valueReference="106" dependencies="105"/>
    <InitialUnknown valueReference="108" dependencies=""/>
  "#,
    ];

    fn place(&mut self, reference: u32) -> Option<(Place<'_>, Causality, Variability)> {
        use Causality::{Input, Output, Parameter};
        use Variability::{Continuous, Discrete, Fixed};
        Some(match reference {
            101 => (Place::Size(&mut self.n), Parameter, Fixed),
            102 => (Place::Reals(&mut self.gains), Parameter, Fixed),
            103 => (Place::Reals(&mut self.v), Input, Continuous),
            104 => (Place::Reals(&mut self.scaled), Output, Continuous),
            105 => (Place::Binary(&mut self.packet), Input, Discrete),
            106 => (Place::Binary(&mut self.echo), Output, Discrete),
            107 => (Place::Clock(&mut self.sample), Input, Discrete),
            108 => (Place::Clock(&mut self.wrapped), Output, Discrete),
            109 => (Place::Clock(&mut self.take), Input, Discrete),
            110 => (Place::Reals(&mut self.offer), Input, Discrete),
            111 => (Place::Reals(&mut self.taken), Output, Discrete),
            112 => (Place::Reals(&mut self.sampled), Output, Discrete),
            113 => (Place::Reals(&mut self.takes), Output, Discrete),
            _ => return None,
        })
    }

    fn resize(&mut self) {
        let n = usize::try_from(self.n).unwrap_or(0).min(1000);
        self.gains = vec![1.0; n];
        self.v = vec![0.0; n];
        self.scaled = vec![0.0; n];
    }

    fn interval(&mut self, _reference: u32) -> Option<(f64, i32)> {
        None
    }

    fn advance(
        &mut self,
        time: f64,
        step: f64,
        importer: &Importer,
    ) -> Result<Advance, Box<dyn std::error::Error>> {
        let (mut now, end) = (time, time + step);
        let slack = 1e-9 * step;
        if importer.event_mode && end > self.next_beat() + slack {
            return Err("a step passes the time event that was announced".into());
        }
        if self.is_wrapping || self.is_settling {
            return Err("a step before the event was handled to its end".into());
        }
        let may_return = importer.event_mode && importer.early_return;
        match importer.update(time + 0.5 * step, may_return) {
            Some(false) => self.updates += 1,
            Some(true) => return Err("the importer has not said whether to return early".into()),
            // It is optional.
            None => {}
        }
        loop {
            let wrap = match self.rate > 0.0 {
                true => now + (1.0 - self.level) / self.rate,
                false => f64::INFINITY,
            };
            let reached = wrap.min(end);
            self.level += self.rate * (reached - now);
            now = reached;
            let is_wrap = wrap <= end;
            self.is_wrapping |= is_wrap;
            self.wrapped = self.is_wrapping;
            let is_beat = self.next_beat() <= now + slack;
            if importer.event_mode {
                let event = is_wrap || is_beat;
                return match may_return || now >= end {
                    true => Ok(Advance { time: now, event }),
                    false => Err("the importer does not allow an early return".into()),
                };
            }
            while is_wrap && self.pass(now)?.again {}
            while self.next_beat() <= now + slack {
                self.beats += 1;
            }
            if now >= end {
                let event = false;
                return Ok(Advance { time: end, event });
            }
        }
    }

    fn pass(&mut self, time: f64) -> Result<Pass, Box<dyn std::error::Error>> {
        let again = std::mem::take(&mut self.is_wrapping);
        if std::mem::take(&mut self.is_settling) {
            self.settled += 1;
        }
        if again {
            (self.level, self.is_settling) = (0.0, true);
            self.wraps += 1;
        }
        if std::mem::take(&mut self.sample) {
            self.samples += 1;
            self.sampled[0] = self.level;
        }
        if std::mem::take(&mut self.take) {
            self.takes[0] += 1.0;
            self.taken[0] = self.offer[0];
        }
        while self.next_beat() <= time + 1e-9 {
            self.beats += 1;
        }
        // It ticks in the first pass only.
        self.wrapped = false;
        let next = Some(self.next_beat());
        Ok(Pass { again, next })
    }
}

fmu_kit::export_extended!(Eventful);
