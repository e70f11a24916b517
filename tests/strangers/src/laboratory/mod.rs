//! Invented laboratories: a table of some kind in a closed loop, one or two faults, and recordings as such
//! a laboratory has them.

mod dialect;
pub mod score;
mod table;

use std::path::Path;
use std::{fs, io};

use serde::{Deserialize, Serialize};

use crate::dice::Dice;
use crate::motion::{Bounds, earthquake};
use crate::noise::{Channel, Shape, Spectrum};
use dialect::Dialect;
use table::{Drive, Loop, Table};

/// Share of the time at a rail from which on a recording shows it.
const SEEN: f64 = 1e-3;

/// A fault that a laboratory does not know of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fault {
    /// What it is, in plain words.
    pub cause: String,
    /// Parts of the names that say it.
    pub words: Vec<String>,
    /// Its size in every unit in which it may be said.
    pub sizes: Vec<(f64, String)>,
}

/// What surrounds a rig and what is wrong with it; drawn, then simulated.
#[derive(Debug, Clone, Default)]
struct Faults {
    /// Reference late by this, s.
    delay: f64,
    /// Reference larger by this share.
    scale: f64,
    /// Displacement read higher by this, m.
    zero: f64,
    /// Free travel of the displacement's linkage to either side, m.
    play: f64,
    /// Accelerometer larger by this share.
    accelerometer: f64,
    said: Vec<Fault>,
}

/// The truth of a laboratory.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Truth {
    /// Its name.
    pub laboratory: String,
    /// What moves its table.
    pub drive: String,
    /// What is wrong.
    pub faults: Vec<Fault>,
    /// Whether a motion takes the drive to its rail.
    pub is_railed: bool,
    /// Whether a spring holds the table, and no integral makes up for that.
    pub gives_way: bool,
    /// By what share a valve's flow falls per speed, s/m.
    #[serde(default)]
    pub flow_falls: f64,
}

/// A laboratory's folder.
pub struct Laboratory {
    /// File name and content, as bytes: not every laboratory writes UTF-8.
    pub recordings: Vec<(String, Vec<u8>)>,
    /// What its people know.
    pub notes: String,
    /// What they do not.
    pub truth: Truth,
}

fn fault(cause: &str, words: &[&str], sizes: &[(f64, &str)]) -> Fault {
    Fault {
        cause: cause.into(),
        words: words.iter().map(|w| (*w).into()).collect(),
        sizes: sizes
            .iter()
            .map(|(value, unit)| (*value, (*unit).into()))
            .collect(),
    }
}

impl Faults {
    fn put(&mut self, kind: usize, table: &mut Table, dice: &mut Dice, reach: f64) {
        let sign = dice.sign();
        let drawn = match kind {
            0 => {
                self.delay = dice.between(4e-3, 15e-3);
                fault(
                    "the command arrives late",
                    &["delay", "late"],
                    &[(self.delay, "s")],
                )
            }
            1 => {
                self.scale = sign * dice.between(0.03, 0.1);
                // A spring takes its share of what the table moves.
                let moves = (1.0 + self.scale) * table.reaches();
                let alone = [(self.scale, "1"), (1.0 + self.scale, "1")];
                let sizes = [alone, [(moves - 1.0, "1"), (moves, "1")]].concat();
                fault("the table moves by another scale", &["scale"], &sizes)
            }
            2 => {
                self.zero = sign * dice.between(0.02, 0.1) * reach;
                fault(
                    "the displacement's zero is off",
                    &["zero", "bias", "offset"],
                    &[(self.zero, "m")],
                )
            }
            3 => {
                self.play = dice.between(0.01, 0.04) * reach;
                fault(
                    "there is play",
                    &["play", "backlash", "hysteresis", "lost_motion"],
                    &[(self.play, "m"), (2.0 * self.play, "m")],
                )
            }
            4 => {
                self.accelerometer = sign * dice.between(0.04, 0.15);
                let sizes = [(self.accelerometer, "1"), (1.0 + self.accelerometer, "1")];
                fault("the accelerometer's scale is off", &["accel"], &sizes)
            }
            5 => {
                let [slides, breaks] = table.rub(dice.between(2.0, 5.0));
                let of = |(force, error): (f64, f64)| [(force, "N"), (error, "m")];
                let sizes = [of(slides), of(breaks)].concat();
                fault("friction is larger than usual", &["friction"], &sizes)
            }
            6 => {
                let overlap = table.overlap(dice.between(0.05, 0.2));
                let travel = overlap / table.control.gain;
                let words = ["dead_band", "dead band", "overlap"];
                fault(
                    "the valve has an overlap",
                    &words,
                    &[(overlap, "V"), (travel, "m")],
                )
            }
            _ => {
                let q = table.asymmetry(sign * dice.between(0.06, 0.15));
                fault(
                    "the valve's gain differs with direction",
                    &["asymmetr"],
                    &[(q, "1")],
                )
            }
        };
        self.said.push(drawn);
    }
}

