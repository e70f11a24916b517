//! Causes for which an interlock trips.

/// Why the interlock tripped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(i32)]
pub enum Trip {
    /// It did not.
    #[default]
    None = 0,
    /// An input is not a finite number.
    NotFinite = 1,
    /// A measurement repeats itself while the reference moves.
    Stale = 2,
    /// The heartbeat stood still.
    Heartbeat = 3,
    /// The displacement is beyond its limit.
    Displacement = 4,
    /// The table could not be stopped any more before the limit if it went on.
    StoppingDistance = 5,
    /// The velocity is beyond its limit.
    Velocity = 6,
    /// The acceleration is beyond its limit.
    Acceleration = 7,
    /// The force is beyond its limit.
    Force = 8,
    /// The displacement is too far from the reference.
    TrackingError = 9,
    /// The command was saturated for too long.
    Saturation = 10,
    /// The operator pressed stop.
    Stop = 11,
    /// The specimen does not answer to the table any more.
    SpecimenLost = 12,
    /// The command chatters.
    Activity = 13,
    /// The supply's pressure is below its limit.
    Pressure = 14,
    /// More flows out of the supply than the pump can give for long.
    Flow = 15,
    /// The accelerometer and the displacement contradict each other.
    SensorsDisagree = 16,
    /// The displacement jumped where the acceleration did not.
    DisplacementJump = 17,
    /// The moving mass is far above the stated one.
    Mass = 18,
}

impl Trip {
    /// All causes, in the order of their numbers.
    pub const ALL: [Self; 19] = [
        Self::None,
        Self::NotFinite,
        Self::Stale,
        Self::Heartbeat,
        Self::Displacement,
        Self::StoppingDistance,
        Self::Velocity,
        Self::Acceleration,
        Self::Force,
        Self::TrackingError,
        Self::Saturation,
        Self::Stop,
        Self::SpecimenLost,
        Self::Activity,
        Self::Pressure,
        Self::Flow,
        Self::SensorsDisagree,
        Self::DisplacementJump,
        Self::Mass,
    ];

    /// Its short name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::NotFinite => "not-finite",
            Self::Stale => "stale",
            Self::Heartbeat => "heartbeat",
            Self::Displacement => "displacement",
            Self::StoppingDistance => "stopping-distance",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Force => "force",
            Self::TrackingError => "tracking-error",
            Self::Saturation => "saturation",
            Self::Stop => "stop",
            Self::SpecimenLost => "specimen-lost",
            Self::Activity => "activity",
            Self::Pressure => "pressure",
            Self::Flow => "flow",
            Self::SensorsDisagree => "sensors-disagree",
            Self::DisplacementJump => "displacement-jump",
            Self::Mass => "mass",
        }
    }

    /// The cause in words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::None => "not tripped",
            Self::NotFinite => "an input is not a finite number",
            Self::Stale => "a measurement repeats itself while the reference moves",
            Self::Heartbeat => "the heartbeat stood still",
            Self::Displacement => "the displacement is beyond its limit",
            Self::StoppingDistance => "the stopping distance reaches beyond the displacement limit",
            Self::Velocity => "the velocity is beyond its limit",
            Self::Acceleration => "the acceleration is beyond its limit",
            Self::Force => "the force is beyond its limit",
            Self::TrackingError => "the displacement is too far from the reference",
            Self::Saturation => "the valve command was saturated for too long",
            Self::Stop => "the operator pressed stop",
            Self::SpecimenLost => "the specimen does not answer to the table any more",
            Self::Activity => "the valve command chatters or the loop oscillates",
            Self::Pressure => "the supply's pressure is below its limit",
            Self::Flow => "the flow out of the supply is beyond its limit",
            Self::SensorsDisagree => "the accelerometer contradicts the displacement",
            Self::DisplacementJump => "the displacement jumps where the acceleration does not",
            Self::Mass => "the moving mass is far above the stated one",
        }
    }

    /// What a warning of it says.
    pub const fn warning(self) -> &'static str {
        match self {
            Self::None => "nothing is near its limit",
            Self::Displacement => "the displacement is near its limit",
            Self::StoppingDistance => "the stopping distance is near the displacement limit",
            Self::Velocity => "the velocity is near its limit",
            Self::Acceleration => "the acceleration is near its limit",
            Self::Force => "the force is near its limit",
            Self::TrackingError => "the displacement is nearly too far from the reference",
            Self::Saturation => "the valve command was saturated for nearly too long",
            Self::Activity => "the valve command nearly chatters or the loop nearly oscillates",
            Self::Pressure => "the supply's pressure is near its limit",
            Self::Flow => "the flow out of the supply is near its limit",
            other => other.words(),
        }
    }
}
