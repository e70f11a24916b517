//! Calls as bytes: a fixed head, the references, the values. Several may follow each other; a parcel
//! begins at a multiple of 8 bytes, and so do its values.

use bytemuck::{Pod, Zeroable};

use super::super::call::{Call, Culprit, Function, Lost, Texts, Values};

/// The head of a parcel.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(super) struct Head {
    /// Bytes of the whole parcel.
    pub size: u64,
    pub function: u32,
    pub instance: u32,
    /// The status that came back.
    pub status: i32,
    /// 0: the status is one; 1: the values are the reason why there is none.
    pub lost: u32,
    pub references: u32,
    pub kind: u32,
    pub count: u64,
    /// Bytes of the values.
    pub length: u64,
    pub numbers: [f64; 3],
    pub flags: [u8; 8],
    pub handle: u64,
}

// SAFETY: numbers without padding between them, valid whatever their bits.
unsafe impl Zeroable for Head {}
// SAFETY: as above.
unsafe impl Pod for Head {}

/// Values of a parcel.
pub(super) const NONE: u32 = 0;
pub(super) const IN: u32 = 1;
pub(super) const OUT: u32 = 2;
pub(super) const TEXTS_IN: u32 = 3;
pub(super) const TEXTS_OUT: u32 = 4;
pub(super) const BOTH: u32 = 5;

const HEAD: usize = size_of::<Head>();

/// Room kept for texts whose lengths are not known before; the last call of several only.
const TEXTS: usize = 64 << 20;

fn padded(length: usize) -> usize {
    length.next_multiple_of(8)
}

impl Head {
    fn new(instance: u32, call: &Call) -> Self {
        let (kind, length) = match &call.values {
            Values::None => (NONE, 0),
            Values::In(bytes) => (IN, bytes.len()),
            Values::Out(bytes) => (OUT, bytes.len()),
            Values::Both(bytes) => (BOTH, bytes.len()),
            Values::TextsIn(texts) => (TEXTS_IN, texts.iter().map(|text| 8 + text.len()).sum()),
            Values::TextsOut(_) => (TEXTS_OUT, 0),
        };
        let mut flags = [0; 8];
        for (byte, flag) in flags.iter_mut().zip(call.flags) {
            *byte = u8::from(flag);
        }
        let size = HEAD + padded(4 * call.references.len()) + padded(length);
        Self {
            size: size as u64,
            function: call.function.number(),
            instance,
            status: 0,
            lost: 0,
            references: call.references.len() as u32,
            kind,
            count: call.count as u64,
            length: length as u64,
            numbers: call.numbers,
            flags,
            handle: call.handle,
        }
    }

    fn values_at(&self) -> usize {
        HEAD + padded(4 * self.references as usize)
    }
}

/// Adds a call to `bytes`.
pub(super) fn append(bytes: &mut Vec<u8>, instance: u32, call: &Call) {
    let at = bytes.len();
    let head = Head::new(instance, call);
    bytes.resize(at + head.size as usize, 0);
    write(&mut bytes[at..], &head, call);
}

/// Sets a flag of the call at the beginning of `bytes`.
pub(super) fn mark(bytes: &mut [u8], flag: usize) {
    bytes[std::mem::offset_of!(Head, flags) + flag] = 1;
}

/// Where the values of a call begin in its parcel.
pub(super) fn values_at(call: &Call) -> usize {
    Head::new(0, call).values_at()
}

/// Where the values of a parcel begin.
pub(super) fn values_of(head: &Head) -> usize {
    head.values_at()
}

/// Whether the calls in `bytes` are those in `other`, whatever came of them.
pub(super) fn are_alike(bytes: &[u8], other: &[u8]) -> bool {
    let said = |head: &Head| (head.size, head.function, head.instance, head.references);
    bytes.len() == other.len()
        && all(bytes).zip(all(other)).all(|((at, one), (_, two))| {
            let content = at + HEAD..at + one.size as usize;
            said(&one) == said(&two) && bytes[content.clone()] == other[content]
        })
}

/// How many bytes a call takes.
pub(super) fn size(call: &Call) -> usize {
    Head::new(0, call).size as usize
}

/// Writes a call to the beginning of `bytes`, which has room for it.
pub(super) fn place(bytes: &mut [u8], instance: u32, call: &Call) {
    let head = Head::new(instance, call);
    write(bytes, &head, call);
}

fn write(bytes: &mut [u8], head: &Head, call: &Call) {
    bytes[..HEAD].copy_from_slice(bytemuck::bytes_of(head));
    let references: &[u8] = bytemuck::cast_slice(call.references);
    bytes[HEAD..HEAD + references.len()].copy_from_slice(references);
    let at = head.values_at();
    match &call.values {
        Values::In(values) => bytes[at..at + values.len()].copy_from_slice(values),
        Values::Both(values) => bytes[at..at + values.len()].copy_from_slice(values),
        Values::TextsIn(texts) => write_texts(&mut bytes[at..], texts),
        _ => {}
    }
}