impl Laboratory {
    /// The laboratory of a seed.
    pub fn draw(seed: u64) -> Self {
        let dice = &mut Dice::new(seed, 60);
        let drive = [
            Drive::Hydraulic,
            Drive::Hydraulic,
            Drive::Shaker,
            Drive::Motor,
        ][(seed % 4) as usize];
        let mut table = Table::draw(drive, dice);
        let reach = dice.between(8e-3, 60e-3);
        // Command and displacement; acceleration besides; force besides.
        let width = 2 + dice.pick(&[0, 1, 1, 2]);
        let mut kinds = vec![0, 1, 2, 3];
        if width > 2 {
            kinds = vec![0, 1, 2, 4];
        }
        if width > 3 {
            kinds.push(5);
        }
        if drive == Drive::Hydraulic {
            kinds.extend([6, 7]);
        }
        let mut faults = Faults::default();
        let first = dice.pick(&kinds);
        faults.put(first, &mut table, dice, reach);
        if dice.chance(0.5) {
            kinds.retain(|kind| {
                *kind != first && !(*kind == 4 && first == 1) && !(*kind == 1 && first == 4)
            });
            let second = dice.pick(&kinds);
            faults.put(second, &mut table, dice, reach);
        }
        let dialect = Dialect::draw(dice);
        let rate = dice.pick(&[100.0, 200.0, 250.0, 500.0]);
        let names = dialect.files();
        let mut is_railed = false;
        let recordings = (0..dice.pick(&[2, 2, 3])).map(|number| {
            let seconds = dice.even(30.0, 60.0).round();
            let n = (seconds * rate) as usize;
            let size = [1.0, 0.7, 0.4][number];
            let motion = if number == 1 {
                let bounds = Bounds {
                    displacement: size * reach,
                    acceleration: 8.0,
                };
                earthquake(n, rate, bounds, dice)
            } else {
                broadband(n, rate, size * reach, dice)
            };
            let (rows, railed) = record(&table, &faults, &motion, rate, width, dice);
            is_railed |= railed > SEEN;
            (
                names[number].into(),
                dialect.write(&rows, rate, width, number),
            )
        });
        let recordings: Vec<_> = recordings.collect();
        Self {
            notes: notes(&table, reach, rate),
            truth: Truth {
                laboratory: format!("laboratory-{seed}"),
                drive: format!("{drive:?} under {:?}", table.control.kind),
                faults: faults.said,
                is_railed,
                gives_way: table.gives_way(),
                flow_falls: table.flow_falls(),
            },
            recordings,
        }
    }

    /// Writes the folder as its people have it.
    ///
    /// # Errors
    /// A folder or file that cannot be written.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        fs::create_dir_all(folder)?;
        fs::write(folder.join("notes.txt"), &self.notes)?;
        for (name, content) in &self.recordings {
            fs::write(folder.join(name), content)?;
        }
        Ok(())
    }
}

fn broadband(n: usize, rate: f64, peak: f64, dice: &mut Dice) -> Vec<f64> {
    let high = dice.between(4.0, 12.0);
    let parts = vec![
        (
            0.7,
            Shape::Resonance {
                frequency: 0.8,
                damping: 0.6,
            },
        ),
        (0.3, Shape::Band { low: 0.2, high }),
    ];
    // Shapes have tails beyond what a laboratory would play.
    let raw = Spectrum(parts).draw(n, rate, 1.0, dice);
    let mut motion = vec![0.0; n];
    let keep = (-std::f64::consts::TAU * high / rate).exp();
    let mut lag = [0.0; 3];
    for (k, value) in raw.into_iter().enumerate() {
        let mut x = value;
        for stage in &mut lag {
            *stage = keep * *stage + (1.0 - keep) * x;
            x = *stage;
        }
        let edge = (k.min(n - 1 - k) as f64 / rate).min(1.0);
        motion[k] = x * edge * edge * (3.0 - 2.0 * edge);
    }
    let largest = motion.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    motion.iter_mut().for_each(|v| *v *= peak / largest);
    motion
}

/// Rows of time, command, displacement, acceleration and force, SI.
fn record(
    table: &Table,
    faults: &Faults,
    motion: &[f64],
    rate: f64,
    width: usize,
    dice: &mut Dice,
) -> (Vec<Vec<f64>>, f64) {
    let n = motion.len();
    let reach = motion.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let flicker = |share: f64| {
        Spectrum(vec![
            (1.0 - share, Shape::White),
            (share, Shape::OneOverF { exponent: 1.0 }),
        ])
    };
    let channel = |rms: f64, range: f64, dice: &mut Dice| Channel {
        spectrum: flicker(dice.pick(&[0.0, 0.3, 0.6])),
        lines: [dice.pick(&[0.0, 0.5]), 0.0, 0.0],
        range,
        bits: dice.pick(&[12, 14, 16]),
        ..Channel::plain(rms)
    };
    let (readings, railed) = table.play(motion, rate, faults.delay, faults.scale);
    let largest = |i: usize| readings.iter().fold(0.0f64, |m, r| m.max(r[i].abs()));
    let channels = [
        channel(2e-4 * reach, 3.0 * reach, dice),
        channel(0.02, (2.0 * largest(1)).max(5.0), dice),
        channel(2e-3 * largest(2), 2.0 * largest(2), dice),
    ];
    let noises = channels
        .clone()
        .map(|channel| channel.noise(n, rate, 50.0, dice));
    let mut linkage = 0.0f64;
    let rows = (0..n)
        .map(|k| {
            let [x, a, f] = readings[k];
            linkage = linkage.clamp(x - faults.play, x + faults.play);
            let shown = [linkage + faults.zero, a * (1.0 + faults.accelerometer), f];
            let shown = (0..3).map(|i| channels[i].convert(shown[i] + noises[i][k]));
            let all = [k as f64 / rate, motion[k]].into_iter().chain(shown);
            all.take(width + 1).collect()
        })
        .collect();
    (rows, railed)
}

fn notes(table: &Table, reach: f64, rate: f64) -> String {
    let Loop { kind, gain, .. } = &table.control;
    format!(
        "{}\nMoving mass about {:.0} kg. Displacement control, {kind:?}, proportional gain {:.3} V/mm, \
         computed at {:.0} Hz.\nUsed to about {:.0} mm. Recorded at {rate} Hz: the command as it was sent, and \
         the sensors.\n",
        table.words(),
        table.mass(),
        gain / 1000.0,
        table.control.rate,
        1000.0 * reach,
    )
}
