//! The client's units, which the protocol does not tell: a unit of length and one of force.

use serde::{Deserialize, Serialize};
use thiserror::Error;
use units::{Unit, convert};

/// Units that are none.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "`{given}`: {reason}; expected a unit of length and one of force, such as `in,kip`, `m,N` or \
     `mm,kN`"
)]
pub struct ScaleError {
    /// As written.
    pub given: String,
    /// What does not fit.
    pub reason: String,
}

/// Factors from the client's units to SI; its unit of time is the second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// As written: `in,kip`.
    pub text: String,
    /// Metres in its unit of length.
    pub length: f64,
    /// Newtons in its unit of force.
    pub force: f64,
}

impl Scale {
    /// Reads `LENGTH,FORCE`; in any order.
    ///
    /// # Errors
    /// What is not a length and a force.
    pub fn read(text: &str) -> Result<Self, ScaleError> {
        let fault = |reason: String| ScaleError {
            given: text.to_string(),
            reason,
        };
        let parts: Vec<&str> = text.split([',', ';']).map(str::trim).collect();
        let [one, other] = parts[..] else {
            return Err(fault(format!("{} units", parts.len())));
        };
        let (mut length, mut force) = (None, None);
        for name in [one, other] {
            Unit::parse(name).map_err(|error| fault(error.to_string()))?;
            if let Ok(factor) = convert(1.0, name, "m") {
                length = Some(factor);
            } else if let Ok(factor) = convert(1.0, name, "N") {
                force = Some(factor);
            } else {
                return Err(fault(format!("`{name}` is neither a length nor a force")));
            }
        }
        match (length, force) {
            (Some(length), Some(force)) => Ok(Self {
                text: text.to_string(),
                length,
                force,
            }),
            (None, _) => Err(fault("no length".to_string())),
            (_, None) => Err(fault("no force".to_string())),
        }
    }

    /// A stiffness of one in its units, N/m; as much for a damping and a mass, for the second is the
    /// same on both sides.
    #[must_use]
    pub fn stiffness(&self) -> f64 {
        self.force / self.length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_and_a_force_in_any_order() {
        for text in ["in,kip", "kip, in"] {
            let scale = Scale::read(text).unwrap();
            assert_eq!(scale.length, 0.0254);
            assert!((scale.force - 4_448.221_615_260_5).abs() < 1e-9);
        }
        assert_eq!(Scale::read("m,N").unwrap().stiffness(), 1.0);
        for wrong in [
            "", "in", "in,mm", "kip,N", "in,kip,s", "in,s", "in,kipp", "kg,m",
        ] {
            let refused = Scale::read(wrong).unwrap_err().to_string();
            assert!(
                refused.contains("a unit of length and one of force"),
                "{refused}"
            );
        }
    }
}
