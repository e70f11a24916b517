//! One step of every tracking law of hybrid simulation, timed step by step in a closed loop on
//! the nominal plant, of one actuator and of two.
//!
//! ```text
//! cargo bench -p hybrid --bench tracking
//! ```
//!
//! A tenth of the benchmark's period is 24.4 us.

use std::error::Error;
use std::time::Instant;

use controllers::Controller;
use hybrid::laws::TrackingInput;
use hybrid::laws::adaptive_inverse::AdaptiveInverse;
use hybrid::laws::gradient_inverse::GradientInverse;
use hybrid::laws::linear_quadratic::{LinearQuadraticDesign, LinearQuadraticTracking};
use hybrid::laws::model_inverse::ModelInverse;
use hybrid::laws::phase_lead_pi::PhaseLeadPi;
use hybrid::laws::robust_tracking::RobustTracking;
use hybrid::laws::sliding_mode::TrackingSlidingMode;
use hybrid::vrths::{
    BenchmarkCase, NumericalSubstructure, PERIOD, TransferSystem, TransferSystemParameters,
};

const STEPS: usize = 40_000;
/// The run is repeated; the fastest time of each step is what the step takes, the rest is what
/// else the machine does.
const REPEATS: usize = 9;

type Law = Box<dyn Controller<Input = TrackingInput, Output = f64>>;

fn laws() -> Result<Vec<(&'static str, Law)>, Box<dyn Error>> {
    let plant = TransferSystemParameters::default();
    Ok(vec![
        ("phase-lead-pi", Box::new(PhaseLeadPi::default()) as Law),
        ("inverse", Box::new(ModelInverse::of(&plant, 5)?)),
        (
            "robust",
            Box::new(RobustTracking::synthesise(&plant, 60.0, 50.0, 1.5, PERIOD)?),
        ),
        (
            "linear-quadratic",
            Box::new(LinearQuadraticTracking::design(
                &plant,
                &LinearQuadraticDesign::default(),
                PERIOD,
            )?),
        ),
        ("sliding-mode", Box::new(TrackingSlidingMode::published()?)),
        ("gradient-inverse", Box::new(GradientInverse::default())),
        (
            "adaptive-inverse",
            Box::new(AdaptiveInverse::benchmark(PERIOD)?),
        ),
    ])
}

/// The laws for two actuators, on their nominal plant with the benchmark's noise.
fn two_actuators() -> Result<(), Box<dyn Error>> {
    use hybrid::marths::laws::{
        DecentralisedAdaptive, Inverse, Law as Tracking, LinearQuadratic, LinearQuadraticDesign,
        Predictive, PredictiveDesign, SingleAxis,
    };
    use hybrid::marths::{Plant, PlantParameters, RATE, independent_noise};
    let noise = independent_noise(1, 0, STEPS);
    let adaptive = PredictiveDesign::default();
    let fixed = PredictiveDesign {
        adaptive: false,
        ..adaptive
    };
    let plant = PlantParameters::default();
    let weights = LinearQuadraticDesign::default();
    let make = |name: &str| -> Result<Box<dyn Tracking>, Box<dyn Error>> {
        Ok(match name {
            "rodeac" => Box::new(DecentralisedAdaptive::default()),
            "single-axis" => Box::new(SingleAxis::new(&plant, 0.1, 3, 16, 0.0)?),
            "full inverse" => Box::new(Inverse::new(plant, 2, 12)?),
            "quadratic, both" => Box::new(LinearQuadratic::new(plant, &weights, 2, 12)?),
            "predictive" => Box::new(Predictive::new(fixed)?),
            _ => Box::new(Predictive::new(adaptive)?),
        })
    };
    for name in [
        "rodeac",
        "single-axis",
        "full inverse",
        "quadratic, both",
        "predictive",
        "adaptive-predictive",
    ] {
        let mut times = vec![u128::MAX; STEPS];
        for _ in 0..REPEATS {
            let mut law = make(name)?;
            let mut plant = Plant::new(PlantParameters::default())?;
            for (k, (time, noise)) in times.iter_mut().zip(&noise).enumerate() {
                let t = k as f64 / RATE;
                let target = [2e-3 * (14.0 * t).sin(), 3e-3 * (14.0 * t).cos()];
                let stroke = plant.strokes();
                let measured = [stroke[0] + noise[0], stroke[1] + noise[1]];
                let start = Instant::now();
                law.feedback(std::hint::black_box(measured));
                let command =
                    std::hint::black_box(law.step(std::hint::black_box(target), measured));
                *time = start.elapsed().as_nanos().min(*time);
                plant.step(command);
            }
        }
        print(name, &mut times);
    }
    Ok(())
}

fn print(name: &str, times: &mut [u128]) {
    times.sort_unstable();
    println!(
        "{name:20} {:>7}  {:>7}  {:>8}",
        times[STEPS / 2],
        times[STEPS * 999 / 1000],
        times[STEPS - 1]
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("law                  median   99.9 %   longest  (ns, {STEPS} steps)");
    for (name, mut law) in laws()? {
        let parameters = TransferSystemParameters::default();
        let specimen = [
            parameters.specimen_mass,
            parameters.specimen_damping(),
            parameters.specimen_stiffness,
        ];
        let frame = BenchmarkCase::ALL[0].frame();
        let mut times = vec![u128::MAX; STEPS];
        for _ in 0..REPEATS {
            law.reset();
            let mut plant = TransferSystem::default();
            let mut part = NumericalSubstructure::new(&frame, specimen, 0, 1, PERIOD)?;
            for (k, time) in times.iter_mut().enumerate() {
                let input = TrackingInput {
                    desired: part.displacements()[0],
                    measured: plant.state.displacement,
                    force: plant.force(),
                };
                let start = Instant::now();
                let command = std::hint::black_box(law.step(std::hint::black_box(&input), PERIOD));
                *time = start.elapsed().as_nanos().min(*time);
                let ground = 0.8 * (21.0 * k as f64 * PERIOD).sin();
                plant.step(command);
                part.step(input.force, [ground; 3]);
            }
        }
        print(name, &mut times);
    }
    two_actuators()
}
