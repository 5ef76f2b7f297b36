//! Fuzzing of the OBJ reader: reading changed files never panics or hangs, and what loads holds together.

use std::{cell::Cell, fs, path::PathBuf};

use rigsmith::mesh::{
    model::Model,
    obj::{ObjArrays, ObjError, ObjSettings, SidecarFile, read_mtl, read_obj, to_model, write_obj},
};

use crate::{mutate::run_fuzz, prerequisites::test_data};

const SEEDS: &[&str] = &[
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/1/1 4/2/1\n",
    "o a\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0\nusemtl m\ns 1\nf -3 -2 -1\ng b c\ns off\nf 1//1 2//1 3//1\nvn 0 0 0\n",
    "mtllib a.mtl b\\ c.mtl\r\nv 1e5 -2.5e-3 .5\r\nv 0 \\\r\n1 0\r\nv 0 0 1\r\nf 1 2 3 \\\r\n1 2\r\nl 1 2\r\np 1\r\n",
    "\u{feff}# comment \\\rv 1 2 3\rv 3 2 1\rv 0 0 9 1\rf 1 2 3\rs 2\rf 3 2 1\rvt 0.5\rvw 1\rcstype bezier\r",
    "v 0 0 0\nv 3 0 0\nv 3 3 0\nv 1 1 0\nv 1 3 0\nv 0 3 0\nv 0 0 0\nv 2 2 2\nf 1 2 3 4 5 6\nf 6 5 4 3 2 1 7 8\nf 1 2 3 4\n",
    "newmtl m\nKd 1 0 0\nd 0.5\nmap_Kd -s 1 2 -o 3 a b.png -bm 2\nnorm -bm 1 n.png\nKe 1 2 3\nPr 1\nPm 0\n",
];

/// Pieces of OBJ and MTL that stumble readers.
const WORDS: &[&[u8]] = &[
    b"\\\n",
    b"//",
    b"1.#IND",
    b"v ",
    b"vt ",
    b"vn ",
    b"f ",
    b"o ",
    b"g ",
    b"s off",
    b"s 1",
    b"usemtl ",
    b"mtllib ",
    b"newmtl ",
    b"map_Kd ",
    b"f 1 2 3 4 5\n",
    b"v 1e30 -1e30 0\n",
    b"f -1 -2 -3\n",
];

/// Reads `bytes` in every way and checks what comes of it. Returns whether they were read.
fn check(bytes: &[u8]) -> bool {
    let mut whole = ObjArrays::default();
    let result = read_obj(bytes, &mut whole, &ObjSettings::default());
    for (threads, block_bytes) in [(1, 16), (2, 50)] {
        let mut blocks = ObjArrays::default();
        let again = read_obj(bytes, &mut blocks, &ObjSettings { threads, block_bytes });
        assert_eq!(again.as_ref().map_err(ObjError::to_string), result.as_ref().map_err(ObjError::to_string));
        assert!(blocks == whole, "blocks of {block_bytes} bytes change the arrays");
    }
    let is_read = result.is_ok();
    match result {
        Err(ObjError::Line { line, .. }) => {
            let ends = bytes.iter().filter(|byte| matches!(byte, b'\n' | b'\r')).count();
            assert!((1..=ends as u64 + 1).contains(&line), "line {line} of {}", ends + 1);
        }
        Err(error) => panic!("{error}"),
        Ok(()) => {
            assert!(whole.is_consistent());
            let model = to_model(&whole, "fuzz", &mut |path| {
                path.ends_with(".mtl").then(|| SidecarFile::Bytes(bytes.to_vec()))
            })
            .unwrap();
            check_model(&whole, &model);
            check_written(&model);
        }
    }
    read_mtl(bytes);
    is_read
}

fn check_model(arrays: &ObjArrays, model: &Model) {
    assert_eq!(model.points.len(), arrays.positions.len());
    assert!(model.points.iter().all(|point| point.is_finite()));
    let mut triangles = 0;
    for part in &model.parts {
        let count = part.vertices.len();
        assert!(part.object < model.objects.len());
        assert!(part.material.is_none_or(|material| material < model.material_set.materials.len()));
        assert!(part.vertices.iter().all(|point| (*point as usize) < model.points.len()));
        assert!(part.triangles.iter().flatten().all(|vertex| (*vertex as usize) < count));
        assert!(part.faces.corners.iter().all(|vertex| (*vertex as usize) < count));
        assert!(part.normals.len() == count && part.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4));
        assert!(part.uvs.iter().all(|uvs| uvs.len() == count && uvs.iter().all(|uv| uv.is_finite())));
        assert!(part.colors.is_empty() || part.colors.len() == count);
        assert!(part.colors.iter().all(|color| color.min_element() >= 0.0 && color.max_element() <= 1.0));
        triangles += part.triangles.len();
    }
    assert_eq!(triangles, arrays.corners.len() - 2 * arrays.face_count());
}

/// Files that are written read as the same geometry.
fn check_written(model: &Model) {
    let written = write_obj(model, "fuzz", &mut |plain, _| plain.to_owned());
    let mut arrays = ObjArrays::default();
    read_obj(&written[..], &mut arrays, &ObjSettings::default()).unwrap();
    let again = to_model(&arrays, "fuzz", &mut |_| None).unwrap();
    assert_eq!(again.points, model.points);
    assert_eq!(again.parts.len(), model.parts.len());
    for (part, wanted) in again.parts.iter().zip(&model.parts) {
        assert_eq!(part.vertices, wanted.vertices);
        assert_eq!(part.faces, wanted.faces);
        assert_eq!(part.triangles, wanted.triangles);
        assert_eq!(part.normals, wanted.normals);
    }
}

#[test]
fn changed_files_never_panic() {
    let mut seeds: Vec<Vec<u8>> = SEEDS.iter().map(|seed| seed.as_bytes().to_vec()).collect();
    if let Some(data) = test_data() {
        for folder in ["tinyobjloader", "tobj", "assimp_invalid"] {
            let mut paths: Vec<PathBuf> = (fs::read_dir(data.join("obj_torture").join(folder)).unwrap())
                .map(|entry| entry.unwrap().path())
                .filter(|path| path.is_file())
                .collect();
            paths.sort();
            seeds.extend(paths.iter().map(|path| fs::read(path).unwrap()).filter(|bytes| bytes.len() < 4096));
        }
    }
    let read = Cell::new(0);
    run_fuzz("obj", &seeds, WORDS, |bytes| read.set(read.get() + usize::from(check(bytes))));
    assert!(read.get() > 100, "only {} mutants are read", read.get());
}
