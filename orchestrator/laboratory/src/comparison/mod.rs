//! A comparison of controllers on motions, beside the values that the thesis prints.

mod errors;
mod page;
mod play;
mod result;
mod tables;
mod thesis;

pub use page::{COMPARISON, page_again, write};
pub use play::{Plan, Played, Progress, compare, labels, request};
pub use result::{Comparison, History, Median, Row};
pub use tables::{ErrorTable, tables};
