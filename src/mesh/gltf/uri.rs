//! URIs of buffers and images: data in the URI itself, or a file below the model's folder and nowhere else.

use super::GltfError;

/// Content or file that a URI refers to.
pub(super) enum Resolved {
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

/// An error about a URI, which is quoted shortened.
pub(super) fn fault(place: &str, uri: &str, what: impl Into<String>) -> GltfError {
    let mut short: String = uri.chars().take(80).collect();
    if short.len() < uri.len() {
        short.push_str("...");
    }
    GltfError::External { file: String::new(), place: place.to_owned(), uri: short, what: what.into() }
}

/// Decodes a URI and checks that it stays below the model's folder.
pub(super) fn resolve(uri: &str, place: &str) -> Result<Resolved, GltfError> {
    let fail = |what: &str| fault(place, uri, what);
    if uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:")) {
        let (header, data) = uri[5..].split_once(',').ok_or_else(|| fail("a data URI without a comma"))?;
        let mime = header.split(';').next().unwrap_or_default().to_ascii_lowercase();
        let bytes = if header.to_ascii_lowercase().ends_with(";base64") {
            base64(data).ok_or_else(|| fail("the base64 data is damaged"))?
        } else {
            percent_decode(data).ok_or_else(|| fail("% must be followed by two hexadecimal digits"))?
        };
        return Ok(Resolved::Data { mime, bytes });
    }
    let decoded = percent_decode(uri).ok_or_else(|| fail("% must be followed by two hexadecimal digits"))?;
    let path = String::from_utf8(decoded).map_err(|_| fail("is not UTF-8 once decoded"))?;
    if path.contains(|c: char| c.is_control()) {
        return Err(fail("contains a control character"));
    }
    if path.starts_with(['/', '\\']) {
        return Err(fail("is an absolute path; only files below the model's folder are read"));
    }
    if path.contains(':') {
        return Err(fail("has a scheme or a drive; only files below the model's folder are read"));
    }
    if path.contains('\\') {
        return Err(fail("contains a backslash; write / between folders"));
    }
    let mut parts = Vec::new();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => return Err(fail("leads out of the model's folder; only files below it are read")),
            part => parts.push(part),
        }
    }
    if parts.is_empty() || path.ends_with('/') {
        return Err(fail("names no file"));
    }
    Ok(Resolved::File(parts.join("/")))
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
