//! The rig against the other generator's, written down on its own: every effect of the catalogue under the
//! same command.

use std::f64::consts::TAU;

use hidden_effects::catalogue::{CATALOGUE, Effect};
use hidden_effects::form::Form;
use strangers::table::hidden::Friction;
use strangers::table::rig::{NOMINAL, Rig};
use strangers::table::{Hidden, Laws};

const LAWS: Laws = Laws {
    friction: Friction::Tanh { width: 0.1 },
    stribeck_velocity: 0.5,
    iwan: false,
    yielding: (3.0, 0.05),
    two_plays: false,
    root_droop: false,
    uplift_ratio: 0.2,
    degradation_drift: 0.8,
    mains_phase: 0.3,
};

#[test]
fn every_effect_moves_both_rigs_alike() {
    for entry in CATALOGUE {
        let middle = |p: &hidden_effects::catalogue::Range| (p.weak * p.strong).sqrt();
        let effect = Effect {
            entry: *entry,
            values: entry.parameters.iter().map(middle).collect(),
            strength: 0.5,
        };
        let mut hidden = Hidden::default();
        hidden.put(&effect);
        let mut ours = Rig::new(NOMINAL, hidden, LAWS);
        let form = Form {
            mains_phase: LAWS.mains_phase,
            ..Form::default()
        };
        let others = hidden_effects::hidden::Hidden {
            effects: vec![effect],
            outside: None,
            form,
        };
        let mut others = hidden_effects::rig::Rig::new(hidden_effects::plant::NOMINAL, others);
        let (mut off, mut size) = ([0.0; 4], [0.0f64; 4]);
        for k in 0..1000 {
            let t = f64::from(k) * 0.002;
            let command = 0.8 * (TAU * 1.5 * t).sin() + 0.4 * (TAU * 6.0 * t + 1.0).sin();
            let theirs = others.sample();
            let theirs = [theirs.x, theirs.a, theirs.f, theirs.s];
            for (i, shown) in ours.sample(0.0).into_iter().enumerate() {
                off[i] += (shown - theirs[i]).powi(2);
                size[i] += theirs[i].powi(2);
            }
            ours.advance(command, 0.002, (0.0, 0.0));
            others.advance(command, 0.0);
        }
        for i in 0..4 {
            let relative = (off[i] / size[i].max(1e-12)).sqrt();
            assert!(relative < 0.01, "{}: channel {i}: {relative}", entry.name);
        }
    }
}
