//! Odd, hard and broken OBJ files from the test suites of other readers, below `RIGSMITH_DATA`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use rigsmith::mesh::{
    model::Model,
    obj::{ObjError, ObjSettings, SidecarFile, read_model, write_obj},
};

use crate::prerequisites::test_data;

fn read(path: &Path) -> Result<Model, ObjError> {
    let folder = path.parent().unwrap();
    let mut sidecar = |relative: &str| fs::read(folder.join(relative)).ok().map(SidecarFile::Bytes);
    let name = path.file_stem().unwrap().to_string_lossy();
    read_model(fs::File::open(path).unwrap(), &name, &ObjSettings::default(), &mut sidecar)
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|extension| extension == "obj") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Files that must be refused, and the line to name; 0 for none.
const BROKEN: &[(&str, u64)] = &[
    ("assimp_invalid/empty.obj", 0),
    ("assimp_invalid/malformed.obj", 28),
    ("assimp_invalid/malformed2.obj", 23),
    ("tinyobjloader/invalid-face-definition.obj", 15),
    ("tinyobjloader/invalid-relative-texture-index.obj", 2),
    ("tinyobjloader/invalid-relative-vertex-index.obj", 1),
    ("tinyobjloader/issue-140-zero-face-idx.obj", 16),
    ("tinyobjloader/issue-356-leading-spaces-newmtl.obj", 0),
    ("tinyobjloader/test-nan.obj", 12),
    ("tobj/invalid_index.obj", 12),
];

#[test]
fn every_file_loads_or_names_its_fault() {
    let Some(data) = test_data() else { return };
    let folder = data.join("obj_torture");
    let mut loaded = 0;
    for path in files(&folder) {
        let name = path.strip_prefix(&folder).unwrap().to_string_lossy().replace('\\', "/");
        let broken = BROKEN.iter().find(|(broken, _)| *broken == name);
        match (read(&path), broken) {
            (Err(ObjError::Line { line, problem }), Some((_, wanted))) => {
                assert_eq!(line, *wanted, "{name}: {problem}");
            }
            (Err(ObjError::NoGeometry), Some((_, 0))) => {}
            (Ok(model), None) => {
                loaded += 1;
                check_model(&name, &model);
            }
            (result, _) => panic!("{name}: {:?}", result.map(|model| model.notes)),
        }
    }
    assert!(loaded >= 45, "only {loaded} files in {}", folder.display());
}

fn check_model(name: &str, model: &Model) {
    assert!(model.points.iter().all(|point| point.is_finite()), "{name}");
    for part in &model.parts {
        assert!(part.vertices.iter().all(|point| (*point as usize) < model.points.len()), "{name}");
        assert!(part.triangles.iter().flatten().all(|vertex| (*vertex as usize) < part.vertices.len()), "{name}");
        assert!(part.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5), "{name}");
        assert!(!part.triangles.is_empty(), "{name}");
    }
    let mut library = None;
    let mut companion = |plain: &str, bytes| {
        library = Some(bytes).filter(|_| plain == "again.mtl").or(library.take());
        plain.to_owned()
    };
    let written = write_obj(model, "again", &mut companion);
    let mut sidecar = |path: &str| library.clone().filter(|_| path == "again.mtl").map(SidecarFile::Bytes);
    let again = read_model(&written[..], name, &ObjSettings::default(), &mut sidecar).unwrap();
    assert_eq!(again.points, model.points, "{name}");
    assert!(again.parts == model.parts, "{name} changed on writing");
}

#[test]
fn files_say_what_they_should() {
    let Some(data) = test_data() else { return };
    // File, points, triangles, objects, materials.
    for (name, points, triangles, objects, materials) in [
        ("tinyobjloader/cube.obj", 8, 12, 6, 3),
        ("tinyobjloader/cornell_box.obj", 76, 36, 8, 4),
        ("tinyobjloader/issue-235-usemtl-then-o.obj", 8, 2, 2, 2),
        ("tinyobjloader/issue-295-trianguation-failure.obj", 16, 28, 1, 0),
        ("tinyobjloader/issue-319-002.obj", 20, 14, 1, 0),
        ("tinyobjloader/issue-319-003.obj", 10, 8, 1, 0),
        ("tinyobjloader/points-prim.obj", 8, 0, 0, 0),
        ("tinyobjloader/cube-vertex-w-component.obj", 8, 12, 6, 3),
        ("tobj/lines.obj", 3, 0, 0, 0),
        ("rapidobj/teapot/teapot.obj", 3241, 6320, 1, 0),
    ] {
        let model = read(&data.join("obj_torture").join(name)).unwrap();
        let count: usize = model.parts.iter().map(|part| part.triangles.len()).sum();
        let found = (model.points.len(), count, model.objects.len(), model.material_set.materials.len());
        assert_eq!(found, (points, triangles, objects, materials), "{name}");
    }
}

#[test]
fn materials_are_found_where_they_are() {
    let Some(data) = test_data() else { return };
    for (name, material, color) in [
        ("tinyobjloader/mtl filename with whitespace issue46.obj", "green", [0.0, 1.0, 0.0]),
        ("tinyobjloader/issue-246-usemtl-whitespace.obj", "1", [1.0, 1.0, 1.0]),
        ("tinyobjloader/pbr-mat-ext.obj", "pbr", [1.0, 1.0, 1.0]),
        ("tinyobjloader/mtllib-multiple-files-issue-112.obj", "default", [0.0, 0.0, 0.0]),
    ] {
        let model = read(&data.join("obj_torture").join(name)).unwrap();
        let found = &model.material_set.materials[0];
        assert_eq!(found["name"], material, "{name}");
        for (at, wanted) in color.iter().enumerate() {
            assert_eq!(found["pbrMetallicRoughness"]["baseColorFactor"][at], *wanted, "{name}");
        }
    }
}

#[test]
fn bodies_and_heads_load_whole() {
    let Some(data) = test_data() else { return };
    for (name, points, objects) in [
        ("bodies/male_young/body.obj", 13_380, 1),
        ("bodies/female_young/full.obj", 0, 6),
        ("heads/ict_neutral.obj", 11_248, 1),
    ] {
        let model = read(&data.join(name)).unwrap();
        assert!(points == 0 || model.points.len() == points, "{name}: {} points", model.points.len());
        assert_eq!(model.objects.len(), objects, "{name}");
        check_model(name, &model);
    }
}
