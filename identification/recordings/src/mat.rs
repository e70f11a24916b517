//! MAT files of level 5 (MATLAB from version 5 up to `-v7`, GNU Octave, SciPy) as a table of text, so that they
//! are read wherever a CSV file is.
//!
//! The format is that of "MAT-File Format" (The MathWorks): a header of 128 bytes, then elements of a type, a
//! length and data, which may be compressed. Every real vector of the most frequent length, and every column of
//! a matrix with so many rows, is a column under its variable's name; fields of structures under the field's. A
//! scalar called `fs` or `dt` gives the time where there is no `time`.

use std::io::Read;
use std::path::Path;

use flate2::read::ZlibDecoder;

use super::DataError;
use super::text::Text;

/// Length of the header, and where its version and its byte order are.
const HEADER: usize = 128;
const VERSION: usize = 124;
/// Bytes of all variables at most, so that a small file cannot fill the memory.
const LARGEST: u64 = 1 << 30;
/// Depth of structures in structures at most.
const DEEPEST: usize = 8;
/// Columns of a matrix that are taken apart.
const WIDEST: usize = 256;
/// Types of elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Classes of arrays.
const CELL: u8 = 1;
const STRUCT: u8 = 2;
const CHAR: u8 = 4;
const NUMERIC: std::ops::RangeInclusive<u8> = 6..=15;
/// Flag of an array with imaginary parts.
const COMPLEX: u8 = 0x08;

/// Whether these are the first bytes of a MAT file, of any version but 4.
pub(super) fn is_mat(bytes: &[u8]) -> bool {
    let head = &bytes[..HEADER.min(bytes.len())];
    let is_named = || head.windows(8).any(|own| own == b"MAT-file");
    (bytes.starts_with(b"MATLAB ") && is_named())
        || (bytes.len() >= HEADER && order(bytes).is_some() && version(bytes).is_some())
}

/// Whether the numbers are in little-endian order.
fn order(bytes: &[u8]) -> Option<bool> {
    match bytes.get(VERSION + 2..HEADER)? {
        b"IM" => Some(true),
        b"MI" => Some(false),
        _ => None,
    }
}

fn version(bytes: &[u8]) -> Option<u16> {
    let pair = [*bytes.get(VERSION)?, *bytes.get(VERSION + 1)?];
    let own = if order(bytes)? {
        u16::from_le_bytes(pair)
    } else {
        u16::from_be_bytes(pair)
    };
    matches!(own, 0x0100 | 0x0200).then_some(own)
}

/// A variable, or a field, that is numbers.
struct Variable {
    name: String,
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

/// The variables that were read, and the names of those that were skipped.
#[derive(Default)]
struct Found {
    variables: Vec<Variable>,
    left: Vec<String>,
}

/// Where a MAT file is damaged.
#[derive(Debug, thiserror::Error)]
enum Damage {
    #[error("it ends within an element")]
    Short,
    #[error("an element is longer than the file")]
    Long,
    #[error("a small element of {0} bytes")]
    Small(usize),
    #[error("a compressed variable cannot be read: {0}")]
    Compressed(#[from] std::io::Error),
    #[error("its variables have more than 1 GB")]
    Large,
    #[error("`{name}` has {values} values, not {count}")]
    Count {
        name: String,
        values: usize,
        count: f64,
    },
    #[error("the names of the fields of `{0}`")]
    Fields(String),
    #[error("numbers of the unknown type {0}")]
    Type(u32),
}

/// The table in a MAT file.
///
/// # Errors
/// A version that is not read, a damaged file, a file without two vectors of one length.
pub(super) fn table(file: &Path, bytes: &[u8]) -> Result<Text, DataError> {
    let fault = |reason: String| DataError::file(file, reason);
    if bytes.starts_with(b"MATLAB 7.3") || version(bytes) == Some(0x0200) {
        return Err(fault(
            "a MAT file of version 7.3, which is HDF5; save it again with `save('FILE.mat', '-v7')`, or export \
             CSV with `writetable`"
                .to_owned(),
        ));
    }
    let Some(little) = order(bytes) else {
        return Err(fault(
            "a MAT file without its byte order; it is damaged or not of level 5".to_owned(),
        ));
    };
    let mut found = Found::default();
    let mut total = 0;
    let reader = Reader { little };
    reader
        .elements(
            &bytes[HEADER.min(bytes.len())..],
            &mut |kind, data| match kind {
                COMPRESSED => {
                    let mut whole = Vec::new();
                    let most = LARGEST - total;
                    ZlibDecoder::new(data).take(most).read_to_end(&mut whole)?;
                    total += whole.len() as u64;
                    if total == LARGEST {
                        return Err(Damage::Large);
                    }
                    reader.elements(&whole, &mut |kind, data| {
                        reader.variable(kind, data, &mut found)
                    })
                }
                _ => reader.variable(kind, data, &mut found),
            },
        )
        .map_err(|what| fault(format!("a damaged MAT file: {what}")))?;
    let text = written(&found).ok_or_else(|| {
        fault(
            "a MAT file without a vector; expected a column of numbers for each channel".to_owned(),
        )
    })?;
    let note = match found.left.as_slice() {
        [] => None,
        left => Some(format!("of the MAT file {} was not read", left.join(", "))),
    };
    Ok(Text { text, note })
}

/// What is done with an element of a type.
type Taking<'a> = dyn FnMut(u32, &[u8]) -> Result<(), Damage> + 'a;

#[derive(Clone, Copy)]
struct Reader {
    little: bool,
}

impl Reader {
    fn word(self, bytes: &[u8]) -> Result<u32, Damage> {
        let four: [u8; 4] = bytes
            .get(..4)
            .and_then(|four| four.try_into().ok())
            .ok_or(Damage::Short)?;
        Ok(if self.little {
            u32::from_le_bytes(four)
        } else {
            u32::from_be_bytes(four)
        })
    }

