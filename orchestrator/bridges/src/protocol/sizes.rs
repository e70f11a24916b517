//! What a client says first: how much it sends, how much it wants, and how long every vector is.

use super::{Action, LONGEST, ProtocolError};

/// A number of components for each quantity, in the order of a vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Quantities {
    /// Displacements.
    pub displacement: usize,
    /// Velocities.
    pub velocity: usize,
    /// Accelerations.
    pub acceleration: usize,
    /// Forces.
    pub force: usize,
    /// 1 where the time is among them.
    pub time: usize,
}

impl Quantities {
    /// Each with its name, in order.
    #[must_use]
    pub fn named(&self) -> [(&'static str, usize); 5] {
        [
            ("displacement", self.displacement),
            ("velocity", self.velocity),
            ("acceleration", self.acceleration),
            ("force", self.force),
            ("time", self.time),
        ]
    }

    /// Components in all.
    #[must_use]
    pub fn total(&self) -> usize {
        self.named().iter().map(|(_, count)| count).sum()
    }

    fn of(counts: [usize; 5]) -> Self {
        let [displacement, velocity, acceleration, force, time] = counts;
        Self {
            displacement,
            velocity,
            acceleration,
            force,
            time,
        }
    }
}

/// The sizes that both sides go by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// What the client sends with a trial.
    pub trial: Quantities,
    /// What it wants.
    pub wanted: Quantities,
    /// Float64 in every later vector.
    pub length: usize,
}

impl Sizes {
    /// How long they are on the wire.
    pub const BYTES: usize = 44;

    /// Reads and checks them.
    ///
    /// # Errors
    /// Bytes that are not sizes; the first bytes of other protocols are recognized.
    pub fn read(bytes: &[u8; Self::BYTES]) -> Result<Self, ProtocolError> {
        check_other_protocols(bytes)?;
        let mut sizes = [0_i32; 11];
        for (size, four) in sizes.iter_mut().zip(bytes.chunks_exact(4)) {
            let mut own = [0; 4];
            own.copy_from_slice(four);
            *size = i32::from_le_bytes(own);
        }
        let fault = |reason| ProtocolError::Sizes { sizes, reason };
        let mut counts = [0_usize; 11];
        for (count, &size) in counts.iter_mut().zip(&sizes) {
            *count = usize::try_from(size).map_err(|_| fault("a count is negative"))?;
        }
        let [d, v, a, f, t, wd, wv, wa, wf, wt, length] = counts;
        if counts.iter().any(|count| *count > LONGEST) {
            return Err(fault(
                "a count is above 65,536 (are they little-endian int32?)",
            ));
        }
        let read = Self {
            trial: Quantities::of([d, v, a, f, t]),
            wanted: Quantities::of([wd, wv, wa, wf, wt]),
            length,
        };
        if read.trial.displacement == 0 {
            return Err(fault("no displacement is sent"));
        }
        if read.trial.time > 1 || read.wanted.time > 1 {
            return Err(fault("there is one time"));
        }
        if length < 1 + read.trial.total() {
            return Err(fault("a trial and its action do not fit the length"));
        }
        if length < read.wanted.total() {
            return Err(fault("what is wanted does not fit the length"));
        }
        Ok(read)
    }

    /// As they go over the wire.
    #[must_use]
    pub fn bytes(&self) -> [u8; Self::BYTES] {
        let counts = self.trial.named().into_iter().chain(self.wanted.named());
        let all = counts.map(|(_, count)| count).chain([self.length]);
        let mut bytes = [0; Self::BYTES];
        for (four, count) in bytes.chunks_exact_mut(4).zip(all) {
            let count = i32::try_from(count).unwrap_or(i32::MAX);
            four.copy_from_slice(&count.to_le_bytes());
        }
        bytes
    }
}

/// Methods with which an HTTP request begins.
const METHODS: [&[u8]; 8] = [
    b"GET ", b"POST", b"HEAD", b"PUT ", b"OPTI", b"DELE", b"CONN", b"PRI ",
];

