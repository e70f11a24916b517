//! A case of the table in the exchange format, and its truth.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{fs, io};

use hidden_effects::catalogue::{CATALOGUE, Effect, Entry};
use hidden_effects::score::{TruthEffect, TruthValue};
use serde::{Deserialize, Serialize};

use crate::dice::Dice;
use crate::motion::{self, Bounds};
use crate::noise::{Channel, Shape, Spectrum};
use crate::table::hidden::{Hidden, Laws, Outside};
use crate::table::rig::{NOMINAL, Plant, Rig};

/// What a case hides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Nothing.
    Nothing,
    /// One effect of the catalogue.
    One,
    /// Two of different parts.
    Two,
    /// Something that the catalogue has not.
    Outside,
}

/// All kinds, in the order of the tables.
pub const KINDS: [Kind; 4] = [Kind::Nothing, Kind::One, Kind::Two, Kind::Outside];

/// The law that makes the command.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Law {
    /// True where the laboratory states it.
    pub stated: bool,
    /// On displacement: proportional (V/in), integral (V/(in s)), derivative (V s/in).
    pub pid: [f64; 3],
    /// Feedforward of velocity and acceleration, feedback of acceleration.
    pub beside: [f64; 3],
}

/// The laboratory's three-variable tuning.
const THREE_VARIABLE: Law = Law {
    stated: true,
    pid: [6.15, 0.161, 0.005],
    beside: [0.125, 1e-4, 1e-4],
};

#[derive(Debug, Clone, Default)]
struct LawState {
    velocity: f64,
    before: Option<f64>,
    integral: f64,
}

impl Law {
    fn draw(dice: &mut Dice) -> Self {
        let unstated = Self {
            stated: false,
            ..THREE_VARIABLE
        };
        match dice.pick(&[0, 0, 1, 2, 2, 3]) {
            0 => THREE_VARIABLE,
            1 => unstated,
            2 => Self {
                pid: [
                    dice.between(4.0, 9.0),
                    dice.between(0.1, 2.0),
                    dice.between(0.002, 0.02),
                ],
                beside: [0.0; 3],
                ..unstated
            },
            // A gain that nobody wrote down.
            _ => Self {
                pid: [dice.between(4.0, 9.0), 0.0, 0.0],
                beside: [0.0; 3],
                ..unstated
            },
        }
    }

    fn command(&self, r: [f64; 3], x: f64, a: f64, rate: f64, state: &mut LawState) -> f64 {
        let before = state.before.replace(x).unwrap_or(x);
        state.velocity += 0.25 * ((x - before) * rate - state.velocity);
        let [p, i, d] = self.pid;
        state.integral += i * (r[0] - x) / rate;
        let [velocity, acceleration, feedback] = self.beside;
        let command = p * (r[0] - x) + state.integral - d * state.velocity
            + velocity * r[1]
            + acceleration * r[2]
            - feedback * a;
        command.clamp(-10.0, 10.0)
    }
}

/// What surrounds a rig: its noises, recorder, law and motions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct World {
    /// Samples a second.
    pub rate: f64,
    /// Seconds a record.
    pub duration: f64,
    /// Relative standard deviation of every parameter of the plant.
    pub mismatch: f64,
    /// Hz.
    pub mains: f64,
    /// Unseen voltage at the valve.
    pub disturbance: Channel,
    /// Displacement, acceleration, force, specimen acceleration, command.
    pub channels: [Channel; 5],
    /// What the laboratory states of their noise.
    pub stated_noise: [f64; 5],
    /// Standard deviation of the sampling instants, s.
    pub jitter: f64,
    /// The law of control.
    pub law: Law,
    /// True where the rig's laws are not the catalogue's.
    pub foreign_laws: bool,
    /// True where earthquakes are all that was played.
    pub earthquakes_only: bool,
}

