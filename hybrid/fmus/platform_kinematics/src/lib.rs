#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Kinematics of a rigid platform as an FMU.

use fmu_kit::{
    Causality, Component, ComponentResult, Dependency::Dependent, Enumeration, Item, Variable,
};
use hybrid::marths::Coupler;
use hybrid::marths::names::MEASURED_STROKE;
use plant::ModelError;
use plant::platform::{MOST, Platform, Pose};
use serde::{Deserialize, Serialize};

/// A platform held by actuators: strokes of a pose, and the pose of strokes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PlatformKinematics {
    points: String,
    directions: String,
    bases: String,
    free: String,
    way_back: i32,
    tolerance: f64,
    platform: Option<Platform>,
    coupler: Option<Coupler>,
    translation: [f64; 3],
    rotation: [f64; 3],
    stroke: [f64; MOST],
    measured: [f64; MOST],
    found_translation: [f64; 3],
    found_rotation: [f64; 3],
    residual: f64,
    iterations: i32,
    fits: bool,
}

impl Default for PlatformKinematics {
    /// The benchmark's coupler: pins 0.2667 m along and 0.127 m to either side, by its rounded angle.
    fn default() -> Self {
        Self {
            points: "0.2667000998826269 -0.12699979024627098 0; 0.2667000998826269 0.12699979024627098 0".into(),
            directions: "1 0 0; 1 0 0".into(),
            bases: String::new(),
            free: "x rz".into(),
            way_back: NEWTON,
            tolerance: 1e-3,
            platform: None,
            coupler: None,
            translation: [0.0; 3],
            rotation: [0.0; 3],
            stroke: [0.0; MOST],
            measured: [0.0; MOST],
            found_translation: [0.0; 3],
            found_rotation: [0.0; 3],
            residual: 0.0,
            iterations: 0,
            fits: true,
        }
    }
}

const NEWTON: i32 = 0;
const FIRST_STROKE: i32 = 1;

const WAYS_BACK: Enumeration = Enumeration {
    name: "WayBack",
    items: &[
        Item {
            name: "newton",
            value: NEWTON,
            description: "Gauss and Newton's method",
        },
        Item {
            name: "first_stroke",
            value: FIRST_STROKE,
            description: "Closed form of two parallel actuators",
        },
    ],
};

impl PlatformKinematics {
    /// The closed form, for two actuators along x on a platform that moves along x and turns about z.
    fn closed(&self) -> Result<Coupler, Box<dyn std::error::Error>> {
        let Some(platform) = &self.platform else {
            return Err("the platform is unknown before the FMU is initialized".into());
        };
        let pins = platform.parallel_pins().ok_or(
            "`way_back` is first_stroke, which is the closed form of two actuators with `directions` 1 0 0 and `free` x \
             rz; choose newton for this geometry",
        )?;
        Ok(Coupler::of_pins(
            pins.map(|[along, _]| along),
            pins.map(|[_, across]| across),
        )?)
    }

    /// The pose of the measured strokes, searched from the zero position: it depends on nothing else.
    fn back(&mut self) -> Result<(), ModelError> {
        let Some(platform) = &self.platform else {
            return Ok(());
        };
        self.fits = false;
        if let Some(coupler) = &self.coupler {
            let motion = coupler.motion([self.measured[0], self.measured[1]])?;
            self.found_translation[0] = motion.translation;
            self.found_rotation[2] = motion.rotation;
            (self.residual, self.iterations, self.fits) = (0.0, 0, true);
            return Ok(());
        }
        let found = platform.pose(&self.measured, &Pose::default());
        let [x, y, z, rx, ry, rz] = found.pose.0;
        self.found_translation = [x, y, z];
        self.found_rotation = [rx, ry, rz];
        self.residual = found.largest().0;
        self.iterations = found.iterations as i32;
        found.within(self.tolerance)?;
        self.fits = true;
        Ok(())
    }
}

