//! Mutational fuzzing within `cargo test`: seeds are bent in the ways that break parsers, and what panics is kept as a file.
//!
//! Each target tries a set number of mutants, or as many as fit into `RIGSMITH_FUZZ_SECONDS`; `RIGSMITH_FUZZ_SEED` is the
//! start of the random sequence, which is the same on every run unless it is set. Findings lie in
//! `tests/fuzz_findings/NAME/` and are replayed first, by every run.

mod harness;

pub use harness::{run_fuzz, run_seeded};

use crate::random::Random;

/// A range within `len` bytes, short ones more often than long ones.
fn range(random: &mut Random, len: usize) -> std::ops::Range<usize> {
    let start = random.below(len + 1);
    let most = match random.below(4) {
        0 => 1,
        1 => 8,
        2 => 128,
        _ => len,
    };
    let end = (start + 1 + random.below(most)).min(len);
    start..end.max(start)
}

/// Numbers as text that readers get wrong, separated by blanks: around the limits of every width, and what is no number.
const TEXT_NUMBERS: &str = "0 -0 -1 1 2 3 4 127 128 255 256 -32769 32767 65535 65536 16777217 2147483647 2147483648 \
    -2147483648 4294967295 4294967296 9223372036854775807 -9223372036854775808 18446744073709551615 \
    18446744073709551616 1e38 1e39 -1e39 1e-45 1e-400 1e400 1e999999999 0.1 1. .1 . - + +1 --1 1e 1e+ 0x10 1_000 1,5 \
    nan NaN inf -inf infinity true null 00000000000000000000000000000001 0.00000000000000000000000000000000000000000001";

/// Values for binary fields of 1, 2, 4 and 8 bytes, as bit patterns: limits, alignments, and floats that are none.
const BINARY_NUMBERS: &str = "0 1 2 3 4 7 8 f 10 7f 80 ff 100 7fff 8000 ffff 10000 1fffffff 3fffffff 40000000 7fffffff \
    80000000 fffffffc fffffffe ffffffff 100000000 7fc00000 7f800000 ff800000 7f7fffff 7fffffffffffffff \
    8000000000000000 ffffffffffffffff";

/// Pieces that stumble decoders of text, separated by blanks.
const TEXT_PIECES: &str =
    "\0 \n \r \r\n \t \\ \\\n # / // \" ' ( ) [ ] { } , : % %00 .. \u{FEFF} \u{85} \u{2028} \u{3000} \u{301} \u{1F600}";

/// Bytes that are not UTF-8.
const BROKEN_TEXT: [&[u8]; 4] = [b"\xFF", b"\xC3", b"\xED\xA0\x80", b"\xF0\x9F"];

/// Bends inputs. The same seed gives the same mutants.
pub struct Mutator<'a> {
    pub random: Random,
    dictionary: &'a [&'a [u8]],
    numbers: Vec<&'static str>,
    patterns: Vec<u64>,
    pieces: Vec<&'static [u8]>,
    max_len: usize,
}

