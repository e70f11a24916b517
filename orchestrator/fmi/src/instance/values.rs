//! Reading and writing variables.

use super::super::call::{Call, Function, Scalar, Texts, Values};
use super::super::{Datum, Kind, convert};
use super::{Instance, Outcome};

/// Whether all are finite: each is looked at, so that nothing branches.
#[inline]
fn are_finite(values: &[f64]) -> bool {
    let all = values.iter();
    all.fold(true, |all, value| all & value.is_finite())
}

impl Instance {
    /// Reads the variables `references`, all of type `kind`, into `values`. A clock is 1 if it has ticked
    /// since the communication point before.
    ///
    /// # Errors
    /// The FMU's refusal, or a value that is not finite.
    #[inline]
    pub fn get(&mut self, kind: &Kind, references: &[u32], values: &mut [f64]) -> Outcome {
        if matches!(kind, Kind::Float64)
            && let Some(status) = self.endpoint.get_reals(references, values)
        {
            if matches!(status, 0 | 1) && are_finite(values) {
                return Ok(());
            }
            return self.not_read(status, references, values);
        }
        self.get_by_call(kind, references, values)
    }

    #[cold]
    fn not_read(&mut self, status: i32, references: &[u32], values: &[f64]) -> Outcome {
        let mut call = Call::plain(Function::Get(Scalar::Float64));
        call.references = references;
        self.judge(Ok(status), &call)?;
        self.finite(Scalar::Float64, references, values)
    }

    #[inline(never)]
    fn get_by_call(&mut self, kind: &Kind, references: &[u32], values: &mut [f64]) -> Outcome {
        let scalar = self.scalar(kind);
        if scalar == Scalar::Clock && !self.has_events {
            values.fill(0.0);
            return Ok(());
        }
        let mut call = Call::plain(Function::Get(scalar));
        call.references = references;
        call.count = values.len();
        if scalar == Scalar::Float64 {
            call.values = Values::Out(bytemuck::cast_slice_mut(values));
            self.call(&mut call)?;
        } else {
            let size = scalar.size(self.version());
            let mut scratch = std::mem::take(&mut self.scratch);
            scratch.resize(values.len(), 0);
            call.values = Values::Out(bytemuck::cast_slice_mut(&mut scratch));
            let done = self.call(&mut call);
            convert::unpack(scalar, bytemuck::cast_slice(&scratch), values, size);
            self.scratch = scratch;
            done?;
        }
        self.finite(scalar, references, values)
    }

    /// Whether all that was read is finite.
    #[inline]
    fn finite(&self, scalar: Scalar, references: &[u32], values: &[f64]) -> Outcome {
        if are_finite(values) {
            return Ok(());
        }
        let at = values.iter().position(|value| !value.is_finite());
        let at = at.unwrap_or_default();
        let outcome = format!("gave {}", values[at]);
        let one = match values.len() == references.len() {
            true => &references[at..=at],
            false => references,
        };
        let mut error = self.failure(Function::Get(scalar), one, outcome);
        error.may_be_of_the_step = true;
        Err(error)
    }

    /// Sets the variables `references`, all of type `kind`. A clock that is set ticks at the next event
    /// of the present communication point.
    ///
    /// # Errors
    /// The FMU's refusal.
    #[inline]
    pub fn set(&mut self, kind: &Kind, references: &[u32], values: &[f64]) -> Outcome {
        if matches!(kind, Kind::Float64)
            && let Some(status) = self.endpoint.set_reals(references, values)
        {
            if matches!(status, 0 | 1) {
                return Ok(());
            }
            return self.not_set(status, references);
        }
        self.set_by_call(kind, references, values)
    }

    #[cold]
    fn not_set(&mut self, status: i32, references: &[u32]) -> Outcome {
        let mut call = Call::plain(Function::Set(Scalar::Float64));
        call.references = references;
        self.judge(Ok(status), &call)
    }

    #[inline(never)]
    fn set_by_call(&mut self, kind: &Kind, references: &[u32], values: &[f64]) -> Outcome {
        let scalar = self.scalar(kind);
        if scalar == Scalar::Clock && !self.has_events {
            return Ok(());
        }
        let mut call = Call::plain(Function::Set(scalar));
        call.references = references;
        call.count = values.len();
        if scalar == Scalar::Float64 {
            call.values = Values::In(bytemuck::cast_slice(values));
            return self.call(&mut call);
        }
        let size = scalar.size(self.version());
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.resize(values.len(), 0);
        convert::pack(scalar, values, bytemuck::cast_slice_mut(&mut scratch), size);
        call.values = Values::In(bytemuck::cast_slice(&scratch));
        let done = self.call(&mut call);
        self.scratch = scratch;
        done
    }

    /// Reads variables of a type that an `f64` does not hold ([`Kind::is_exact`]).
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn get_exact(&mut self, kind: &Kind, references: &[u32], data: &mut [Datum]) -> Outcome {
        let scalar = self.scalar(kind);
        let mut call = Call::plain(Function::Get(scalar));
        call.references = references;
        call.count = data.len();
        if matches!(scalar, Scalar::String | Scalar::Binary) {
            let mut texts = Texts::new();
            call.values = Values::TextsOut(&mut texts);
            self.call(&mut call)?;
            for (datum, text) in data.iter_mut().zip(texts) {
                *datum = match scalar {
                    Scalar::String => Datum::Text(text),
                    _ => Datum::Bytes(text),
                };
            }
            return Ok(());
        }
        let mut scratch = vec![0_u64; data.len()];
        call.values = Values::Out(bytemuck::cast_slice_mut(&mut scratch));
        self.call(&mut call)?;
        for (datum, bits) in data.iter_mut().zip(scratch) {
            *datum = match scalar {
                Scalar::UInt64 => Datum::Unsigned(bits),
                _ => Datum::Signed(bits.cast_signed()),
            };
        }
        Ok(())
    }

    /// Sets variables of a type that an `f64` does not hold.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn set_exact(&mut self, kind: &Kind, references: &[u32], data: &[Datum]) -> Outcome {
        let scalar = self.scalar(kind);
        let mut call = Call::plain(Function::Set(scalar));
        call.references = references;
        call.count = data.len();
        if matches!(scalar, Scalar::String | Scalar::Binary) {
            let texts = data.iter().map(|datum| match datum {
                Datum::Text(bytes) | Datum::Bytes(bytes) => bytes.clone(),
                number => number.to_string().into_bytes(),
            });
            let texts = texts.collect();
            call.values = Values::TextsIn(&texts);
            return self.call(&mut call);
        }
        let numbers = data.iter().map(|datum| match datum {
            Datum::Signed(value) => value.cast_unsigned(),
            Datum::Unsigned(value) => *value,
            Datum::Number(value) => *value as i64 as u64,
            Datum::Text(_) | Datum::Bytes(_) => 0,
        });
        let numbers: Vec<u64> = numbers.collect();
        call.values = Values::In(bytemuck::cast_slice(&numbers));
        self.call(&mut call)
    }
}
