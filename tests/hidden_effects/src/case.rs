//! A case: what the laboratory has, and the truth kept apart.

use std::fmt::Write as _;
use std::path::Path;
use std::{fs, io};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::catalogue::{CATALOGUE, Effect, Entry, entry};
use crate::excitation::{EXCITATIONS, Excitation};
use crate::form::Form;
use crate::hidden::Hidden;
use crate::law::Law;
use crate::outside::Outside;
use crate::plant::{NOMINAL, Plant};
use crate::rig::{RATE, Rig};
use crate::score::{Truth, TruthEffect, TruthValue};
use crate::world::{Noises, World};

/// What a case hides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Nothing.
    Nothing,
    /// One effect of the catalogue, drawn.
    One,
    /// This effect of the catalogue.
    This(&'static str),
    /// Two effects that change different parts.
    Two,
    /// Something that the catalogue does not hold, drawn.
    Outside,
    /// This one from outside the catalogue.
    ThisOutside(Outside),
}

/// How a case is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// What is hidden.
    pub kind: Kind,
    /// Relative standard deviation of every plant parameter.
    pub mismatch: f64,
    /// Factor on every sensor's noise.
    pub noise: f64,
    /// Seconds a record.
    pub duration: f64,
    /// What disturbs the rig and its sensors.
    pub world: World,
}

impl Settings {
    /// 1 % mismatch, plain noise, 20 s.
    pub fn new(kind: Kind) -> Self {
        Self {
            kind,
            mismatch: 0.01,
            noise: 1.0,
            duration: 20.0,
            world: World::Plain,
        }
    }
}

/// One record of a case, inch-pound, as the data file shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// File name without ending.
    pub name: &'static str,
    /// How the rig was driven.
    pub excitation: Excitation,
    /// Rows: time, valve command, displacement, acceleration, force, specimen acceleration,
    /// reference.
    pub rows: Vec<[f64; 7]>,
}

impl Record {
    /// True when the command is hardly ever at its limit of 10 V.
    fn is_under_control(&self) -> bool {
        let clipped = self.rows.iter().filter(|row| row[1].abs() > 9.9).count();
        let finite = self.rows.iter().flatten().all(|value| value.is_finite());
        finite && 100 * clipped < self.rows.len()
    }
}

/// A case with its truth.
#[derive(Debug, Clone)]
pub struct Case {
    /// Records, `identification`, `validation`, `small` and sometimes `baseline`.
    pub records: Vec<Record>,
    /// What was hidden.
    pub truth: Truth,
    plant: Plant,
    hidden: Hidden,
    noises: Noises,
    mismatch: f64,
}

const HEADER: &str = "time [s],valve_command [V],displacement [in],acceleration [in/s^2],\
    actuator_force [lbf],specimen_acceleration [in/s^2],reference [in]";

impl Case {
    /// Draws a case; the same seed and settings give the same case. A rig that its effects put out
    /// of control is no case: another one is drawn.
    pub fn draw(seed: u64, settings: &Settings) -> Self {
        let mut attempt = seed;
        loop {
            let mut case = Self::attempt(attempt, settings);
            if case.records.iter().all(Record::is_under_control) {
                case.truth.case = format!("seed-{seed}");
                return case;
            }
            attempt = attempt.wrapping_add(1 << 40);
        }
    }

    fn attempt(seed: u64, settings: &Settings) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = ChaCha8Rng::seed_from_u64(seed ^ 0x9e37_79b9_7f4a_7c15);
        let plant = NOMINAL.perturbed(|| settings.mismatch * gauss(&mut normal));
        let noises = Noises::draw(settings.world, settings.noise, seed);
        let mut hidden = Hidden {
            form: Form::draw(&mut rng, settings.world),
            ..Hidden::default()
        };
        let any = |rng: &mut ChaCha8Rng| CATALOGUE[rng.random_range(0..CATALOGUE.len())];
        let strength: f64 = rng.random_range(0.0..1.0);
        match settings.kind {
            Kind::Nothing => {}
            Kind::One => hidden.effects = vec![Effect::draw(any(&mut rng), &mut rng)],
            Kind::This(name) => {
                hidden.effects = entry(name)
                    .map(|e| Effect::draw(e, &mut rng))
                    .into_iter()
                    .collect();
            }
            Kind::Two => {
                let first: Entry = any(&mut rng);
                let second = loop {
                    let candidate = any(&mut rng);
                    if candidate.part != first.part {
                        break candidate;
                    }
                };
                hidden.effects = [first, second].map(|e| Effect::draw(e, &mut rng)).to_vec();
            }
            Kind::Outside => {
                let kind = Outside::draw(&mut rng);
                hidden.outside = Some((kind, kind.size(strength)));
            }
            Kind::ThisOutside(kind) => hidden.outside = Some((kind, kind.size(strength))),
        }