fn write_texts(bytes: &mut [u8], texts: &Texts) {
    let mut at = 0;
    for text in texts {
        bytes[at..at + 8].copy_from_slice(&(text.len() as u64).to_ne_bytes());
        at += 8;
        bytes[at..at + text.len()].copy_from_slice(text);
        at += text.len();
    }
}

fn read_texts(bytes: &[u8], count: usize) -> Option<Texts> {
    let mut at = 0;
    let mut texts = Texts::new();
    for _ in 0..count {
        let length = bytes.get(at..at + 8)?;
        let length = u64::from_ne_bytes(length.try_into().ok()?) as usize;
        at += 8;
        texts.push(bytes.get(at..at.checked_add(length)?)?.to_vec());
        at += length;
    }
    Some(texts)
}

/// The head of the parcel at the beginning of `bytes`.
pub(super) fn head(bytes: &[u8]) -> Option<Head> {
    let head: Head = bytemuck::try_pod_read_unaligned(bytes.get(..HEAD)?).ok()?;
    // A guest gone mad may have written anything: no sum may wrap.
    let size = usize::try_from(head.size).ok()?;
    let length = usize::try_from(head.length).ok()?;
    let values_end = head.values_at().checked_add(length)?;
    let fits = (HEAD..=bytes.len()).contains(&size)
        && size.is_multiple_of(8)
        && head.values_at() <= size
        && values_end <= bytes.len();
    fits.then_some(head)
}

/// The references of a parcel.
pub(super) fn references(bytes: &[u8], head: &Head) -> Vec<u32> {
    let bytes = &bytes[HEAD..HEAD + 4 * head.references as usize];
    bytes
        .chunks_exact(4)
        .map(|four| u32::from_ne_bytes([four[0], four[1], four[2], four[3]]))
        .collect()
}

/// Whether the references of a parcel are those.
pub(super) fn are_references(bytes: &[u8], head: &Head, references: &[u32]) -> bool {
    let own = bytes.get(HEAD..HEAD + 4 * head.references as usize);
    own == Some(bytemuck::cast_slice(references))
}

/// Each parcel in `bytes`: where it begins, and its head.
pub(super) fn all(bytes: &[u8]) -> impl Iterator<Item = (usize, Head)> {
    let mut next = 0;
    std::iter::from_fn(move || {
        let at = next;
        let head = head(bytes.get(at..)?)?;
        next += head.size as usize;
        Some((at, head))
    })
}

/// In the guest: carries out the parcel at the beginning of `bytes` by `endpoint` and writes what
/// came of it in the first `end` bytes; gives whether it went well. Without a status, the reason may take more of
/// `bytes`, because nothing that follows is carried out.
pub(super) fn carry_out(
    bytes: &mut [u8],
    end: usize,
    head: &Head,
    endpoint: impl FnOnce(&mut Call) -> Result<i32, Lost>,
) -> bool {
    let at = head.values_at();
    let (before, values) = bytes[..end].split_at_mut(at);
    let references = &before[HEAD..HEAD + 4 * head.references as usize];
    let length = (head.length as usize).min(values.len());
    let (count, mut texts) = (head.count as usize, Texts::new());
    let Some(function) = Function::numbered(head.function) else {
        let reason = Lost("is no function".to_string());
        answer(bytes, *head, Err(reason));
        return false;
    };
    let mut flags = [false; 5];
    for (flag, byte) in flags.iter_mut().zip(head.flags) {
        *flag = byte != 0;
    }
    let mut call = Call {
        function,
        // Heads take a multiple of 8 bytes, so that they are aligned.
        references: bytemuck::try_cast_slice(references).unwrap_or_default(),
        values: match head.kind {
            IN => Values::In(&values[..length]),
            OUT => Values::Out(&mut values[..length]),
            BOTH => Values::Both(&mut values[..length]),
            TEXTS_IN => {
                texts = read_texts(&values[..length], count).unwrap_or_default();
                Values::TextsIn(&texts)
            }
            TEXTS_OUT => Values::TextsOut(&mut texts),
            _ => Values::None,
        },
        count,
        numbers: head.numbers,
        flags,
        handle: head.handle,
        culprit: None,
    };
    let mut outcome = endpoint(&mut call);
    let mut head = *head;
    head.numbers = call.numbers;
    head.handle = call.handle;
    if let Some(culprit) = &call.culprit {
        head.function = culprit.function.number();
    }
    for (byte, flag) in head.flags.iter_mut().zip(call.flags) {
        *byte = u8::from(flag);
    }
    if head.kind == TEXTS_OUT {
        let needed: usize = texts.iter().map(|text| 8 + text.len()).sum();
        if needed > values.len().min(TEXTS) {
            outcome = Err(Lost(format!(
                "gave {needed} bytes, more than can be passed on"
            )));
        } else {
            head.length = needed as u64;
            head.count = texts.len() as u64;
            write_texts(values, &texts);
        }
    }
    let went_well = matches!(outcome, Ok(0 | 1));
    answer(bytes, head, outcome);
    went_well
}

