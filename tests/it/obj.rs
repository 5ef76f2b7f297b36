//! Reading and writing OBJ files.

use std::{
    collections::{BTreeMap, HashMap},
    io::{self, Read},
};

use rigsmith::mesh::{
    model::Model,
    obj::{
        LineProblem, NONE, ObjArrays, ObjError, ObjSettings, SidecarFile, read_model, read_obj, to_model, write_obj,
    },
};

fn arrays(text: &str) -> Result<ObjArrays, ObjError> {
    let mut arrays = ObjArrays::default();
    read_obj(text.as_bytes(), &mut arrays, &ObjSettings::default())?;
    Ok(arrays)
}

fn model(text: &str) -> Model {
    read_model(text.as_bytes(), "test", &ObjSettings::default(), &mut |_| None).unwrap()
}

pub fn model_with(text: &str, files: &[(&str, &[u8])]) -> Model {
    let files: HashMap<&str, &[u8]> = files.iter().copied().collect();
    let mut sidecar = |path: &str| files.get(path).map(|bytes| SidecarFile::Bytes(bytes.to_vec()));
    read_model(text.as_bytes(), "test", &ObjSettings::default(), &mut sidecar).unwrap()
}

pub const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn spellings_of_the_same_triangle() {
    let plain = arrays("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    for (name, text) in [
        ("no line end at the end", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3"),
        ("CRLF", "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n"),
        ("CR only", "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r"),
        ("mixed line ends", "v 0 0 0\rv 1 0 0\r\nv 0 1 0\n\r\n\rf 1 2 3"),
        ("byte order mark", "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("tabs", "v\t0\t0\t0\nv\t1 \t0 0\t\nv 0\t1\t 0\nf\t1\t2\t3\t\n"),
        ("blanks", "  v  0  0  0 \n v 1 0 0\n\tv 0 1 0  \n   f   1   2   3   \n"),
        ("comments", "# a\nv 0 0 0 # b\n  # c\nv 1 0 0\n#\nv 0 1 0\n\nf 1 2 3 # d\n#"),
        ("comment that ends in a backslash", "# C:\\models\\\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("continued", "v 0 \\\n0 0\nv 1 0\\\r\n 0\nv 0 1 0\nf \\\n 1 \\\n\\\n2 3\\\n"),
        ("continued at the end", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\\"),
        ("exponents", "v 0e0 0.0E+5 -0.0\nv 1e+00 0 0\nv 0 10.0e-1 0\nf 1 2 3\n"),
        ("leading zeros and signs", "v 00 +0 .0\nv 1. 000 0\nv 0 +1.0e0 0.000\nf +1 02 3\n"),
        ("many digits", "v 0.00000000000000000000 0 0\nv 1.00000000000000000000001 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("negative indices", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n"),
        ("mixed indices", "v 0 0 0\nv 1 0 0\nf -2 -1 3\nv 0 1 0\n"),
        ("vertices after the face", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        ("a weight", "v 0 0 0 1\nv 1 0 0 0.5\nv 0 1 0 2.0\nf 1 2 3\n"),
        ("empty fields", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/ 2// 3\n"),
        ("the old face", "v 0 0 0\nv 1 0 0\nv 0 1 0\nfo 1 2 3\n"),
    ] {
        let read = arrays(text).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(read.positions.len(), 3, "{name}");
        assert_eq!(read.positions, plain.positions, "{name}");
        assert_eq!(read.corners, [0, 1, 2], "{name}");
        assert_eq!(read.face_starts, [0, 3], "{name}");
        assert!(read.corner_texcoords.is_empty() && read.corner_normals.is_empty(), "{name}");
        assert!(read.is_consistent(), "{name}");
    }
}

#[test]
fn corners_of_every_form() {
    let text = format!(
        "{TRIANGLE}vt 0 0\nvt 1 0 0\nvt 0.5\nvn 0 0 1\nvn 0 0 -1\n\
        f 1 2 3\nf 1/1 2/2 3/3\nf 1//1 2//1 3//2\nf 1/1/1 2/2/2 3/3/-1\nf 1/-3/-2 2 3//1\n"
    );
    let read = arrays(&text).unwrap();
    let n = NONE;
    assert_eq!(read.corners, [0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2]);
    assert_eq!(read.corner_texcoords, [n, n, n, 0, 1, 2, n, n, n, 0, 1, 2, 0, n, n]);
    assert_eq!(read.corner_normals, [n, n, n, n, n, n, 0, 0, 1, 0, 1, 1, 0, n, 0]);
    assert_eq!(read.texcoords, [[0.0, 0.0], [1.0, 0.0], [0.5, 0.0]]);
}

#[test]
fn errors_name_the_line() {
    for (text, line, part) in [
        ("v 0 0\n", 1, "`v` has 2 of the 3"),
        ("\n\nv\n", 3, "`v` has 0 of the 3"),
        ("vn 0 0\n", 1, "`vn` has 2 of the 3"),
        ("vt\n", 1, "`vt` has 0 of the 1"),
        ("# c\nv 0 0 x\n", 2, "`x` is not a number"),
        ("v 0 0 1.5.5\n", 1, "not a number"),
        ("v 0 0 1-2\n", 1, "not a number"),
        ("v 1,5 0 0\n", 1, "not a number"),
        ("v 0 0 0 0 0 red\n", 1, "`red` is not a number"),
        ("vt 0.1.5 .5 .5\n", 1, "not a number"),
        ("v nan 0 0\n", 1, "finite"),
        ("v 0 -inf 0\n", 1, "finite"),
        ("v 0 infinity 0\n", 1, "finite"),
        ("v 0 1e39 0\n", 1, "finite"),
        ("v 0 340282350000000000000000000000000000000000 0\n", 1, "finite"),
        ("v 1.#IND 0 0\n", 1, "not a number"),
        ("vt nan 0\n", 1, "finite"),
        ("vn 0 0 inf\n", 1, "finite"),
        ("v 0 0 0\r\nv 0 0 0\r\nf 1 2\r\n", 3, "2 corners"),
        ("v 0 0 0\rv 0 0 0\rf 1\r", 3, "1 corners"),
        ("f\n", 1, "0 corners"),
        ("v 0 0 0\nf 1 1 0\n", 2, "vertex 0"),
        ("v 0 0 0\nvt 0 0\nf 1/1 1/1 1/0\n", 3, "texture coordinate 0"),
        ("v 0 0 0\nvn 0 0 1\nf 1//1 1//0 1//1\n", 3, "normal 0"),
        ("v 0 0 0\nf 1 1 2\n", 2, "vertex 2, but there are 1"),
        ("v 0 0 0\nf 1 1 99999999999999999999\n", 2, "vertex 99999999999999999999"),
        ("v 0 0 0\nf 1 1 4294967299\n", 2, "vertex 4294967299"),
        ("v 0 0 0\nf 1 1 4294967295\n", 2, "vertex 4294967295, but there are 1"),
        ("v 0 0 0\nf 1 1 123456789\n", 2, "vertex 123456789"),
        ("v 0 0 0\nvt 0 0\nf 1/1 1/1 1/2\n", 3, "texture coordinate 2, but there are 1"),
        ("v 0 0 0\nvn 0 0 1\nf 1//1 1//1 1//2\n", 3, "normal 2, but there are 1"),
        ("v 0 0 0\nf 1 1 -2\n", 2, "1 before the first vertex"),
        ("f 1 1 -1\nv 0 0 0\n", 1, "before the first vertex"),
        ("v 0 0 0\nf 1 1 -99999999999999999999\n", 2, "vertex -99999999999999999999"),
        ("v 0 0 0\nf 1 1 -2147483648\n", 2, "before the first vertex"),
        ("v 0 0 0\nf 1 1 1.5\n", 2, "not a face corner"),
        ("v 0 0 0\nf 1 1 a\n", 2, "not a face corner"),
        ("v 0 0 0\nf 1 1 1/1/1/1\n", 2, "not a face corner"),
        ("v 0 0 0\nf 1 1 /1\n", 2, "not a face corner"),
        ("v 0 0 0\nf 1 1 -\n", 2, "not a face corner"),
        ("v 0 0 \\\n\\\n x\n", 1, "not a number"),
        ("v 0 0 0 \\\n\nv 0 0 0\nf 1 2 \\\n 3\nf 1 2\n", 6, "2 corners"),
        ("v 0 0 0\nf 1 1 1\nf 1 2 1\nf 1 9 1\nf 1 3 1\n", 3, "vertex 2, but there are 1"),
        ("\u{feff}v 0 0 x\n", 1, "not a number"),
    ] {
        let error = arrays(text).expect_err(text);
        let ObjError::Line { line: found, .. } = &error else { panic!("{text:?}: {error}") };
        assert_eq!(*found, line, "{text:?}: {error}");
        assert!(error.to_string().contains(part), "{text:?}: {error}");
    }
    for mark in [b"\xff\xfev\0 \0".as_slice(), b"\xfe\xff\0v\0 "] {
        let error = read_obj(mark, &mut ObjArrays::default(), &ObjSettings::default()).unwrap_err();
        assert!(matches!(error, ObjError::Line { line: 1, problem: LineProblem::Utf16 }), "{error}");
    }
}

#[test]
fn files_without_geometry() {
    for text in ["", "\n\n", "# nothing\n", "o a\ng b\n", "\0\0\0\0", "\\\n\\\n\\"] {
        assert!(arrays(text).unwrap().positions.is_empty(), "{text:?}");
        let error = read_model(text.as_bytes(), "", &ObjSettings::default(), &mut |_| None).unwrap_err();
        assert!(matches!(error, ObjError::NoGeometry), "{text:?}: {error}");
    }
    let points = model(TRIANGLE);
    assert_eq!((points.points.len(), points.parts.len(), points.objects.len()), (3, 0, 0));
    assert!(points.notes.iter().any(|note| note.contains("no faces")));
}

#[test]
fn statements_left_out_are_noted() {
    let text = format!("{TRIANGLE}l 1 2\nl 2 3\np 1\ncstype bezier\ncurv 0 1 1 2 3\nend\nvw 0 0 1.0\nlod 3\nf 1 2 3\n");
    let notes = arrays(&text).unwrap().notes;
    for wanted in ["2 line element(s) (`l`) left out, the first on line 4", "1 point", "3 statement", "1 unknown"] {
        assert!(notes.iter().any(|note| note.contains(wanted)), "{wanted}: {notes:?}");
    }
    assert_eq!(notes.len(), 4);
}

#[test]
fn absent_lists_are_no_indices() {
    let read = arrays(&format!("{TRIANGLE}vt 0 0\nf 1/1/1 2/1/2 3/1/3\n")).unwrap();
    assert_eq!((read.corner_texcoords.len(), read.corner_normals.len()), (3, 0));
    assert!(read.notes[0].contains("normals, from line 5"), "{:?}", read.notes);
}

/// A mesh with everything that can be cut in two by the end of a block.
fn long_text(line_end: &str) -> String {
    let mut text = String::new();
    let mut push = |line: String| {
        text.push_str(&line);
        text.push_str(line_end);
    };
    for i in 0..600_i32 {
        push(format!("v {}.{} {} -{}e-2", i, i * 7, i * i, i));
        push(format!("vt 0.{i} {}", i % 7));
        if i % 5 == 0 {
            push(format!("vn 0 {i} 1"));
        }
        if i % 50 == 17 {
            push(format!("v 1 \\{line_end}2 \\{line_end} 3 0.5 0.25 1"));
            push(format!("o object {}", i / 100));
        }
        if i % 30 == 3 {
            push(format!("usemtl m{}", i % 4));
            push(format!("s {}", i % 3));
            push("# a comment that goes on and on, past the end of a small block \\".into());
            push(format!("g {} part", i % 9));
        }
        if i > 4 {
            push(format!("f {} -1/-2/-1 {i}//1 -3", i - 1));
            push(format!("f {i}/{i}/1 \\{line_end} -2/1/-1 1/1/1 2/2/1 3/1/1"));
        }
        if i % 100 == 99 {
            push("l 1 2".into());
            push(String::new());
        }
    }
    text
}

#[test]
fn blocks_and_threads_change_nothing() {
    for line_end in ["\n", "\r\n", "\r"] {
        let text = long_text(line_end);
        let whole = arrays(&text).unwrap();
        assert_eq!(whole.face_count(), 595 * 2);
        for (threads, block_bytes) in [(1, 64), (1, 997), (2, 64), (2, 1000), (3, 333), (8, 128), (8, 5000)] {
            let settings = ObjSettings { threads, block_bytes };
            let mut read = ObjArrays::default();
            // A second time, to see that nothing stays from the first.
            for _ in 0..2 {
                read_obj(text.as_bytes(), &mut read, &settings).unwrap();
                assert!(read == whole, "{settings:?} {line_end:?}");
            }
        }
    }
}

#[test]
fn errors_name_the_line_in_any_block() {
    let text = long_text("\n");
    let lines: Vec<&str> = text.lines().collect();
    for at in [0, 40, 1000, 1777, lines.len() - 1] {
        // Not between a line and its continuation, which would take the bad line in.
        let at = (at..).find(|at| *at == 0 || !lines[*at - 1].ends_with('\\')).unwrap();
        for bad in ["v 0 0 oops", "f 1 2 999999", "f -9999 1 2", "f 1 2"] {
            let mut lines = lines.clone();
            lines.insert(at, bad);
            let text = lines.join("\n");
            for (threads, block_bytes) in [(1, 1 << 20), (1, 100), (2, 100), (4, 700)] {
                let mut read = ObjArrays::default();
                let error = read_obj(text.as_bytes(), &mut read, &ObjSettings { threads, block_bytes }).unwrap_err();
                let ObjError::Line { line, .. } = error else { panic!("{error}") };
                assert_eq!(line, at as u64 + 1, "{bad} with {threads} threads and blocks of {block_bytes}");
                assert!(read.positions.is_empty());
            }
        }
    }
}

/// Gives a few bytes at a time, and then perhaps fails.
struct Slow<'a>(&'a [u8], bool);

impl Read for Slow<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.0.is_empty() && self.1 {
            return Err(io::Error::other("the cable is out"));
        }
        let count = buffer.len().min(self.0.len()).min(7);
        buffer[..count].copy_from_slice(&self.0[..count]);
        self.0 = &self.0[count..];
        Ok(count)
    }
}

#[test]
fn readers_may_be_slow_or_fail() {
    let text = long_text("\n");
    let whole = arrays(&text).unwrap();
    for threads in [1, 3] {
        let settings = ObjSettings { threads, block_bytes: 512 };
        let mut read = ObjArrays::default();
        read_obj(Slow(text.as_bytes(), false), &mut read, &settings).unwrap();
        assert!(read == whole);
        let error = read_obj(Slow(text.as_bytes(), true), &mut read, &settings).unwrap_err();
        assert!(matches!(&error, ObjError::Io(_)) && error.to_string().contains("cable"), "{error}");
    }
}

#[test]
fn runs_hold_for_their_faces() {
    let text = format!(
        "{TRIANGLE}f 1 2 3\no a\ng x y\nusemtl m\nf 1 2 3\nf 1 2 3\ns 4\nusemtl m\ns off\nf 1 2 3\n\
        usemtl (null)\no b\nf 1 2 3\nusemtl unused\n"
    );
    let read = arrays(&text).unwrap();
    let name = |name| read.names.get(name);
    let runs: Vec<_> = read
        .runs
        .iter()
        .map(|run| (run.first_face, name(run.object), name(run.group), name(run.material), run.smoothing))
        .collect();
    assert_eq!(
        runs,
        [(0, "", "", "", NONE), (1, "a", "x y", "m", NONE), (3, "a", "x y", "m", 0), (4, "b", "x y", "", 0),]
    );
}

#[test]
fn objects_and_parts() {
    let by_group = model(&format!("{TRIANGLE}g a\nf 1 2 3\ng b\nusemtl m\nf 1 2 3\ng a\nf 1 3 2\ng empty\n"));
    let names: Vec<&str> = by_group.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["a", "b"]);
    let parts: Vec<_> = by_group.parts.iter().map(|part| (part.object, part.material)).collect();
    assert_eq!(parts, [(0, None), (1, Some(0)), (0, Some(0))]);
    assert_eq!(by_group.material_set.materials[0]["name"], "m");

    let by_object = model(&format!("{TRIANGLE}g g\nf 1 2 3\no a\ng h\nf 1 2 3\no b\nf 1 2 3\n"));
    let names: Vec<&str> = by_object.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["", "a", "b"]);
    assert_eq!(by_object.points.len(), 3, "points are shared");
}

#[test]
fn vertices_are_the_different_corners() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nvt 0 0.25\nvt 1 1\nvn 0 0 2\n\
        f 1/1/1 2/1/1 3/1/1\nf 1/1/1 3/1/1 4/1/1\nf 1/2/1 2/1/1 3/1/1\n";
    let model = model(text);
    let part = &model.parts[0];
    assert_eq!(part.vertices, [0, 1, 2, 3, 0]);
    assert_eq!(part.triangles, [[0, 1, 2], [0, 2, 3], [4, 1, 2]]);
    assert!(part.faces.is_empty(), "triangles only");
    assert_eq!(part.uvs[0][0].to_array(), [0.0, 0.75]);
    assert!(part.normals.iter().all(|normal| normal.to_array() == [0.0, 0.0, 1.0]));
    assert_eq!(model.points.len(), 5, "unused points stay");
}