    /// The first element: type, data, and what follows it.
    fn element(self, bytes: &[u8]) -> Result<(u32, &[u8], &[u8]), Damage> {
        let first = self.word(bytes)?;
        // Small ones have their length beside the type.
        let (kind, length, begin, end) = if first >> 16 != 0 {
            let length = (first >> 16) as usize;
            if length > 4 {
                return Err(Damage::Small(length));
            }
            (first & 0xffff, length, 4, 8)
        } else {
            let length = self.word(&bytes[4..])? as usize;
            let padded = if first == COMPRESSED {
                length
            } else {
                length.next_multiple_of(8)
            };
            (first, length, 8, 8 + padded)
        };
        let data = bytes.get(begin..begin + length).ok_or(Damage::Long)?;
        Ok((kind, data, bytes.get(end..).unwrap_or_default()))
    }

    fn elements(self, mut bytes: &[u8], take: &mut Taking<'_>) -> Result<(), Damage> {
        while !bytes.is_empty() {
            let (kind, data, rest) = self.element(bytes)?;
            take(kind, data)?;
            bytes = rest;
        }
        Ok(())
    }

    fn variable(self, kind: u32, data: &[u8], found: &mut Found) -> Result<(), Damage> {
        if kind == MATRIX {
            self.matrix(data, "", 0, found)
        } else {
            Ok(())
        }
    }

    /// An array: numbers are kept under `name` or their own, structures taken apart.
    fn matrix(
        self,
        data: &[u8],
        name: &str,
        depth: usize,
        found: &mut Found,
    ) -> Result<(), Damage> {
        if data.is_empty() {
            return Ok(());
        }
        let (_, flags, rest) = self.element(data)?;
        let word = self.word(flags)?;
        let (class, flags) = ((word & 0xff) as u8, (word >> 8 & 0xff) as u8);
        let (kind, dimensions, rest) = self.element(rest)?;
        let sizes = self.numbers(kind, dimensions)?;
        let (_, own, rest) = self.element(rest)?;
        let own = String::from_utf8_lossy(own);
        let name = if name.is_empty() {
            own.trim_end_matches('\0')
        } else {
            name
        };
        let count = sizes.iter().product::<f64>();
        if NUMERIC.contains(&class) {
            let (kind, real, _) = self.element(rest)?;
            let values = self.numbers(kind, real)?;
            if values.len() as f64 != count {
                return Err(Damage::Count {
                    name: name.to_owned(),
                    values: values.len(),
                    count,
                });
            }
            if flags & COMPLEX != 0 || sizes.len() != 2 {
                found.left.push(format!(
                    "`{name}` (complex, or of more than two dimensions)"
                ));
                return Ok(());
            }
            found.variables.push(Variable {
                name: name.to_owned(),
                rows: sizes[0] as usize,
                columns: sizes[1] as usize,
                values,
            });
            return Ok(());
        }
        if class == STRUCT && count == 1.0 && depth < DEEPEST {
            let (kind, length, rest) = self.element(rest)?;
            let length = self.numbers(kind, length)?.first().copied().unwrap_or(0.0) as usize;
            let (_, names, mut rest) = self.element(rest)?;
            if length == 0 || names.len() % length != 0 {
                return Err(Damage::Fields(name.to_owned()));
            }
            for field in names.chunks(length) {
                let field = String::from_utf8_lossy(field);
                let (kind, data, more) = self.element(rest)?;
                if kind == MATRIX {
                    self.matrix(data, field.trim_end_matches('\0'), depth + 1, found)?;
                }
                rest = more;
            }
            return Ok(());
        }
        if class != CHAR {
            let what = match class {
                CELL => "a cell array",
                STRUCT => "an array of structures",
                _ => "an object, such as a table or a time series",
            };
            found.left.push(format!("`{name}` ({what})"));
        }
        Ok(())
    }

