//! Seismic qualification on a rig: a motion for a required response spectrum within the rig's limits, resonance
//! searches, and runs whose drive is corrected on the spectrum.
//!
//! 1. The motion is matched ([`qualification::matching`]) and scaled to the largest level that the rig plays.
//! 2. A search at a low level finds the specimen's resonances.
//! 3. Runs at a quarter and a half of the level find the transfer function from drive to table, and correct the
//!    drive on the waveform.
//! 4. Runs at the level: wavelets that would bring the *measured* spectrum to its aim go through the inverse of the
//!    transfer function into the drive.
//! 5. The search is repeated.

pub mod limits;
mod page;

use std::path::PathBuf;
use std::time::Instant;
use units::vocabulary;

use fmi_import::Datum;
use fmi_master::Ending;
use fmi_system::{System, Value};
use motion::{Motion, Record};
use qualification::matching::{self, Aim, Matched, refine, together};
use qualification::resonance::{self, Excitation, Found, Resonance, Shift};
use qualification::{Rule, Verdict, doubts};
use serde::Serialize;
use units::STANDARD_GRAVITY;

pub use self::limits::{Limits, Use};
pub use self::page::{motion_at2, spectrum_panel, trs_page, write};
use crate::error::Error;
use crate::iteration::{Inverse, Measured, USUAL_CROSSOVER, control_model};
use crate::run::experiment::{Prepared, Request, prepare};
use crate::run::manifest::Manifest;

/// Parts of the level of the runs before the first at the level itself.
const APPROACH: [f64; 2] = [0.25, 0.5];
/// Part of the displacement limit that a search uses at low frequencies.
const SLOW: f64 = 0.4;
/// Number of the run of the second search: its noise is its own.
const AFTER: usize = 100;
/// The share of stroke and stopping distance up to which the level is kept: what a run at a lower level shows of it.
const REACH: f64 = 0.9;
/// Frequencies between which a drive is corrected, over the band's ends.
const BEYOND: [f64; 2] = [0.5, 1.2];
/// Ratio that a corrected drive aims at, and what is good enough for it.
const CENTRE: f64 = 1.08;
const ENOUGH: [f64; 2] = [1.05, 1.12];
/// Lower ends of the band, over the rule's, for which the level is computed where a motion does not fit.
const HIGH_PASS: [f64; 3] = [1.5, 2.0, 3.0];

/// What to qualify.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The rule.
    pub rule: Rule,
    /// Record whose phases are kept; none: random phases.
    pub record: Option<Record>,
    /// Seed of the phases.
    pub seed: u64,
    /// The system on its rig; none: no limits, and nothing is run.
    pub request: Option<Request>,
    /// Whether only the motion is made.
    pub motion_only: bool,
    /// Runs at the level, at most.
    pub rounds: usize,
    /// How resonances are searched; none: not.
    pub search: Option<Excitation>,
    /// Parameters of the rig for the second search, to see what a change would show.
    pub set_after: Vec<String>,
}

/// The motion of an axis.
#[derive(Debug, Clone, Serialize)]
pub struct MotionEntry {
    /// File in the folder of the results.
    pub file: PathBuf,
    /// Seed of its phases.
    pub seed: Option<u64>,
    /// Peak acceleration, g.
    pub pga_g: f64,
    /// Peak velocity.
    pub peak_velocity_m_s: f64,
    /// Peak displacement.
    pub peak_displacement_m: f64,
    /// Lowest ratio of its spectrum to the required one at the level, on 1/12 octaves over the band.
    pub lowest_ratio: f64,
    /// Highest ratio.
    pub highest_ratio: f64,
    /// Time between a quarter of the peak first and last.
    pub strong_motion_s: f64,
}

/// A level with a band that begins later.
#[derive(Debug, Clone, Serialize)]
pub struct HighPass {
    /// Where the motion's band begins, Hz; the spectrum is not enveloped below.
    pub from_hz: f64,
    /// Part of the required spectrum that the rig plays then.
    pub level: f64,
}