#[test]
fn many_vertices_at_one_point() {
    let mut text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    let count = 20_000;
    (0..count).for_each(|i| text += &format!("vt {i} 0\n"));
    (1..=count).for_each(|i| text += &format!("f 1/{i} 2/1 3/1\nf 1/{i} 3/1 2/1\n"));
    let part = &model(&text).parts[0];
    assert_eq!(part.vertices.len(), count + 2);
    assert_eq!(part.triangles.len(), 2 * count);
}

#[test]
fn polygons_are_kept_and_triangulated() {
    // An arrow head, whose notch is its third corner, and an L, both seen from +Z, and the L again from below.
    let text = "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 0.5 1 0\n\
        v 0 0 1\nv 3 0 1\nv 3 1 1\nv 1 1 1\nv 1 3 1\nv 0 3 1\n\
        f 1 2 3 4\nf 5 6 7 8 9 10\nf 10 9 8 7 6 5\nf 1 2 3\n";
    let model = model(text);
    let part = &model.parts[0];
    let sizes: Vec<usize> = part.faces.iter().map(<[u32]>::len).collect();
    assert_eq!(sizes, [4, 6, 6, 3]);
    let area = |triangles: &[[u32; 3]]| -> Vec<f32> {
        let point = |vertex: u32| model.points[part.vertices[vertex as usize] as usize];
        triangles.iter().map(|[a, b, c]| (point(*b) - point(*a)).cross(point(*c) - point(*a)).z / 2.0).collect()
    };
    for (triangles, whole) in [(0..2, 1.5_f32), (2..6, 5.0), (6..10, -5.0), (10..11, 2.0)] {
        let areas = area(&part.triangles[triangles.clone()]);
        assert!((areas.iter().sum::<f32>() - whole).abs() < 1e-6, "{triangles:?}: {areas:?}");
        assert!(areas.iter().all(|area| area * whole > 0.0), "{triangles:?}: {areas:?}");
    }
    assert_eq!(part.triangles.len(), 11);
}

