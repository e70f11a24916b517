//! An instance in a guest, called like one in this process.

use std::sync::{Arc, Mutex, PoisonError};

use super::super::call::{Call, Culprit, Endpoint, Function, Lost, Values};
use super::super::native::{Setup, Sink};
use super::host::{Answer, Host};
use super::parcel;

/// Bytes of settings that are kept until the next call that gives something.
const KEPT: usize = 64 << 10;

/// An instance in a guest.
pub(in super::super) struct Remote {
    host: Arc<Mutex<Host>>,
    instance: u32,
    /// Settings that have not been sent yet.
    kept: Vec<u8>,
    /// Whether settings may wait.
    keeps: bool,
}

impl Remote {
    /// Makes an instance in the guest of `host`. Where calls are traced settings do not wait.
    ///
    /// # Errors
    /// As for an instance in this process; or the guest ended.
    pub(in super::super) fn new(
        host: &Arc<Mutex<Host>>,
        setup: &Setup,
        sink: Arc<dyn Sink>,
        is_traced: bool,
    ) -> Result<Self, String> {
        let text = serde_json::to_vec(setup).map_err(|error| error.to_string())?;
        let mut guest = host.lock().unwrap_or_else(PoisonError::into_inner);
        let instance = guest.enroll(sink);
        let mut call = Call::plain(Function::Instantiate);
        call.values = Values::In(&text);
        match guest.call(instance, &[], &mut call) {
            Answer::Last(Ok(_)) | Answer::Earlier(..) => {}
            Answer::Last(Err(Lost(reason))) => return Err(reason),
        }
        drop(guest);
        Ok(Self {
            host: host.clone(),
            instance,
            kept: Vec::new(),
            keeps: !is_traced,
        })
    }
}

impl Endpoint for Remote {
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
        if self.keeps
            && matches!(call.function, Function::Set(_))
            && self.kept.len() + parcel::size(call) < KEPT
        {
            parcel::append(&mut self.kept, self.instance, call);
            return Ok(0);
        }
        let mut host = self.host.lock().unwrap_or_else(PoisonError::into_inner);
        let answer = host.call(self.instance, &self.kept, call);
        drop(host);
        self.kept.clear();
        match answer {
            Answer::Last(outcome) => outcome,
            Answer::Earlier(parcel, outcome) => {
                if let Some(head) = parcel::head(&parcel)
                    && let Some(function) = Function::numbered(head.function)
                {
                    call.culprit = Some(Box::new(Culprit {
                        function,
                        references: parcel::references(&parcel, &head),
                    }));
                }
                outcome
            }
        }
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        let mut host = self.host.lock().unwrap_or_else(PoisonError::into_inner);
        // An FMU that does not let itself be freed is ended with its guest.
        let mut call = Call::plain(Function::FreeInstance);
        let _ = host.call(self.instance, &[], &mut call);
        // The last one out.
        if Arc::strong_count(&self.host) == 1 {
            host.end();
        }
    }
}
