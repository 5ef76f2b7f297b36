//! The outermost layer: GLB chunks (section 4) and the JSON text, measured before it is parsed.

use std::{borrow::Cow, mem::size_of};

use super::{GltfError, budget::Budget, tree::Json};

/// A file's JSON text and, in a GLB, its binary chunk.
pub(super) struct Container<'a> {
    pub(super) json: &'a [u8],
    pub(super) bin: Option<&'a [u8]>,
}

const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// Splits the container into its chunks; every length in it is checked.
pub(super) fn split(bytes: &[u8]) -> Result<Container<'_>, GltfError> {
    if bytes.is_empty() {
        return Err(GltfError::container(0, "the file is empty"));
    }
    if bytes.starts_with(b"glTF") {
        return split_glb(bytes);
    }
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    match text.iter().find(|byte| !byte.is_ascii_whitespace()) {
        Some(b'{' | b'[') => Ok(Container { json: text, bin: None }),
        _ => Err(GltfError::container(
            0,
            "neither a GLB (begins with \"glTF\") nor a glTF JSON file (begins with \"{\")",
        )),
    }
}

fn word(bytes: &[u8], offset: usize) -> Option<u32> {
    let word = bytes.get(offset..offset.checked_add(4)?)?;
    Some(u32::from_le_bytes(word.try_into().ok()?))
}

fn split_glb(bytes: &[u8]) -> Result<Container<'_>, GltfError> {
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(GltfError::container(bytes.len(), "the file ends inside the 12-byte GLB header"));
    };
    if version != 2 {
        return Err(GltfError::container(4, format!("GLB version {version}; only version 2 can be read")));
    }
    let length = length as usize;
    if length > bytes.len() {
        let what = format!("the header says {length} bytes, the file has {}; it is cut off", bytes.len());
        return Err(GltfError::container(8, what));
    }
    let bytes = &bytes[..length];
    let (mut json, mut bin) = (None, None);
    let mut offset = 12;
    while offset < bytes.len() {
        let (Some(size), Some(kind)) = (word(bytes, offset), word(bytes, offset + 4)) else {
            return Err(GltfError::container(offset, "the file ends inside a chunk header"));
        };
        let start = offset + 8;
        let Some(data) = bytes[start..].get(..size as usize) else {
            let what = format!("a chunk of {size} bytes, but only {} are left", bytes.len() - start);
            return Err(GltfError::container(offset, what));
        };
        match kind {
            JSON if data.is_empty() => return Err(GltfError::container(offset, "the JSON chunk is empty")),
            JSON if json.is_none() => json = Some(data),
            JSON => return Err(GltfError::container(offset, "a second JSON chunk")),
            _ if json.is_none() => return Err(GltfError::container(offset, "the first chunk is not the JSON chunk")),
            BIN if bin.is_none() => bin = Some(data),
            BIN => return Err(GltfError::container(offset, "a second BIN chunk")),
            _ => {}
        }
        offset = start + data.len();
    }
    match json {
        Some(json) => Ok(Container { json, bin }),
        None => Err(GltfError::container(12, "there is no JSON chunk")),
    }
}

/// Parses the JSON after charging the memory of its tree.
pub(super) fn parse<'a>(json: &'a [u8], budget: &Budget) -> Result<Json<'a>, GltfError> {
    let json = json.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(json);
    budget.take(1, tree_size(json), "")?;
    let value: Json = serde_json::from_slice(json).map_err(|error| GltfError::Json {
        file: String::new(),
        line: error.line(),
        column: error.column(),
        what: error.to_string(),
    })?;
    if value.as_object().is_none() {
        return Err(GltfError::at("/", "the JSON is not an object"));
    }
    Ok(value)
}

/// An upper bound of the memory that the parsed tree takes: `[0,0,...` is two bytes a value in the file and dozens in
/// memory. Ill-formed text may be measured wrongly; the parser stops at it, having used no more than counted so far.
fn tree_size(json: &[u8]) -> usize {
    // A list that grows is copied into one of twice its length, and both are there while it is copied.
    const VALUE: usize = size_of::<Json>() * 3 / 2;
    const FIELD: usize = (size_of::<Json>() + size_of::<Cow<str>>()) * 3 / 2;
    let close = |entry: usize, commas: usize| (commas + 1).next_power_of_two().max(4) * entry + 32;
    let mut open: Vec<(usize, usize)> = Vec::new();
    let mut total = size_of::<Json>();
    let mut rest = json.iter();
    while let Some(byte) = rest.next() {
        match byte {
            b'"' => {
                let mut length = 0;
                while let Some(byte) = rest.next() {
                    match byte {
                        b'"' => break,
                        b'\\' => drop(rest.next()),
                        _ => {}
                    }
                    length += 1;
                }
                total += length + 32;
            }
            // The parser refuses text deeper than 128 levels.
            b'[' if open.len() < 256 => open.push((VALUE, 0)),
            b'{' if open.len() < 256 => open.push((FIELD, 0)),
            b',' => {
                if let Some((_, commas)) = open.last_mut() {
                    *commas += 1;
                }
            }
            b']' | b'}' => {
                if let Some((entry, commas)) = open.pop() {
                    total += close(entry, commas);
                }
            }
            _ => {}
        }
    }
    total + open.into_iter().map(|(entry, commas)| close(entry, commas)).sum::<usize>()
}