#[test]
fn huge_polygons_end() {
    // A star with many points: concave at every second corner.
    let count = 20_000;
    let mut text = String::new();
    for i in 0..count {
        let angle = f64::from(i) / f64::from(count) * std::f64::consts::TAU;
        let radius = if i % 2 == 0 { 100.0 } else { 99.0 };
        text += &format!("v {} {} 0\n", radius * angle.cos(), radius * angle.sin());
    }
    text += "f";
    (1..=count).for_each(|i| text += &format!(" {i}"));
    let model = model(&text);
    let part = &model.parts[0];
    assert_eq!(part.triangles.len(), count as usize - 2);
    let point = |vertex: u32| model.points[part.vertices[vertex as usize] as usize].as_dvec3();
    let areas = part.triangles.iter().map(|[a, b, c]| (point(*b) - point(*a)).cross(point(*c) - point(*a)).z);
    assert!(areas.clone().all(|area| area > 0.0));
    let corners = || (0..count as u32).map(point);
    let whole: f64 = corners().zip(corners().cycle().skip(1)).map(|(a, b)| a.truncate().perp_dot(b.truncate())).sum();
    assert!((areas.sum::<f64>() / whole - 1.0).abs() < 1e-9);
}

#[test]
fn normals_where_there_are_none() {
    // A roof: two quads that meet at a right angle along the y axis.
    let roof = "v -1 0 -1\nv 0 0 0\nv 0 1 0\nv -1 1 -1\nv 1 0 -1\nv 1 1 -1\n";
    let h = std::f32::consts::FRAC_1_SQRT_2;
    let (left, right, ridge) = ([-h, 0.0, h], [h, 0.0, h], [0.0, 0.0, 1.0]);
    for (name, faces, wanted) in [
        ("smooth", "f 1 2 3 4\nf 2 5 6 3\n", vec![left, ridge, ridge, left, right, right]),
        ("one group", "s 1\nf 1 2 3 4\nf 2 5 6 3\n", vec![left, ridge, ridge, left, right, right]),
        ("two groups", "s 1\nf 1 2 3 4\ns 2\nf 2 5 6 3\n", vec![left, left, left, left, right, right, right, right]),
        ("flat", "s off\nf 1 2 3 4\nf 2 5 6 3\n", vec![left, left, left, left, right, right, right, right]),
        ("given", "vn 0 0 5\nf 1//1 2//1 3//1 4//1\n", vec![ridge; 4]),
        ("given as zero", "vn 0 0 0\nf 1//1 2//1 3//1 4//1\n", vec![left; 4]),
        ("no area", "f 1 2 1\n", vec![[0.0, 1.0, 0.0]; 2]),
    ] {
        let model = model(&format!("{roof}{faces}"));
        let normals = &model.parts[0].normals;
        assert_eq!(normals.len(), wanted.len(), "{name}");
        for (normal, wanted) in normals.iter().zip(wanted) {
            assert!(normal.distance(wanted.into()) < 1e-6, "{name}: {normal}, not {wanted:?}");
        }
    }
    // However the faces of a cube are cut, the corner's normal is on its diagonal.
    let cube =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 0\nv 0 1 1\nv 1 0 1\nf 1 3 5\nf 1 5 2\nf 1 4 6 3\nf 1 2 7 4\n";
    let corner = model(cube).parts[0].normals[0];
    assert!(corner.distance(glam::Vec3::splat(-1.0).normalize()) < 1e-4, "{corner}");
}