impl World {
    /// Drawn.
    pub fn draw(dice: &mut Dice) -> Self {
        let colour = dice.pick(&[0.0, 0.0, 0.3, 0.6]);
        let coloured = |share: f64, exponent: f64| {
            Spectrum(vec![
                (1.0 - share, Shape::White),
                (share, Shape::OneOverF { exponent }),
            ])
        };
        let resonance = Shape::Resonance {
            frequency: dice.between(5.0, 40.0),
            damping: dice.between(0.01, 0.06),
        };
        let share = dice.even(0.2, 0.6);
        let disturbance = Channel {
            spectrum: Spectrum(vec![
                (share, resonance),
                (
                    0.9 - share,
                    Shape::OneOverF {
                        exponent: dice.even(1.0, 2.0),
                    },
                ),
                (
                    0.1,
                    Shape::Band {
                        low: 20.0,
                        high: 200.0,
                    },
                ),
            ]),
            lines: [dice.pick(&[0.0, 0.3]), 0.0, 0.0],
            bursts: dice.pick(&[0.0, 0.0, 4.0]),
            ..Channel::plain(dice.between(1e-3, 6e-3))
        };
        let loud = dice.pick(&[0.5, 1.0, 1.0, 2.0]);
        let bits = dice.pick(&[0, 10, 12, 12, 14, 16]);
        let has_lines = dice.chance(0.5);
        let channels = [
            (5e-4, 1.8),
            (1.5, 600.0),
            (0.3, 120.0),
            (1.0, 600.0),
            (5e-4, 10.0),
        ]
        .map(|(rms, range)| Channel {
            spectrum: coloured(colour, dice.even(0.8, 1.4)),
            lines: if has_lines {
                [
                    dice.even(0.0, 0.6),
                    dice.even(0.0, 0.2),
                    dice.even(0.0, 0.3),
                ]
            } else {
                [0.0; 3]
            },
            bursts: dice.pick(&[0.0, 0.0, 3.0]),
            drift: dice.pick(&[0.0, 0.0, 1.0]),
            bits,
            range,
            ..Channel::plain(loud * rms)
        });
        let rate = dice.pick(&[256.0, 400.0, 500.0, 500.0, 512.0, 1000.0]);
        Self {
            rate,
            duration: dice.even(14.0, 25.0).round(),
            mismatch: dice.pick(&[0.005, 0.01, 0.01, 0.02, 0.03]),
            mains: dice.pick(&[50.0, 60.0]),
            stated_noise: std::array::from_fn(|i| {
                let factor: f64 = dice.pick(&[0.5, 1.0, 1.0, 2.0]);
                (1e5 * channels[i].level() * factor).round() / 1e5
            }),
            disturbance,
            channels,
            jitter: dice.pick(&[0.0, 0.0, 0.02]) / rate,
            law: Law::draw(dice),
            foreign_laws: dice.chance(0.5),
            earthquakes_only: dice.chance(0.7),
        }
    }
}

/// The truth of a case.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Truth {
    /// Name of the case.
    pub case: String,
    /// What it hides.
    pub kind: Kind,
    /// Effects of the catalogue, and `outside_catalogue`.
    pub effects: Vec<TruthEffect>,
    /// Names that are true besides: relatives of what the catalogue has not, hum of the mains.
    #[serde(default)]
    pub also_true: Vec<String>,
    /// The weakest effect's place between weak (0) and strong (1).
    #[serde(default)]
    pub strength: Option<f64>,
    /// What it is that the catalogue has not.
    #[serde(default)]
    pub outside: Option<Outside>,
    /// What surrounds it.
    #[serde(default)]
    pub world: Option<World>,
    /// Motions of the records.
    #[serde(default)]
    pub records: Vec<String>,
}

/// A case with its truth.
pub struct Case {
    /// `nominal.toml`.
    pub nominal: String,
    /// File name and content of the records.
    pub records: Vec<(String, String)>,
    /// What is hidden.
    pub truth: Truth,
    /// The same as the rig has it.
    pub hidden: Hidden,
    /// The laws of the rig.
    pub laws: Laws,
}

impl Case {
    /// The case of a seed; the same seed gives the same case. Motions are the records in `recorded` where
    /// there are any, else drawn. A rig that its effects put out of control is drawn anew.
    pub fn draw(seed: u64, kind: Kind, recorded: &[PathBuf]) -> Self {
        (0..)
            .find_map(|attempt| Self::attempt(seed, attempt, kind, recorded))
            .expect("some rig holds")
    }

