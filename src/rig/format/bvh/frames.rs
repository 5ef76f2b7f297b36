//! Frames of a BVH file, read in blocks on all cores.

use rayon::prelude::*;

use super::{BvhError, error::quoted};

/// Bytes of a block; a block ends with a line.
const BLOCK: usize = 1 << 20;

/// Reads the rest of a file, which begins within the line `line`, as frames of `width` values. Returns the values and the
/// count of frames.
pub(super) fn read(bytes: &[u8], line: usize, width: usize) -> Result<(Vec<f32>, usize), BvhError> {
    let blocks: Vec<&[u8]> = blocks(bytes);
    let read: Vec<Block> = blocks.par_iter().map(|block| Block::read(block, width)).collect();
    // Lines before a block are counted only if it has an error.
    if let Some(at) = read.iter().position(|block| block.error.is_some()) {
        let before: usize = blocks[..at].iter().map(|block| line_ends(block)).sum();
        if let Some((own, fault)) = read.into_iter().nth(at).and_then(|block| block.error) {
            return Err(fault.at(line + before + own, width));
        }
        return Ok((Vec::new(), 0));
    }
    let rows = read.iter().map(|block| block.rows).sum();
    let mut values = Vec::with_capacity(read.iter().map(|block| block.values.len()).sum());
    read.iter().for_each(|block| values.extend_from_slice(&block.values));
    Ok((values, rows))
}

/// Pieces that end with a line.
fn blocks(mut bytes: &[u8]) -> Vec<&[u8]> {
    let mut blocks = Vec::new();
    while !bytes.is_empty() {
        let from = BLOCK.min(bytes.len());
        let end = memchr::memchr2(b'\n', b'\r', &bytes[from..]).map_or(bytes.len(), |end| from + end + 1);
        // Both bytes of a line's end belong together.
        let end = if bytes[end - 1] == b'\r' && bytes.get(end) == Some(&b'\n') { end + 1 } else { end };
        let (block, rest) = bytes.split_at(end);
        blocks.push(block);
        bytes = rest;
    }
    blocks
}

fn line_ends(block: &[u8]) -> usize {
    let both = block.windows(2).filter(|pair| *pair == b"\r\n").count();
    memchr::memchr2_iter(b'\n', b'\r', block).count() - both
}

/// Error of a line.
enum Fault {
    Number(String),
    Count(usize),
}

impl Fault {
    fn at(self, line: usize, wanted: usize) -> BvhError {
        match self {
            Self::Number(found) => BvhError::BadNumber { line, found },
            Self::Count(found) => BvhError::BadFrame { line, found, wanted },
        }
    }
}

/// Values of a block, or its first error with the number of lines before it.
#[derive(Default)]
struct Block {
    values: Vec<f32>,
    rows: usize,
    error: Option<(usize, Fault)>,
}

impl Block {
    fn read(bytes: &[u8], width: usize) -> Self {
        // A value takes at least two bytes, and most take eight or more.
        let mut block = Self { values: Vec::with_capacity(bytes.len() / 8), ..Self::default() };
        let (mut at, mut line, mut count) = (0, 0, 0);
        loop {
            while at < bytes.len() && matches!(bytes[at], b' ' | b'\t' | 0x0B | 0x0C) {
                at += 1;
            }
            let end = bytes.get(at).copied();
            if matches!(end, None | Some(b'\n' | b'\r')) {
                if count > 0 && count != width {
                    block.error = Some((line, Fault::Count(count)));
                    return block;
                }
                block.rows += usize::from(count > 0);
                count = 0;
                at += match end {
                    None => return block,
                    Some(b'\r') if bytes.get(at + 1) == Some(&b'\n') => 2,
                    Some(_) => 1,
                };
                line += 1;
                continue;
            }
            match fast_float2::parse_partial::<f32, _>(&bytes[at..]) {
                Ok((value, length)) if length > 0 && ends_word(bytes.get(at + length)) && is_usable(value) => {
                    block.values.push(value);
                    at += length;
                    count += 1;
                }
                _ => {
                    let word = &bytes[at..];
                    let length = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
                    let word = &word[..length];
                    block.error = Some((line, Fault::Number(quoted(word))));
                    return block;
                }
            }
        }
    }
}

fn is_usable(value: f32) -> bool {
    value.abs() <= super::MAX_NUMBER
}

fn ends_word(next: Option<&u8>) -> bool {
    next.is_none_or(|byte| byte.is_ascii_whitespace() || *byte == 0x0B)
}
