//! Watching a run while it goes on: `shakebench run --watch`.

mod scene;
mod server;
mod tap;

pub use scene::{Plot, Scene};
pub use server::Server;
pub use tap::Tap;