    fn attempt(seed: u64, attempt: u64, kind: Kind, recorded: &[PathBuf]) -> Option<Self> {
        let dice = &mut Dice::new(seed, 16 * attempt);
        let world = World::draw(dice);
        let mut laws = Laws::draw(world.foreign_laws, dice);
        let plant = NOMINAL.perturbed(|| dice.gauss(), world.mismatch);
        let mut drawn = Draw::of(kind, dice, &mut laws);

        let n = (world.duration * world.rate) as usize;
        let mut records = Vec::new();
        let mut names = Vec::new();
        for (name, displacement, earthquake) in [
            ("identification", 0.9, world.earthquakes_only),
            ("validation", 1.0, true),
            ("small", 0.2, world.earthquakes_only),
        ] {
            let bounds = Bounds {
                displacement,
                acceleration: 180.0 * displacement,
            };
            let (motion, what) = if !earthquake {
                (
                    motion::multisine(n, world.rate, bounds, dice),
                    "multisine".into(),
                )
            } else if recorded.is_empty() {
                (
                    motion::earthquake(n, world.rate, bounds, dice),
                    "drawn earthquake".into(),
                )
            } else {
                let file = dice.pick(recorded);
                let motion = motion::recorded(&file, n, world.rate, bounds)?;
                let name = file.file_name()?.to_string_lossy().into_owned();
                (motion, name)
            };
            if name == "identification" {
                drawn.scale_limit(|hidden| {
                    let quiet = world.clone().silent();
                    let mut rig = Rig::new(plant, hidden, laws);
                    play(&mut rig, &quiet, &motion, &mut Dice::new(seed, 1))?;
                    Some(rig.peak_command())
                })?;
            }
            let mut rig = Rig::new(plant, drawn.hidden.clone(), laws);
            records.push((
                format!("{name}.csv"),
                play(&mut rig, &world, &motion, dice)?,
            ));
            names.push(what);
        }
        let hums = world.channels[1].lines[0] > 0.0;
        let relatives = drawn.outside.map_or(&[][..], Outside::relatives).iter();
        let also = relatives.copied().chain(hums.then_some("mains_hum"));
        Some(Self {
            nominal: nominal(&world),
            records,
            truth: Truth {
                case: format!("strange-{seed}"),
                kind,
                also_true: also.map(String::from).collect(),
                effects: drawn.truth(),
                strength: drawn.effects.iter().map(|e| e.strength).reduce(f64::min),
                outside: drawn.outside,
                world: Some(world),
                records: names,
            },
            hidden: drawn.hidden,
            laws,
        })
    }

    /// Writes what the laboratory has into `folder`.
    ///
    /// # Errors
    /// A folder or file that cannot be written.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        fs::create_dir_all(folder)?;
        fs::write(folder.join("nominal.toml"), &self.nominal)?;
        for (name, text) in &self.records {
            fs::write(folder.join(name), text)?;
        }
        Ok(())
    }
}

struct Draw {
    effects: Vec<Effect>,
    outside: Option<Outside>,
    hidden: Hidden,
}

impl Draw {
    fn of(kind: Kind, dice: &mut Dice, laws: &mut Laws) -> Self {
        let any = |dice: &mut Dice| -> Entry { dice.pick(CATALOGUE) };
        let mut entries = match kind {
            Kind::Nothing | Kind::Outside => Vec::new(),
            Kind::One => vec![any(dice)],
            Kind::Two => vec![any(dice), any(dice)],
        };
        while let [first, second] = entries[..]
            && first.part == second.part
        {
            entries[1] = any(dice);
        }
        let effects: Vec<Effect> = entries
            .into_iter()
            .map(|entry| effect(entry, dice))
            .collect();
        let mut hidden = Hidden::default();
        effects.iter().for_each(|effect| hidden.put(effect));
        let outside = (kind == Kind::Outside).then(|| Outside::draw(dice));
        if let Some(outside) = outside {
            hidden.put_outside(outside, laws);
        }
        Self {
            effects,
            outside,
            hidden,
        }
    }

    /// A spool's limit is drawn as a share of the peak command without it.
    fn scale_limit(&mut self, peak: impl FnOnce(Hidden) -> Option<f64>) -> Option<()> {
        let Some(share) = self.hidden.spool_limit.take() else {
            return Some(());
        };
        let limit = share * peak(self.hidden.clone())?;
        self.hidden.spool_limit = Some(limit);
        for effect in &mut self.effects {
            if effect.entry.name == "valve_spool_saturation" {
                effect.values[0] = limit;
            }
        }
        Some(())
    }

    fn truth(&self) -> Vec<TruthEffect> {
        let named = self.effects.iter().map(|effect| TruthEffect {
            effect: effect.entry.name.into(),
            parameters: effect
                .entry
                .parameters
                .iter()
                .zip(&effect.values)
                .map(|(p, value)| {
                    (
                        p.name.into(),
                        TruthValue {
                            value: *value,
                            unit: p.unit.into(),
                        },
                    )
                })
                .collect(),
        });
        let outside = self.outside.map(|_| TruthEffect {
            effect: "outside_catalogue".into(),
            parameters: BTreeMap::new(),
        });
        named.chain(outside).collect()
    }
}

