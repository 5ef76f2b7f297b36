//! The odd, hard and broken files of other readers' test suites: each loads right, or gets an error that names file and
//! place.

use std::path::{Path, PathBuf};

use rigsmith::mesh::{
    gltf::{ExternalError, ExternalFile, GltfError, GltfWriteSettings, read_gltf, write_glb},
    model::Model,
};
use serde_json::{Value, json};

use crate::prerequisites::test_data;

fn files(folder: &str) -> Vec<PathBuf> {
    let Some(data) = test_data() else { return Vec::new() };
    let mut found = Vec::new();
    collect(&data.join("gltf_torture").join(folder), &mut found);
    found.sort();
    assert!(found.len() > 10, "{found:?}");
    found
}

fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "glb" || extension == "gltf") {
            found.push(path);
        }
    }
}

/// Reads a file; an error must begin with the file's name and say where in it.
fn read(path: &Path) -> Result<Model, String> {
    let folder = path.parent().unwrap();
    let name = path.file_name().unwrap().to_str().unwrap();
    let mut load =
        |ExternalFile { path: uri, .. }: ExternalFile| std::fs::read(folder.join(uri)).map_err(ExternalError::new);
    match read_gltf(&std::fs::read(path).unwrap(), name, &mut load) {
        Ok(model) => Ok(model),
        Err(error) => {
            let place = match &error {
                GltfError::Container { offset, .. } => format!("byte {offset}: "),
                GltfError::Json { line, .. } => format!("line {line}, column "),
                GltfError::Invalid { place, .. } => format!("{place}: "),
                GltfError::External { place, .. } | GltfError::TooLarge { place, .. } => format!("{place}: "),
                GltfError::Extension { .. } => "/extensionsRequired: ".to_owned(),
                other => panic!("{name}: {other}"),
            };
            let text = error.to_string();
            assert!(text.starts_with(&format!("{name}: {place}")), "{text}");
            Err(text)
        }
    }
}

/// Models that were read can be written and read again.
fn check_model(path: &Path, model: &Model) {
    let settings =
        GltfWriteSettings { max_influences: 8, all_joints: true, bind_unweighted: true, ..Default::default() };
    let glb = write_glb(model, &settings).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gltf");
    std::fs::create_dir_all(&folder).unwrap();
    let name = path.file_name().unwrap().to_string_lossy().replace('.', "_");
    std::fs::write(folder.join(format!("torture_{name}.glb")), &glb).unwrap();
    let again = read_gltf(&glb, "again.glb", &mut |_| Err(ExternalError::new("there is nothing outside")));
    let again = again.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert_eq!(again.parts.len(), model.parts.len(), "{}", path.display());
    let corners = |model: &Model| {
        model.point_triangles().into_iter().flatten().map(|point| model.points[point as usize]).collect::<Vec<_>>()
    };
    for (a, b) in corners(model).into_iter().zip(corners(&again)) {
        assert!(a.abs_diff_eq(b, 1e-5 * a.length().max(1.0)), "{}: {a} {b}", path.display());
    }
}

/// Files that the validator calls wrong and that load: what is wrong with them is not used, can be put right without doubt,
/// or is a rule that readers need not care about.
const HARMLESS: &[(&str, &str)] = &[
    // Rules of style: empty lists, names, targets and bounds nobody here reads, alignment of bytes that are read one by one.
    ("EMPTY_ENTITY", "an empty list is as good as none"),
    ("ACCESSOR_NORMALIZED_INVALID", "floats are not normalised, whatever is said"),
    ("ACCESSOR_OFFSET_ALIGNMENT", "bytes are read one by one"),
    ("ACCESSOR_TOTAL_OFFSET_ALIGNMENT", "bytes are read one by one"),
    ("ACCESSOR_MATRIX_ALIGNMENT", "bytes are read one by one"),
    ("MESH_PRIMITIVE_ACCESSOR_UNALIGNED", "bytes are read one by one"),
    ("GLB_CHUNK_LENGTH_UNALIGNED", "bytes are read one by one"),
    ("GLB_UNEXPECTED_BIN_CHUNK", "the chunk is found all the same"),
    ("MESH_PRIMITIVE_ACCESSOR_WITHOUT_BYTESTRIDE", "elements are packed then"),
    ("MESH_PRIMITIVE_INDICES_ACCESSOR_WITH_BYTESTRIDE", "the stride is obeyed"),
    ("BUFFER_VIEW_INVALID_BYTE_STRIDE", "sparse elements are packed, whatever is said"),
    ("BUFFER_VIEW_TARGET_OVERRIDE", "targets are not read"),
    ("MESH_PRIMITIVE_POSITION_ACCESSOR_WITHOUT_BOUNDS", "bounds are not read"),
    ("ACCESSOR_MIN_MISMATCH", "bounds are not read"),
    ("ACCESSOR_MAX_MISMATCH", "bounds are not read"),
    ("ACCESSOR_ELEMENT_OUT_OF_MIN_BOUND", "bounds are not read"),
    ("ACCESSOR_ELEMENT_OUT_OF_MAX_BOUND", "bounds are not read"),
    ("MESH_PRIMITIVE_INVALID_ATTRIBUTE", "unknown attributes are left out, with a note"),
    ("MESH_PRIMITIVE_INDEXED_SEMANTIC_CONTINUITY", "gaps are filled, with a note"),
    ("MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_UNSIGNED_INT", "unknown attributes are left out, with a note"),
    ("MESH_PRIMITIVE_MORPH_TARGET_NO_BASE_ACCESSOR", "displacements of nothing are left out"),
    ("MESH_PRIMITIVE_TOO_FEW_TEXCOORDS", "materials are carried unread"),
    ("UNSATISFIED_DEPENDENCY", "a property without the one it needs is not used"),
    ("NODE_SKIN_WITH_NON_SKINNED_MESH", "read without the skin, with a note"),
    ("NODE_MATRIX_TRS", "the matrix is used, with a note"),
    ("ROTATION_NON_UNIT", "is normalised"),
    ("NODE_LOOP", "see NODE_PARENT_OVERRIDE"),
    ("INVALID_JSON", "a byte order mark is skipped"),
    // In meshes that no node uses, so their data is not read.
    ("ACCESSOR_INVALID_FLOAT", "not used"),
    ("ACCESSOR_NON_CLAMPED", "not used"),
    ("ACCESSOR_INDEX_OOB", "not used"),
    ("ACCESSOR_INDEX_PRIMITIVE_RESTART", "not used"),
    ("ACCESSOR_JOINTS_INDEX_OOB", "not used"),
    ("ACCESSOR_JOINTS_INDEX_DUPLICATE", "not used"),
    ("ACCESSOR_WEIGHTS_NEGATIVE", "not used"),
    ("ACCESSOR_WEIGHTS_NON_NORMALIZED", "not used"),
    ("ACCESSOR_VECTOR3_NON_UNIT", "not used"),
    ("ACCESSOR_INVALID_SIGN", "not used"),
    ("MESH_PRIMITIVE_INDICES_ACCESSOR_INVALID_FORMAT", "not used"),
    ("MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT", "not used"),
    ("MESH_PRIMITIVE_JOINTS_WEIGHTS_MISMATCH", "not used"),
];

