//! Random changes to OBJ files: reading them never panics or hangs, and what loads holds together.
//!
//! Runs for about two seconds, or for `RIGSMITH_FUZZ_SECONDS`. Files in `tests/fuzz_findings/obj` are replayed first; a
//! file that fails is left in the folder for temporary files and named.

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use rigsmith::mesh::{
    model::Model,
    obj::{ObjArrays, ObjError, ObjSettings, read_mtl, read_obj, to_model, write_obj},
};

const SEEDS: &[&str] = &[
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/1/1 4/2/1\n",
    "o a\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0\nusemtl m\ns 1\nf -3 -2 -1\ng b c\ns off\nf 1//1 2//1 3//1\nvn 0 0 0\n",
    "mtllib a.mtl b\\ c.mtl\r\nv 1e5 -2.5e-3 .5\r\nv 0 \\\r\n1 0\r\nv 0 0 1\r\nf 1 2 3 \\\r\n1 2\r\nl 1 2\r\np 1\r\n",
    "\u{feff}# comment \\\rv 1 2 3\rv 3 2 1\rv 0 0 9 1\rf 1 2 3\rs 2\rf 3 2 1\rvt 0.5\rvw 1\rcstype bezier\r",
    "v 0 0 0\nv 3 0 0\nv 3 3 0\nv 1 1 0\nv 1 3 0\nv 0 3 0\nv 0 0 0\nv 2 2 2\nf 1 2 3 4 5 6\nf 6 5 4 3 2 1 7 8\nf 1 2 3 4\n",
    "newmtl m\nKd 1 0 0\nd 0.5\nmap_Kd -s 1 2 -o 3 a b.png -bm 2\nnorm -bm 1 n.png\nKe 1 2 3\nPr 1\nPm 0\n",
];

const TOKENS: &[&str] = &[
    "\n",
    "\r",
    "\r\n",
    "\\\n",
    " ",
    "\t",
    "#",
    "/",
    "//",
    "-",
    "0",
    "-1",
    "1",
    "99999999",
    "4294967295",
    "4294967296",
    "-2147483649",
    "1e38",
    "1e39",
    "-1e-45",
    "nan",
    "inf",
    ".",
    "1.#IND",
    "16777217",
    "v ",
    "vt ",
    "vn ",
    "f ",
    "o ",
    "g ",
    "s off",
    "s 1",
    "usemtl ",
    "mtllib ",
    "f 1 2 3 4 5\n",
    "v 1e30 -1e30 0\n",
    "f -1 -2 -3\n",
    "\0",
    "\u{feff}",
    "\u{ff}",
];

struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 33) as usize) % limit.max(1)
    }

    /// A changed copy of one of the seeds.
    fn mutate(&mut self, seeds: &[Vec<u8>]) -> Vec<u8> {
        let mut text = seeds[self.below(seeds.len())].clone();
        for _ in 0..1 + self.below(6) {
            let at = self.below(text.len() + 1);
            let to = (at + self.below(40)).min(text.len());
            match self.below(7) {
                0 => text.truncate(at),
                1 if at < text.len() => text[at] ^= 1 << self.below(8),
                2 => {
                    let token = TOKENS[self.below(TOKENS.len())];
                    text.splice(at..at, token.bytes());
                }
                3 => {
                    text.drain(at..to);
                }
                4 => {
                    let again: Vec<u8> = text[at..to].to_vec();
                    for _ in 0..1 + self.below(20) {
                        text.splice(at..at, again.iter().copied());
                    }
                }
                5 => {
                    let other = &seeds[self.below(seeds.len())];
                    let start = self.below(other.len() + 1);
                    let end = (start + self.below(200)).min(other.len());
                    text.splice(at..at, other[start..end].iter().copied());
                }
                _ => {
                    let token = TOKENS[self.below(TOKENS.len())];
                    text.splice(at..to, token.bytes());
                }
            }
            text.truncate(1 << 16);
        }
        text
    }
}