#[test]
fn very_many_smoothing_groups() {
    let mut text = TRIANGLE.to_owned();
    (1..50_000).for_each(|i| text += &format!("s {i}\nf 1 2 3\n"));
    let part = &model(&text).parts[0];
    assert_eq!((part.triangles.len(), part.vertices.len()), (49_999, 3 * 4096));
}

#[test]
fn vertex_colors() {
    let text = "v 0 0 0\nv 1 0 0 1 0.5 0\nv 0 1 0 0 0 1 0.5\nf 1 2 3\n";
    assert_eq!(arrays(text).unwrap().colors, [[1.0; 3], [1.0, 0.5, 0.0], [0.0, 0.0, 1.0]]);
    let model = model(text);
    let colors = &model.parts[0].colors;
    assert!((colors[1].y - 0.214_041_14).abs() < 1e-6, "sRGB one half is {}", colors[1].y);
    assert_eq!(colors[0].to_array(), [1.0; 4]);
    let bytes = self::model("v 0 0 0 255 0 0\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n");
    assert_eq!(bytes.parts[0].colors[0].to_array(), [1.0, 0.0, 0.0, 1.0]);
}

pub const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Geometry as written and read again is the same to the bit.
fn check_round_trip(name: &str, model: &Model) {
    let mut files = BTreeMap::new();
    let mut companion = |plain: &str, bytes| {
        files.insert(plain.to_owned(), bytes);
        plain.to_owned()
    };
    let written = write_obj(model, "test", &mut companion);
    let mut sidecar = |path: &str| files.get(path).cloned().map(SidecarFile::Bytes);
    let again = read_model(&written[..], &model.name, &ObjSettings::default(), &mut sidecar).unwrap();
    assert_eq!(again.points, model.points, "{name}");
    assert_eq!(again.parts.len(), model.parts.len(), "{name}");
    for (part, wanted) in again.parts.iter().zip(&model.parts) {
        assert!(part == wanted, "{name}: {part:?}, not {wanted:?}");
    }
    let names = |model: &Model| model.objects.iter().map(|object| object.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&again), names(model), "{name}");
    assert_eq!(again.material_set, model.material_set, "{name}");
}

