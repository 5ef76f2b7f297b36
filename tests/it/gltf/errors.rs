//! Faults of a file are said with the file's name and the place, before anything is built on it.

use super::compose::{ComposedDocument, character, glb, read, triangle};
use rigsmith::mesh::gltf::{ExternalError, ExternalFile, MAX_IMAGE_BYTES, memory_limit, read_gltf};
use serde_json::{Value, json};

fn error(bytes: &[u8]) -> String {
    match read(bytes) {
        Ok(model) => panic!("read as {model:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn fields() {
    let set = |file: &mut ComposedDocument, place: &str, value: Value| {
        let (parent, key) = place.rsplit_once('/').unwrap();
        let parent = file.json.pointer_mut(parent).unwrap();
        match parent {
            Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
            parent => parent[key] = value,
        }
    };
    // The character with one field changed: the error's place and a part of its text.
    let check = |place: &str, value: Value, at: &str, text: &str| {
        let mut file = character();
        set(&mut file, place, value.clone());
        let error = error(&file.glb());
        assert!(error.starts_with(&format!("folder/test.glb: {at}: ")), "{place} = {value}: {error}");
        assert!(error.contains(text), "{place} = {value}: {error}");
    };
    check("/asset/version", json!("1.0"), "/asset/version", "only 2.0");
    check("/asset/minVersion", json!("2.1"), "/asset/version", "only 2.0");
    check("/asset", json!(3), "/asset", "must be an object");
    check("/nodes", json!({}), "/nodes", "must be an array");
    check("/accessors/0/bufferView", json!(99), "/accessors/0/bufferView", "refers to buffer view 99, but there are");
    check("/accessors/0/bufferView", json!(-1), "/accessors/0/bufferView", "whole number");
    check("/accessors/0/count", json!(5), "/accessors/0/byteOffset", "reach beyond buffer view 0");
    check("/accessors/0/count", json!(1e300), "/accessors/0/count", "whole number");
    check("/accessors/0/count", json!(9007199254740992_u64), "/accessors/0/byteOffset", "reach beyond");
    check("/accessors/0/byteOffset", json!(4), "/accessors/0/byteOffset", "reach beyond");
    check("/accessors/0/type", json!("VEC2"), "/accessors/0/type", "has 2 components");
    check("/accessors/0/type", json!("VEC9"), "/accessors/0/type", "has 0 components");
    check("/accessors/0/componentType", json!(5124), "/accessors/0/componentType", "not a component type");
    check("/bufferViews/0/byteStride", json!(8), "/accessors/0/byteOffset", "elements of 12 bytes every 8");
    check("/bufferViews/0/byteStride", json!(0), "/bufferViews/0/byteStride", "from 4 to 252");
    check("/bufferViews/0/byteLength", json!(1_u64 << 40), "/bufferViews/0/byteLength", "but buffer 0 has");
    check("/bufferViews/0/byteOffset", json!(u64::MAX), "/bufferViews/0/byteLength", "but buffer 0 has");
    check("/bufferViews/0/buffer", json!(1), "/bufferViews/0/buffer", "refers to buffer 1");
    check("/meshes/0/primitives/0/indices", json!(77), "/meshes/0/primitives/0/indices", "refers to accessor 77");
    check("/meshes/0/primitives/0/indices", json!(0), "/accessors/0/componentType", "unsigned");
    check("/meshes/0/primitives/0/material", json!(2), "/meshes/0/primitives/0/material", "refers to material 2");
    check("/meshes/0/primitives/0/mode", json!(7), "/meshes/0/primitives/0/mode", "at most 6");
    check(
        "/meshes/0/primitives/0/attributes/NORMAL",
        json!(8),
        "/meshes/0/primitives/0/attributes/NORMAL",
        "6 elements",
    );
    check("/meshes/0/primitives/0/attributes/JOINTS_0", json!(0), "/accessors/0/componentType", "unsigned");
    check(
        "/meshes/0/primitives/0/targets/1/POSITION",
        json!(8),
        "/meshes/0/primitives/0/targets/1/POSITION",
        "vertices",
    );
    check("/meshes/0/weights", json!([1.0]), "/meshes/0/weights", "1 weights for 2");
    check("/nodes/4/weights", json!([1.0]), "/nodes/4/weights", "1 weights for 2");
    check("/nodes/4/skin", json!(1), "/nodes/4/skin", "refers to skin 1");
    check("/nodes/4/mesh", json!(2), "/nodes/4/mesh", "refers to mesh 2");
    check("/nodes/3/children", json!([1]), "/nodes/3/children/0", "already a child of node 0");
    check("/nodes/3/children", json!([0]), "/nodes/0", "its own ancestor");
    check("/nodes/3/children", json!([3]), "/nodes/3/children/0", "already a child of node 2");
    check("/nodes/3/children", json!([40]), "/nodes/3/children/0", "refers to node 40");
    check("/nodes/3/translation", json!([1.0, 2.0]), "/nodes/3/translation", "must have 3 numbers, has 2");
    check("/nodes/3/translation", json!([1.0, 2.0, 1e39]), "/nodes/3/translation/2", "finite");
    check("/nodes/3/rotation", json!([0, 0, 0, 0]), "/nodes/3/rotation", "is zero");
    check("/nodes/3/matrix", vec![1.0; 16].into(), "/nodes/3/matrix", "last row");
    check("/nodes/0/scale", json!([2e38, 2e38, 2e38]), "/nodes/3", "not finite");
    check("/skins/0/joints/1", json!(2), "/skins/0/joints", "node 2 is listed twice");
    check("/skins/0/joints/1", json!(70), "/skins/0/joints/1", "refers to node 70");
    check("/skins/0/inverseBindMatrices", json!(0), "/accessors/0/type", "has 3 components");
    check("/skins/0/joints", json!([2]), "/meshes/0/primitives/0", "refers to joint 1, but the skin has 1");
    check("/scene", json!(1), "/scene", "refers to scene 1");
    check("/scenes/0/nodes/0", json!(11), "/scenes/0/nodes/0", "refers to node 11");
    check("/textures/0/source", json!(1), "/textures/0/source", "refers to image 1");
    check("/textures/0/sampler", json!(1), "/textures/0/sampler", "refers to sampler 1");
    let texture = "/materials/0/pbrMetallicRoughness/baseColorTexture";
    check(&format!("{texture}/index"), json!(1), &format!("{texture}/index"), "refers to texture 1");
    check("/images/0/bufferView", json!(99), "/images/0/bufferView", "refers to buffer view 99");
    check("/animations/0/channels/0/sampler", json!(4), "/animations/0/channels/0/sampler", "refers to sampler 4");
    check("/animations/0/channels/0/target/node", json!(9), "/animations/0/channels/0/target/node", "refers to node 9");
    check("/animations/0/samplers/0/output", json!(2), "/accessors/2/type", "has 4 components");
    check(
        "/animations/0/samplers/0/output",
        json!(0),
        "/animations/0/channels/0",
        "3 times need 3 values each, there are 12",
    );
    check("/animations/0/samplers/0/input", json!(8), "/animations/0/channels/0", "must be floats");
    check(
        "/extensionsRequired",
        json!(["KHR_draco_mesh_compression"]),
        "/extensionsRequired",
        "KHR_draco_mesh_compression",
    );
    check("/extensionsRequired", json!(["EXT_meshopt_compression"]), "/extensionsRequired", "EXT_meshopt_compression");
}

#[test]
fn compressed_geometry() {
    let mut file = triangle();
    let draco = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
    file.json["meshes"][0]["primitives"][0]["extensions"] = draco;
    // Plain geometry beside it is as good.
    assert_eq!(file.read().unwrap().points.len(), 3);
    file.json["accessors"][0].as_object_mut().unwrap().shift_remove("bufferView");
    assert!(error(&file.glb()).contains("needs the extension KHR_draco_mesh_compression"));
}

#[test]
fn missing_fields() {
    let check = |place: &str, text: &str| {
        let mut file = character();
        let (parent, key) = place.rsplit_once('/').unwrap();
        file.json.pointer_mut(parent).unwrap().as_object_mut().unwrap().shift_remove(key).unwrap();
        assert_eq!(error(&file.glb()), format!("folder/test.glb: {text}"), "without {place}");
    };
    check("/asset", ": \"asset\" is missing");
    check("/accessors/0/count", "/accessors/0: \"count\" is missing");
    check("/accessors/0/componentType", "/accessors/0: \"componentType\" is missing");
    check("/accessors/0/type", "/accessors/0: \"type\" is missing");
    check("/bufferViews/0/buffer", "/bufferViews/0: \"buffer\" is missing");
    check("/bufferViews/0/byteLength", "/bufferViews/0: \"byteLength\" is missing");
    check("/meshes/0/primitives", "/meshes/0: \"primitives\" is missing");
    check("/meshes/0/primitives/0/attributes", "/meshes/0/primitives/0: \"attributes\" is missing");
    let weights = "/meshes/0/primitives/0/attributes: JOINTS_0 and WEIGHTS_0 must both be there";
    check("/meshes/0/primitives/0/attributes/WEIGHTS_0", weights);
    check("/meshes/0/primitives/0/targets", "/meshes/0/weights: 2 weights for 0 morph targets");
    check("/skins/0/joints", "/skins/0: \"joints\" is missing");
    check("/animations/0/samplers/0/input", "/animations/0/samplers/0: \"input\" is missing");
    check("/animations/0/channels/0/target/path", "/animations/0/channels/0/target: \"path\" is missing");
    check("/images/0/bufferView", "/images/0: an image needs a uri or a bufferView");
}

#[test]
fn values_in_buffers() {
    let check = |floats: &[f32], text: &str| {
        let mut file = triangle();
        file.bin.clear();
        file.bin.extend(floats.iter().flat_map(|value| value.to_le_bytes()));
        assert_eq!(error(&file.glb()), format!("folder/test.glb: {text}"));
    };
    check(&[0.0, 0.0, 0.0, f32::NAN, 0.0, 0.0, 0.0, 0.0, 0.0], "/accessors/0: position 1 is not finite");
    check(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f32::INFINITY], "/accessors/0: position 2 is not finite");
    let mut file = triangle();
    let indices = file.bytes(&[0, 1, 3], "SCALAR");
    file.json["meshes"][0]["primitives"][0]["indices"] = indices.into();
    let text = "folder/test.glb: /meshes/0/primitives/0/indices: index 2 is 3, but there are 3 vertices";
    assert_eq!(error(&file.glb()), text);
    file.json["buffers"] = json!([{"byteLength": file.bin.len() + 8}]);
    assert!(error(&file.glb()).contains("/buffers/0/byteLength: says 47 bytes, but has 40"));
}

#[test]
fn uris() {
    let check = |uri: &str, text: &str| {
        let file = triangle();
        let error =
            read_gltf(&file.gltf(uri), "m.gltf", &mut |file| panic!("{file} was opened")).unwrap_err().to_string();
        assert!(error.starts_with("m.gltf: /buffers/0/uri: ") && error.contains(text), "{uri}: {error}");
    };
    check("file:///etc/passwd", "scheme or a drive");
    check("http://localhost/a.bin", "scheme or a drive");
    check("HTTPS://localhost/a.bin", "scheme or a drive");
    check("c:/a.bin", "scheme or a drive");
    check("c%3A/a.bin", "scheme or a drive");
    check("/etc/passwd", "absolute");
    check("//host/a.bin", "absolute");
    check("%2Fetc/passwd", "absolute");
    check("\\\\host\\a.bin", "absolute");
    check("a\\..\\..\\b.bin", "backslash");
    check("../a.bin", "leads out");
    check("b/../../a.bin", "leads out");
    check("%2e%2e/a.bin", "leads out");
    check("%2e%2e%2fa.bin", "leads out");
    check("b/%2E./../a.bin", "leads out");
    check("a%00.bin", "control character");
    check("%FF.bin", "not UTF-8");
    check("%4", "two hexadecimal digits");
    check("%zz", "two hexadecimal digits");
    check("%+1", "two hexadecimal digits");
    check("", "names no file");
    check("a/", "names no file");
    check("data:application/octet-stream;base64", "without a comma");
    check("data:;base64,AAA=A", "damaged");
    check("data:;base64,A", "damaged");
    check("data:;base64,A$AA", "damaged");

    let check = |uri: &str, path: &str| {
        let file = triangle();
        let mut load = |ExternalFile { path: asked, .. }: ExternalFile| {
            if asked == path { Ok(file.bin.clone()) } else { Err(ExternalError::new(format!("{asked} was opened"))) }
        };
        let model = read_gltf(&file.gltf(uri), "m.gltf", &mut load);
        assert!(model.is_ok(), "{uri}: {model:?}");
    };
    check("a.bin", "a.bin");
    check("./b/./a%20b.bin", "b/a b.bin");
    check("a b%2fc.bin", "a b/c.bin");
    check("..a/b...bin", "..a/b...bin");
    // A triangle's 36 bytes in the URI itself.
    let zeros = "A".repeat(48);
    for uri in [
        format!("data:application/octet-stream;base64,{zeros}"),
        format!("DATA:;base64,{zeros}=="),
        format!("data:,{}", "%00".repeat(36)),
    ] {
        assert!(read(&triangle().gltf(&uri)).is_ok() != uri.ends_with('='), "{uri}");
    }
}

#[test]
fn containers() {
    let whole = triangle().glb();
    let check = |bytes: &[u8], text: &str| {
        let error = error(bytes);
        assert!(error.starts_with("folder/test.glb: ") && error.contains(text), "{error}");
    };
    let with = |at: usize, value: u32| {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    check(b"", "the file is empty");
    check(b"hello", "byte 0: neither a GLB");
    check(b"   ", "neither a GLB");
    check(b"glTF", "ends inside the 12-byte GLB header");
    check(&whole[..11], "ends inside the 12-byte GLB header");
    check(&whole[..whole.len() - 1], "byte 8: the header says");
    check(&with(4, 1), "byte 4: GLB version 1");
    check(&with(8, u32::MAX), "4294967295 bytes, the file has");
    check(&with(8, 12), "no JSON chunk");
    check(&with(8, 15), "byte 12: the file ends inside a chunk header");
    check(&with(12, u32::MAX), "byte 12: a chunk of 4294967295 bytes");
    check(&with(12, 0), "the JSON chunk is empty");
    check(&with(16, 7), "the first chunk is not the JSON chunk");
    check(&glb(b"{\"asset\":}", b""), "line 1, column 10 of the JSON");
    check(&glb(b"[]", b""), "/: the JSON is not an object");
    check(b"{\"asset\": {\"version\": \"2.0\"}, \"nodes\": [1e999]}", "line 1");
    check(&[b"{\"a\":".repeat(1000), b"1".to_vec()].concat(), "recursion limit");
    for end in 0..whole.len() {
        assert!(read(&whole[..end]).is_err());
    }
}

#[test]
fn memory() {
    // A small file that asks for much: elements without bytes, and JSON that is much larger in memory.
    let mut file = triangle();
    file.json["accessors"][0].as_object_mut().unwrap().shift_remove("bufferView");
    file.json["accessors"][0]["count"] = (1_u64 << 40).into();
    let text = format!("/accessors/0: takes more than the {} bytes of memory", memory_limit(file.glb().len() as u64));
    assert!(error(&file.glb()).contains(&text), "{}", error(&file.glb()));

    let text = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"extras\":[{}0]}}", "0,".repeat(2 << 20));
    assert!(error(text.as_bytes()).contains("takes more than"));
    let text = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"extras\":[{}0]}}", "{\"\":[]},".repeat(1 << 19));
    assert!(error(text.as_bytes()).contains("takes more than"));

    // Many instances of a large mesh.
    let mut file = ComposedDocument::new();
    let position = file.floats(&vec![0.5; 30_000], "VEC3");
    file.push("meshes", json!({"primitives": [{"attributes": {"POSITION": position}}]}));
    for _ in 0..2000 {
        file.root(json!({"mesh": 0}));
    }
    assert!(error(&file.glb()).contains("takes more than"));

    // The same picture, over and over.
    let mut file = triangle();
    let view = file.view(&vec![0; 1 << 20]);
    let count = (MAX_IMAGE_BYTES >> 20) + 1;
    for _ in 0..count {
        file.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
    }
    assert!(error(&file.glb()).contains(&format!("/images/{}: the images have more than 256 MiB", count - 1)));
}

