//! The text of a file, whatever the program that wrote it: byte-order marks, line ends, encodings.

use std::path::Path;

use super::DataError;
use super::mat::{self, is_mat};

/// A file's text with `\n` line ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Text {
    /// The text.
    pub text: String,
    /// What its reader should know, if anything.
    pub note: Option<String>,
}

/// Reads the text of a file that is there and not empty.
///
/// # Errors
/// A file that is missing, unreadable, empty or binary.
pub fn read_text(file: &Path) -> Result<Text, DataError> {
    let bytes = std::fs::read(file).map_err(|error| DataError::Unreadable {
        file: file.to_path_buf(),
        reason: match error.kind() {
            std::io::ErrorKind::NotFound => "no such file".to_string(),
            _ => error.to_string(),
        },
    })?;
    decode(file, &bytes)
}

/// The text of `bytes`, of a MAT file its table; `file` is what messages call them.
///
/// # Errors
/// No text, or binary data; a MAT file that cannot be read.
pub fn decode(file: &Path, bytes: &[u8]) -> Result<Text, DataError> {
    if is_mat(bytes) {
        return mat::table(file, bytes);
    }
    let mut note = None;
    let text = match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => std::str::from_utf8(rest).ok().map(str::to_string),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        _ => Some(match std::str::from_utf8(bytes) {
            Ok(text) => text.to_string(),
            Err(error) => {
                let before = &bytes[..error.valid_up_to()];
                let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
                note = Some(format!(
                    "line {line} is not UTF-8; the file was read as ISO-8859-1"
                ));
                bytes.iter().copied().map(char::from).collect()
            }
        }),
    };
    let text = text.filter(|text| !text.contains('\0'));
    let Some(text) = text else {
        return Err(DataError::Unreadable {
            file: file.to_path_buf(),
            reason: "holds binary data, text was expected".to_string(),
        });
    };
    if text.trim().is_empty() {
        return Err(DataError::Empty {
            file: file.to_path_buf(),
        });
    }
    let text = if text.contains('\r') {
        text.replace("\r\n", "\n").replace('\r', "\n")
    } else {
        text
    };
    Ok(Text { text, note })
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Option<String> {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    char::decode_utf16(units).collect::<Result<_, _>>().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_programs_write_before_and_between_lines_is_no_content() {
        let read = |bytes: &[u8]| decode(Path::new("a.csv"), bytes).map(|text| text.text);
        let wanted = "t,x\n1,2\n".to_string();
        for bytes in [&b"t,x\n1,2\n"[..], b"t,x\r\n1,2\r\n", b"t,x\r1,2\r"] {
            assert_eq!(read(bytes), Ok(wanted.clone()));
        }
        assert_eq!(read(b"\xef\xbb\xbft,x\n1,2\n"), Ok(wanted.clone()));
        let units: Vec<u16> = wanted.encode_utf16().collect();
        let little: Vec<u8> = units.iter().flat_map(|u| u.to_le_bytes()).collect();
        let big: Vec<u8> = units.iter().flat_map(|u| u.to_be_bytes()).collect();
        assert_eq!(
            read(&[&[0xff, 0xfe], &little[..]].concat()),
            Ok(wanted.clone())
        );
        assert_eq!(read(&[&[0xfe, 0xff], &big[..]].concat()), Ok(wanted));
    }

    #[test]
    fn another_encoding_is_read_and_said() {
        let text = decode(Path::new("a.csv"), b"# a\n# M\xfcller\nt,x\n").unwrap();
        assert!(text.text.contains("Müller"));
        let note = text.note.unwrap();
        assert_eq!(note, "line 2 is not UTF-8; the file was read as ISO-8859-1");
        let message = |bytes: &[u8]| decode(Path::new("a"), bytes).unwrap_err().to_string();
        assert_eq!(message(b" \r\n"), "a: the file is empty");
        assert_eq!(message(b"t\0x"), "a: holds binary data, text was expected");
    }
}
