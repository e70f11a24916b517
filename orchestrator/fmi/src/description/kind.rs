//! Types of variables.

/// One of the choices of an enumeration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Item {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: i64,
    /// What it means; may be empty.
    pub description: String,
}

/// The type of a variable, named as in FMI 3.0.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// FMI 2.0 Real.
    Float64,
    /// A short floating-point number.
    Float32,
    /// A whole number of 8 bits.
    Int8,
    /// A whole number of 8 bits, not negative.
    UInt8,
    /// A whole number of 16 bits.
    Int16,
    /// A whole number of 16 bits, not negative.
    UInt16,
    /// FMI 2.0 Integer.
    Int32,
    /// A whole number of 32 bits, not negative.
    UInt32,
    /// A whole number of 64 bits.
    Int64,
    /// A whole number of 64 bits, not negative.
    UInt64,
    /// A choice.
    Enumeration(Vec<Item>),
    /// True or false.
    Boolean,
    /// Text.
    String,
    /// Bytes; people write them in hexadecimal.
    Binary,
    /// Ticks of a clock.
    Clock,
}

impl Kind {
    /// The type's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Float64 => "Float64",
            Self::Float32 => "Float32",
            Self::Int8 => "Int8",
            Self::UInt8 => "UInt8",
            Self::Int16 => "Int16",
            Self::UInt16 => "UInt16",
            Self::Int32 => "Int32",
            Self::UInt32 => "UInt32",
            Self::Int64 => "Int64",
            Self::UInt64 => "UInt64",
            Self::Enumeration(_) => "Enumeration",
            Self::Boolean => "Boolean",
            Self::String => "String",
            Self::Binary => "Binary",
            Self::Clock => "Clock",
        }
    }

    /// Whether every value of it is an `f64`.
    pub fn is_numeric(&self) -> bool {
        !matches!(
            self,
            Self::Int64 | Self::UInt64 | Self::String | Self::Binary | Self::Clock
        )
    }

    /// Whether its values are kept as they are, beside the numbers.
    pub fn is_exact(&self) -> bool {
        matches!(
            self,
            Self::Int64 | Self::UInt64 | Self::String | Self::Binary
        )
    }

    /// Whether it has values: a clock has ticks only.
    pub fn has_values(&self) -> bool {
        *self != Self::Clock
    }

    /// The least and the greatest whole number of the type.
    pub fn whole_range(&self) -> Option<(i128, i128)> {
        Some(match self {
            Self::Int8 => (i8::MIN.into(), i8::MAX.into()),
            Self::UInt8 => (0, u8::MAX.into()),
            Self::Int16 => (i16::MIN.into(), i16::MAX.into()),
            Self::UInt16 => (0, u16::MAX.into()),
            Self::Int32 => (i32::MIN.into(), i32::MAX.into()),
            Self::UInt32 => (0, u32::MAX.into()),
            Self::Int64 => (i64::MIN.into(), i64::MAX.into()),
            Self::UInt64 => (0, u64::MAX.into()),
            _ => return None,
        })
    }

    /// Whether a value of this type can drive an input of type `target` without loss (a Float64
    /// is rounded to a Float32). Whole numbers and choices drive each other by the values of the
    /// choices.
    pub fn drives(&self, target: &Self) -> bool {
        let floating = |kind: &Self| matches!(kind, Self::Float64 | Self::Float32);
        if self.name() == target.name() {
            return true;
        }
        if let (Self::Enumeration(items), other) | (other, Self::Enumeration(items)) =
            (self, target)
        {
            let holds = |(least, most): (i128, i128)| {
                let mut values = items.iter().map(|item| i128::from(item.value));
                values.all(|value| (least..=most).contains(&value))
            };
            return !other.is_exact() && other.whole_range().is_some_and(holds);
        }
        match (self.whole_range(), target.whole_range()) {
            (Some((least, most)), Some((from, to))) => from <= least && most <= to,
            // Whole numbers up to 24 bits are Float32, up to 53 bits Float64.
            (Some((_, most)), None) if *target == Self::Float32 => most < 1 << 24,
            (Some((_, most)), None) => *target == Self::Float64 && most < 1 << 53,
            _ => floating(self) && floating(target),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_and_choices_drive_each_other_where_the_choices_fit() {
        let choice = |value| {
            Kind::Enumeration(vec![Item {
                name: "only".to_string(),
                value,
                description: String::new(),
            }])
        };
        assert!(Kind::Int32.drives(&choice(3)) && choice(3).drives(&Kind::Int32));
        assert!(choice(200).drives(&Kind::UInt8) && !choice(300).drives(&Kind::UInt8));
        assert!(!choice(-1).drives(&Kind::UInt8));
        assert!(!Kind::Float64.drives(&choice(1)) && !Kind::String.drives(&choice(1)));
        assert!(Kind::Int16.drives(&Kind::Float64) && !Kind::Int64.drives(&Kind::Float64));
    }

    #[test]
    fn a_number_drives_every_type_that_holds_all_its_values() {
        use Kind::{
            Binary, Boolean, Clock, Float32, Float64, Int8, Int16, Int32, Int64, String, UInt8,
            UInt16, UInt32, UInt64,
        };
        let all = [
            Float64, Float32, Int8, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64, Boolean,
            String, Binary, Clock,
        ];
        for (kind, driven) in [
            (Float64, &[Float64, Float32][..]),
            (Float32, &[Float64, Float32]),
            (Int8, &[Float64, Float32, Int8, Int16, Int32, Int64]),
            (
                UInt8,
                &[
                    Float64, Float32, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64,
                ],
            ),
            (Int32, &[Float64, Int32, Int64]),
            (UInt32, &[Float64, UInt32, Int64, UInt64]),
            (Int64, &[Int64]),
            (UInt64, &[UInt64]),
            (Boolean, &[Boolean]),
            (String, &[String]),
            (Binary, &[Binary]),
            (Clock, &[Clock]),
        ] {
            let found: Vec<&Kind> = all.iter().filter(|target| kind.drives(target)).collect();
            let expected: Vec<&Kind> = driven.iter().collect();
            assert_eq!(found, expected, "{kind:?}");
        }
        // As many values as bits say.
        for (kind, bits) in [(Int8, 8), (UInt16, 16), (Int32, 32), (UInt64, 64)] {
            let (least, most) = kind.whole_range().unwrap();
            assert_eq!(most - least + 1, 1 << bits);
        }
        let without: Vec<&Kind> = all.iter().filter(|kind| !kind.has_values()).collect();
        assert_eq!(without, [&Clock]);
    }
}