#[test]
fn deep_hierarchies() {
    // Deeper than any stack: a chain of nodes, all of them joints.
    let count = 50_000;
    let mut file = triangle();
    let first = file.json["nodes"].as_array().unwrap().len();
    let chain = |i: usize| if i + 1 < count { json!({"children": [first + i + 1]}) } else { json!({}) };
    for i in 0..count {
        file.push("nodes", chain(i));
    }
    file.push("skins", json!({"joints": (first..first + count).collect::<Vec<_>>()}));
    let model = file.read().unwrap();
    assert_eq!(model.nodes.len(), count);
    assert_eq!(model.nodes[count - 1].parent, Some(count - 2));
}

/// Nodes as programs write them take less memory than their file allows, whatever their number.
#[test]
fn long_lists_of_nodes_are_within_the_memory_of_their_file() {
    let count = 120_000;
    let mut file = triangle();
    let first = file.json["nodes"].as_array().unwrap().len();
    for i in 0..count {
        let mut node = json!({"name": format!("joint_{i:06}"), "translation": [0.0, 0.125, 0.0]});
        if i + 1 < count {
            node["children"] = json!([first + i + 1]);
        }
        file.push("nodes", node);
    }
    file.push("skins", json!({"joints": (first..first + count).collect::<Vec<_>>()}));
    let model = file.read().unwrap();
    assert_eq!(model.nodes.len(), count);
    assert_eq!(model.nodes[count - 1].name, "joint_119999");
}

/// The last of several fields with one key counts, as in other readers of JSON.
#[test]
fn repeated_keys_count_once() {
    let more: String = (0..40).map(|number| format!("\"x{number}\":{number},")).collect();
    for (before, after) in [("", ""), (&*more, ""), ("", &*more)] {
        let text = format!(
            "{{\"asset\":{{\"version\":\"9\",\"version\":\"2.0\"}},{before}\"nodes\":[{{\"name\":\"first\"}}],\"skins\":[{{\
             \"joints\":[0]}}],{after}\"nodes\":[{{\"name\":\"second\"}}],\"nodes\":[{{\"na\\u006de\":\"l\\u0061st\",\
             \"extras\":{{\"b\":1,\"a\":-2,\"b\":2.5}}}}]}}"
        );
        let model = read(text.as_bytes()).unwrap();
        assert_eq!(model.nodes.len(), 1);
        assert_eq!(model.nodes[0].name, "last");
        assert_eq!(serde_json::to_string(&model.nodes[0].extras).unwrap(), "{\"b\":2.5,\"a\":-2}");
    }
}
