//! One run of the loop, without FMI.

use nalgebra::{Matrix2, Matrix3x2, Vector2};
use plant::ModelError;

use super::laws::Law;
use super::{
    Coupler, Freedom, InterfaceForce, JointMotion, Newmark, PERIOD, Pair, Plant, PlantParameters,
    RATE, Specimen, Structure,
};

/// Ground acceleration at every sample, m/s^2.
pub type Ground = [f64];

/// A record at the benchmark's samples, linear between its own, scaled by `intensity`.
#[must_use]
pub fn ground(spacing: f64, acceleration: &[f64], intensity: f64) -> Vec<f64> {
    let end = spacing * acceleration.len().saturating_sub(1) as f64;
    // A record that ends at a sample must not lose it by rounding.
    let last = (end * RATE + 1e-6).floor() as usize;
    let at = |i: usize| acceleration.get(i).copied().unwrap_or(0.0);
    (0..=last)
        .map(|k| {
            let place = k as f64 * PERIOD / spacing;
            let i = (place.floor() as usize).min(acceleration.len().saturating_sub(2));
            let part = place - i as f64;
            intensity * (at(i) * (1.0 - part) + at(i + 1) * part)
        })
        .collect()
}

/// Motion of the structure that the criteria compare: the interface's translation and rotation (sign
/// turned), then translation and rotation of storeys 2 and 3.
pub const COMPARED: usize = 6;

/// Histories of [`COMPARED`], m and rad.
pub type Motions = [Vec<f64>; COMPARED];

/// Histories of a run, a value a sample.
#[derive(Debug, Clone, Default)]
pub struct Histories {
    /// Target strokes, m.
    pub target: [Vec<f64>; 2],
    /// True strokes, m.
    pub stroke: [Vec<f64>; 2],
    /// Measured strokes, m.
    pub measured: [Vec<f64>; 2],
    /// Commands, m.
    pub command: [Vec<f64>; 2],
    /// The joint's motion that the force was made of: translation (m) and rotation (rad).
    pub fed: [Vec<f64>; 2],
    /// The numerical substructure.
    pub motions: Motions,
    /// How the run ended.
    pub ending: Ending,
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Ending {
    /// With the ground motion.
    #[default]
    Complete,
    /// A stroke, target or command went beyond 0.1 m.
    RanAway,
    /// The strokes fed back had a difference that no rotation of the coupler gives.
    OutOfReach,
}

impl Histories {
    /// Number of samples.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.motions[0].len()
    }
}

/// What a run takes place on.
#[derive(Debug, Clone, Copy)]
pub struct Setting<'a> {
    /// The plant.
    pub plant: &'a PlantParameters,
    /// The ground's acceleration.
    pub ground: &'a Ground,
    /// Noise of the stroke sensors, m.
    pub noise: &'a [Pair],
}

/// Stroke beyond which a run counts as unstable and ends, m.
const RUNAWAY: f64 = 0.1;

/// Runs the loop with `law`. A run that runs away is cut short; its histories are then shorter than
/// the ground.
///
/// # Errors
/// A plant or structure that cannot be simulated.
pub fn run(setting: &Setting<'_>, law: &mut dyn Law) -> Result<Histories, ModelError> {
    let coupler = Coupler::default();
    let mut structure = Newmark::new(&Structure::numerical()?)?;
    let mut specimen = Specimen::new()?;
    let mut plant = Plant::new(*setting.plant)?;
    let mut histories = Histories::default();
    for (ground, noise) in setting.ground.iter().zip(setting.noise) {
        let stroke = plant.strokes();
        let measured = [0, 1].map(|i| stroke[i] + noise[i]);
        let Ok(fed) = coupler.motion(law.feedback(measured)) else {
            histories.ending = Ending::OutOfReach;
            break;
        };
        structure.propose(*ground);
        structure.accept(specimen.step(fed).by_freedom());
        let target = coupler.strokes(held(&structure));
        let command = law.step(target, measured);
        let all = [target, stroke, command].into_iter().flatten();
        if !all.into_iter().all(|value| value.abs() < RUNAWAY) {
            histories.ending = Ending::RanAway;
            break;
        }
        record(&mut histories.motions, |freedom| {
            structure.displacement(freedom)
        });
        for i in 0..2 {
            histories.target[i].push(target[i]);
            histories.stroke[i].push(stroke[i]);
            histories.measured[i].push(measured[i]);
            histories.command[i].push(command[i]);
        }
        histories.fed[0].push(fed.translation);
        histories.fed[1].push(fed.rotation);
        plant.step(command);
    }
    Ok(histories)
}