#[test]
fn reading_what_was_written_gives_the_same() {
    check_round_trip("plain", &model(&format!("{TRIANGLE}f 1 2 3\n")));
    check_round_trip("polygons", &model(&format!("{TRIANGLE}v 0.1 -1e-30 3.4e38\nf 1 2 3 4\nf 1 2 3\n")));
    check_round_trip("long", &model(&long_text("\n")));
    let obj = "mtllib l.mtl\nv 0 0 0 0.1 0.2 0.3\nv 1 0 0 0.9 1 0.004\nv 0 1 0\nvt 0.1 0.7\nvt 3.3 -2.7\nvt 1e-3 0.9999\n\
        o a\nusemtl m\nf 1/1 2/2 3/3\no b\ng c\nusemtl (null)\ns off\nf 3/1 2/2 1/3\nusemtl n\nf 1 2 3\n";
    let mtl = "newmtl m\nKd 0.1 0.2 0.3\nd 0.5\nKe 1 2 3\nPr 0.25\nPm 0.75\nmap_Kd -s 2 4 t/a b.png\nmap_Bump -bm 2 n.png\n\
        newmtl n\nmap_Kd -clamp on t/a b.png\nmap_Pr q.png\nmap_Pm q.png\nPr 0.5\nmap_d t/a b.png\n";
    let model = model_with(obj, &[("l.mtl", mtl.as_bytes()), ("t/a b.png", PNG), ("n.png", PNG), ("q.png", PNG)]);
    assert_eq!((model.parts.len(), model.material_set.images.len()), (3, 3));
    check_round_trip("looks", &model);
}

