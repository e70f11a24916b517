//! A call of a function of the standard, the same for FMI 2.0 and 3.0, whoever carries it out: the
//! library in this process, or another process that has loaded it.

#![allow(
    dead_code,
    reason = "the whole standard is named, though not all of it is called yet"
)]

use super::FmiVersion;

/// The type of a value as it crosses the C interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub(super) enum Scalar {
    Float64,
    Float32,
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Boolean,
    Clock,
    String,
    Binary,
}

impl Scalar {
    pub(super) const ALL: [Self; 14] = [
        Self::Float64,
        Self::Float32,
        Self::Int8,
        Self::UInt8,
        Self::Int16,
        Self::UInt16,
        Self::Int32,
        Self::UInt32,
        Self::Int64,
        Self::UInt64,
        Self::Boolean,
        Self::Clock,
        Self::String,
        Self::Binary,
    ];

    /// The name in FMI 3.0.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Float64 => "Float64",
            Self::Float32 => "Float32",
            Self::Int8 => "Int8",
            Self::UInt8 => "UInt8",
            Self::Int16 => "Int16",
            Self::UInt16 => "UInt16",
            Self::Int32 => "Int32",
            Self::UInt32 => "UInt32",
            Self::Int64 => "Int64",
            Self::UInt64 => "UInt64",
            Self::Boolean => "Boolean",
            Self::Clock => "Clock",
            Self::String => "String",
            Self::Binary => "Binary",
        }
    }

    /// Bytes of a value; FMI 2.0's Boolean is an `int`.
    pub(super) fn size(self, version: FmiVersion) -> usize {
        match self {
            Self::Float64 | Self::Int64 | Self::UInt64 => 8,
            Self::Float32 | Self::Int32 | Self::UInt32 => 4,
            Self::Int16 | Self::UInt16 => 2,
            Self::Int8 | Self::UInt8 | Self::Clock => 1,
            Self::Boolean if version == FmiVersion::V2 => 4,
            Self::Boolean => 1,
            Self::String | Self::Binary => 0,
        }
    }
}

