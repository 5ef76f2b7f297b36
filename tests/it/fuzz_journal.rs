//! Fuzzing of the journal's reader, behind its checksums and before them: no panic, no hang.

use rigsmith::{
    files::journal::{Ending, file_hash, recover},
    rig::step::replay,
};

use crate::mutate::run_fuzz;

const JOURNAL: &[u8] = include_bytes!("../frozen/format-1.journal");
/// Magic, format, session.
const PRELUDE: usize = 20;

/// The frames of a sound journal: kind and payload.
fn frames(mut bytes: &[u8]) -> Vec<(u8, Vec<u8>)> {
    let mut frames = Vec::new();
    bytes = &bytes[PRELUDE..];
    while !bytes.is_empty() {
        let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
        frames.push((bytes[4], bytes[13..13 + length].to_vec()));
        bytes = &bytes[13 + length + 8..];
    }
    frames
}

/// A journal of these frames, with checksums that fit.
fn journal(frames: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut out = JOURNAL[..PRELUDE].to_vec();
    let session = u64::from_le_bytes(JOURNAL[12..20].try_into().unwrap());
    for (number, (kind, payload)) in frames.iter().enumerate() {
        let start = out.len();
        out.extend((payload.len() as u32).to_le_bytes());
        out.push(*kind);
        out.extend((number as u64).to_le_bytes());
        out.extend(payload);
        out.extend((file_hash(&out[start..]) ^ session).to_le_bytes());
    }
    out
}

fn check(bytes: &[u8]) {
    let Ok(recovered) = recover(bytes) else { return };
    let base = recovered.base().cloned().unwrap_or_default();
    let back = replay(base, recovered.changes(), 0);
    assert!(back.applied <= recovered.changes().len());
    assert_eq!(back.refused.is_none(), back.applied == recovered.changes().len());
    let restored = recovered.restore(recovered.basis(|_| None), None);
    assert!(restored.replayed.applied + restored.skipped.len() <= recovered.changes().len());
}

#[test]
fn no_bytes_break_the_reader() {
    let frames = frames(JOURNAL);
    assert_eq!(journal(&frames), JOURNAL, "the format as it is described");
    assert_eq!(recover(JOURNAL).unwrap().ending, Ending::Open);
    // What is mutated is a list of frames: kind, two bytes of length, payload; small ones, so that there are many.
    let mut seeds: Vec<Vec<u8>> = Vec::new();
    for group in frames.chunks(6) {
        let seed: Vec<u8> = group
            .iter()
            .filter(|(_, payload)| payload.len() < 3000)
            .flat_map(|(kind, payload)| [&[*kind][..], &(payload.len() as u16).to_le_bytes(), payload].concat())
            .collect();
        seeds.push(seed);
    }
    let small_skin = [&7u64.to_le_bytes()[..], &[1, 1, 2, 2, 9, 0, 0, 0, 0, 0, 0, 0, 3, 0, 3, 0]].concat();
    seeds.push([&[8, small_skin.len() as u8, 0][..], &small_skin].concat());
    let dictionary: &[&[u8]] = &[
        b"Edit(",
        b"Skin(",
        b"Batch([",
        b"Batch([Batch([",
        b"SetRest(",
        b"forward:[",
        b"backward:[",
        b"None",
        b"Some(",
        b"18446744073709551615",
        b"Project(path:\"",
        b"NaN",
        b"inf",
    ];
    let head = &frames[..1];
    run_fuzz("journal", &seeds, dictionary, |mut bytes| {
        check(bytes);
        let mut list = head.to_vec();
        while let [kind, low, high, rest @ ..] = bytes {
            let length = usize::from(u16::from_le_bytes([*low, *high])).min(rest.len());
            list.push((*kind, rest[..length].to_vec()));
            bytes = &rest[length..];
        }
        check(&journal(&list));
    });
}