        let n = (settings.duration * RATE).round() as usize;
        let identification = if rng.random_bool(0.6) {
            Excitation::Multisine
        } else {
            EXCITATIONS[rng.random_range(0..EXCITATIONS.len())]
        };
        let validation = loop {
            let candidate = if rng.random_bool(0.6) {
                Excitation::Earthquake
            } else {
                EXCITATIONS[rng.random_range(0..EXCITATIONS.len())]
            };
            if candidate != identification {
                break candidate;
            }
        };
        let mut plan = vec![
            ("identification", identification, 0.9),
            ("validation", validation, 1.0),
            ("small", Excitation::Multisine, 0.2),
        ];
        if rng.random_bool(0.2) {
            plan.push(("baseline", Excitation::Multisine, 0.7));
        }
        let references: Vec<Vec<f64>> = plan
            .iter()
            .map(|(_, kind, peak)| kind.draw(n, RATE, *peak, &mut rng))
            .collect();

        resolve_peak_command(&mut hidden, &plant, &references[0]);
        let records = plan
            .iter()
            .zip(&references)
            .map(|(&(name, excitation, _), reference)| {
                let present = if name == "baseline" {
                    Hidden::default()
                } else {
                    hidden.clone()
                };
                let rows = play((&plant, present, &noises), reference, &mut normal, |_| {});
                Record {
                    name,
                    excitation,
                    rows,
                }
            })
            .collect();
        let truth = Truth {
            case: format!("seed-{seed}"),
            effects: truth_effects(&hidden),
            mismatch: settings.mismatch,
            noise: settings.noise,
            excitation: vec![identification, validation],
            strength: hidden
                .effects
                .iter()
                .map(|e| e.strength)
                .fold(None, |weakest: Option<f64>, s| {
                    Some(weakest.map_or(s, |w| w.min(s)))
                })
                .or(hidden.outside.map(|_| strength)),
            outside: hidden.outside.map(|(kind, _)| format!("{kind:?}")),
            usual_form: hidden.form.usual,
        };
        Self {
            records,
            truth,
            plant,
            hidden,
            noises,
            mismatch: settings.mismatch,
        }
    }

    /// What the table does, displacement (in) and acceleration (in/s²), while the case's rig with what
    /// is hidden in it follows another `reference` (in) under the laboratory's law.
    pub fn follow(&self, reference: &[f64], seed: u64) -> Vec<[f64; 2]> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (hidden, mut motion) = (self.hidden.clone(), Vec::new());
        let played = (&self.plant, hidden, &self.noises);
        play(played, reference, &mut rng, |rig| {
            motion.push(rig.table_motion())
        });
        motion
    }

    /// Writes `nominal.toml` and the records into `folder`, and nothing about the truth.
    ///
    /// # Errors
    /// A folder or file that cannot be written.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        fs::create_dir_all(folder)?;
        fs::write(folder.join("nominal.toml"), self.nominal())?;
        for record in &self.records {
            let mut text = String::from(HEADER);
            text.push('\n');
            for row in &record.rows {
                let cells: Vec<String> = row.iter().map(|v| six_digits(*v)).collect();
                let _ = writeln!(text, "{}", cells.join(","));
            }
            fs::write(folder.join(format!("{}.csv", record.name)), text)?;
        }
        Ok(())
    }

    /// The nominal model as the laboratory writes it down.
    pub fn nominal(&self) -> String {
        let [x, a, f, s, u] = self.noises.stated;
        let Plant {
            denominator,
            voltage_to_force,
            velocity_to_force,
            table,
            specimen,
        } = NOMINAL;
        let list = |tail: [f64; 3]| format!("{:?}, {:?}, {:?}", tail[0], tail[1], tail[2]);
        format!(
            "# Nominal rig: what the laboratory believes. Units: inch, lbf, second, volt.\n\
             sample_rate = {RATE:?}\n\
             [actuator]\n\
             denominator = [1.0, {}]\n\
             voltage_to_force = [{}]\n\
             velocity_to_force = [{}]\n\
             [table]\nmass = {}\ndamping = {}\nstiffness = {}\n\
             [specimen]\nmass = {}\ndamping = {}\nstiffness = {}\n\
             [controller]\nkind = \"three_variable_control\"\nproportional = 6.15\n\
             integral = 0.161\nvelocity_feedforward = 0.125\nacceleration_feedforward = 0.0001\n\
             velocity_feedback = 0.005\nacceleration_feedback = 0.0001\nvelocity_filter = 0.25\n\
             limit = 10.0\n\
             [noise]\ndisplacement = {x}\nacceleration = {a}\nactuator_force = {f}\n\
             specimen_acceleration = {s}\nvalve_command = {u}\n\
             [uncertainty]\nrelative = {}\n",
            list(denominator),
            list(voltage_to_force),
            list(velocity_to_force),
            table[0],
            table[1],
            table[2],
            specimen[0],
            specimen[1],
            specimen[2],
            self.mismatch
        )
    }
}

