//! The division of an actuator's delay between spool and pure delay.

use std::f64::consts::TAU;

use super::LEAST_INERTIA;
use super::equations::HydraulicRig;

/// Damping ratio below which no servo valve's spool works.
const LEAST_DAMPING: f64 = 0.2;
/// Spools that are tried instead, Hz, and their damping ratio.
const SPOOLS: [f64; 3] = [30.0, 60.0, 120.0];
const DAMPING: f64 = 0.8;

/// Whether the spool is one that a valve may have: a fit that took its lag for delay ends at the
/// quickest spool, without damping.
fn is_plausible(rig: &HydraulicRig) -> bool {
    let quickest = rig.spool_inertia <= 1.01 * LEAST_INERTIA;
    !quickest && rig.spool_lag > 2.0 * LEAST_DAMPING * rig.spool_inertia.sqrt()
}

/// The rig of a fit's `values` with its total delay divided differently between spool and pure
/// delay; none where its own division is plausible.
pub(super) fn divisions(values: &[f64]) -> Vec<HydraulicRig> {
    let Some(rig) = HydraulicRig::at(values).filter(|rig| !is_plausible(rig)) else {
        return Vec::new();
    };
    let late = rig.command_delay + rig.spool_lag;
    let divided = |hertz: f64| {
        let omega = TAU * hertz;
        let lag = 2.0 * DAMPING / omega;
        HydraulicRig {
            spool_lag: lag,
            spool_inertia: 1.0 / (omega * omega),
            command_delay: (late - lag).max(0.0),
            ..rig
        }
    };
    SPOOLS.map(divided).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closed_loop::equations::PARAMETERS;

    #[test]
    fn a_spool_that_no_valve_has_is_divided_anew_and_another_is_left_alone() {
        let mut rig = HydraulicRig::from([1.0; PARAMETERS]);
        (rig.spool_lag, rig.spool_inertia) = (0.0, LEAST_INERTIA);
        rig.command_delay = 0.007;
        let all = divisions(&rig.coordinates());
        assert_eq!(all.len(), SPOOLS.len());
        for own in &all {
            assert!(is_plausible(own));
            let late = own.command_delay + own.spool_lag;
            assert!(
                own.command_delay == 0.0 || (late - 0.007).abs() < 1e-12,
                "{own:?}"
            );
        }
        assert!(divisions(&all[1].coordinates()).is_empty());
    }
}
