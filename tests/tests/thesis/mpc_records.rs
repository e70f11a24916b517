//! Model predictive control on the thesis's records, bare and with the linear specimen: the goals
//! for its time-domain error (Table 5-2's measure) and its order before three-variable control.

use acceptance::shared;
use controllers::mpc::{
    ModelPredictiveControl, ModelPredictiveInput, Outlook, Parameters, prediction_plant,
};
use controllers::three_variable::{ThreeVariableControl, ThreeVariableInput};
use controllers::{Controller, Motion};
use nalgebra::{DVector, dvector};
use plant::identified::coupled::Rig;
use plant::specimens::linear::LinearSpecimen;
use rayon::prelude::*;

const H: f64 = 0.002;

fn records() -> Vec<(String, Vec<Motion>)> {
    shared::records()
        .iter()
        .map(|path| {
            let played = motion::load(path, &motion::Options::default()).unwrap();
            assert_eq!(played.dt, H);
            let samples = (0..played.len())
                .map(|i| Motion {
                    displacement: played.displacement[i],
                    velocity: played.velocity[i],
                    acceleration: played.acceleration[i],
                })
                .collect();
            (played.name, samples)
        })
        .collect()
}

/// `100 rms(a_ref - a) / max |a_ref|` of the rig sampled at 2 ms: commands are computed from the
/// outputs at a sample and act until the next.
fn error(rig: &Rig, reference: &[Motion], outlook: Option<Outlook>, model: &Rig) -> f64 {
    let mut high_level = outlook.map(|outlook| {
        ModelPredictiveControl::new(Parameters {
            plant: prediction_plant(model),
            outlook,
            ..Parameters::default()
        })
        .unwrap()
    });
    let rig = rig.state_space().sample(H);
    let mut low_level = ThreeVariableControl::table_3_2();
    let mut x = DVector::zeros(rig.order());
    let (mut squares, mut largest) = (0.0, 0.0f64);
    for (k, wanted) in reference.iter().enumerate() {
        let y = &rig.c * &x;
        let measured = Motion {
            displacement: y[0],
            velocity: y[1],
            acceleration: y[2],
        };
        squares += (wanted.acceleration - y[2]).powi(2);
        largest = largest.max(wanted.acceleration.abs());
        let command = high_level.as_mut().map_or(*wanted, |control| {
            let input = ModelPredictiveInput::window(reference, k, measured).unwrap();
            control.step(&input, H)
        });
        let input = ThreeVariableInput {
            reference: command,
            measured,
        };
        x = rig.advance(&x, &dvector![low_level.step(&input, H)]);
    }
    100.0 * (squares / reference.len() as f64).sqrt() / largest
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (values[(n - 1) / 2] + values[n / 2]) / 2.0
}

#[needs::shared("records")]
#[test]
fn records_are_followed_to_the_goals_and_before_three_variable_control() {
    let records = records();
    let bare = Rig::default();
    let loaded = Rig {
        specimen: Some(LinearSpecimen::appendix_a()),
        ..bare
    };
    for (name, rig) in [("bare", bare), ("specimen", loaded)] {
        let rows: Vec<[f64; 5]> = records
            .par_iter()
            .map(|(_, reference)| {
                [
                    error(&rig, reference, None, &bare),
                    error(&rig, reference, Some(Outlook::Hold), &rig),
                    error(&rig, reference, Some(Outlook::Extrapolate), &rig),
                    error(&rig, reference, Some(Outlook::Preview), &rig),
                    error(&rig, reference, Some(Outlook::Preview), &bare),
                ]
            })
            .collect();
        println!(
            "{name}: three-variable, MPC held, extrapolated, preview, preview with bare model"
        );
        for ((record, _), row) in records.iter().zip(&rows) {
            println!("  {record:<32} {row:8.4?}");
            assert!(
                row[1..].iter().all(|error| error < &row[0]),
                "{record}: {row:?}"
            );
        }
        let medians: [f64; 5] =
            std::array::from_fn(|column| median(rows.iter().map(|row| row[column]).collect()));
        println!("  {:<32} {medians:8.4?}", "median");
        assert!(
            medians[2] < 1.0,
            "{name}, without preview: {} %",
            medians[2]
        );
        assert!(medians[3] < 0.01, "{name}, with preview: {} %", medians[3]);
    }
}