impl<'a> Mutator<'a> {
    /// `dictionary` holds the words of the format: keywords, keys, magic numbers.
    pub fn new(seed: u64, dictionary: &'a [&'a [u8]], max_len: usize) -> Self {
        Self {
            random: Random(seed),
            dictionary,
            numbers: TEXT_NUMBERS.split(' ').collect(),
            patterns: BINARY_NUMBERS.split(' ').map(|digits| u64::from_str_radix(digits, 16).unwrap()).collect(),
            pieces: TEXT_PIECES.split(' ').map(str::as_bytes).chain(BROKEN_TEXT).collect(),
            max_len,
        }
    }

    /// Returns `input` after one to several mutations; `other` is a second input to take pieces from.
    pub fn mutate(&mut self, input: &[u8], other: &[u8]) -> Vec<u8> {
        let mut bytes = input.to_vec();
        // Mostly a single step, so that what follows it is still read; now and then a heap of them.
        let steps = match self.random.below(8) {
            0..4 => 1,
            4..6 => 2,
            6 => 1 + self.random.below(8),
            _ => 1 + self.random.below(32),
        };
        for _ in 0..steps {
            self.step(&mut bytes, other);
        }
        bytes.truncate(self.max_len);
        bytes
    }

    fn step(&mut self, bytes: &mut Vec<u8>, other: &[u8]) {
        let random = &mut self.random;
        let len = bytes.len();
        match random.below(20) {
            0 => {
                if let Some(byte) = at(random, bytes) {
                    *byte ^= 1 << random.below(8);
                }
            }
            1 => {
                if let Some(byte) = at(random, bytes) {
                    *byte = random.next() as u8;
                }
            }
            2 => bytes.truncate(random.below(len + 1)),
            3 => {
                let range = range(random, len);
                bytes.drain(range);
            }
            4 => {
                let range = range(random, len);
                let copy = bytes[range].to_vec();
                insert(random, bytes, &copy);
            }
            5 => {
                // Repeated often: deep nesting, long lines, large counts.
                let range = range(random, len.min(64));
                let copy = bytes[range].repeat(1 + random.below(200));
                insert(random, bytes, &copy);
            }
            6 => {
                let piece = other[range(random, other.len())].to_vec();
                insert(random, bytes, &piece);
            }
            7 => {
                // The head of one and the tail of another.
                bytes.truncate(random.below(len + 1));
                bytes.extend_from_slice(&other[random.below(other.len() + 1)..]);
            }
            8 => {
                let piece = other[range(random, other.len())].to_vec();
                overwrite(random, bytes, &piece);
            }
            9 | 10 => {
                let width = 1 << random.below(4);
                let number = random.pick(&self.patterns);
                let mut value = number.to_le_bytes();
                if random.chance(4) {
                    value = number.wrapping_neg().to_le_bytes();
                }
                // Fields of binary formats are aligned more often than not.
                let aligned = !random.chance(4);
                let mut start = random.below(len.saturating_sub(width) + 1);
                if aligned {
                    start -= start % width;
                }
                for (to, from) in bytes.iter_mut().skip(start).zip(&value[..width]) {
                    *to = *from;
                }
            }
            11 => {
                let width = [1, 2, 4][random.below(3)];
                let start = random.below(len);
                let change = random.below(33) as i64 - 16;
                if let Some(field) = bytes.get_mut(start..start + width) {
                    let mut value = [0; 8];
                    value[..width].copy_from_slice(field);
                    let moved = i64::from_le_bytes(value).wrapping_add(change).to_le_bytes();
                    field.copy_from_slice(&moved[..width]);
                }
            }
            12 | 13 => {
                let text = random.pick(&self.numbers).as_bytes();
                let numbers = tokens(bytes, |b| b.is_ascii_digit() || b"+-.eE".contains(&b));
                replace(random, bytes, &numbers, text);
            }
            14 => {
                let words = tokens(bytes, |b| !b.is_ascii_whitespace());
                let word = match words.is_empty() {
                    true => Vec::new(),
                    false => bytes[random.pick(&words)].to_vec(),
                };
                replace(random, bytes, &words, &word);
            }
            15 => {
                let lines = tokens(bytes, |b| b != b'\n' && b != b'\r');
                if let (false, true) = (lines.is_empty(), random.chance(2)) {
                    let line = bytes[random.pick(&lines)].to_vec();
                    replace(random, bytes, &lines, &line);
                } else {
                    replace(random, bytes, &lines, b"");
                }
            }
            16 => {
                let piece: &[u8] = random.pick(&self.pieces);
                insert(random, bytes, piece);
            }
            17 => {
                // One kind of byte becomes another everywhere: line ends, separators, brackets.
                if let Some(from) = at(random, bytes).copied() {
                    let to = random.pick(&self.pieces)[0];
                    bytes.iter_mut().filter(|byte| **byte == from).for_each(|byte| *byte = to);
                }
            }
            _ if self.dictionary.is_empty() => {}
            18 => {
                let word: &[u8] = random.pick(self.dictionary);
                insert(random, bytes, word);
            }
            _ => {
                let word: &[u8] = random.pick(self.dictionary);
                let words = tokens(bytes, |b| b.is_ascii_alphanumeric() || b == b'_');
                replace(random, bytes, &words, word);
            }
        }
        bytes.truncate(2 * self.max_len);
    }
}

fn at<'b>(random: &mut Random, bytes: &'b mut [u8]) -> Option<&'b mut u8> {
    let index = random.below(bytes.len());
    bytes.get_mut(index)
}

fn insert(random: &mut Random, bytes: &mut Vec<u8>, piece: &[u8]) {
    let start = random.below(bytes.len() + 1);
    bytes.splice(start..start, piece.iter().copied());
}

fn overwrite(random: &mut Random, bytes: &mut [u8], piece: &[u8]) {
    let start = random.below(bytes.len() + 1);
    for (to, from) in bytes[start..].iter_mut().zip(piece) {
        *to = *from;
    }
}

/// Puts `piece` in place of one of `ranges`.
fn replace(random: &mut Random, bytes: &mut Vec<u8>, ranges: &[std::ops::Range<usize>], piece: &[u8]) {
    if !ranges.is_empty() {
        let range = random.pick(ranges);
        bytes.splice(range, piece.iter().copied());
    }
}

/// The longest runs of bytes that `belongs` accepts.
fn tokens(bytes: &[u8], belongs: impl Fn(u8) -> bool) -> Vec<std::ops::Range<usize>> {
    let mut found = Vec::new();
    let mut start = None;
    for (i, &byte) in bytes.iter().enumerate() {
        match (belongs(byte), start) {
            (true, None) => start = Some(i),
            (false, Some(from)) => {
                found.push(from..i);
                start = None;
            }
            _ => {}
        }
    }
    found.extend(start.map(|from| from..bytes.len()));
    found
}

#[test]
fn the_same_seed_gives_the_same_mutants() {
    let run = |seed| {
        let mut mutator = Mutator::new(seed, &[b"joint"], 1000);
        (0..500).map(|_| mutator.mutate(b"rig 1\njoint 0 -1 0 0 0\n", b"other 2\n")).collect::<Vec<_>>()
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
    let mutants = run(1);
    assert!(mutants.iter().all(|mutant| mutant.len() <= 1000));
    let distinct: std::collections::BTreeSet<_> = mutants.iter().collect();
    assert!(distinct.len() > 400, "{}", distinct.len());
}

#[test]
fn empty_inputs_are_bent_too() {
    let mut mutator = Mutator::new(3, &[], 100);
    let mutants: Vec<Vec<u8>> = (0..5000).map(|_| mutator.mutate(b"", b"")).collect();
    assert!(mutants.iter().all(|mutant| mutant.len() <= 100));
    assert!(mutants.iter().any(|mutant| !mutant.is_empty()), "nothing is ever put in");
}
