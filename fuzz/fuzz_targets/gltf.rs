//! glTF and GLB: no panic, no hang, and no path that leads out of the folder.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::mesh::gltf::{ExternalError, ExternalFile, read_gltf};

fuzz_target!(|data: &[u8]| {
    let mut external = |ExternalFile { path, .. }: ExternalFile| {
        // Only checked paths may arrive here.
        assert!(!path.starts_with('/') && !path.split('/').any(|part| part == ".."), "{path}");
        Err(ExternalError::new("no files here"))
    };
    let _ = read_gltf(data, "fuzz.gltf", &mut external);
});
