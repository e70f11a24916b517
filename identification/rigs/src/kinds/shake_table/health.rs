//! The relations R1 to R5 against what they are on a healthy rig.

use std::collections::BTreeMap;

use plant::identified::rig::{IdentifiedRig, IdentifiedRigState};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::predictor::Disturbance;
use super::relations::{self, Relation};
use crate::case::{Case, Nominal};
use recordings::{Channel, Recording};

/// Seed of the noise on the simulated healthy rig.
const SEED: u64 = 20_170_401;

/// A relation's error in units of the sensors' noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RelationReport {
    /// With the nominal parameters.
    pub nominal: f64,
    /// With the parameters that were estimated along, without the effects.
    pub estimated: f64,
    /// On a simulated rig of these parameters without effects, under the same reference; none
    /// where the case states no law or reference. Above one where a record's ends and the unseen
    /// voltage count.
    pub healthy: Option<f64>,
}

/// The relations on the identification record of `case`, which are `nominal` with the nominal
/// parameters; `estimated` are those that were estimated along.
pub(super) fn health(
    case: &Case,
    nominal: &[Relation],
    estimated: &Nominal,
) -> BTreeMap<&'static str, RelationReport> {
    let after = relations::relations(&case.identification, estimated);
    let healthy = healthy(&case.identification, estimated)
        .map(|record| relations::relations(&record, estimated));
    let all = nominal.iter().map(|relation| {
        let find = |all: &[Relation]| {
            let mut all = all.iter();
            all.find(|other| other.name == relation.name)
                .map(|other| other.ratio)
        };
        let report = RelationReport {
            nominal: relation.ratio,
            estimated: find(&after).unwrap_or(relation.ratio),
            healthy: healthy.as_deref().and_then(find),
        };
        (relation.name, report)
    });
    all.collect()
}

/// What a rig of these parameters without effects would record in place of `recording`.
fn healthy(recording: &Recording, nominal: &Nominal) -> Option<Recording> {
    let law = nominal.controller?;
    let reference = recording.channel(Channel::Reference)?;
    let period = 1.0 / nominal.sample_rate;
    let rig = IdentifiedRig {
        shake_table: nominal.shake_table,
        specimen: nominal.specimen,
        effects: nominal.effects,
        sensors: nominal.sensors,
    };
    let sampled = rig.sample(period, 1).ok()?;
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
    let unseen = Disturbance::beside_command(nominal.command_noise, period);
    let (mut state, mut control) = (IdentifiedRigState::default(), law.start(period));
    let mut voltage = [0.0; 2];
    let mut outputs: [Vec<f64>; 4] = Default::default();
    let mut commands = Vec::with_capacity(recording.len());
    for k in 0..recording.len() {
        let readings = sampled.measure(&mut state, period * k as f64);
        let mut measured = [0.0; 4];
        for i in 0..4 {
            measured[i] = readings[i] + nominal.noise[i] * normal();
            outputs[i].push(measured[i]);
        }
        let command = control.command(reference, k, measured[0], measured[1]);
        let recorded = command + nominal.command_noise * normal();
        commands.push(recorded);
        voltage[0] = unseen.expect(&mut voltage) + unseen.drive() * normal();
        sampled.step_disturbed(&mut state, command, voltage[0]);
    }
    let mut simulated = recording.clone();
    for (channel, values) in Channel::OUTPUTS.into_iter().zip(outputs) {
        if recording.channel(channel).is_some() {
            simulated.replace(channel, values).ok()?;
        }
    }
    simulated.replace(Channel::ValveCommand, commands).ok()?;
    Some(simulated)
}