/// Many files have meshes but no nodes, so nothing of them is read. With nodes the same must hold.
fn use_meshes(path: &Path) {
    let bytes = std::fs::read(path).unwrap();
    let Ok(mut json) = serde_json::from_slice::<Value>(&bytes) else {
        return;
    };
    let (None, Some(meshes)) = (json.get("nodes"), json.get("meshes").and_then(Value::as_array)) else {
        return;
    };
    json["nodes"] = (0..meshes.len()).map(|mesh| json!({"mesh": mesh})).collect();
    let name = path.file_name().unwrap().to_str().unwrap();
    let mut load = |ExternalFile { path: uri, .. }: ExternalFile| {
        std::fs::read(path.with_file_name(uri)).map_err(ExternalError::new)
    };
    match read_gltf(json.to_string().as_bytes(), name, &mut load) {
        Ok(model) => check_model(path, &model),
        Err(error) => assert!(error.to_string().starts_with(&format!("{name}: /")), "{error}"),
    }
}

#[test]
fn validator_files() {
    let (mut good, mut harmless, mut refused) = (0, 0, 0);
    for path in files("validator") {
        let report: Value =
            serde_json::from_slice(&std::fs::read(format!("{}.report.json", path.display())).unwrap()).unwrap();
        let messages = report["issues"]["messages"].as_array().cloned().unwrap_or_default();
        let errors: Vec<&str> = messages
            .iter()
            .filter(|message| message["severity"] == 0)
            .filter_map(|message| message["code"].as_str())
            .collect();
        match read(&path) {
            Ok(model) => {
                for code in &errors {
                    assert!(
                        HARMLESS.iter().any(|(known, _)| known == code),
                        "{} loads in spite of {code}",
                        path.display()
                    );
                }
                check_model(&path, &model);
                use_meshes(&path);
                *(if errors.is_empty() { &mut good } else { &mut harmless }) += 1;
            }
            Err(error) => {
                assert!(!errors.is_empty(), "valid, but: {error}");
                refused += 1;
            }
        }
    }
    let total = good + harmless + refused;
    println!("{total} files: {good} valid files load, {harmless} others load, {refused} are refused");
    assert!(total == 0 || good >= 20 && refused >= 40, "{good} valid files load, {refused} are refused");
}

#[test]
fn asset_generator_files() {
    for path in files("asset_generator") {
        let model = read(&path).unwrap();
        check_model(&path, &model);
        let lines = ["00", "01", "02", "03", "07", "08", "09", "10"];
        let lines = lines.iter().any(|number| path.ends_with(format!("Mesh_PrimitiveMode_{number}.gltf")));
        let points_or_lines = model.notes.iter().any(|note| note.starts_with("Points or lines"));
        assert_eq!(lines, points_or_lines, "{}: {:?}", path.display(), model.notes);
        assert_eq!(model.parts.is_empty(), points_or_lines, "{}", path.display());
        let skinned = path.to_string_lossy().contains("Animation_Skin_");
        assert_eq!(model.objects.iter().any(|object| object.skin.is_some()), skinned, "{}", path.display());
    }
}

#[test]
fn tinygltf_files() {
    // Each of these must be refused, and why.
    let broken = [
        ("integer-out-of-bounds.gltf", "/bufferViews/0/byteLength: must be a whole number"),
        ("invalid-buffer-index.gltf", "/bufferViews/1/buffer: refers to buffer 1, but there are 1"),
        ("invalid-buffer-view-index.gltf", "/bufferViews/0/buffer: refers to buffer 0, but there are 0"),
        ("invalid-primitive-indices.gltf", "/bufferViews/0/buffer: refers to buffer 0, but there are 0"),
    ];
    for path in files("tinygltf") {
        let name = path.file_name().unwrap().to_str().unwrap();
        match (read(&path), broken.iter().find(|(file, _)| *file == name)) {
            (Ok(model), None) => check_model(&path, &model),
            (Err(error), Some((_, text))) => assert!(error.contains(text), "{error}"),
            (Ok(_), Some(_)) => panic!("{name} loads"),
            (Err(error), None) => panic!("{error}"),
        }
    }
}