fn check_other_protocols(bytes: &[u8; Sizes::BYTES]) -> Result<(), ProtocolError> {
    if METHODS.iter().any(|method| bytes.starts_with(method)) {
        return Err(ProtocolError::Http);
    }
    if bytes.starts_with(&[0x16, 0x03]) {
        return Err(ProtocolError::Tls);
    }
    let mut first = [0; 8];
    first.copy_from_slice(&bytes[..8]);
    let first = f64::from_le_bytes(first);
    match Action::numbered(first) {
        Ok(_) => Err(ProtocolError::NotSetUp { action: first }),
        Err(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The eleven numbers that OpenSees' `genericClient` was seen to send.
    const SEEN: [i32; 11] = [1, 1, 1, 0, 1, 0, 0, 0, 1, 0, 256];

    fn on_the_wire(sizes: [i32; 11]) -> [u8; 44] {
        let mut bytes = [0; 44];
        for (four, size) in bytes.chunks_exact_mut(4).zip(sizes) {
            four.copy_from_slice(&size.to_le_bytes());
        }
        bytes
    }

    #[test]
    fn sizes_of_opensees_are_understood() {
        let read = Sizes::read(&on_the_wire(SEEN)).unwrap();
        assert_eq!(read.trial, Quantities::of([1, 1, 1, 0, 1]));
        assert_eq!(read.wanted, Quantities::of([0, 0, 0, 1, 0]));
        assert_eq!(read.length, 256);
        assert_eq!(read.bytes(), on_the_wire(SEEN));
    }

    #[test]
    fn other_protocols_are_called_by_their_names() {
        let mut http = [0; 44];
        http.copy_from_slice(&b"GET / HTTP/1.1\r\nHost: 127.0.0.1:8090\r\nUser-Agent: x"[..44]);
        assert_eq!(Sizes::read(&http), Err(ProtocolError::Http));
        let mut tls = [7; 44];
        tls[..3].copy_from_slice(&[0x16, 0x03, 0x01]);
        assert_eq!(Sizes::read(&tls), Err(ProtocolError::Tls));
        let mut trial = [0; 44];
        trial[..8].copy_from_slice(&3_f64.to_le_bytes());
        let refused = Sizes::read(&trial);
        assert_eq!(refused, Err(ProtocolError::NotSetUp { action: 3.0 }));
    }

    #[test]
    fn sizes_that_cannot_be_are_refused_with_the_reason() {
        let refused = |change: &dyn Fn(&mut [i32; 11])| {
            let mut sizes = SEEN;
            change(&mut sizes);
            Sizes::read(&on_the_wire(sizes)).unwrap_err().to_string()
        };
        assert!(refused(&|s| s[0] = -1).contains("negative"));
        assert!(refused(&|s| s[0] = 0).contains("no displacement"));
        assert!(refused(&|s| s[4] = 2).contains("one time"));
        assert!(refused(&|s| s[10] = 4).contains("a trial and its action do not fit"));
        assert!(refused(&|s| s[5] = 300).contains("wanted does not fit"));
        // As a machine with the other byte order writes 256.
        assert!(refused(&|s| s[10] = 65_536 + 1).contains("little-endian"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::array::uniform32(any::<u8>()), rest in prop::array::uniform12(any::<u8>())) {
            let mut all = [0; 44];
            all[..32].copy_from_slice(&bytes);
            all[32..].copy_from_slice(&rest);
            if let Ok(sizes) = Sizes::read(&all) {
                prop_assert!(sizes.length <= LONGEST);
                prop_assert!(sizes.trial.total() < sizes.length);
            }
        }

        #[test]
        fn what_is_written_is_read(n in 1_usize..20, time in 0_usize..2, length in 61_usize..300) {
            let sizes = Sizes {
                trial: Quantities::of([n, n, 0, 0, time]),
                wanted: Quantities::of([n, 0, 0, n, time]),
                length,
            };
            prop_assert_eq!(Sizes::read(&sizes.bytes()), Ok(sizes));
        }
    }
}
