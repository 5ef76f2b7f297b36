//! Materials, textures and vertex looks of OBJ files.

use rigsmith::mesh::obj::{ObjSettings, SidecarFile, library_names, read_model, read_mtl, safe_relative_path};

use crate::obj::{PNG, TRIANGLE, model_with};

#[test]
fn materials_become_those_of_gltf() {
    let obj =
        format!("mtllib sub/looks.mtl\n{TRIANGLE}usemtl skin\nf 1 2 3\nusemtl glass\nf 1 2 3\nusemtl lost\nf 1 2 3\n");
    let mtl = "newmtl glass\nKd 0.1 0.2 0.3\nTr 0.75\nNs 1000\nKe 0 2 4\n\
        newmtl skin\nKd 0 0 0\nmap_Kd -s 2 2 -o 0.5 0 C:\\art\\skin color.png\nmap_Bump -bm 0.5 nrm.jpg\nPr 0.3\nPm 0.6\n";
    let model = model_with(
        &obj,
        &[("sub/looks.mtl", mtl.as_bytes()), ("sub/skin color.png", PNG), ("nrm.jpg", b"\xff\xd8\xff\xe0")],
    );
    let [skin, glass, lost] = &model.material_set.materials[..] else { panic!("{:?}", model.material_set.materials) };
    assert_eq!(skin["name"], "skin");
    let surface = &skin["pbrMetallicRoughness"];
    assert_eq!(surface["baseColorFactor"], serde_json::json!([1.0, 1.0, 1.0, 1.0]));
    assert_eq!(surface["roughnessFactor"], 0.3);
    assert_eq!(surface["metallicFactor"], 0.6);
    let transform = &surface["baseColorTexture"]["extensions"]["KHR_texture_transform"];
    assert_eq!(*transform, serde_json::json!({ "offset": [0.5, -1.0], "scale": [2.0, 2.0] }));
    assert_eq!(skin["normalTexture"]["scale"], 0.5);
    assert_eq!(model.material_set.images.len(), 2);
    assert_eq!(model.material_set.images[0].mime, "image/png");
    assert_eq!(model.material_set.images[1].mime, "image/jpeg");
    assert_eq!(glass["alphaMode"], "BLEND");
    assert_eq!(glass["pbrMetallicRoughness"]["baseColorFactor"], serde_json::json!([0.1, 0.2, 0.3, 0.25]));
    assert_eq!(glass["pbrMetallicRoughness"]["roughnessFactor"], 0.0);
    assert_eq!(glass["emissiveFactor"], serde_json::json!([0.0, 0.5, 1.0]));
    assert_eq!(glass["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 4.0);
    assert_eq!(model.material_set.extensions_used, ["KHR_texture_transform", "KHR_materials_emissive_strength"]);
    assert_eq!(lost["name"], "lost");
    assert!(model.notes.iter().any(|note| note.contains("`lost`")), "{:?}", model.notes);
}

#[test]
fn missing_files_are_notes() {
    let obj = format!("mtllib a.mtl\nmtllib no such.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\n");
    let mtl = "newmtl m\nKd 0.5 0.5 0.5\nmap_Kd ../../secret.png\nmap_Ke picture.tga\n";
    let mut asked = Vec::new();
    let mut sidecar = |path: &str| {
        asked.push(path.to_owned());
        match path {
            "a.mtl" => Some(SidecarFile::Bytes(mtl.into())),
            "picture.tga" => Some(SidecarFile::Bytes(vec![0; 18])),
            _ => None,
        }
    };
    let model = read_model(obj.as_bytes(), "test", &ObjSettings::default(), &mut sidecar).unwrap();
    assert_eq!(model.material_set.materials[0]["pbrMetallicRoughness"]["baseColorFactor"][0], 0.5);
    for wanted in ["`no`", "`such.mtl`", "outside the model's folder", "neither PNG nor JPEG"] {
        assert!(model.notes.iter().any(|note| note.contains(wanted)), "{wanted}: {:?}", model.notes);
    }
    assert!(asked.iter().all(|path| !path.contains("..") && !path.starts_with('/')), "{asked:?}");
    assert!(asked.contains(&"no such.mtl".to_owned()) && asked.contains(&"secret.png".to_owned()), "{asked:?}");
}

#[test]
fn files_that_are_there_and_refused_are_not_told_as_missing() {
    let obj = format!("mtllib large.mtl\nmtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\n");
    let mut sidecar = |path: &str| {
        Some(match path {
            "a.mtl" => SidecarFile::Bytes("newmtl m\nmap_Kd wood.png\n".into()),
            "large.mtl" => SidecarFile::Bytes(vec![b'\n'; (64 << 20) + 1]),
            _ => SidecarFile::Refused("it may not be read".to_owned()),
        })
    };
    let model = read_model(obj.as_bytes(), "test", &ObjSettings::default(), &mut sidecar).unwrap();
    assert!(model.material_set.images.is_empty());
    for wanted in ["`large.mtl` was left out: it is larger than", "`wood.png` was left out: it may not be read"] {
        assert!(model.notes.iter().any(|note| note.contains(wanted)), "{wanted}: {:?}", model.notes);
    }
    assert!(model.notes.iter().all(|note| !note.contains("not found")), "{:?}", model.notes);
}

#[test]
fn libraries_are_named_in_many_ways() {
    for (statement, names) in [
        ("a.mtl", vec!["a.mtl"]),
        ("a b.mtl", vec!["a b.mtl", "a", "b.mtl"]),
        ("a\\ b.mtl  c.mtl", vec!["a\\ b.mtl  c.mtl", "a b.mtl", "c.mtl"]),
        ("\"a b.mtl\"", vec!["a b.mtl", "a", "b.mtl"]),
        ("sub\\a.mtl", vec!["sub\\a.mtl"]),
    ] {
        assert_eq!(library_names(statement), names, "{statement}");
    }
}

#[test]
fn only_paths_below_the_folder_are_safe() {
    for (path, safe) in [
        ("a.png", Some("a.png")),
        ("textures/a b.png", Some("textures/a b.png")),
        ("textures\\a.png", Some("textures/a.png")),
        ("./a/../b.png", Some("b.png")),
        ("a//b.png", Some("a/b.png")),
        ("", None),
        (".", None),
        ("..", None),
        ("../a.png", None),
        ("a/../../b.png", None),
        ("/etc/passwd", None),
        ("\\\\server\\a.png", None),
        ("C:\\a.png", None),
        ("c:a.png", None),
        ("file:///etc/passwd", None),
        ("http://example.org/a.png", None),
        ("a\0.png", None),
    ] {
        assert_eq!(safe_relative_path(path).as_deref(), safe, "{path:?}");
    }
}

#[test]
fn materials_are_read_whatever_their_options() {
    let text = "\u{feff}# head\r\nKd 9 9 9\r\nnewmtl  two words \r\n\tKd .5\r\nmap_Kd -blendu on -mm 0 1 -clamp on -o 1 -s 1 2 3 my file.png -bm 3\r\n\
        d 0.5\r\nTr 0.9\r\nnorm n.png\r\nbump b.png\r\nPr nonsense\r\nKe spectral x.rfl\r\nnewmtl b\r\nTr 0.25\r\nmap_d -imfchan m 4 5.png\r\n\
        map_Ke\r\nbump -bm 2 -o 1 7";
    let materials = read_mtl(text.as_bytes());
    let [a, b] = &materials[..] else { panic!("{materials:?}") };
    assert_eq!(a.name, "two words");
    assert_eq!(a.diffuse, Some([0.5; 3]));
    let map = a.diffuse_map.as_ref().unwrap();
    assert_eq!((map.path.as_str(), map.clamp, map.strength), ("my file.png", true, 3.0));
    assert_eq!((map.offset, map.scale), ([1.0, 0.0], [1.0, 2.0]));
    assert_eq!(a.opacity, Some(0.5));
    assert_eq!(a.normal_map.as_ref().unwrap().path, "n.png");
    assert_eq!((a.roughness, a.emissive), (None, None));
    assert_eq!(b.opacity, Some(0.75));
    assert_eq!(b.opacity_map.as_ref().unwrap().path, "4 5.png");
    assert_eq!(b.emissive_map, None);
    let bump = b.normal_map.as_ref().unwrap();
    assert_eq!((bump.path.as_str(), bump.strength, bump.offset), ("7", 2.0, [1.0, 0.0]));
}