/// A run.
#[derive(Debug, Clone, Serialize)]
pub struct Round {
    /// Part of the required spectrum.
    pub level: f64,
    /// Lowest ratio of the measured spectrum on 1/12 octaves over the band.
    pub lowest_ratio: f64,
    /// Highest ratio.
    pub highest_ratio: f64,
    /// The rule's verdict.
    pub verdict: &'static str,
    /// Energy of the table's motion so far over that of the motion at the level.
    pub exposure: f64,
    /// Peak displacement of the drive.
    pub drive_peak_displacement_m: f64,
    /// How it ended.
    pub ended: Ending,
    /// Why it ended early.
    pub ended_because: Option<String>,
}

/// What was found: `qualification.json`, and what `--json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct Qualification {
    /// The rule.
    pub rule: Rule,
    /// The system, if one was run or limits the motion.
    pub system: Option<String>,
    /// The motion of the first axis.
    pub motion: MotionEntry,
    /// Those of further axes.
    pub further_axes: Vec<MotionEntry>,
    /// Largest correlation and coherence of two axes.
    pub correlation: Option<f64>,
    /// Largest coherence within the band.
    pub coherence: Option<f64>,
    /// Part of the required spectrum that was played.
    pub level: f64,
    /// The limit that a level of 1 exceeds.
    pub limited_by: Option<String>,
    /// How much of each limit the motion uses at the level.
    pub limits: Vec<Use>,
    /// Levels with bands that begin later, where stroke, velocity, valve or flow limit.
    pub high_pass: Vec<HighPass>,
    /// Runs at the level; those before, at lower ones, are in `approach`.
    pub rounds: Vec<Round>,
    /// Runs at lower levels before.
    pub approach: Vec<Round>,
    /// `envelops` or `falls short`: of the best run, or of the motion where nothing was run.
    pub verdict: &'static str,
    /// Resonances before.
    pub resonances_before: Vec<Resonance>,
    /// And after.
    pub resonances_after: Vec<Resonance>,
    /// Their shifts.
    pub shifts: Vec<Shift>,
    /// What is doubtful.
    pub warnings: Vec<String>,
    /// Time that it took.
    pub wall_s: f64,
    /// The motions as made, at the level.
    #[serde(skip)]
    pub motions: Vec<Motion>,
    /// The spectrum of the best run, or of the motion.
    #[serde(skip)]
    pub best: Option<Verdict>,
    /// The drive of the best run.
    #[serde(skip)]
    pub drive: Option<Motion>,
    /// What the table measured in it, m/s².
    #[serde(skip)]
    pub measured: Vec<f64>,
    /// Transfer functions of both searches.
    #[serde(skip)]
    pub searches: [Option<Found>; 2],
    /// What was run.
    #[serde(skip)]
    pub manifest: Option<Manifest>,
}

impl Qualification {
    /// Whether a run ended early, and why.
    #[must_use]
    pub fn ended_early(&self) -> Option<&str> {
        let runs = self.approach.iter().chain(&self.rounds);
        let early = runs.rev().find(|round| round.ended != Ending::Complete)?;
        Some(
            early
                .ended_because
                .as_deref()
                .unwrap_or("a run ended early"),
        )
    }
}

/// What a run gave.
struct Played {
    /// Velocity of the table as measured, m/s.
    velocity: Vec<f64>,
    /// Acceleration and displacement of the table as measured, SI.
    table: Measured,
    /// Acceleration of the specimen, m/s².
    specimen: Option<Vec<f64>>,
    ended: fmi_master::Ended,
}

