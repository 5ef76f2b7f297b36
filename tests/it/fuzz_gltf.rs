//! Fuzzing of the glTF reader and writer: bent JSON, bent containers, bent bytes. Nothing panics or hangs, what is read keeps
//! the promises of `Model`, and what is read can be written.

use super::{
    gltf::{compose, data},
    mutate::run_fuzz,
    prerequisites::test_data,
    whole::promises,
};
use rigsmith::{
    mesh::gltf::{ExternalError, ExternalFile, GltfError, GltfWriteSettings, memory_limit, read_gltf, write_glb},
    rig::animation::file_clip::motion_of,
};

/// Words that a mutator should try inside JSON.
const WORDS: &str = r#""bufferView":0 "byteOffset":4 "byteStride":4 "byteStride":255 "byteLength":0 "count":0 "count":1 "count":4294967295
"componentType":5120 "componentType":5121 "componentType":5122 "componentType":5123 "componentType":5125 "componentType":5126
"normalized":true "type":"SCALAR" "type":"VEC2" "type":"VEC3" "type":"VEC4" "type":"MAT4" "sparse":{ "mode":5 "mode":6 "mode":0
"children":[0] "children":[1] "children":[2,3] "mesh":0 "mesh":1 "skin":0 "skin":null "joints":[0] "joints":[] "skeleton":9
"matrix":[ "translation":[1e38,0,0] "scale":[0,0,0] "scale":[-1,1,1] "rotation":[0,0,0,0] "weights":[] "targets":[] "targets":[{}]
"extensions":{"KHR_texture_transform":{}} "extensionsRequired":["x"] "interpolation":"CUBICSPLINE" "path":"weights" "path":"scale"
"node":0 "node":1 "index":7 "source":0 "uri":"../x" "uri":"data:;base64,AAAA" "uri":"%FF" "scene":0 "scenes":[] "extras":{} {} [] null true
1e308 -1 1.5 0 2 255 65535 4294967296 9007199254740993 1e-45 -0.0"#;

fn check(bytes: &[u8], bins: &[Vec<u8>]) {
    // JSON refers to the binary part of a seed by number, so that bent JSON still finds bytes.
    let mut load = |ExternalFile { path: uri, .. }: ExternalFile| {
        let missing = || ExternalError::new(format!("there is no {uri}"));
        let number: usize = uri.trim_end_matches(".bin").parse().map_err(|_| missing())?;
        bins.get(number).cloned().ok_or_else(missing)
    };
    match read_gltf(bytes, "fuzz.glb", &mut load) {
        Err(error) => assert!(error.to_string().starts_with("fuzz.glb: "), "{error}"),
        Ok(model) => {
            promises::model(&model);
            for clip in &model.clips {
                // Sampling a clip of hours at every mutation takes too long.
                if clip.channels.iter().flat_map(|channel| &channel.times).any(|time| *time > 60.0) {
                    continue;
                }
                let motion = motion_of(&model, clip);
                assert_eq!(motion.values.len(), motion.frames() * motion.width());
                assert!(motion.values.iter().all(|value| value.is_finite()) && motion.frame_time > 0.0);
            }
            for (all_joints, max_influences) in [(true, 8), (false, 2)] {
                let settings =
                    GltfWriteSettings { all_joints, max_influences, bind_unweighted: true, ..Default::default() };
                match write_glb(&model, &settings) {
                    // Far points may leave the numbers there are on the way to their node.
                    Err(GltfError::Model { .. } | GltfError::Unweighted { .. }) => {}
                    Err(error) => panic!("{error}"),
                    Ok(glb) => {
                        let mut none = |ExternalFile { path: uri, .. }: ExternalFile| {
                            Err(ExternalError::new(format!("{uri} is outside")))
                        };
                        match read_gltf(&glb, "again.glb", &mut none) {
                            Ok(again) => promises::model(&again),
                            Err(GltfError::TooLarge { limit, .. }) => assert_eq!(limit, memory_limit(glb.len() as u64)),
                            Err(error) => panic!("written, but: {error}"),
                        }
                    }
                }
            }
        }
    }
}

/// The JSON and the binary part of a GLB, found by their marks rather than by lengths.
fn pieces(glb: &[u8]) -> Option<(&[u8], &[u8])> {
    let rest = glb.strip_prefix(b"glTF")?.get(16..)?;
    let mark = rest.windows(4).position(|bytes| bytes == b"BIN\0")?;
    Some((&rest[..mark.saturating_sub(4)], &rest[mark + 4..]))
}

#[test]
fn fuzz_gltf() {
    let files = [compose::character(), compose::triangle(), compose::extremes()];
    assert!(files.iter().all(|file| file.read().is_ok()));
    let mut bins: Vec<Vec<u8>> = files.iter().map(|file| file.bin.clone()).collect();
    let mut seeds: Vec<Vec<u8>> = files.iter().enumerate().map(|(i, file)| file.gltf(&format!("{i}.bin"))).collect();
    seeds.extend(files.iter().map(|file| file.glb()));
    for path in test_data().into_iter().flat_map(data::skinned_files) {
        let bytes = std::fs::read(&path).unwrap();
        if bytes.len() > 80_000 {
            continue;
        }
        if let Some((json, bin)) = pieces(&bytes) {
            let json = String::from_utf8(json.to_vec()).unwrap();
            let uri = format!("\"buffers\":[{{\"uri\":\"{}.bin\",", bins.len());
            seeds.push(json.replace("\"buffers\":[{", &uri).into_bytes());
            bins.push(bin.to_vec());
        }
        seeds.push(bytes);
    }
    let words: Vec<&[u8]> = WORDS.split_ascii_whitespace().map(str::as_bytes).collect();
    run_fuzz("gltf", &seeds, &words, |bytes| {
        check(bytes, &bins);
        // Most changes to a GLB break its lengths; with those put right the rest is tried, too.
        if let Some((json, bin)) = pieces(bytes) {
            check(&compose::glb(json, bin), &bins);
        }
    });
}