fn three(
    name: &'static str,
    about: &'static str,
    causality: Causality,
    (unit, nominal): (&'static str, f64),
    field: fn(&mut PlatformKinematics) -> &mut [f64],
) -> impl Iterator<Item = Variable<PlatformKinematics>> {
    let elements = Variable::array(name, causality, 3, field).into_iter();
    elements.zip(["x", "y", "z"]).map(move |(element, axis)| {
        element
            .about(&format!("{about} {axis}"))
            .unit(unit)
            .nominal(nominal)
    })
}

fn each(
    name: &'static str,
    about: &'static str,
    causality: Causality,
    field: fn(&mut PlatformKinematics) -> &mut [f64],
) -> impl Iterator<Item = Variable<PlatformKinematics>> {
    let elements = Variable::array(name, causality, MOST, field)
        .into_iter()
        .enumerate();
    elements.map(move |(i, element)| {
        element
            .about(&format!("{about} {}", i + 1))
            .unit("m")
            .shown_in("mm")
            .nominal(5e-3)
    })
}

const POSE: [&str; 6] = [
    "translation[1]",
    "translation[2]",
    "translation[3]",
    "rotation[1]",
    "rotation[2]",
    "rotation[3]",
];

const GEOMETRY: [&str; 4] = ["points", "directions", "bases", "free"];

// A name for each actuator that a platform may have.
const _: () = assert!(MEASURED_STROKE.len() == MOST);

impl Component for PlatformKinematics {
    const NAME: &'static str = "PlatformKinematics";
    const DESCRIPTION: &'static str =
        "Kinematics of a rigid platform that up to eight actuators hold";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const STEP_SIZE: f64 = hybrid::marths::PERIOD;

    fn variables() -> Vec<Variable<Self>> {
        let ahead = |variable: Variable<Self>| {
            variable
                .depends_on(&POSE, Dependent)
                .initially_depends_on(&POSE)
                .initially_depends_on(&GEOMETRY)
        };
        let back = |variable: Variable<Self>| {
            variable
                .depends_on(&MEASURED_STROKE, Dependent)
                .initially_depends_on(&MEASURED_STROKE)
                .initially_depends_on(&GEOMETRY)
                .initially_depends_on(&["way_back", "tolerance"])
        };
        let mut variables: Vec<Variable<Self>> = Vec::new();
        variables.extend(three(
            "translation",
            "Translation along",
            Causality::Input,
            ("m", 5e-3),
            |s| &mut s.translation,
        ));
        variables.extend(three(
            "rotation",
            "Rotation vector, component",
            Causality::Input,
            ("rad", 1e-2),
            |s| &mut s.rotation,
        ));
        variables.extend(each(
            "measured_stroke",
            "Measured stroke of actuator",
            Causality::Input,
            |s| &mut s.measured,
        ));
        variables.extend(
            each(
                "stroke",
                "Stroke at the pose, of actuator",
                Causality::Output,
                |s| &mut s.stroke,
            )
            .map(ahead),
        );
        variables.extend(
            three(
                "found_translation",
                "Translation that the measured strokes have, along",
                Causality::Output,
                ("m", 5e-3),
                |s| &mut s.found_translation,
            )
            .map(back),
        );
        variables.extend(
            three(
                "found_rotation",
                "Rotation vector that they have, component",
                Causality::Output,
                ("rad", 1e-2),
                |s| &mut s.found_rotation,
            )
            .map(back),
        );
        variables.extend(
            fmu_kit::table! { Self, s:
                output("residual", s.residual, "Largest contradiction of the measured strokes", "m" => "mm").nominal(1e-5);
            }
            .into_iter()
            .map(back),
        );
        variables.extend(fmu_kit::table! { Self, s:
            output("iterations", s.iterations, "Iterations of the way back");
            output("fits", s.fits, "Whether the measured strokes belong to a pose");
            parameter("points", s.points, "Pins on the platform, m: `x y z` for each actuator, separated by semicolons");
            parameter("directions", s.directions, "Directions of lines of action that stay parallel, likewise");
            parameter("bases", s.bases, "Pins that lines of action pass through, m, likewise, instead of directions");
            parameter("free", s.free, "Axes along which the platform moves, of x y z rx ry rz");
            parameter("tolerance", s.tolerance, "Largest contradiction that strokes may have", "m" => "mm").min(0.0);
        });
        variables.push(
            Variable::choice("way_back", WAYS_BACK, |s: &mut Self| &mut s.way_back)
                .about("How strokes are worked back"),
        );
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        self.platform = Some(Platform::read(
            &self.points,
            &self.bases,
            &self.directions,
            &self.free,
        )?);
        self.coupler = match self.way_back {
            FIRST_STROKE => Some(self.closed()?),
            _ => None,
        };
        self.found_translation = [0.0; 3];
        self.found_rotation = [0.0; 3];
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        let ([x, y, z], [rx, ry, rz]) = (self.translation, self.rotation);
        if let Some(platform) = &self.platform {
            self.stroke = platform.strokes(&Pose([x, y, z, rx, ry, rz]));
        }
        // What does not fit is an output here and an error of the step.
        self.fits = self.back().is_ok();
    }

    fn step(&mut self, _time: f64, _step_size: f64) -> ComponentResult {
        Ok(self.back()?)
    }
}

fmu_kit::export!(PlatformKinematics);
