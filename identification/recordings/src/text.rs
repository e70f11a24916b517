//! The text of a file, whatever the program that wrote it: byte-order marks, line ends, encodings.

use std::io;
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
    let bytes = read_bytes(file).map_err(|error| DataError::Unreadable {
        file: file.to_path_buf(),
        reason: error.to_string(),
    })?;
    decode(file, &bytes)
}

/// Reads the bytes of a file. A device such as /dev/zero, which has no end, is not read.
///
/// # Errors
/// Why it cannot be read, as [`why`] puts it.
pub fn read_bytes(file: &Path) -> io::Result<Vec<u8>> {
    let said = |error: io::Error| io::Error::new(error.kind(), why(&error));
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = std::fs::metadata(file).map_err(said)?.file_type();
        if kind.is_char_device() || kind.is_block_device() {
            return Err(io::Error::other("it is a device; expected a file"));
        }
    }
    std::fs::read(file).map_err(said)
}

/// Why a file cannot be read, in words.
#[must_use]
pub fn why(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "no such file".to_string(),
        io::ErrorKind::IsADirectory => "it is a folder; expected a file".to_string(),
        io::ErrorKind::NotADirectory => {
            "no such file: a part of its path is a file, not a folder".to_string()
        }
        io::ErrorKind::PermissionDenied => {
            "you may not read it; change its permissions, or copy it".to_string()
        }
        _ => error.to_string(),
    }
}

/// Reads a file that a person wrote for this program, such as a system in TOML: UTF-8, or UTF-16 with
/// its mark, as some editors save it.
///
/// # Errors
/// Why it cannot be read, as [`why`] puts it, or the line that is not UTF-8.
pub fn read_written(file: &Path) -> io::Result<String> {
    let bytes = read_bytes(file)?;
    let binary = || fault("holds binary data, text was expected".to_string());
    match &bytes[..] {
        [0xef, 0xbb, 0xbf, rest @ ..] => utf8(rest),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes).ok_or_else(binary),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes).ok_or_else(binary),
        all => utf8(all),
    }
}

fn fault(reason: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, reason)
}

fn utf8(bytes: &[u8]) -> io::Result<String> {
    let read = std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        fault(format!("line {line} is not UTF-8; save the file as UTF-8"))
    })?;
    Ok(read.to_string())
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

    #[cfg(unix)]
    #[test]
    fn a_device_without_an_end_is_not_read() {
        let said = |file: &str| read_text(Path::new(file)).unwrap_err().to_string();
        assert!(said("/dev/zero").contains("it is a device; expected a file"));
        assert!(said("/").contains("it is a folder; expected a file"));
        assert!(said("/nothing/a.csv").contains("no such file"));
    }

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
    fn files_for_this_program_are_read_as_editors_save_them() {
        let folder = std::env::temp_dir().join(format!("read-written-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("a.toml");
        let read = |bytes: &[u8]| {
            std::fs::write(&file, bytes).unwrap();
            read_written(&file).map_err(|error| error.to_string())
        };
        let units: Vec<u8> = "a = 1\n"
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect();
        for bytes in [
            &b"a = 1\n"[..],
            b"\xef\xbb\xbfa = 1\n",
            &[&[0xff, 0xfe], &units[..]].concat(),
        ] {
            assert_eq!(read(bytes), Ok("a = 1\n".to_string()));
        }
        let reason = read(b"a = 1\n# M\xfcller\n").unwrap_err();
        assert_eq!(reason, "line 2 is not UTF-8; save the file as UTF-8");
        let reason = |path: &Path| read_written(path).unwrap_err().to_string();
        assert_eq!(reason(&folder), "it is a folder; expected a file");
        assert_eq!(reason(&folder.join("b.toml")), "no such file");
        let below = reason(&file.join("b.toml"));
        assert!(
            below.starts_with("no such file: a part of its path"),
            "{below}"
        );
        std::fs::remove_dir_all(&folder).unwrap();
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
