//! Why data give no model, and what to measure instead.

/// Data from which a model cannot be identified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IdentificationError {
    /// A channel that the structure needs is not in the recording.
    #[error("{recording}: no column `{channel}` (it has {found}); expected {expected}")]
    MissingChannel {
        /// The recording.
        recording: String,
        /// The channel.
        channel: String,
        /// The channels there are.
        found: String,
        /// What would do.
        expected: &'static str,
    },
    /// Time stamps or samples that are not a recording.
    #[error("{recording}: {what}; expected {expected}")]
    Unreadable {
        /// The recording.
        recording: String,
        /// What is wrong and where.
        what: String,
        /// What was expected.
        expected: &'static str,
    },
    /// A channel that never moves.
    #[error(
        "{recording}: channel `{channel}` is constant at {value}; check its cable and calibration \
         and measure again"
    )]
    ConstantChannel {
        /// The recording.
        recording: String,
        /// The channel.
        channel: String,
        /// Its value, SI.
        value: f64,
    },
    /// Fewer samples than the structure needs.
    #[error(
        "{recording}: {samples} samples are too short to fit {parameters} parameters; record at \
         least {needed} samples ({seconds:.1} s)"
    )]
    TooShort {
        /// The recording.
        recording: String,
        /// Samples there are.
        samples: usize,
        /// Parameters asked for.
        parameters: usize,
        /// Samples needed.
        needed: usize,
        /// The same in seconds.
        seconds: f64,
    },
    /// The input does not stir the plant.
    #[error(
        "{recording}: no excitation: {what}; play a motion that fills the band of interest, for \
         example band-limited noise or an earthquake at 30 % of the stroke"
    )]
    NoExcitation {
        /// The recording.
        recording: String,
        /// What was seen.
        what: String,
    },
    /// The regression has fewer independent columns than unknowns.
    #[error("rank deficiency: {what}; {remedy}")]
    RankDeficient {
        /// Which unknowns cannot be told apart and why.
        what: String,
        /// What to measure instead.
        remedy: String,
    },
    /// The input is a function of the measured outputs alone.
    #[error(
        "{recording}: feedback makes the plant unidentifiable: the command is a fixed function of \
         the measured channels to {residual:.1e} of its size, so any model that differs by a \
         multiple of the control law explains the data as well; record while the loop follows a \
         moving reference, or add a test signal to the command"
    )]
    FeedbackOnly {
        /// The recording.
        recording: String,
        /// Part of the command that the outputs leave unexplained, relative.
        residual: f64,
    },
    /// Channels that cannot be of one motion.
    #[error(
        "{recording}: {what}; check the units in the header, the signs, and that no channels are \
         swapped"
    )]
    Contradiction {
        /// The recording.
        recording: String,
        /// Which channels, and how they contradict each other.
        what: String,
    },
    /// An unstable or non-physical result.
    #[error("unstable result where a stable one is expected: {what}; {remedy}")]
    Unstable {
        /// Which model and pole.
        what: String,
        /// What to do about it.
        remedy: String,
    },
    /// The iteration ended without an optimum.
    #[error("{method} did not converge: {reason}")]
    NotConverged {
        /// The method.
        method: &'static str,
        /// Why.
        reason: String,
    },
    /// A model file that cannot be read.
    #[error("{path}: {what}; expected {expected}")]
    ModelFile {
        /// The file.
        path: String,
        /// What is wrong and where.
        what: String,
        /// What was expected.
        expected: &'static str,
    },
}