#[test]
fn scales_from_tiny_to_huge() {
    for scale in ["e-38", "e-12", "e-3", "e3", "e12", "e37"] {
        let text = format!("v 0 0 0\nv 1{scale} 0 0\nv 1{scale} 1{scale} 0\nv 0 1{scale} 0\nf 1 2 3 4\n");
        let model = model(&text);
        assert!(model.parts[0].normals.iter().all(|normal| *normal == glam::Vec3::Z), "{scale}");
    }
}

#[test]
fn changed_arrays_are_refused() {
    let mut read = arrays(&format!("{TRIANGLE}f 1 2 3\n")).unwrap();
    read.corners[1] = 3;
    assert!(matches!(to_model(&read, "", &mut |_| None), Err(ObjError::Inconsistent)));
}

#[test]
fn too_many_groups_become_one_object() {
    let mut text = TRIANGLE.to_owned();
    (0..70_000).for_each(|i| text += &format!("g {i}\nf 1 2 3\n"));
    let model = model(&text);
    assert_eq!((model.objects.len(), model.parts.len()), (1, 1));
    assert_eq!(model.parts[0].triangles.len(), 70_000);
    assert!(model.notes.iter().any(|note| note.contains("one object")), "{:?}", model.notes);
}

/// Each object costs memory, which the size of the file bounds.
#[test]
fn a_file_has_as_many_objects_as_its_size_allows() {
    let text = |count: usize, padding: &str| {
        let objects: String = (0..count).map(|i| format!("o {i}\n{padding}f 1 2 3\n")).collect();
        TRIANGLE.to_owned() + &objects
    };
    let comment = format!("#{}\n", "x".repeat(2100));
    for (count, padding, objects) in [(1400, "", 1400), (4000, "", 1), (4000, comment.as_str(), 4000)] {
        assert_eq!(model(&text(count, padding)).objects.len(), objects, "{count} with {} bytes each", padding.len());
    }
}
