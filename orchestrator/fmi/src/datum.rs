//! Values of every type, also those that an `f64` does not hold.

use std::fmt;

use super::Kind;

/// A value of any type.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Datum {
    /// A number.
    Number(f64),
    /// Int64.
    Signed(i64),
    /// UInt64.
    Unsigned(u64),
    /// String; bytes that are not UTF-8 are kept.
    Text(Vec<u8>),
    /// Binary.
    Bytes(Vec<u8>),
}

impl Datum {
    /// The zero or empty value of a type.
    pub fn empty(kind: &Kind) -> Self {
        match kind {
            Kind::Int64 => Self::Signed(0),
            Kind::UInt64 => Self::Unsigned(0),
            Kind::Binary => Self::Bytes(Vec::new()),
            Kind::String => Self::Text(Vec::new()),
            _ => Self::Number(0.0),
        }
    }

    /// Reads a value of type `kind` as descriptions and people write it; Binary in hexadecimal.
    pub fn read(kind: &Kind, text: &str) -> Option<Self> {
        Some(match kind {
            Kind::Int64 => Self::Signed(text.trim().parse().ok()?),
            Kind::UInt64 => Self::Unsigned(text.trim().parse().ok()?),
            Kind::Binary => {
                let digits: Vec<u8> = text.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
                let pairs = digits.chunks(2).map(|pair| {
                    let pair = std::str::from_utf8(pair)
                        .ok()
                        .filter(|pair| pair.len() == 2)?;
                    u8::from_str_radix(pair, 16).ok()
                });
                Self::Bytes(pairs.collect::<Option<_>>()?)
            }
            Kind::String => Self::Text(text.as_bytes().to_vec()),
            Kind::Boolean => Self::Number(match text.trim() {
                "true" | "1" => 1.0,
                "false" | "0" => 0.0,
                _ => return None,
            }),
            _ => Self::Number(text.trim().parse().ok()?),
        })
    }

    /// As a number, rounded where it has more than 53 bits.
    pub fn number(&self) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::Signed(value) => *value as f64,
            Self::Unsigned(value) => *value as f64,
            Self::Text(_) | Self::Bytes(_) => 0.0,
        }
    }

    /// A number of another type as this one, for the type `kind`.
    pub fn from_number(kind: &Kind, value: f64) -> Self {
        match kind {
            Kind::UInt64 => Self::Unsigned(value as u64),
            _ => Self::Signed(value as i64),
        }
    }

    /// The same value for an input of type `kind`.
    pub fn for_kind(&self, kind: &Kind) -> Self {
        match (self, kind) {
            (Self::Unsigned(value), Kind::Int64) => Self::Signed(*value as i64),
            (Self::Signed(value), Kind::UInt64) => Self::Unsigned(*value as u64),
            _ => self.clone(),
        }
    }
}

/// All digits; Binary in hexadecimal.
impl fmt::Display for Datum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value) => write!(f, "{value}"),
            Self::Signed(value) => write!(f, "{value}"),
            Self::Unsigned(value) => write!(f, "{value}"),
            Self::Text(text) => f.write_str(&String::from_utf8_lossy(text)),
            Self::Bytes(bytes) => f.write_str(&super::hexadecimal(bytes)),
        }
    }
}