/// Motion of the whole frame under `ground`.
///
/// # Errors
/// None with the benchmark's numbers.
pub fn reference(ground: &Ground) -> Result<Motions, ModelError> {
    let mut structure = Newmark::new(&Structure::reference())?;
    let mut motions = Motions::default();
    for acceleration in ground {
        structure.propose(*acceleration);
        structure.accept(InterfaceForce::default().by_freedom());
        record(&mut motions, |freedom| structure.displacement(freedom));
    }
    Ok(motions)
}

/// Motion of the numerical substructure with actuators whose strokes are the targets at every sample
/// and sensors without noise. The force and the step of a sample are solved together.
///
/// # Errors
/// None with the benchmark's numbers.
pub fn perfect(ground: &Ground) -> Result<Histories, ModelError> {
    let coupler = Coupler::default();
    let mut structure = Newmark::new(&Structure::numerical()?)?;
    let mut specimen = Specimen::new()?;
    // What a unit of each force takes from the joint's motion, in the coupler's axes.
    let flexibility = nalgebra::Matrix2x3::from_fn(|i, j| {
        let (on, sign) = HELD[i];
        let (of, _) = InterfaceForce::default().by_freedom()[j];
        sign * structure.influence(on, of)
    });
    let mut histories = Histories::default();
    for acceleration in ground {
        structure.propose(*acceleration);
        let free = Vector2::from(HELD.map(|(on, sign)| sign * structure.proposed(on)));
        let (constant, slope) = specimen.affine();
        let fed = solve(&coupler, free, &flexibility, constant, &slope)?;
        structure.accept(specimen.step(fed).by_freedom());
        let target = coupler.strokes(held(&structure));
        record(&mut histories.motions, |freedom| {
            structure.displacement(freedom)
        });
        for (i, target) in target.into_iter().enumerate() {
            for history in [
                &mut histories.target,
                &mut histories.stroke,
                &mut histories.measured,
            ] {
                history[i].push(target);
            }
        }
        histories.fed[0].push(fed.translation);
        histories.fed[1].push(fed.rotation);
    }
    Ok(histories)
}

/// Freedoms of the joint, with the sign that turns them to the coupler's axes.
const HELD: [(Freedom, f64); 2] = [
    (Freedom::Interface, 1.0),
    (Freedom::InterfaceRotation, -1.0),
];

fn held(structure: &Newmark) -> JointMotion {
    let [translation, rotation] = HELD.map(|(on, sign)| sign * structure.displacement(on));
    JointMotion {
        translation,
        rotation,
    }
}

/// The motion `q` that is fed back where the strokes are its own: `q = b(free - flexibility (constant
/// + slope q))`, `b` being the way through the strokes and back, which changes 4e-8 m at most.
fn solve(
    coupler: &Coupler,
    free: Vector2<f64>,
    flexibility: &nalgebra::Matrix2x3<f64>,
    constant: InterfaceForce,
    slope: &Matrix3x2<f64>,
) -> Result<JointMotion, ModelError> {
    let constant = constant.by_freedom().map(|(_, force)| force);
    let free = free - flexibility * nalgebra::Vector3::from(constant);
    let matrix = Matrix2::identity() + flexibility * slope;
    let inverse = matrix.try_inverse().ok_or(ModelError::NotForSimulation {
        model: "perfect actuator",
        reason: "force and motion of a sample have no common solution".into(),
    })?;
    let mut way = Vector2::zeros();
    let mut fed = Vector2::zeros();
    for _ in 0..4 {
        let moved = inverse * (free - flexibility * slope * way);
        let back = coupler.motion(coupler.strokes(JointMotion {
            translation: moved[0],
            rotation: moved[1],
        }))?;
        fed = Vector2::new(back.translation, back.rotation);
        way = fed - moved;
    }
    Ok(JointMotion {
        translation: fed[0],
        rotation: fed[1],
    })
}

fn record(to: &mut Motions, displacement: impl Fn(Freedom) -> f64) {
    for (history, (freedom, sign)) in to.iter_mut().zip(Freedom::COMPARED) {
        history.push(sign * displacement(freedom));
    }
}
