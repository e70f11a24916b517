//! The state of an FMU that is driven here, by a solver or through its events: the FMU's own, and the
//! driver's.

use std::collections::HashMap;

use super::super::call::{Call, Endpoint, Function, Lost, Values};

/// What can be written as numbers and read again.
pub(super) trait Numbers: Clone {
    /// All of it as numbers.
    fn numbers(&self) -> Vec<f64>;

    /// From numbers, with how many of them it took; none where they are of something else.
    fn of_numbers(all: &[f64]) -> Option<(Self, usize)>;
}

/// States that were kept: the FMU's handle and what drives it here, by the handle that was given out.
pub(super) struct KeptStates<S> {
    all: HashMap<u64, (u64, S)>,
    given: u64,
}

impl<S> Default for KeptStates<S> {
    fn default() -> Self {
        Self {
            all: HashMap::new(),
            given: 0,
        }
    }
}

impl<S: Numbers> KeptStates<S> {
    /// Carries out a call that concerns states; none where it is another call. `now` is what
    /// drives the FMU here.
    pub(super) fn carry_out(
        &mut self,
        call: &mut Call,
        fmu: &mut dyn Endpoint,
        now: &mut S,
    ) -> Option<Result<i32, Lost>> {
        Some(match call.function {
            Function::GetState => self.get(call, fmu, now),
            Function::SetState => self.set(call, fmu, now),
            Function::FreeState => {
                let outcome = self.pass_on(call, fmu).map(|(status, _)| status);
                self.all.remove(&call.handle);
                call.handle = 0;
                outcome
            }
            Function::SizeOfState => self.size(call, fmu),
            Function::WriteState => self.write(call, fmu),
            Function::ReadState => self.read(call, fmu),
            _ => return None,
        })
    }

    fn get(&mut self, call: &mut Call, fmu: &mut dyn Endpoint, now: &S) -> Result<i32, Lost> {
        let known = self.all.get(&call.handle).map(|kept| kept.0);
        let mut own = Call::plain(Function::GetState);
        own.handle = known.unwrap_or(0);
        let status = fmu.call(&mut own)?;
        if known.is_none() {
            self.given += 1;
            call.handle = self.given;
        }
        self.all.insert(call.handle, (own.handle, now.clone()));
        Ok(status)
    }

    /// Passes the call on with the FMU's own handle; gives the status and the handle that came back.
    fn pass_on(&self, call: &Call, fmu: &mut dyn Endpoint) -> Result<(i32, u64), Lost> {
        let (own, _) = self.all.get(&call.handle).ok_or_else(unknown)?;
        let mut inner = Call::plain(call.function);
        inner.handle = *own;
        let status = fmu.call(&mut inner)?;
        Ok((status, inner.handle))
    }

    fn set(&self, call: &Call, fmu: &mut dyn Endpoint, now: &mut S) -> Result<i32, Lost> {
        let (status, _) = self.pass_on(call, fmu)?;
        if let Some((_, kept)) = self.all.get(&call.handle) {
            now.clone_from(kept);
        }
        Ok(status)
    }

    fn size(&self, call: &mut Call, fmu: &mut dyn Endpoint) -> Result<i32, Lost> {
        let (status, own) = self.pass_on(call, fmu)?;
        let driver = self
            .all
            .get(&call.handle)
            .map_or(0, |kept| 8 * kept.1.numbers().len());
        call.handle = own.saturating_add(driver as u64);
        Ok(status)
    }

    fn write(&self, call: &mut Call, fmu: &mut dyn Endpoint) -> Result<i32, Lost> {
        let (own, driver) = self.all.get(&call.handle).ok_or_else(unknown)?;
        let driver = driver.numbers();
        let Values::Out(bytes) = &mut call.values else {
            return Err(unknown());
        };
        let (head, rest) = bytes
            .split_at_mut_checked(8 * driver.len())
            .ok_or_else(unknown)?;
        head.copy_from_slice(bytemuck::cast_slice(&driver));
        let mut inner = Call::plain(Function::WriteState);
        inner.handle = *own;
        inner.count = rest.len();
        inner.values = Values::Out(rest);
        fmu.call(&mut inner)
    }

    fn read(&mut self, call: &mut Call, fmu: &mut dyn Endpoint) -> Result<i32, Lost> {
        let Values::In(bytes) = &call.values else {
            return Err(unknown());
        };
        let whole = &bytes[..bytes.len() / 8 * 8];
        let numbers: &[f64] = bytemuck::try_cast_slice(whole).map_err(|_| unknown())?;
        let (driver, length) = S::of_numbers(numbers).ok_or_else(unknown)?;
        let rest = &bytes[8 * length..];
        let mut own = Call::plain(Function::ReadState);
        own.count = rest.len();
        own.values = Values::In(rest);
        let status = fmu.call(&mut own)?;
        self.given += 1;
        call.handle = self.given;
        self.all.insert(call.handle, (own.handle, driver));
        Ok(status)
    }
}

fn unknown() -> Lost {
    Lost("is of a state that was not kept".to_string())
}
