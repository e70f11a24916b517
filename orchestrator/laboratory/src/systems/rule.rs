//! The rules by which controllers can be tuned.

use std::path::PathBuf;

use identification::IdentificationError;
use plant::ModelError;
use plant::specimens::YieldingSpecimen;
use serde::de::value::Error as UnknownRule;

use super::tuning::Rules;
use fmi_system::{ComponentFile, Link, Origin};

/// Why the controllers of a system cannot be tuned.
#[derive(Debug, thiserror::Error)]
pub(super) enum TuningError {
    /// A rule refuses the model.
    #[error(transparent)]
    Refused(#[from] ModelError),
    /// The model cannot be read.
    #[error(transparent)]
    Model(#[from] IdentificationError),
    /// A component asks for a rule that there is not.
    #[error(transparent)]
    Rule(#[from] UnknownRule),
    /// A model for parameters that are printed.
    #[error("printed parameters do not use `--control-model`; omit one of the two")]
    Printed,
    /// A plant that nobody has commissioned.
    #[error(
        "there is no tuning for the plant `{plant}`: the printed one was made for it; expected \
         `--plant servohydraulic`, `--tuning printed` or `--control-model FILE`"
    )]
    NoTuning {
        /// The plant.
        plant: String,
    },
    /// The rules refuse the model of a file.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: Box<TuningError>,
    },
}

/// A component that a rule tunes.
pub struct Tuned<'a> {
    /// Its name in the system.
    pub name: &'a str,
    /// Its parameters.
    pub component: &'a mut ComponentFile,
    /// All connections of the system.
    pub connections: &'a mut [Link],
    /// The specimen as a controller knows it.
    pub specimen: Option<&'a YieldingSpecimen>,
}

/// A rule: gives a component its parameters on the model of [`Rules`].
pub(super) type Rule = fn(&Rules, &mut Tuned<'_>) -> Result<(), TuningError>;

impl Tuned<'_> {
    /// How many samples ahead the references are that go to this component, with the input that takes them.
    fn references(&mut self) -> impl Iterator<Item = (&str, &mut isize)> {
        let name = self.name;
        self.connections.iter_mut().filter_map(move |link| {
            let Origin::Reference { ahead, .. } = &mut link.from else {
                return None;
            };
            (link.to.component == name).then_some((link.to.variable.as_str(), ahead))
        })
    }

    /// The references that go to `inputs` of the component are those so many `samples` ahead.
    pub(super) fn place_references(&mut self, inputs: impl Fn(&str) -> bool, samples: isize) {
        for (_, ahead) in self.references().filter(|(input, _)| inputs(input)) {
            *ahead = samples;
        }
    }

    /// The component compares measurements that are so many samples late with the reference of the same time.
    pub(super) fn delay_references(&mut self, delay: usize) {
        for (_, ahead) in self.references() {
            *ahead -= delay as isize;
        }
    }
}
