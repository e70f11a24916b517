//! Effects that a model lacks: hidden by an independent program, put on measurements, or neither.

mod closing_the_circle;
mod extended_model;
mod foreign;
mod frame_with_damper;
mod hidden_effects;
mod measured;
mod next_measurement;
mod spreadsheet_files;
mod walkthrough;
