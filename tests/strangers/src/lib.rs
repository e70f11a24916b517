//! Rigs, noises and laboratories that share nothing with the project's own, and judges of what is said
//! of them.
//!
//! Nothing here knows `plant`, `controllers` or `identification`. Noise is drawn from spectra, rigs are
//! integrated as one system at steps far below the sample time, and the program is judged by its
//! command line.

pub mod dice;
pub mod hydraulic;
pub mod judge;
pub mod laboratory;
pub mod motion;
pub mod noise;
pub mod options;
pub mod records;
pub mod table;
