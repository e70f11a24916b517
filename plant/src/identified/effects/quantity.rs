//! Quantities of the effects' parameters with their units.

/// A physical quantity with its units as people and as FMI write them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantity {
    /// SI unit.
    pub si: &'static str,
    /// The laboratory's unit.
    pub laboratory: &'static str,
    /// SI unit of the FMU's variable.
    pub fmi: &'static str,
    /// Display unit of the FMU's variable.
    pub fmi_display: Option<&'static str>,
}

macro_rules! quantities {
    ($($name:ident = $si:literal, $laboratory:literal, $fmi:literal, $display:expr;)*) => {
        $(
            #[doc = concat!("In ", $si, ".")]
            pub const $name: Quantity = Quantity {
                si: $si,
                laboratory: $laboratory,
                fmi: $fmi,
                fmi_display: $display,
            };
        )*
        const ALL: &[Quantity] = &[$($name),*];
    };
}

quantities! {
    RATIO = "1", "%", "1", None;
    VOLTAGE = "V", "V", "V", None;
    FREQUENCY = "Hz", "Hz", "Hz", None;
    DELAY = "s", "ms", "s", Some("ms");
    TIME_CONSTANT = "s", "ms", "s", None;
    ANGLE = "rad", "rad", "rad", Some("deg");
    LENGTH = "m", "in", "m", Some("in");
    VELOCITY = "m/s", "in/s", "m/s", Some("in/s");
    ACCELERATION = "m/s^2", "in/s^2", "m/s2", Some("in/s2");
    FORCE = "N", "lbf", "N", Some("lbf");
    MASS = "kg", "lbf s^2/in", "kg", Some("lbf.s2/in");
    DAMPING = "N s/m", "lbf s/in", "N.s/m", Some("lbf.s/in");
    CUBIC_STIFFNESS = "N/m^3", "lbf/in^3", "N/m3", Some("lbf/in3");
    PER_VOLT = "1/V", "%/V", "1/V", None;
    FLOW_PER_FORCE = "V/N", "V/lbf", "V/N", Some("V/lbf");
    FLOW_PER_FORCE_RATE = "V s/N", "V s/lbf", "V.s/N", Some("V.s/lbf");
    TILT = "rad/m", "rad/in", "rad/m", Some("rad/in");
}

/// The laboratory's unit for an SI unit; the same where it has no other.
pub fn laboratory_unit(si: &str) -> &str {
    ALL.iter()
        .find(|quantity| quantity.si == si)
        .map_or(si, |quantity| quantity.laboratory)
}