/// Makes the motion, runs it, and searches resonances; `progress` says what begins.
///
/// # Errors
/// A rule or record at fault; a system that cannot be run.
pub fn qualify(plan: &Plan, progress: &mut dyn FnMut(&str)) -> Result<Qualification, Error> {
    let start = Instant::now();
    let rule = &plan.rule;
    let dt = motion::Options::default().sample_time;
    let mut warnings = match &plan.record {
        Some(record) => doubts(rule, record)?,
        None => Vec::new(),
    };
    let prepared = plan.request.as_ref().map(prepare).transpose()?;
    progress("matching the motion");
    let matched = matching::axes(rule, plan.record.as_ref(), plan.seed, dt)?;
    let manifest = match (&plan.request, &prepared) {
        (Some(request), Some(prepared)) => {
            let first = prepared.playing(matched[0].motion.clone());
            let how = (first.algorithm, first.step, first.samples);
            Some(Manifest::new(request, &first.system, &first.motion, how))
        }
        _ => None,
    };
    let limits = manifest.as_ref().map(Limits::of);
    let (level, limited_by) = match &limits {
        Some(limits) => limits.level(&matched[0].motion),
        None => (1.0, None),
    };
    let at_level = rule.at_level(level);
    let motions: Vec<Motion> = matched
        .iter()
        .map(|own| scaled(&own.motion, level))
        .collect();
    let entries = entries(&matched, &motions);
    let fits = |own: &&Matched| own.ratios[0] >= 1.0;
    if !matched.iter().all(|own| fits(&own)) {
        warnings.push(
            "the motion does not envelop the required spectrum by itself; try another --seed, or a longer \
             duration"
                .into(),
        );
    }
    let mut found = Qualification {
        rule: rule.clone(),
        system: plan.request.as_ref().map(|request| request.system.clone()),
        motion: entries[0].clone(),
        further_axes: entries[1..].to_vec(),
        correlation: None,
        coherence: None,
        level,
        limits: limits
            .as_ref()
            .map_or_else(Vec::new, |own| own.used(&motions[0], 1.0)),
        high_pass: high_pass(plan, limits.as_ref(), limited_by.as_deref(), dt),
        limited_by,
        rounds: Vec::new(),
        approach: Vec::new(),
        verdict: "falls short",
        resonances_before: Vec::new(),
        resonances_after: Vec::new(),
        shifts: Vec::new(),
        warnings,
        wall_s: 0.0,
        best: Some(Verdict::new(
            &at_level,
            &motions[0].acceleration,
            dt,
            Vec::new(),
        )),
        motions,
        drive: None,
        measured: Vec::new(),
        searches: [None, None],
        manifest,
    };
    alike(rule, &mut found, dt);
    if let (Some(request), Some(prepared), false) = (&plan.request, &prepared, plan.motion_only) {
        carry_out(plan, request, prepared, &at_level, &mut found, progress)?;
    }
    found.verdict = found.best.as_ref().map_or("falls short", |own| own.verdict);
    found.wall_s = start.elapsed().as_secs_f64();
    Ok(found)
}

fn scaled(motion: &Motion, level: f64) -> Motion {
    let times = |history: &[f64]| history.iter().map(|value| level * value).collect();
    Motion {
        displacement: times(&motion.displacement),
        velocity: times(&motion.velocity),
        acceleration: times(&motion.acceleration),
        ..motion.clone()
    }
}

fn entries(matched: &[Matched], motions: &[Motion]) -> Vec<MotionEntry> {
    let both = matched.iter().zip(motions).enumerate();
    both.map(|(n, (matched, motion))| MotionEntry {
        file: page::motion_name(n, "csv").into(),
        seed: motion.seed,
        pga_g: motion.peak_acceleration() / STANDARD_GRAVITY,
        peak_velocity_m_s: motion.peak_velocity(),
        peak_displacement_m: motion.peak_displacement(),
        lowest_ratio: matched.ratios[0],
        highest_ratio: matched.ratios[1],
        strong_motion_s: matching::strong_motion(&motion.acceleration, motion.dt),
    })
    .collect()
}

fn alike(rule: &Rule, found: &mut Qualification, dt: f64) {
    for (n, one) in found.motions.iter().enumerate() {
        for other in &found.motions[n + 1..] {
            let [r, c] = together(&one.acceleration, &other.acceleration, dt, rule.band_hz);
            found.correlation = Some(found.correlation.unwrap_or(0.0).max(r));
            found.coherence = Some(found.coherence.unwrap_or(0.0).max(c));
        }
    }
}

