//! Files beside a glTF file: each buffer's file is read once, and images are asked for within the limit.

use std::cell::RefCell;

use rigsmith::mesh::gltf::{ExternalError, ExternalFile, ExternalKind, MAX_IMAGE_BYTES, read_gltf};
use serde_json::json;

#[test]
fn buffers_share_a_file_and_images_have_a_limit() {
    let buffers: Vec<_> = (0..200).map(|_| json!({ "uri": "data.bin", "byteLength": 16 })).collect();
    let file = json!({
        "asset": { "version": "2.0" },
        "buffers": buffers,
        "images": [{ "uri": "a.png" }, { "uri": "b.png" }],
    });
    let asked = RefCell::new(Vec::new());
    let mut load = |file: ExternalFile| {
        asked.borrow_mut().push((file.path.to_owned(), file.kind, file.limit));
        match file.kind {
            ExternalKind::Buffer => Ok(vec![0; 16]),
            ExternalKind::Image if file.path == "a.png" => Ok(vec![0; 1000]),
            ExternalKind::Image => Err(ExternalError::new("too large")),
        }
    };
    let model = read_gltf(file.to_string().as_bytes(), "m.gltf", &mut load).unwrap();
    let asked = asked.into_inner();
    assert_eq!(asked.iter().filter(|(path, ..)| path == "data.bin").count(), 1);
    let limits: Vec<u64> =
        asked.iter().filter(|(_, kind, _)| *kind == ExternalKind::Image).map(|(.., limit)| *limit).collect();
    assert_eq!(limits, [MAX_IMAGE_BYTES, MAX_IMAGE_BYTES - 1000]);
    assert!(model.notes.iter().any(|note| note.contains("b.png")), "{:?}", model.notes);
}