/// Reads `bytes` in every way and checks what comes of it.
fn check(bytes: &[u8]) {
    let mut whole = ObjArrays::default();
    let result = read_obj(bytes, &mut whole, &ObjSettings::default());
    for (threads, block_bytes) in [(1, 16), (2, 50)] {
        let mut blocks = ObjArrays::default();
        let again = read_obj(bytes, &mut blocks, &ObjSettings { threads, block_bytes });
        assert_eq!(again.as_ref().map_err(ObjError::to_string), result.as_ref().map_err(ObjError::to_string));
        assert!(blocks == whole, "blocks of {block_bytes} bytes change the arrays");
    }
    match result {
        Err(ObjError::Line { line, .. }) => {
            let ends = bytes.iter().filter(|byte| matches!(byte, b'\n' | b'\r')).count();
            assert!((1..=ends as u64 + 1).contains(&line), "line {line} of {}", ends + 1);
        }
        Err(error) => panic!("{error}"),
        Ok(()) => {
            assert!(whole.is_consistent());
            let model = to_model(&whole, "fuzz", &mut |path| path.ends_with(".mtl").then(|| bytes.to_vec())).unwrap();
            check_model(&whole, &model);
            check_written(&model);
        }
    }
    read_mtl(bytes);
}

fn check_model(arrays: &ObjArrays, model: &Model) {
    assert_eq!(model.points.len(), arrays.positions.len());
    assert!(model.points.iter().all(|point| point.is_finite()));
    let mut triangles = 0;
    for part in &model.parts {
        let count = part.vertices.len();
        assert!(part.object < model.objects.len());
        assert!(part.material.is_none_or(|material| material < model.looks.materials.len()));
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

/// What is written reads as the same geometry.
fn check_written(model: &Model) {
    let written = write_obj(model, "fuzz.mtl");
    let mut arrays = ObjArrays::default();
    read_obj(&written.obj[..], &mut arrays, &ObjSettings::default()).unwrap();
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

/// Checks `bytes`; keeps them and says where if that fails or takes long.
fn guarded(name: &str, bytes: &[u8]) {
    let start = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| check(bytes)));
    let took = start.elapsed();
    if result.is_err() || took > Duration::from_secs(2) {
        let path = std::env::temp_dir().join("rigsmith-fuzz-obj.obj");
        fs::write(&path, bytes).unwrap();
        panic!("{name} failed after {took:?}; the file is {}", path.display());
    }
}

#[test]
fn changed_files_never_panic() {
    let findings = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz_findings/obj");
    for (path, bytes) in files_in(&findings) {
        guarded(&path.display().to_string(), &bytes);
    }
    let mut seeds: Vec<Vec<u8>> = SEEDS.iter().map(|seed| seed.as_bytes().to_vec()).collect();
    if let Some(data) = std::env::var_os("RIGSMITH_DATA") {
        let torture = Path::new(&data).join("obj_torture");
        for folder in ["tinyobjloader", "tobj", "assimp_invalid"] {
            let files = files_in(&torture.join(folder));
            seeds.extend(files.into_iter().map(|(_, bytes)| bytes).filter(|bytes| bytes.len() < 4096));
        }
    }
    let seconds = std::env::var("RIGSMITH_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(2.0);
    // A long run starts elsewhere each time it is asked for a different length.
    let mut random = Random(0x9e37_79b9_7f4a_7c15 ^ f64::to_bits(seconds));
    let start = Instant::now();
    let mut rounds = 0_u64;
    while start.elapsed().as_secs_f64() < seconds {
        let bytes = random.mutate(&seeds);
        guarded("a changed file", &bytes);
        rounds += 1;
    }
    println!("{rounds} files");
    assert!(rounds > 0);
}

fn files_in(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()).collect();
    paths.sort();
    paths.into_iter().map(|path| (fs::read(&path).unwrap(), path)).map(|(bytes, path)| (path, bytes)).collect()
}
