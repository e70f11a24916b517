//! Watching a run live: `shakebench run --watch`.

mod scene;
mod server;
mod tap;
mod tuning;

pub use scene::{Plot, Run, Scene};
pub use server::Server;
pub use tap::Tap;
pub use tuning::Tuning;
