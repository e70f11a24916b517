//! Ground motions: what the table is asked to do.
//!
//! A *record* is an acceleration only (PEER AT2, or CSV) and is processed into a motion the table
//! can play ([`load`]). A *reference* gives displacement, velocity and acceleration and is played
//! as given ([`load_reference`]). [`built_in`] is a synthetic record.

mod accelerogram;
mod at2;
mod clough_penzien;
mod csv_file;
mod error;
pub mod metrics;
mod options;
mod playable;
mod process;
mod record;
mod reference;
mod source;

pub use accelerogram::Record;
pub use clough_penzien::{CloughPenzien, DEFAULT_SEED};
pub use error::MotionError;
pub use options::{Options, Scaling};
pub use playable::Motion;
pub use playable::peak;
pub use process::{Unscaled, process, smooth_step};
pub use record::{read_acceleration, read_record};
pub use reference::load_reference;
pub use source::{built_in, built_in_unscaled, load, load_unscaled};

#[cfg(test)]
mod tests;
