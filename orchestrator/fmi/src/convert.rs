//! Values between the types of C and `f64`.

use super::call::Scalar;

/// Writes `values` into `bytes` in the layout of C.
pub(super) fn pack(scalar: Scalar, values: &[f64], bytes: &mut [u8], size: usize) {
    for (value, place) in values.iter().zip(bytes.chunks_exact_mut(size)) {
        let value = *value;
        match scalar {
            Scalar::Float64 => place.copy_from_slice(&value.to_ne_bytes()),
            Scalar::Float32 => place.copy_from_slice(&(value as f32).to_ne_bytes()),
            Scalar::Int8 => place.copy_from_slice(&(value as i8).to_ne_bytes()),
            Scalar::UInt8 => place.copy_from_slice(&(value as u8).to_ne_bytes()),
            Scalar::Int16 => place.copy_from_slice(&(value as i16).to_ne_bytes()),
            Scalar::UInt16 => place.copy_from_slice(&(value as u16).to_ne_bytes()),
            Scalar::Int32 => place.copy_from_slice(&(value as i32).to_ne_bytes()),
            Scalar::UInt32 => place.copy_from_slice(&(value as u32).to_ne_bytes()),
            Scalar::Int64 => place.copy_from_slice(&(value as i64).to_ne_bytes()),
            Scalar::UInt64 => place.copy_from_slice(&(value as u64).to_ne_bytes()),
            Scalar::Boolean | Scalar::Clock => {
                place.fill(0);
                // An `int` in FMI 2.0, a byte in FMI 3.0.
                let at = if cfg!(target_endian = "big") {
                    size - 1
                } else {
                    0
                };
                place[at] = u8::from(value != 0.0);
            }
            Scalar::String | Scalar::Binary => {}
        }
    }
}

/// Reads what C gave.
pub(super) fn unpack(scalar: Scalar, bytes: &[u8], values: &mut [f64], size: usize) {
    for (value, place) in values.iter_mut().zip(bytes.chunks_exact(size)) {
        *value = match scalar {
            Scalar::Float64 => f64::from_ne_bytes(array(place)),
            Scalar::Float32 => f64::from(f32::from_ne_bytes(array(place))),
            Scalar::Int8 => f64::from(i8::from_ne_bytes(array(place))),
            Scalar::UInt8 => f64::from(u8::from_ne_bytes(array(place))),
            Scalar::Int16 => f64::from(i16::from_ne_bytes(array(place))),
            Scalar::UInt16 => f64::from(u16::from_ne_bytes(array(place))),
            Scalar::Int32 => f64::from(i32::from_ne_bytes(array(place))),
            Scalar::UInt32 => f64::from(u32::from_ne_bytes(array(place))),
            Scalar::Int64 => i64::from_ne_bytes(array(place)) as f64,
            Scalar::UInt64 => u64::from_ne_bytes(array(place)) as f64,
            Scalar::Boolean | Scalar::Clock => {
                f64::from(u8::from(place.iter().any(|&byte| byte != 0)))
            }
            Scalar::String | Scalar::Binary => 0.0,
        };
    }
}

/// A value for people, with all its digits.
pub(super) fn text(scalar: Scalar, bytes: &[u8]) -> String {
    match scalar {
        Scalar::Int64 => i64::from_ne_bytes(array(bytes)).to_string(),
        Scalar::UInt64 => u64::from_ne_bytes(array(bytes)).to_string(),
        _ => {
            let mut value = [0.0];
            unpack(scalar, bytes, &mut value, bytes.len());
            value[0].to_string()
        }
    }
}

/// The first `N` bytes; zeros where there are fewer.
fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut array = [0; N];
    let length = N.min(bytes.len());
    array[..length].copy_from_slice(&bytes[..length]);
    array
}
