//! A `nominal.toml` to fill in.

use recordings::Channel;

const NOMINAL: &str = r#"# What is believed of a shake table. Put this file, as nominal.toml, into a folder with
# identification.csv and validation.csv (another motion and amplitude), better with small.csv (a low
# level) and baseline.csv (the same rig before the effect); replace every `nan`; then run
# shakebench diagnose FOLDER --out results
units = "si"             # m, N, kg, s, V; or "laboratory": inch, lbf, lbf s^2/in, s, V
sample_rate = nan        # Hz, of the records

# Actuator force F = G1(s) u + G2(s) dx/dt, u the valve command in V, x the table's displacement.
# Numerators and the common denominator by falling powers of s. `shakebench identify` finds them.
[actuator]
denominator = [1.0, nan, nan, nan]     # s^3, s^2, s, 1
voltage_to_force = [nan, nan, nan]     # G1: s^2, s, 1
velocity_to_force = [nan, nan, nan]    # G2: s^2, s, 1

[table]
mass = nan
damping = nan
stiffness = nan

# Without this section no specimen stands on the table.
[specimen]
mass = nan
damping = nan
stiffness = nan

# Without this section the recorded command is taken as it is. v is the displacement's difference,
# filtered: v_k = v_(k-1) + velocity_filter ((x_k - x_(k-1)) / T - v_(k-1)).
[controller]
kind = "three_variable_control"
proportional = nan                # V a length
integral = nan
velocity_feedforward = nan
acceleration_feedforward = nan
velocity_feedback = nan
acceleration_feedback = nan
velocity_filter = nan
limit = 10.0                      # V

# White noise of the sensors, one standard deviation.
[noise]
displacement = nan
acceleration = nan
actuator_force = nan
specimen_acceleration = nan
valve_command = nan

# One standard deviation of every parameter above but the noise, as a share of it.
[uncertainty]
relative = 0.01
"#;

/// A commented `nominal.toml` with the columns of the records. Its numbers are `nan`, which it must
/// not keep.
pub fn template() -> String {
    let mut text = String::from(
        "# Columns of the records, `name [unit]` in any order and unit; others are ignored:\n",
    );
    for channel in Channel::KNOWN {
        let also = channel.aliases().join(", ");
        text += &format!(
            "#   {} [{}], also called {also}\n",
            channel.name(),
            channel.unit()
        );
    }
    text + "\n" + NOMINAL
}

#[cfg(test)]
mod tests {
    use super::super::Nominal;
    use super::*;

    #[test]
    fn the_template_is_refused_until_it_is_filled_in() {
        assert!(Nominal::parse(&template()).is_err());
        let wrong = template().replace("\"si\"", "\"metre\"");
        let refused = Nominal::parse(&wrong).unwrap_err().to_string();
        assert!(
            refused.contains("metre") && refused.contains("laboratory"),
            "{refused}"
        );
        // All that is to be filled in are numbers.
        Nominal::parse(&template().replace("nan", "1.0")).unwrap();
    }

    #[test]
    fn units_of_both_kinds_tell_the_same_rig() {
        let text = |units: &str, length: f64, force: f64| {
            let (mass, damping, stiffness) = (0.1212, 0.2465, 23.3189);
            let body = force / length;
            let lists = [3430.0, 38600.0, 403.3].map(|v| v * force);
            let speeds = [565.1, -1818.0, 312000.0].map(|v| v * body);
            format!(
                "units = \"{units}\"\nsample_rate = 500.0\n[actuator]\n\
                 denominator = [1.0, 56.18, 13330.0, 178.2]\nvoltage_to_force = {lists:?}\n\
                 velocity_to_force = {speeds:?}\n[table]\nmass = {:?}\ndamping = {:?}\n\
                 stiffness = {:?}\n[noise]\ndisplacement = {:?}\nacceleration = {:?}\n\
                 actuator_force = {:?}\nspecimen_acceleration = {:?}\nvalve_command = 0.0005\n\
                 [uncertainty]\nrelative = 0.01\n",
                mass * body,
                damping * body,
                stiffness * body,
                0.0005 * length,
                1.5 * length,
                0.3 * force,
                1.0 * length
            )
        };
        let inch = Nominal::parse(&text("laboratory", 1.0, 1.0)).unwrap();
        let metre = Nominal::parse(&text("si", 0.0254, 4.448_221_615_260_5)).unwrap();
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        near(inch.shake_table.table.mass, metre.shake_table.table.mass);
        near(
            inch.shake_table.table.stiffness,
            metre.shake_table.table.stiffness,
        );
        for (a, b) in inch.noise.iter().zip(metre.noise) {
            near(*a, b);
        }
        let (a, b) = (inch.shake_table.actuator, metre.shake_table.actuator);
        for i in 0..3 {
            near(a.voltage_to_force[i], b.voltage_to_force[i]);
            near(a.velocity_to_force[i], b.velocity_to_force[i]);
        }
    }
}
