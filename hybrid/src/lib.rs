//! Real-time hybrid simulation: the community's benchmark problems and the tracking laws that are
//! tried on them.
//!
//! A structure under an earthquake is cut in two. One part is computed, the other is a specimen that
//! hydraulic actuators move as the computed part asks, and whose force goes back.

#[doc(hidden)]
pub mod component;
pub mod laws;
pub mod marths;
pub mod vrths;