/// Levels of motions whose band begins later, where that helps.
fn high_pass(
    plan: &Plan,
    limits: Option<&Limits>,
    limited_by: Option<&str>,
    dt: f64,
) -> Vec<HighPass> {
    let slow = [
        "displacement",
        "stopping distance",
        "velocity",
        "valve",
        "flow",
    ];
    let (Some(limits), Some(true)) = (limits, limited_by.map(|name| slow.contains(&name))) else {
        return Vec::new();
    };
    let [low, high] = plan.rule.band_hz;
    let ends = HIGH_PASS.into_iter().map(|over| over * low);
    ends.filter(|from| *from < 0.5 * high)
        .map(|from_hz| {
            let rule = Rule {
                band_hz: [from_hz, high],
                ..plan.rule.clone()
            };
            let motion = matching::from_noise(&rule, plan.seed, dt).motion;
            HighPass {
                from_hz,
                level: limits.level(&motion).0,
            }
        })
        .collect()
}

/// Searches, runs and corrects.
fn carry_out(
    plan: &Plan,
    request: &Request,
    prepared: &Prepared,
    rule: &Rule,
    found: &mut Qualification,
    progress: &mut dyn FnMut(&str),
) -> Result<(), Error> {
    let stroke = found
        .manifest
        .as_ref()
        .map_or(0.0, |own| Limits::of(own).displacement());
    let has_specimen = prepared
        .system
        .components
        .iter()
        .any(|own| own.name == "specimen");
    if let (Some(how), true) = (plan.search, has_specimen) {
        progress("searching resonances");
        let before = search(plan, how, prepared, stroke, 0)?;
        found.resonances_before.clone_from(&before.resonances);
        found.searches[0] = Some(before);
    }
    let complete = rounds(plan, request, prepared, rule, found, progress)?;
    if let (Some(how), true, true) = (plan.search, has_specimen, complete) {
        progress("searching resonances again");
        let after = if plan.set_after.is_empty() {
            search(plan, how, prepared, stroke, AFTER)?
        } else {
            let mut changed = request.clone();
            changed.set.extend(plan.set_after.iter().cloned());
            search(plan, how, &prepare(&changed)?, stroke, AFTER)?
        };
        found.shifts = resonance::shifts(&found.resonances_before, &after.resonances);
        found.resonances_after.clone_from(&after.resonances);
        found.searches[1] = Some(after);
    }
    Ok(())
}

fn search(
    plan: &Plan,
    how: Excitation,
    prepared: &Prepared,
    stroke: f64,
    run: usize,
) -> Result<Found, Error> {
    let own = &plan.rule.search;
    let seed = plan.seed.wrapping_add(run as u64);
    let drive = resonance::excitation(own, how, seed, prepared.motion.dt, SLOW * stroke);
    let dt = drive.dt;
    let played = play(prepared, drive, run)?;
    if played.ended.kind() != Ending::Complete {
        return Err(Error::Option {
            option: "--search",
            reason: format!(
                "the resonance search at {} g ended early: {}; expected a lower --set search_level_g or a \
                 higher --set search_band_hz",
                own.level_g,
                played.ended.message()
            ),
        });
    }
    let Some(specimen) = &played.specimen else {
        return Ok(Found::default());
    };
    Ok(resonance::find(
        &played.table.acceleration,
        specimen,
        dt,
        own.band_hz,
    ))
}