/// Names functions in both versions and numbers them for the way to another process.
macro_rules! functions {
    ($($(#[$about:meta])* $name:ident = $number:literal, $two:literal, $three:literal;)*) => {
        /// A function of the standard. Where one version has none, its name there is empty.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(super) enum Function {
            $($(#[$about])* $name,)*
            /// Reads variables of a type.
            Get(Scalar),
            /// Sets variables of a type.
            Set(Scalar),
        }

        impl Function {
            /// Its number.
            pub(super) fn number(self) -> u32 {
                match self {
                    $(Self::$name => $number,)*
                    Self::Get(scalar) => 100 + scalar as u32,
                    Self::Set(scalar) => 200 + scalar as u32,
                }
            }

            /// The function of that number.
            pub(super) fn numbered(number: u32) -> Option<Self> {
                let scalar = |at: u32| Scalar::ALL.get(at as usize).copied();
                match number {
                    $($number => Some(Self::$name),)*
                    200.. => scalar(number - 200).map(Self::Set),
                    100.. => scalar(number - 100).map(Self::Get),
                    _ => None,
                }
            }

            /// The name as the standard writes it.
            pub(super) fn name(self, version: FmiVersion) -> String {
                let name = match (self, version) {
                    $((Self::$name, FmiVersion::V2) => $two.to_string(),
                    (Self::$name, FmiVersion::V3) => $three.to_string(),)*
                    (Self::Get(scalar), _) => format!("Get{}", kind(scalar, version)),
                    (Self::Set(scalar), _) => format!("Set{}", kind(scalar, version)),
                };
                format!("{}{name}", version.folder())
            }
        }
    };
}

functions! {
    Instantiate = 1, "Instantiate", "InstantiateCoSimulation";
    /// `numbers`: start, stop, tolerance; `flags`: stop defined, tolerance defined.
    SetupExperiment = 2, "SetupExperiment", "";
    /// As [`Function::SetupExperiment`] in FMI 3.0.
    EnterInitializationMode = 3, "EnterInitializationMode", "EnterInitializationMode";
    ExitInitializationMode = 4, "ExitInitializationMode", "ExitInitializationMode";
    EnterConfigurationMode = 5, "", "EnterConfigurationMode";
    ExitConfigurationMode = 6, "", "ExitConfigurationMode";
    EnterEventMode = 7, "EnterEventMode", "EnterEventMode";
    EnterStepMode = 8, "", "EnterStepMode";
    EnterContinuousTimeMode = 9, "EnterContinuousTimeMode", "EnterContinuousTimeMode";
    /// Gives `flags`: again, terminate, nominals changed, states changed, next event defined;
    /// `numbers`: next event.
    UpdateDiscreteStates = 10, "NewDiscreteStates", "UpdateDiscreteStates";
    /// `numbers`: time, step; `flags`: no state is set that lies before; the last: whether another
    /// process shall measure it. Gives `numbers`: last successful time, and third how long a measured
    /// one took, s; `flags`: event handling needed, terminate, early return.
    DoStep = 11, "DoStep", "DoStep";
    /// `handle`: the state.
    GetState = 12, "GetFMUstate", "GetFMUState";
    SetState = 13, "SetFMUstate", "SetFMUState";
    FreeState = 14, "FreeFMUstate", "FreeFMUState";
    /// `handle`: the state; gives `handle`: how many bytes.
    SizeOfState = 32, "SerializedFMUstateSize", "SerializedFMUStateSize";
    /// `handle`: the state; gives values: its bytes.
    WriteState = 33, "SerializeFMUstate", "SerializeFMUState";
    /// Values: bytes; gives `handle`: a state.
    ReadState = 34, "DeSerializeFMUstate", "DeserializeFMUState";
    Terminate = 15, "Terminate", "Terminate";
    Reset = 16, "Reset", "Reset";
    FreeInstance = 17, "FreeInstance", "FreeInstance";
    /// `flags`: on; `texts`: categories.
    SetDebugLogging = 18, "SetDebugLogging", "SetDebugLogging";
    /// Gives `flags`: whether a discarded step ends the run.
    GetTerminated = 19, "GetBooleanStatus", "";
    /// Gives `numbers`: how far a discarded step came.
    GetLastSuccessfulTime = 20, "GetRealStatus", "";
    /// `numbers`: time.
    SetTime = 21, "SetTime", "SetTime";
    SetContinuousStates = 22, "SetContinuousStates", "SetContinuousStates";
    GetContinuousStates = 23, "GetContinuousStates", "GetContinuousStates";
    GetDerivatives = 24, "GetDerivatives", "GetContinuousStateDerivatives";
    GetEventIndicators = 25, "GetEventIndicators", "GetEventIndicators";
    GetNominals = 26, "GetNominalsOfContinuousStates", "GetNominalsOfContinuousStates";
    /// `flags`: no state is set that lies before. Gives `flags`: enter event mode, terminate.
    CompletedIntegratorStep = 27, "CompletedIntegratorStep", "CompletedIntegratorStep";
    /// Gives `handle`: how many.
    GetNumberOfContinuousStates = 28, "", "GetNumberOfContinuousStates";
    /// Gives `handle`: how many.
    GetNumberOfEventIndicators = 29, "", "GetNumberOfEventIndicators";
    /// Values: intervals, s; then qualifiers (0 not known, 1 unchanged, 2 changed).
    GetIntervalDecimal = 30, "", "GetIntervalDecimal";
    /// Values: shifts, s.
    GetShiftDecimal = 31, "", "GetShiftDecimal";
    /// `references`: unknowns, then knowns; `handle`: how many unknowns. Values: changes of the knowns
    /// (`count` of them), then places for those of the unknowns. Gives status 2 where there is none.
    GetDirectionalDerivative = 35, "GetDirectionalDerivative", "GetDirectionalDerivative";
    /// As [`Function::GetDirectionalDerivative`], the values the other way round: `count` weights of the
    /// unknowns, then places for those of the knowns.
    GetAdjointDerivative = 36, "", "GetAdjointDerivative";
    /// None of the standard: copies numbers from answers before to settings behind, in another process.
    Copy = 37, "", "";
}

fn kind(scalar: Scalar, version: FmiVersion) -> &'static str {
    match (version, scalar) {
        (FmiVersion::V2, Scalar::Float64) => "Real",
        (FmiVersion::V2, Scalar::Int32) => "Integer",
        _ => scalar.name(),
    }
}

/// The flag of a step that asks another process to measure it.
pub(super) const MEASURED: usize = 4;
/// The flag of a reading that comes before anybody has asked for it.
pub(super) const AHEAD: usize = 3;

/// Texts and binaries, which have lengths of their own.
pub(super) type Texts = Vec<Vec<u8>>;

/// What will be set and read after each step of an instance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Foreseen<'a> {
    /// What is set, all of it Float64, and to what where no wire leads there.
    pub set: &'a [u32],
    pub values: &'a [f64],
    pub wires: &'a [Wire],
    /// What is read, of which type, and how many values that are, of 8 bytes each.
    pub read: &'a [u32],
    pub scalar: Scalar,
    pub count: usize,
}

/// A Float64 that was read before, and where it is set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wire {
    /// The reading, as it was numbered.
    pub reading: usize,
    /// Which of its values.
    pub element: usize,
    /// Where it goes among the Float64 that are set.
    pub place: usize,
    /// What is done to it on its way.
    pub change: Linear,
}

/// `factor * value + offset`: what is done to a value on its way along a connection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linear {
    /// The factor.
    pub factor: f64,
    /// Added after the factor.
    pub offset: f64,
}

impl Linear {
    /// Leaves values as they are.
    pub const NOTHING: Self = Self {
        factor: 1.0,
        offset: 0.0,
    };

