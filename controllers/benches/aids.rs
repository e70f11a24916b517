//! One step of the aids, all on, of each variant of sliding mode down to the valve, and of the laws that learn, timed step
//! by step.
//!
//! ```text
//! cargo bench -p controllers --bench aids
//! ```
//!
//! A tenth of the period is 200 us.

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use controllers::adaptive_inverse::{
    AdaptiveInverse, AdaptiveInverseInput, LEAD, Parameters as AdaptiveInverseParameters,
};
use controllers::aids::{AidsInput, OperatorAids, Switches};
use controllers::clipped_optimal::{ClippedOptimalDesign, ClippedOptimalInput};
use controllers::preview::adaptation::Adaptation;
use controllers::preview::feedforward::PREVIEW;
use controllers::preview::{self, PreviewControl, PreviewInput};
use controllers::surface_control::{Parameters, SurfaceControl, SurfaceInput, Variant};
use controllers::{Controller, Motion};
use plant::specimens::{MAX_STOREYS, YieldingSpecimen};

const STEPS: usize = 40_000;
const PERIOD: f64 = 0.002;
/// The run is repeated; the fastest time of each step is what the step takes.
const REPEATS: usize = 5;

fn motion(k: usize) -> Motion {
    let t = PERIOD * k as f64;
    Motion {
        displacement: 0.01 * (9.0 * t).sin(),
        velocity: 0.09 * (9.0 * t).cos(),
        acceleration: -0.81 * (9.0 * t).sin(),
    }
}

fn time(name: &str, mut step: impl FnMut(usize) -> f64) {
    let mut times = vec![u128::MAX; STEPS];
    for _ in 0..REPEATS {
        for (k, time) in times.iter_mut().enumerate() {
            let start = Instant::now();
            black_box(step(black_box(k)));
            *time = start.elapsed().as_nanos().min(*time);
        }
    }
    times.sort_unstable();
    println!(
        "{name:18} {:>7}  {:>7}  {:>8}",
        times[STEPS / 2],
        times[STEPS * 999 / 1000],
        times[STEPS - 1]
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("law                 median   99.9 %   longest  (ns, {STEPS} steps)");
    let mut aids = OperatorAids {
        on: Switches {
            friction: true,
            specimen: true,
            pressure: true,
            valve: true,
        },
        ..OperatorAids::default()
    };
    aids.friction.friction = 13.0;
    aids.harmonics.fundamental = true;
    aids.harmonics.cancellation = true;
    aids.validate()?;
    time("aids, all on", |k| {
        let input = AidsInput {
            command: 0.1,
            reference: motion(k),
            measured: motion(k + 1),
            force: 20.0 * motion(k).acceleration,
        };
        aids.step(&input, PERIOD)
    });
    for (name, variant) in [
        ("multiple-surface", Variant::MultipleSurface),
        ("dynamic-surface", Variant::DynamicSurface),
        ("receding-horizon", Variant::RecedingHorizon),
    ] {
        let mut law = SurfaceControl::new(Parameters {
            variant,
            ..Parameters::default()
        })?;
        time(name, |k| {
            let input = SurfaceInput {
                reference: std::array::from_fn::<_, { PREVIEW + 1 }, _>(|j| motion(k + j)),
                measured: motion(k),
            };
            law.step(&input, PERIOD)
        });
    }
    let mut inverse = AdaptiveInverse::new(AdaptiveInverseParameters::default())?;
    time("adaptive-inverse", |k| {
        let input = AdaptiveInverseInput {
            ahead: motion(k + LEAD).velocity,
            reference: motion(k),
            measured: motion(k + 1),
        };
        inverse.step(&input, PERIOD)
    });
    let mut preview = preview::Parameters {
        adaptation: Some(Adaptation::default()),
        ..preview::Parameters::default()
    };
    preview.load.friction = 13.0;
    preview.load.specimen = Some(YieldingSpecimen::default());
    let mut preview = PreviewControl::new(preview)?;
    time("adaptive-preview", |k| {
        let input = PreviewInput {
            reference: std::array::from_fn(|j| motion(k + j)),
            measured: motion(k + 1),
            specimen_acceleration: 0.7 * motion(k).acceleration,
            actuator_force: 60.0 * motion(k).acceleration,
            ..PreviewInput::default()
        };
        preview.step(&input, PERIOD)
    });
    let mut clipped = ClippedOptimalDesign::default().law(PERIOD)?;
    time("clipped-optimal", |k| {
        let input = ClippedOptimalInput {
            floor_acceleration: [motion(k).acceleration; MAX_STOREYS],
            damper_force: 30.0 * motion(k).velocity,
        };
        clipped.step(&input, PERIOD)
    });
    Ok(())
}