/// Runs from a low level up; false where one ended early.
fn rounds(
    plan: &Plan,
    request: &Request,
    prepared: &Prepared,
    rule: &Rule,
    found: &mut Qualification,
    progress: &mut dyn FnMut(&str),
) -> Result<bool, Error> {
    let crossover = control_model(request)?.map_or(USUAL_CROSSOVER, |own| {
        (own.noise.acceleration / own.noise.displacement).sqrt() / std::f64::consts::TAU
    });
    let mut wanted = found.motions[0].clone();
    let mut rule = rule.clone();
    let limits = found.manifest.as_ref().map(Limits::of);
    let dt = wanted.dt;
    let band = [BEYOND[0] * rule.band_hz[0], BEYOND[1] * rule.band_hz[1]];
    let energy = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>();
    let whole = energy(&wanted.acceleration);
    let mut exposure = 0.0;
    let mut drive = wanted.clone();
    let mut best_miss = f64::INFINITY;
    for n in 0..APPROACH.len() + plan.rounds {
        let part = APPROACH.get(n).copied().unwrap_or(1.0);
        let level = part * found.level;
        progress(&format!(
            "running at {:.1} % of the spectrum",
            100.0 * level
        ));
        let own = scaled(&drive, part);
        let played = play(prepared, own.clone(), 1 + n)?;
        let measured = &played.table.acceleration;
        exposure += energy(measured) / whole;
        let here = rule.at_level(part);
        let verdict = Verdict::new(&here, measured, dt, Vec::new());
        let [lowest_ratio, highest_ratio] = verdict.twelfth_octaves;
        let complete = played.ended.kind() == Ending::Complete;
        let round = Round {
            level,
            lowest_ratio,
            highest_ratio,
            verdict: verdict.verdict,
            exposure,
            drive_peak_displacement_m: own.peak_displacement(),
            ended: played.ended.kind(),
            ended_because: played.ended.reason(),
        };
        if part < 1.0 {
            found.approach.push(round);
        } else {
            found.rounds.push(round);
            let miss = (highest_ratio / CENTRE)
                .ln()
                .max((CENTRE / lowest_ratio).ln());
            let held = if complete { 0.0 } else { 1e3 };
            if miss + held < best_miss {
                best_miss = miss + held;
                found.drive = Some(own.clone());
                found.measured.clone_from(measured);
                found.best = Some(verdict.clone());
            }
        }
        if !complete {
            return Ok(false);
        }
        let held = lowest_ratio >= 1.0 && highest_ratio <= rule.highest_ratio && verdict.envelops();
        if part == 1.0 && held {
            break;
        }
        let Some(inverse) = Inverse::new(&own, &played.table, crossover, band) else {
            return Err(Error::Option {
                option: "RULE",
                reason:
                    "the motion is too short to find a transfer function from; expected a longer \
                         duration_s"
                        .into(),
            });
        };
        let inverse = inverse.within_band();
        // At the level: what the measured spectrum lacks. Below: what the measured waveform does.
        let lacking = if part == 1.0 {
            let zero = || vec![0.0; measured.len()];
            let mut more = [zero(), zero(), zero()];
            refine(&Aim::of(&rule, CENTRE, ENOUGH), measured, &mut more, dt);
            more[2].clone()
        } else {
            let error = inverse.error(&scaled(&wanted, part), &played.table);
            error.iter().map(|value| value / part).collect()
        };
        inverse.correct(&mut drive, &lacking, 1.0);
        let share = limits
            .as_ref()
            .map_or(0.0, |own| reach(own, &played, &drive, part));
        if part < 1.0 && share > REACH {
            let less = REACH / share;
            reduce(found, limits.as_ref(), less);
            (wanted, drive, rule) = (
                scaled(&wanted, less),
                scaled(&drive, less),
                rule.at_level(less),
            );
        }
    }
    Ok(true)
}

/// The share of stroke and stopping distance that the level would use, by what a run at a part of it measured
/// and by the drive.
fn reach(limits: &Limits, played: &Played, drive: &Motion, part: f64) -> f64 {
    let measured = Motion {
        displacement: played.table.displacement.clone(),
        velocity: played.velocity.clone(),
        acceleration: played.table.acceleration.clone(),
        ..drive.clone()
    };
    let slow = ["displacement", "stopping distance"];
    let all = [limits.used(&measured, 1.0 / part), limits.used(drive, 1.0)];
    let shares = all
        .iter()
        .flatten()
        .filter(|own| slow.contains(&own.limit.as_str()));
    shares.map(|own| own.share).fold(0.0, f64::max)
}

/// Lowers the level after a run that showed more travel than the motion has.
fn reduce(found: &mut Qualification, limits: Option<&Limits>, less: f64) {
    found.level *= less;
    found
        .motions
        .iter_mut()
        .for_each(|own| *own = scaled(own, less));
    for own in std::iter::once(&mut found.motion).chain(&mut found.further_axes) {
        own.pga_g *= less;
        own.peak_velocity_m_s *= less;
        own.peak_displacement_m *= less;
    }
    found.limits = limits.map_or_else(Vec::new, |own| own.used(&found.motions[0], 1.0));
    found.limited_by = Some("stopping distance".into());
}

