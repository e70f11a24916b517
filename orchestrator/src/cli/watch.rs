//! The page of a run: `--watch` and `--tune`.

use std::sync::Arc;

use super::out::units;
use fmi_master::Simulation;
use laboratory::error::Error;
use laboratory::run::experiment::Prepared;
use laboratory::run::tuning;
use pages::live::{Scene, Server, Tap, Tuning};

/// Serves the page of the run, with controls for the parameters of `tune`, and prints where it is.
///
/// # Errors
/// A port that is taken, or parameters that cannot be changed.
pub(super) fn watch(
    prepared: &Prepared,
    simulation: &mut Simulation,
    port: u16,
    tune: &[String],
) -> Result<(Server, Arc<Tap>), Error> {
    let (scene, places) = Scene::new(prepared.shown(), simulation.names(), units());
    let tap = Arc::new(Tap::new(places, prepared.samples));
    let tuning = match tune {
        [] => None,
        wanted => {
            let panel = tuning::panel(&prepared.system, wanted, prepared.motion.dt)?;
            let panel = Arc::new(panel);
            simulation.tune(Arc::clone(&panel))?;
            let seconds = panel.samples() as f64 * prepared.motion.dt;
            Some(Tuning::new(&prepared.system, panel, seconds, units()))
        }
    };
    let server = Server::start(&scene, Arc::clone(&tap), tuning, port);
    let server = server.map_err(|error| Error::Option {
        option: "--watch",
        reason: error.to_string(),
    })?;
    simulation.watch(tap.clone());
    eprintln!("watch it at {}", server.url());
    if let Some(url) = server.tuning_url() {
        eprintln!("tune it at {url}");
    }
    Ok((server, tap))
}