    /// What comes of a value.
    #[must_use]
    #[inline]
    pub fn of(self, value: f64) -> f64 {
        let value = self.factor * value;
        // A sum with nothing would turn -0 into 0.
        if self.offset == 0.0 {
            value
        } else {
            value + self.offset
        }
    }
}

/// What goes into a call and what comes out of it; [`Function`] says which fields it uses.
#[derive(Debug)]
pub(super) struct Call<'a> {
    pub function: Function,
    pub references: &'a [u32],
    /// Numbers in the layout of C, aligned to 8 bytes.
    pub values: Values<'a>,
    /// How many values there are; more than references where variables are arrays.
    pub count: usize,
    pub numbers: [f64; 3],
    pub flags: [bool; 5],
    pub handle: u64,
    /// The call that the outcome belongs to, if it is an earlier one.
    pub culprit: Option<Box<Culprit>>,
}

/// A call whose outcome came back with that of a later one.
#[derive(Debug)]
pub(super) struct Culprit {
    pub function: Function,
    pub references: Vec<u32>,
}

/// Values of a call.
#[derive(Debug)]
pub(super) enum Values<'a> {
    None,
    In(&'a [u8]),
    Out(&'a mut [u8]),
    /// What goes in, and places for what comes out behind it.
    Both(&'a mut [u8]),
    TextsIn(&'a Texts),
    TextsOut(&'a mut Texts),
}

impl Values<'_> {
    /// How many Float64 they hold room for.
    pub(super) fn numbers(&self) -> usize {
        match self {
            Self::In(bytes) => bytes.len() / 8,
            Self::Out(bytes) | Self::Both(bytes) => bytes.len() / 8,
            Self::None | Self::TextsIn(_) | Self::TextsOut(_) => 0,
        }
    }
}

impl Call<'_> {
    /// A call without references and values.
    pub(super) fn plain(function: Function) -> Self {
        Self {
            function,
            references: &[],
            values: Values::None,
            count: 0,
            numbers: [0.0; 3],
            flags: [false; 5],
            handle: 0,
            culprit: None,
        }
    }

    /// How many of the references are unknowns of a derivative.
    pub(super) fn unknowns(&self) -> usize {
        usize::try_from(self.handle).map_or(0, |count| count.min(self.references.len()))
    }
}

/// Why a call gave no status: the library lacks the function, or the process that had loaded it is
/// gone. A clause that follows the name of the function.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Lost(pub String);

/// Whoever carries out calls for one instance.
pub(super) trait Endpoint: Send {
    /// Carries out a call and gives its status as the FMU gave it.
    ///
    /// # Errors
    /// No status came back.
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost>;

    /// Reads Float64 variables and gives the status; none where [`Endpoint::call`] has to.
    #[inline]
    fn get_reals(&mut self, _references: &[u32], _values: &mut [f64]) -> Option<i32> {
        None
    }

    /// Sets Float64 variables and gives the status; none where [`Endpoint::call`] has to.
    #[inline]
    fn set_reals(&mut self, _references: &[u32], _values: &[f64]) -> Option<i32> {
        None
    }

    /// Steps from `time` by `step`, s; none where [`Endpoint::call`] has to.
    #[inline]
    fn step(&mut self, _time: f64, _step: f64) -> Option<Stepped> {
        None
    }

    /// Takes a step as a request that travels with those of other instances, at the latest when
    /// [`Endpoint::answer`] asks for its outcome; false where [`Endpoint::call`] has to step.
    fn request(&mut self, _call: &Call) -> bool {
        false
    }

    /// Takes a step that travels with those of other instances, as [`Endpoint::request`], where `wires` lead
    /// to what is set right before it from what is read right after earlier ones. Gives the number of what
    /// is read after this one, which is none where that is not known to be `read`.
    fn request_wired(
        &mut self,
        _call: &Call,
        _wires: &[Wire],
        _read: (&[u32], usize),
    ) -> Option<Option<usize>> {
        None
    }

    /// How often calls have travelled to the other process that carries them out.
    fn exchanges(&self) -> u64 {
        0
    }

    /// Whether nothing has been set that has not reached the FMU, and no step been requested.
    fn is_settled(&self) -> bool {
        true
    }

    /// Notes what will be set and read after each step, so that it can be done together with those of
    /// other instances; gives its number, or none where nothing can be gained.
    fn foresee(&mut self, _foreseen: &Foreseen) -> Option<usize> {
        None
    }

    /// The outcome of the step that was requested.
    ///
    /// # Errors
    /// No status came back.
    fn answer(&mut self, _call: &mut Call) -> Result<i32, Lost> {
        Err(Lost("was not requested".to_string()))
    }
}

/// What came of a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stepped {
    pub status: i32,
    /// The FMU asks to end the run.
    pub end: bool,
    /// It came back before the end of the step.
    pub early: bool,
    /// How far it came, s.
    pub last: f64,
}