/// Log-evenly from the upper 85 % of the range.
fn effect(entry: Entry, dice: &mut Dice) -> Effect {
    let strength = dice.even(0.15, 1.0);
    let values = entry.parameters.iter().map(|p| {
        let sign = if p.signed { dice.sign() } else { 1.0 };
        sign * p.weak * (p.strong / p.weak).powf(strength)
    });
    Effect {
        values: values.collect(),
        entry,
        strength,
    }
}

impl World {
    fn silent(mut self) -> Self {
        self.disturbance = Channel::plain(0.0);
        self.channels = self.channels.map(|_| Channel::plain(0.0));
        self
    }
}

/// The record of a motion as a file; `None` where the rig is out of control.
fn play(rig: &mut Rig, world: &World, motion: &[f64], dice: &mut Dice) -> Option<String> {
    let (n, rate) = (motion.len(), world.rate);
    let unseen = world.disturbance.noise(n + 1, rate, world.mains, dice);
    let noises: Vec<Vec<f64>> = world
        .channels
        .iter()
        .map(|channel| channel.noise(n, rate, world.mains, dice))
        .collect();
    let at = |k: usize| motion[k.min(n - 1)];
    let mut state = LawState::default();
    let mut text = String::from(
        "time [s],valve_command [V],displacement [in],acceleration [in/s^2],\
         actuator_force [lbf],specimen_acceleration [in/s^2],reference [in]\n",
    );
    let mut clipped = 0;
    for k in 0..n {
        let early = (world.jitter * dice.gauss()).abs().min(0.2 / rate);
        let reading = rig.sample(early);
        let shown: [f64; 4] =
            std::array::from_fn(|i| world.channels[i].convert(reading[i] + noises[i][k]));
        let before = at(k.saturating_sub(1));
        let r = [
            at(k),
            (at(k + 1) - before) * rate / 2.0,
            (at(k + 1) - 2.0 * at(k) + before) * rate * rate,
        ];
        let command = world.law.command(r, shown[0], shown[1], rate, &mut state);
        rig.advance(command, 1.0 / rate, (unseen[k], unseen[k + 1]));
        let told = world.channels[4].convert(command + noises[4][k]);
        clipped += usize::from(command.abs() > 9.9);
        let inside = |i: usize| shown[i].abs() < 0.95 * world.channels[i].range;
        if !(command.is_finite() && (0..4).all(inside)) {
            return None;
        }
        let _ = write!(text, "{},{}", digits(k as f64 / rate), digits(told));
        for value in shown.into_iter().chain([at(k)]) {
            let _ = write!(text, ",{}", digits(value));
        }
        text.push('\n');
    }
    (100 * clipped < n).then_some(text)
}

/// Seven significant digits.
fn digits(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    format!("{}", format!("{value:.6e}").parse::<f64>().unwrap_or(value))
}

fn nominal(world: &World) -> String {
    let Plant {
        denominator: [a, b, c],
        voltage_to_force,
        velocity_to_force,
        table,
        specimen,
    } = NOMINAL;
    let mut text = format!(
        "# Nominal rig: what the laboratory believes. Units: inch, lbf, second, volt.\n\
         sample_rate = {:?}\n\
         [actuator]\ndenominator = [1.0, {a:?}, {b:?}, {c:?}]\n\
         voltage_to_force = {voltage_to_force:?}\nvelocity_to_force = {velocity_to_force:?}\n",
        world.rate
    );
    for (name, [mass, damping, stiffness]) in [("table", table), ("specimen", specimen)] {
        let _ = write!(
            text,
            "[{name}]\nmass = {mass}\ndamping = {damping}\nstiffness = {stiffness}\n"
        );
    }
    if world.law.stated {
        let ([p, i, d], [velocity, acceleration, feedback]) = (world.law.pid, world.law.beside);
        let _ = write!(
            text,
            "[controller]\nkind = \"three_variable_control\"\nproportional = {p}\nintegral = {i}\n\
             velocity_feedforward = {velocity}\nacceleration_feedforward = {acceleration}\n\
             velocity_feedback = {d}\nacceleration_feedback = {feedback}\nvelocity_filter = 0.25\n\
             limit = 10.0\n"
        );
    }
    let [x, a, f, s, u] = world.stated_noise;
    let _ = write!(
        text,
        "[noise]\ndisplacement = {x}\nacceleration = {a}\nactuator_force = {f}\n\
         specimen_acceleration = {s}\nvalve_command = {u}\n[uncertainty]\nrelative = {}\n",
        world.mismatch
    );
    text
}
