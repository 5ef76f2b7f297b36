//! URIs of buffers and images: data in the URI itself, or a file below the model's folder and nowhere else.

use std::{error::Error, fmt, sync::Arc};

use super::GltfError;

/// Content or file that a URI refers to.
pub(super) enum UriTarget {
    /// The bytes are in the URI.
    Data {
        /// The media type, possibly empty.
        mime: String,
        /// The decoded bytes.
        bytes: Vec<u8>,
    },
    /// A relative path below the model's folder, decoded, parts separated by `/`.
    File(String),
}

/// Fault of a URI in a glTF file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GltfUriError {
    /// A data URI has no comma before its data.
    #[error("a data URI without a comma")]
    NoComma,
    /// The data of a data URI is no base64.
    #[error("the base64 data is damaged")]
    Base64,
    /// A percent sign begins no escape.
    #[error("% must be followed by two hexadecimal digits")]
    Percent,
    /// The decoded URI is no text.
    #[error("is not UTF-8 once decoded")]
    Utf8,
    /// The URI holds a control character.
    #[error("contains a control character")]
    Control,
    /// The URI is an absolute path.
    #[error("is an absolute path; only files below the model's folder are read")]
    Absolute,
    /// The URI has a scheme or a drive.
    #[error("has a scheme or a drive; only files below the model's folder are read")]
    Scheme,
    /// The URI holds a backslash.
    #[error("contains a backslash; write / between folders")]
    Backslash,
    /// The URI leads out of the model's folder.
    #[error("leads out of the model's folder; only files below it are read")]
    Outside,
    /// The URI names no file.
    #[error("names no file")]
    NoFile,
    /// The file cannot be loaded.
    #[error(transparent)]
    External(#[from] ExternalError),
}

/// File that a glTF file refers to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ExternalFile<'a> {
    /// Path relative to the folder of the glTF file, decoded, with `/` between its parts.
    pub path: &'a str,
    /// Use of the file.
    pub kind: ExternalKind,
    /// Largest number of bytes that the reader can use; a longer file is refused in any case.
    pub limit: u64,
}

impl fmt::Display for ExternalFile<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.path)
    }
}

/// Use of a file that a glTF file refers to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExternalKind {
    /// Data of accessors.
    Buffer,
    /// An encoded image.
    Image,
}

/// Reason why a file that a glTF file refers to cannot be loaded: an error of the caller's own type. Two are equal if
/// they are the same occurrence.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{0}")]
pub struct ExternalError(Arc<dyn Error + Send + Sync>);

impl ExternalError {
    /// Wraps an error of the caller.
    pub fn new(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self(error.into().into())
    }

    /// The error of the caller, to be downcast to the caller's own type.
    pub fn get(&self) -> &(dyn Error + Send + Sync + 'static) {
        self.0.as_ref()
    }
}

impl PartialEq for ExternalError {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for ExternalError {}

/// An error about a URI, which is quoted shortened.
pub(super) fn fault(place: &str, uri: &str, fault: impl Into<GltfUriError>) -> GltfError {
    let mut short: String = uri.chars().take(80).collect();
    if short.len() < uri.len() {
        short.push_str("...");
    }
    GltfError::External { file: String::new(), place: place.to_owned(), uri: short, fault: fault.into() }
}

/// Decodes a URI and checks that it stays below the model's folder.
pub(super) fn resolve(uri: &str, place: &str) -> Result<UriTarget, GltfError> {
    let fail = |what: GltfUriError| fault(place, uri, what);
    if uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:")) {
        let (header, data) = uri[5..].split_once(',').ok_or_else(|| fail(GltfUriError::NoComma))?;
        let mime = header.split(';').next().unwrap_or_default().to_ascii_lowercase();
        let bytes = if header.to_ascii_lowercase().ends_with(";base64") {
            base64(data).ok_or_else(|| fail(GltfUriError::Base64))?
        } else {
            percent_decode(data).ok_or_else(|| fail(GltfUriError::Percent))?
        };
        return Ok(UriTarget::Data { mime, bytes });
    }
    let decoded = percent_decode(uri).ok_or_else(|| fail(GltfUriError::Percent))?;
    let path = String::from_utf8(decoded).map_err(|_| fail(GltfUriError::Utf8))?;
    if path.contains(|c: char| c.is_control()) {
        return Err(fail(GltfUriError::Control));
    }
    if path.starts_with(['/', '\\']) {
        return Err(fail(GltfUriError::Absolute));
    }
    if path.contains(':') {
        return Err(fail(GltfUriError::Scheme));
    }
    if path.contains('\\') {
        return Err(fail(GltfUriError::Backslash));
    }
    let mut parts = Vec::new();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => return Err(fail(GltfUriError::Outside)),
            part => parts.push(part),
        }
    }
    if parts.is_empty() || path.ends_with('/') {
        return Err(fail(GltfUriError::NoFile));
    }
    Ok(UriTarget::File(parts.join("/")))
}

fn percent_decode(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&byte, tail)) = rest.split_first() {
        rest = tail;
        if byte != b'%' {
            out.push(byte);
            continue;
        }
        let digit = |at: usize| tail.get(at).and_then(|&byte| (byte as char).to_digit(16));
        out.push((digit(0)? * 16 + digit(1)?) as u8);
        rest = tail.get(2..)?;
    }
    Some(out)
}

/// A relative file name as a URI.
pub(super) fn percent_encode(name: &str) -> String {
    let mut uri = String::with_capacity(name.len());
    for &byte in name.as_bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => uri.push(byte as char),
            _ => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}

/// Base64 in either alphabet, with or without padding and line breaks.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let (mut bits, mut count, mut padding) = (0u32, 0, 0);
    for byte in text.bytes() {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'=' => {
                padding += 1;
                continue;
            }
            b' ' | b'\t' | b'\r' | b'\n' => continue,
            _ => return None,
        };
        if padding > 0 {
            return None;
        }
        bits = bits << 6 | u32::from(value);
        count += 1;
        if count == 4 {
            out.extend_from_slice(&bits.to_be_bytes()[1..]);
            (bits, count) = (0, 0);
        }
    }
    match (count, padding) {
        (0, 0) => {}
        (2, 0 | 2) => out.push((bits >> 4) as u8),
        (3, 0 | 1) => out.extend_from_slice(&[(bits >> 10) as u8, (bits >> 2) as u8]),
        _ => return None,
    }
    Some(out)
}
