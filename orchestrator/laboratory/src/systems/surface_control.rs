//! Sliding mode down to the valve and adaptive inverse control by rule.

use controllers::preview::feedback::Uncertainty;
use controllers::surface_control::{Parameters, Variant};
use controllers::three_variable::ThreeVariableGains;
use units::vocabulary;

use units::Parameters as _;

use super::aids::unyielding;
use super::rule::{Tuned, TuningError};
use super::tuning::{Rules, set};
use fmi_system::Setting;

impl Rules {
    /// Model and hold.
    pub(super) fn adaptive_inverse(&self, own: &mut Tuned<'_>) -> Result<(), TuningError> {
        let rig = self.known_rig()?;
        let measurements = self.model.measurements();
        let (delay, period) = (measurements.delay(), measurements.period);
        let gains = ThreeVariableGains::tuned(&self.model.rig, delay, period)?;
        set(own.component, &rig.named());
        let hold = ("hold_gain", 0.5 * gains.proportional);
        set(own.component, &[hold]);
        self.delay(own.component);
        let compared = |input: &str| input.starts_with("reference_");
        own.place_references(compared, -(self.model.delay as isize));
        Ok(())
    }

    /// Model, noise, surfaces and lead of the variant that the file names.
    pub(super) fn surface_control(
        &self,
        Tuned {
            component,
            specimen,
            ..
        }: &mut Tuned<'_>,
    ) -> Result<(), TuningError> {
        let variant = match component.parameters.get("variant") {
            Some(Setting::Text(name)) if name == "dynamic-surface" => Variant::DynamicSurface,
            Some(Setting::Text(name)) if name == "receding-horizon" => Variant::RecedingHorizon,
            _ => Variant::MultipleSurface,
        };
        let usual = Parameters::default();
        let measurements = self.model.measurements();
        let own = Parameters {
            variant,
            rig: self.known_rig()?,
            uncertainty: Uncertainty {
                measurement: measurements.noise,
                ..usual.uncertainty
            },
            ..usual
        };
        let tuned = own.tuned(measurements.late, specimen.map(unyielding).as_ref())?;
        let noise = &tuned.uncertainty.measurement;
        set(component, &tuned.rig.named());
        set(
            component,
            &[
                ("surface_rate", tuned.surface_rate),
                ("motion_reaching_rate", tuned.reaching_rates[0]),
                ("oil_reaching_rate", tuned.reaching_rates[1]),
                ("spool_reaching_rate", tuned.reaching_rates[2]),
                ("oil_filter_time", tuned.filter_times[0]),
                ("spool_filter_time", tuned.filter_times[1]),
                ("move_weight", tuned.move_weight),
                ("force_step", tuned.uncertainty.force_step),
                (vocabulary::MEASUREMENT_NOISE[0], noise[0]),
                (vocabulary::MEASUREMENT_NOISE[1], noise[1]),
                (vocabulary::MEASUREMENT_NOISE[2], noise[2]),
            ],
        );
        self.delay(component);
        component.set("reference_lead_samples", tuned.lead as i64);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::control_model::ControlModel;
    use super::*;
    use fmi_system::ComponentFile;

    /// The parameters of the variant of that name.
    fn tuned(variant: &str) -> ComponentFile {
        let mut component = ComponentFile::default();
        component.set("variant", Setting::Text(variant.into()));
        let own = &mut Tuned {
            name: "control",
            component: &mut component,
            connections: &mut [],
            specimen: None,
        };
        let model = ControlModel::commissioned().unwrap();
        Rules::unprinted(model).surface_control(own).unwrap();
        component
    }

    fn number(own: &ComponentFile, name: &str) -> f64 {
        match own.parameters.get(name) {
            Some(Setting::Number(value)) => *value,
            Some(Setting::Integer(value)) => *value as f64,
            other => panic!("{name}: {other:?}"),
        }
    }

    #[test]
    fn every_surface_is_twice_as_quick_as_the_one_around_it() {
        for variant in ["multiple-surface", "dynamic-surface", "receding-horizon"] {
            let own = tuned(variant);
            let of = |name: &str| number(&own, name);
            let rate = of("surface_rate");
            for (name, times) in [
                ("motion_reaching_rate", 1.0),
                ("oil_reaching_rate", 2.0),
                ("spool_reaching_rate", 4.0),
            ] {
                assert!((of(name) / rate - times).abs() < 1e-9, "{variant}: {name}");
            }
            // The horizon's rate is given, and its moves are weighed; the others' is the best that was tried.
            let is_horizon = variant == "receding-horizon";
            assert_eq!(rate == 20.0, is_horizon);
            assert!((15.0..=90.0).contains(&rate));
            let usual = Parameters::default().move_weight;
            assert_eq!(of("move_weight") != usual, is_horizon);
        }
    }
}
