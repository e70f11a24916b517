//! Pages: reports of runs and studies as HTML, and a run watched live.

pub mod live;
pub mod report;