/// Plays a drive; the noise of the sensors is another one in each of the runs.
fn play(prepared: &Prepared, drive: Motion, run: usize) -> Result<Played, Error> {
    let mut own = prepared.playing(drive);
    for component in &mut own.system.components {
        let Some(seed) = component.fmu.description.position("seed") else {
            continue;
        };
        let first = match component.start_value(&component.given(), seed) {
            Datum::Number(first) => first,
            _ => continue,
        };
        component
            .parameters
            .retain(|(position, _)| *position != seed);
        let next = Value::Number(first + run as f64);
        component.parameters.push((seed, next));
    }
    let outcome = own.run(own.algorithm)?;
    let column = |system: &System, names: &[&str]| {
        let all = names.iter().flat_map(|name| {
            let components = system.components.iter();
            components.map(move |own| format!("{}.{name}", own.name))
        });
        let mut found = all.filter_map(|name| outcome.record.column(&name));
        found.next()
    };
    let table = |measured: &str, own: &str| {
        column(&prepared.system, &[measured])
            .or_else(|| outcome.record.column(&format!("table.{own}")))
            .or_else(|| column(&prepared.system, &[own]))
            .ok_or_else(|| Error::Option {
                option: "--system",
                reason: format!(
                    "{} has no component with the output `{own}`, which a qualification measures",
                    prepared.system.name
                ),
            })
    };
    let specimen = column(
        &prepared.system,
        &[vocabulary::MEASURED_SPECIMEN_ACCELERATION],
    )
    .or_else(|| outcome.record.column("specimen.acceleration"));
    Ok(Played {
        velocity: table(vocabulary::MEASURED_VELOCITY, "velocity")?,
        table: Measured {
            displacement: table(vocabulary::MEASURED_DISPLACEMENT, "displacement")?,
            acceleration: table(vocabulary::MEASURED_ACCELERATION, "acceleration")?,
        },
        specimen,
        ended: outcome.ended,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;

    fn plan(rule: &Rule, rounds: usize) -> Plan {
        Plan {
            rule: rule.clone(),
            record: None,
            seed: 3,
            request: None,
            motion_only: false,
            rounds,
            search: None,
            set_after: Vec::new(),
        }
    }

    fn stated(rule: &Rule, motion: &Motion) -> Qualification {
        let matched = Matched {
            motion: motion.clone(),
            ratios: [0.98, 1.2],
            rounds: 0,
        };
        let entries = entries(&[matched], std::slice::from_ref(motion));
        Qualification {
            rule: rule.clone(),
            system: None,
            motion: entries[0].clone(),
            further_axes: Vec::new(),
            correlation: None,
            coherence: None,
            level: 1.0,
            limited_by: None,
            limits: Vec::new(),
            high_pass: Vec::new(),
            rounds: Vec::new(),
            approach: Vec::new(),
            verdict: "falls short",
            resonances_before: Vec::new(),
            resonances_after: Vec::new(),
            shifts: Vec::new(),
            warnings: Vec::new(),
            wall_s: 0.0,
            motions: vec![motion.clone()],
            best: None,
            drive: None,
            measured: Vec::new(),
            searches: [None, None],
            manifest: None,
        }
    }

    fn short_rule() -> Rule {
        let settings = ["s_ds=0.5", "duration_s=8"].map(String::from);
        let load = qualification::load("ac156", &settings);
        load.unwrap_or_else(|_| qualification::load("ac156", &settings[..1]).unwrap())
    }

    #[test]
    fn runs_begin_at_a_quarter_and_a_half_and_the_best_drive_is_kept() {
        let rule = short_rule();
        let matched = matching::from_noise(&rule, 3, 0.002);
        let motion = matched.motion;
        let prepared = made::prepared(motion.clone(), made::follows);
        let mut found = stated(&rule, &motion);
        let mut said = Vec::new();
        let request = Request::built_in("mpc");
        let complete = rounds(
            &plan(&rule, 2),
            &request,
            &prepared,
            &rule,
            &mut found,
            &mut |words| {
                said.push(words.to_string());
            },
        );
        assert!(complete.unwrap());
        let levels: Vec<f64> = found.approach.iter().map(|round| round.level).collect();
        assert_eq!(levels, [0.25, 0.5]);
        assert!((1..=2).contains(&found.rounds.len()));
        assert_eq!(
            said[..3],
            [
                "running at 25.0 % of the spectrum",
                "running at 50.0 % of the spectrum",
                "running at 100.0 % of the spectrum"
            ]
        );
        // At first the table lacks a tenth, which the corrections of the drive bring.
        let first = &found.approach[0];
        assert!(
            (first.highest_ratio / matched.ratios[1] - 0.9).abs() < 0.02,
            "{first:?}"
        );
        assert!(
            (first.exposure - (0.25_f64 * 0.9).powi(2)).abs() < 1e-3,
            "{first:?}"
        );
        assert!((first.drive_peak_displacement_m - 0.25 * motion.peak_displacement()).abs() < 1e-9);
        let last = found.rounds.last().unwrap();
        assert!(
            last.lowest_ratio > first.lowest_ratio + 0.05,
            "{first:?} {last:?}"
        );
        assert!(found.best.is_some() && found.measured.len() == motion.len());
        let drive = found.drive.as_ref().unwrap();
        let more = drive.peak_acceleration() / motion.peak_acceleration();
        assert!((1.02..1.3).contains(&more), "{more}");
        assert_eq!(found.ended_early(), None);
    }

    #[test]
    fn a_run_that_fails_ends_the_approach() {
        fn runs_away(inputs: &[f64], outputs: &mut [f64]) {
            made::follows(inputs, outputs);
            outputs[0] *= -9.0;
        }
        let rule = short_rule();
        let motion = made::wave("wave", 2000);
        let prepared = made::prepared(motion.clone(), runs_away);
        let mut found = stated(&rule, &motion);
        let request = Request::built_in("mpc");
        let complete = rounds(
            &plan(&rule, 1),
            &request,
            &prepared,
            &rule,
            &mut found,
            &mut |_| (),
        );
        assert!(!complete.unwrap());
        assert_eq!((found.approach.len(), found.rounds.len()), (1, 0));
        assert!(found.ended_early().is_some());
    }

    #[test]
    fn a_lower_level_scales_motions_and_figures() {
        let rule = short_rule();
        let motion = made::wave("wave", 200);
        let mut found = stated(&rule, &motion);
        let before = found.motion.clone();
        reduce(&mut found, None, 0.5);
        assert_eq!(
            (found.level, found.limited_by.as_deref()),
            (0.5, Some("stopping distance"))
        );
        assert_eq!(found.motion.pga_g, 0.5 * before.pga_g);
        assert_eq!(
            found.motion.peak_velocity_m_s,
            0.5 * before.peak_velocity_m_s
        );
        assert_eq!(
            found.motion.peak_displacement_m,
            0.5 * before.peak_displacement_m
        );
        assert_eq!(found.motions[0].velocity[7], 0.5 * motion.velocity[7]);
        assert!(found.limits.is_empty());
        assert!((before.pga_g - motion.peak_acceleration() / STANDARD_GRAVITY).abs() < 1e-12);
        assert_eq!((before.lowest_ratio, before.highest_ratio), (0.98, 1.2));
        let twice = [motion.clone(), motion];
        found.motions = twice.to_vec();
        alike(&rule, &mut found, 0.002);
        assert!((found.correlation.unwrap() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn levels_of_later_bands_are_computed_where_slow_motion_limits() {
        let rule = short_rule();
        let manifest = made::manifest(&Request::built_in("mpc"), &made::wave("wave", 3));
        let limits = Limits::of(&manifest);
        let levels = |limited_by| high_pass(&plan(&rule, 0), Some(&limits), limited_by, 0.005);
        assert!(levels(Some("acceleration")).is_empty() && levels(None).is_empty());
        let all = levels(Some("velocity"));
        let from: Vec<f64> = all
            .iter()
            .map(|own| own.from_hz / rule.band_hz[0])
            .collect();
        assert_eq!(from, HIGH_PASS);
        assert!(all.iter().all(|own| own.level > 0.0 && own.level <= 1.0));
        assert!(high_pass(&plan(&rule, 0), None, Some("velocity"), 0.005).is_empty());
    }
}