fn gauss(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn six_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let digits = 5 - value.abs().log10().floor() as i32;
    if (0..=12).contains(&digits) {
        let text = format!("{value:.*}", digits as usize);
        if text.contains('.') {
            return text.trim_end_matches('0').trim_end_matches('.').to_string();
        }
        return text;
    }
    format!("{value:.5e}")
}

/// A spool limit is drawn as a share of the peak command without it.
fn resolve_peak_command(hidden: &mut Hidden, plant: &Plant, reference: &[f64]) {
    let Some(i) = hidden
        .effects
        .iter()
        .position(|e| e.entry.name == "valve_spool_saturation")
    else {
        return;
    };
    let mut free = hidden.clone();
    free.effects.remove(i);
    let mut quiet = ChaCha8Rng::seed_from_u64(0);
    let rows = play(
        (plant, free, &Noises::none()),
        reference,
        &mut quiet,
        |_| {},
    );
    let peak = rows.iter().fold(0.0f64, |m, row| m.max(row[1].abs()));
    hidden.effects[i].values[0] *= peak;
}

/// Rows of a record; `seen` is shown the rig at every sample.
fn play(
    (plant, hidden, noises): (&Plant, Hidden, &Noises),
    reference: &[f64],
    rng: &mut ChaCha8Rng,
    mut seen: impl FnMut(&Rig),
) -> Vec<[f64; 7]> {
    let n = reference.len();
    let at = |k: usize| reference[k.min(n - 1)];
    let mut rig = Rig::new(*plant, hidden);
    let mut law = Law::default();
    let mut noise = noises.start();
    (0..n)
        .map(|k| {
            let before = at(k.saturating_sub(1));
            let rate = (at(k + 1) - before) * RATE / 2.0;
            let curvature = (at(k + 1) - 2.0 * at(k) + before) * RATE * RATE;
            seen(&rig);
            let true_values = rig.sample();
            let x = noise.reading(0, true_values.x, rng);
            let a = noise.reading(1, true_values.a, rng);
            let f = noise.reading(2, true_values.f, rng);
            let s = noise.reading(3, true_values.s, rng);
            let u = law.command([at(k), rate, curvature], x, a);
            // The valve adds a coloured voltage to what it is told.
            rig.advance(u, noise.disturbance(rng));
            let shown = noise.reading(4, u, rng);
            [k as f64 / RATE, shown, x, a, f, s, at(k)]
        })
        .collect()
}

fn truth_effects(hidden: &Hidden) -> Vec<TruthEffect> {
    let mut effects: Vec<TruthEffect> = hidden
        .effects
        .iter()
        .map(|effect| TruthEffect {
            effect: effect.entry.name.into(),
            parameters: effect
                .entry
                .parameters
                .iter()
                .zip(&effect.values)
                .map(|(p, &value)| {
                    (
                        p.name.into(),
                        TruthValue {
                            value,
                            unit: p.unit.into(),
                        },
                    )
                })
                .collect(),
        })
        .collect();
    if hidden.outside.is_some() {
        effects.push(TruthEffect {
            effect: "outside_catalogue".into(),
            parameters: Default::default(),
        });
    }
    effects
}