    /// Numbers of a type, which may be smaller than that of their array.
    fn numbers(self, kind: u32, data: &[u8]) -> Result<Vec<f64>, Damage> {
        macro_rules! all {
            ($number:ty, $size:literal) => {{
                let all = data.chunks_exact($size).map(|bytes| {
                    let mut own = [0; $size];
                    own.copy_from_slice(bytes);
                    if self.little {
                        <$number>::from_le_bytes(own) as f64
                    } else {
                        <$number>::from_be_bytes(own) as f64
                    }
                });
                all.collect()
            }};
        }
        Ok(match kind {
            1 => all!(i8, 1),
            2 => all!(u8, 1),
            3 => all!(i16, 2),
            4 => all!(u16, 2),
            5 => all!(i32, 4),
            6 => all!(u32, 4),
            7 => all!(f32, 4),
            9 => all!(f64, 8),
            12 => all!(i64, 8),
            13 => all!(u64, 8),
            other => return Err(Damage::Type(other)),
        })
    }
}

/// The table as text: a header, and a line for each sample; none without a vector.
fn written(found: &Found) -> Option<String> {
    let mut columns: Vec<(String, &[f64])> = Vec::new();
    for one in &found.variables {
        let long = one.rows.max(one.columns);
        if long < 2 {
            continue;
        }
        if one.rows == 1 || one.columns == 1 {
            columns.push((one.name.clone(), &one.values));
        } else if one.columns <= WIDEST {
            let all = one.values.chunks(one.rows).enumerate();
            columns.extend(all.map(|(i, own)| (format!("{}_{}", one.name, i + 1), own)));
        }
    }
    let count = |length: usize| {
        columns
            .iter()
            .filter(|(_, own)| own.len() == length)
            .count()
    };
    let lengths = columns.iter().map(|(_, own)| own.len());
    let length = lengths.max_by_key(|length| (count(*length), *length))?;
    columns.retain(|(_, own)| own.len() == length);
    let is_time = |name: &str| {
        let name = name.to_lowercase();
        [
            "t", "time", "t_s", "time_s", "zeit", "temps", "tiempo", "tempo",
        ]
        .contains(&name.as_str())
    };
    let scalar = |names: &[&str]| {
        let all = found.variables.iter();
        let mut own = all.filter(|one| one.values.len() == 1);
        let is_called = |one: &&Variable| names.contains(&one.name.to_lowercase().as_str());
        own.find(is_called).map(|one| one.values[0])
    };
    let step = scalar(&["dt", "ts", "sample_time", "time_step"])
        .or_else(|| Some(1.0 / scalar(&["fs", "fsamp", "sample_rate", "sampling_rate"])?))
        .filter(|step| step.is_finite() && *step > 0.0);
    let times: Option<Vec<f64>> = match step {
        Some(step) if !columns.iter().any(|(name, _)| is_time(name)) => {
            Some((0..length).map(|k| k as f64 * step).collect())
        }
        _ => None,
    };
    if let Some(times) = &times {
        columns.insert(0, ("time [s]".to_owned(), times));
    }
    let heads = columns.iter().map(|(name, _)| {
        // A vector of times has no unit in its name, and every program counts them in s.
        if is_time(name) && !name.contains('_') {
            format!("{name} [s]")
        } else {
            name.clone()
        }
    });
    let mut text = heads.collect::<Vec<_>>().join(",");
    for k in 0..length {
        text.push('\n');
        let cells = columns.iter().map(|(_, own)| {
            if own[k].is_finite() {
                own[k].to_string()
            } else {
                String::new()
            }
        });
        text += &cells.collect::<Vec<_>>().join(",");
    }
    text.push('\n');
    Some(text)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::ZlibEncoder;

    use super::*;
    use crate::{Channel, Recording};

    /// A writer after the format's description.
    struct Writer {
        little: bool,
    }

    impl Writer {
        fn word(&self, value: u32) -> [u8; 4] {
            if self.little {
                value.to_le_bytes()
            } else {
                value.to_be_bytes()
            }
        }

        fn element(&self, kind: u32, data: &[u8]) -> Vec<u8> {
            let length = data.len() as u32;
            let mut all = if !data.is_empty() && data.len() <= 4 {
                self.word(length << 16 | kind).to_vec()
            } else {
                [self.word(kind), self.word(length)].concat()
            };
            all.extend(data);
            all.resize(all.len().next_multiple_of(8), 0);
            all
        }

        fn head(&self, class: u32, sizes: [u32; 2], name: &str) -> Vec<u8> {
            let flags = [self.word(class), self.word(0)].concat();
            let sizes = sizes.map(|size| self.word(size)).concat();
            [
                self.element(6, &flags),
                self.element(5, &sizes),
                self.element(1, name.as_bytes()),
            ]
            .concat()
        }

        fn doubles(&self, name: &str, sizes: [u32; 2], values: &[f64]) -> Vec<u8> {
            let bytes = |value: &f64| {
                if self.little {
                    value.to_le_bytes()
                } else {
                    value.to_be_bytes()
                }
            };
            let data: Vec<u8> = values.iter().flat_map(bytes).collect();
            let all = [self.head(6, sizes, name), self.element(9, &data)].concat();
            self.element(MATRIX, &all)
        }

        fn compressed(&self, element: &[u8]) -> Vec<u8> {
            let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
            encoder.write_all(element).unwrap();
            let data = encoder.finish().unwrap();
            [
                &self.word(COMPRESSED)[..],
                &self.word(data.len() as u32),
                &data,
            ]
            .concat()
        }

        fn file(&self, elements: &[Vec<u8>]) -> Vec<u8> {
            let mut bytes = b"MATLAB 5.0 MAT-file, written by a test".to_vec();
            bytes.resize(VERSION, b' ');
            bytes.extend(if self.little {
                [0, 1, b'I', b'M']
            } else {
                [1, 0, b'M', b'I']
            });
            bytes.extend(elements.concat());
            bytes
        }
    }

    fn read(bytes: &[u8]) -> Result<Text, DataError> {
        super::super::decode(Path::new("a.mat"), bytes)
    }

    #[test]
    fn vectors_are_columns_in_either_byte_order_compressed_or_not() {
        for little in [true, false] {
            let own = Writer { little };
            // Whole numbers are stored in as few bytes as they need.
            let whole = [own.head(6, [1, 3], "disp_mm"), own.element(2, &[1, 2, 3])].concat();
            let elements = [
                own.doubles("t", [3, 1], &[0.0, 0.01, 0.02]),
                own.compressed(&own.element(MATRIX, &whole)),
                own.doubles("acc", [3, 2], &[0.1, f64::NAN, 0.3, 1.0, 2.0, 3.0]),
                own.doubles("gain", [1, 1], &[7.0]),
            ];
            let text = read(&own.file(&elements)).unwrap();
            let wanted = "t [s],disp_mm,acc_1,acc_2\n0,1,0.1,1\n0.01,2,,2\n0.02,3,0.3,3\n";
            assert_eq!((text.text.as_str(), text.note), (wanted, None));
        }
    }

    #[test]
    fn fields_are_columns_a_rate_gives_the_time_and_it_is_a_recording() {
        let own = Writer { little: true };
        let field = |values: &[f64]| own.doubles("", [values.len() as u32, 1], values);
        let names: Vec<u8> = [b"disp_mm\0".as_slice(), b"ref_mm\0\0"].concat();
        let structure = [
            own.head(2, [1, 1], "data"),
            own.element(5, &own.word(8)),
            own.element(1, &names),
            field(&[1.0, 2.0, 4.0]),
            field(&[3.0, 5.0, 6.0]),
        ]
        .concat();
        let object = own.element(MATRIX, &own.head(17, [1, 1], "tt"));
        let elements = [
            own.doubles("fs", [1, 1], &[200.0]),
            own.element(MATRIX, &structure),
            object,
        ];
        let bytes = own.file(&elements);
        let text = read(&bytes).unwrap();
        assert!(
            text.note.as_ref().unwrap().contains("`tt` (an object"),
            "{text:?}"
        );
        let recording = Recording::parse(Path::new("a.mat"), text, "a").unwrap();
        assert_eq!(recording.samples(Channel::Displacement), [1e-3, 2e-3, 4e-3]);
        assert_eq!(recording.samples(Channel::Reference), [3e-3, 5e-3, 6e-3]);
        assert_eq!(recording.stamps().unwrap()[2], 0.01);
    }

    #[test]
    fn what_a_table_cannot_hold_is_left_out_with_a_note() {
        let own = Writer { little: true };
        let complex = |name: &str, flag: u32, sizes: [u32; 2]| {
            let values: Vec<u8> = [1.0_f64, 2.0, 3.0]
                .iter()
                .flat_map(|it| it.to_le_bytes())
                .collect();
            let all = [
                own.head(6 | flag << 8, sizes, name),
                own.element(9, &values),
                own.element(9, &values),
            ];
            own.element(MATRIX, &all.concat())
        };
        // Flags of a global and of a logical array do not matter.
        let elements = [
            complex("z", 0x08, [3, 1]),
            complex("global", 0x04, [3, 1]),
            complex("logical", 0x02, [3, 1]),
            own.element(MATRIX, &own.head(1, [1, 1], "cells")),
            own.element(MATRIX, &own.head(2, [2, 1], "pair")),
        ];
        let text = read(&own.file(&elements)).unwrap();
        assert_eq!(text.text.lines().next(), Some("global,logical"));
        let note = text.note.unwrap();
        for part in [
            "`z` (complex",
            "`cells` (a cell array)",
            "`pair` (an array of structures)",
        ] {
            assert!(note.contains(part), "{note}");
        }
        assert!(!note.contains("global"));
        // More sizes than values.
        let short = own.file(&[complex("x", 0, [4, 1])]);
        assert!(
            read(&short)
                .unwrap_err()
                .to_string()
                .contains("a damaged MAT file")
        );
    }

    #[test]
    fn a_mat_file_is_told_by_its_first_words_or_its_marks() {
        let file = Writer { little: false }.file(&[]);
        assert!(is_mat(&file));
        // Another program's words, with the marks of the format.
        let mut other = file.clone();
        other[..8].copy_from_slice(b"Octave  ");
        assert!(is_mat(&other));
        other[VERSION + 2] = b'?';
        assert!(!is_mat(&other));
        assert!(is_mat(b"MATLAB 5.0 MAT-file") && !is_mat(b"MATLAB is a program"));
        assert!(!is_mat(b"") && !is_mat(b"a MAT-file"));
    }

    #[test]
    fn what_cannot_be_read_is_said_with_its_remedy() {
        let own = Writer { little: true };
        let whole = own.file(&[own.doubles("x", [3, 1], &[1.0, 2.0, 3.0])]);
        let mut newer = whole.clone();
        newer[..10].copy_from_slice(b"MATLAB 7.3");
        let said = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
        assert!(said(&newer).contains("-v7'"), "{}", said(&newer));
        let alone = own.file(&[own.doubles("x", [1, 1], &[1.0])]);
        assert!(
            said(&alone).contains("without a vector"),
            "{}",
            said(&alone)
        );
        // Cut or changed anywhere it is an error or another table, and never a panic.
        for end in HEADER + 1..whole.len() {
            let _ = read(&whole[..end]);
            let mut changed = whole.clone();
            changed[end] ^= 0xff;
            let _ = read(&changed);
        }
        assert!(said(&whole[..whole.len() - 9]).contains("a damaged MAT file"));
    }
}