fn answer(bytes: &mut [u8], mut head: Head, outcome: Result<i32, Lost>) {
    match outcome {
        Ok(status) => head.status = status,
        Err(Lost(reason)) => {
            let at = head.values_at();
            let room = bytes.len().saturating_sub(at);
            let reason = &reason.as_bytes()[..reason.len().min(room)];
            bytes[at..at + reason.len()].copy_from_slice(reason);
            head.lost = 1;
            head.length = reason.len() as u64;
        }
    }
    bytes[..HEAD].copy_from_slice(bytemuck::bytes_of(&head));
}

/// In the host: how many bytes the parcel at the beginning of `bytes` takes with what came of it.
pub(super) fn answered(bytes: &[u8]) -> usize {
    head(bytes).map_or(0, |head| {
        let end = head.values_at() + head.length as usize;
        end.max(head.size as usize)
    })
}

/// In the host: what came of a parcel.
pub(super) fn outcome(bytes: &[u8], head: &Head) -> Result<i32, Lost> {
    if head.lost == 0 {
        return Ok(head.status);
    }
    let at = head.values_at();
    let reason = &bytes[at..at + head.length as usize];
    Err(Lost(String::from_utf8_lossy(reason).into_owned()))
}

/// In the host: the call that the outcome belongs to, where it was made within the one that was asked for.
pub(super) fn culprit(head: &Head, call: &Call) -> Option<Box<Culprit>> {
    let function = Function::numbered(head.function)?;
    (function != call.function).then(|| {
        Box::new(Culprit {
            function,
            references: Vec::new(),
        })
    })
}

/// In the host: gives the call what came back.
pub(super) fn give_back(bytes: &[u8], head: &Head, call: &mut Call) {
    call.numbers = head.numbers;
    call.handle = head.handle;
    for (flag, byte) in call.flags.iter_mut().zip(head.flags) {
        *flag = byte != 0;
    }
    let at = head.values_at();
    match &mut call.values {
        Values::Out(values) | Values::Both(values) => {
            let length = values.len().min(bytes.len() - at);
            values[..length].copy_from_slice(&bytes[at..at + length]);
        }
        Values::TextsOut(texts) => {
            let values = &bytes[at..at + head.length as usize];
            **texts = read_texts(values, head.count as usize).unwrap_or_default();
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::call::Scalar;
    use super::{
        Call, Function, HEAD, Lost, Values, answered, append, are_alike, carry_out, head, outcome,
    };

    #[test]
    fn a_reason_longer_than_its_parcel_comes_back_whole() {
        let mut bytes = Vec::new();
        append(&mut bytes, 0, &Call::plain(Function::DoStep));
        let end = bytes.len();
        append(&mut bytes, 1, &Call::plain(Function::Terminate));
        bytes.resize(4096, 0);
        let reason = Lost("cannot".repeat(100));
        let first = head(&bytes).unwrap();
        let went_well = carry_out(&mut bytes, end, &first, |_| Err(reason.clone()));
        assert!(!went_well);
        let length = answered(&bytes);
        assert_eq!(length, end + 600);
        let first = head(&bytes[..length]).unwrap();
        assert_eq!(outcome(&bytes[..length], &first), Err(reason));
    }

    #[test]
    fn calls_are_alike_whatever_came_of_them() {
        let set = |value: f64| {
            let (mut bytes, value) = (Vec::new(), [value]);
            let mut call = Call::plain(Function::Set(Scalar::Float64));
            call.references = &[4];
            call.values = Values::In(bytemuck::cast_slice(&value));
            append(&mut bytes, 1, &call);
            append(&mut bytes, 1, &Call::plain(Function::EnterStepMode));
            bytes
        };
        let mut warned = set(2.5);
        let first = head(&warned).unwrap();
        let end = first.size as usize;
        assert!(carry_out(&mut warned, end, &first, |_| Ok(1)));
        assert!(warned != set(2.5) && are_alike(&warned, &set(2.5)));
        assert!(!are_alike(&warned, &set(2.25)));
        assert!(!are_alike(&warned, &set(2.5)[..end]));
        assert!(!are_alike(&[], &set(2.5)));
    }

    #[test]
    fn heads_with_forged_lengths_are_refused() {
        let mut bytes = Vec::new();
        let mut call = Call::plain(Function::Terminate);
        let references = [1, 2, 3];
        call.references = &references;
        call.values = Values::In(&[7; 24]);
        append(&mut bytes, 0, &call);
        assert!(head(&bytes).is_some());
        assert!(head(&bytes[..HEAD - 1]).is_none());
        // Size, references, length of the values: 8, 4 and 8 bytes in the head.
        for (at, width) in [(0, 8), (24, 4), (40, 8)] {
            for forged in [
                u64::MAX,
                u64::MAX - 100,
                (1 << 40) + 1_000_000,
                4_000_000_000,
            ] {
                let mut other = bytes.clone();
                other[at..at + width].copy_from_slice(&forged.to_le_bytes()[..width]);
                assert!(head(&other).is_none(), "{at}: {forged}");
            }
        }
        let mut short = bytes.clone();
        short[..8].copy_from_slice(&(HEAD as u64).to_le_bytes());
        assert!(
            head(&short).is_none(),
            "the references reach beyond the parcel"
        );
    }
}
