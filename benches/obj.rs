//! OBJ to arrays: our reader against `tobj` on the same file in the same run.
//!
//! `cargo bench --bench obj` makes a file of about 160 MB in the folder for temporary files (a million positions,
//! texture coordinates, normals and quads; kept for the next run) and one of 100 KB, reads each by turns with
//!
//! - `fresh`: `read_obj` into empty arrays;
//! - `reused`: `read_obj` into arrays that held the same file before;
//! - `one thread`: the same as `reused`, with one thread;
//! - `tobj`: `tobj::load_obj_buf` with `LoadOptions::default()`, which keeps polygons and separate indices, as we do;
//! - `tobj single index`: with `GPU_LOAD_OPTIONS`, as most programs call it;
//!
//! and prints the least and the median wall time of each and how many times as long `tobj` takes. Then it reads the
//! large file in a process of its own and prints by how much the peak of its memory (`VmHWM`) grew, against the size of
//! the arrays. `-- ROUNDS` sets the number of rounds; `-- FILE` reads that file instead.

use std::{
    fs::File,
    hint::black_box,
    io::{BufReader, BufWriter, Write},
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

use rigsmith::mesh::obj::{ObjArrays, ObjSettings, read_obj};

fn main() {
    let mut rounds = 5;
    let mut file = None;
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    while let Some(argument) = arguments.next() {
        if argument == "--peak" {
            let (how, path) = (arguments.next().unwrap(), arguments.next().unwrap());
            return print_peak(&how, Path::new(&path));
        }
        match argument.parse() {
            Ok(number) => rounds = number,
            Err(_) => file = Some(PathBuf::from(argument)),
        }
    }
    let large = file.unwrap_or_else(|| made_file(1000));
    let small = made_file(25);
    compare(&small, rounds.max(3) * 40);
    compare(&large, rounds);
    for how in ["ours", "tobj"] {
        let program = std::env::current_exe().unwrap();
        let output = Command::new(program).args(["--peak", how]).arg(&large).output().unwrap();
        print!("{}", String::from_utf8_lossy(&output.stdout));
    }
}

/// A name and what reads the file once and says how many seconds that took.
type Way<'a> = (&'a str, Box<dyn FnMut() -> f64 + 'a>);

/// Reads `path` in each way by turns and prints the times.
fn compare(path: &Path, rounds: usize) {
    let size = std::fs::metadata(path).unwrap().len();
    println!("{} ({:.1} MB), {rounds} rounds", path.display(), size as f64 / 1e6);
    let mut reused = ObjArrays::default();
    let settings = ObjSettings::default();
    let one_thread = ObjSettings { threads: 1, ..ObjSettings::default() };
    let read = |arrays: &mut ObjArrays, settings| {
        read_obj(File::open(path).unwrap(), arrays, settings).unwrap();
        black_box(arrays.corners.len());
    };
    read(&mut reused, &settings);
    let mut ways: [Way; 5] = [
        ("fresh", {
            let settings = &settings;
            Box::new(move || {
                let start = Instant::now();
                let mut arrays = ObjArrays::default();
                read(&mut arrays, settings);
                start.elapsed().as_secs_f64()
            })
        }),
        ("reused", timed(|| read(&mut reused, &settings))),
        ("one thread", {
            let mut arrays = ObjArrays::default();
            read(&mut arrays, &one_thread);
            let one_thread = &one_thread;
            timed(move || read(&mut arrays, one_thread))
        }),
        ("tobj", timed(|| read_tobj(path, &tobj::LoadOptions::default()))),
        ("tobj single index", timed(|| read_tobj(path, &tobj::GPU_LOAD_OPTIONS))),
    ];
    let mut times = vec![Vec::new(); ways.len()];
    for _ in 0..rounds {
        for (way, times) in ways.iter_mut().zip(&mut times) {
            times.push(way.1());
        }
    }
    for times in &mut times {
        times.sort_by(f64::total_cmp);
    }
    let peer = (times[3][0], times[3][rounds / 2]);
    for ((name, _), times) in ways.iter().zip(&times) {
        let (least, median) = (times[0], times[rounds / 2]);
        println!(
            "  {name:18} least {:9.3} ms  median {:9.3} ms  {:7.1} MB/s  tobj/this: {:.2} least, {:.2} median",
            least * 1e3,
            median * 1e3,
            size as f64 / least / 1e6,
            peer.0 / least,
            peer.1 / median,
        );
    }
}

fn timed<'a>(mut work: impl FnMut() + 'a) -> Box<dyn FnMut() -> f64 + 'a> {
    Box::new(move || {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    })
}

fn read_tobj(path: &Path, options: &tobj::LoadOptions) {
    let mut reader = BufReader::new(File::open(path).unwrap());
    let loaded = tobj::load_obj_buf(&mut reader, options, |_| Err(tobj::LoadError::OpenFileFailed)).unwrap();
    black_box(loaded.0.len());
}

/// Reads the file once and prints how far the memory of this process rose.
fn print_peak(how: &str, path: &Path) {
    let before = peak_bytes();
    let mut arrays = ObjArrays::default();
    match how {
        "ours" => read_obj(File::open(path).unwrap(), &mut arrays, &ObjSettings::default()).unwrap(),
        _ => read_tobj(path, &tobj::LoadOptions::default()),
    }
    let rose = peak_bytes().saturating_sub(before) as f64;
    print!("  peak memory {how}: {:.1} MB", rose / 1e6);
    if how == "ours" {
        let bytes = arrays.bytes() as f64;
        let allowed = 1.6 * bytes + 16e6;
        print!("; the arrays {:.1} MB, ratio {:.2}, allowed {:.1} MB", bytes / 1e6, rose / bytes, allowed / 1e6);
    }
    println!();
}

/// The highest resident size of this process so far; 0 where `/proc` does not tell.
fn peak_bytes() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("0 kB");
    line.trim().trim_end_matches(" kB").parse::<usize>().unwrap_or(0) * 1024
}

/// A torus of `side` times `side` quads with bumps, each vertex with its own texture coordinate and normal.
fn made_file(side: usize) -> PathBuf {
    let path = std::env::temp_dir().join(format!("rigsmith-bench-{side}.obj"));
    if path.exists() {
        return path;
    }
    let mut out = BufWriter::new(File::create(&path).unwrap());
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut bump = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f64 / (1_u64 << 24) as f64 * 0.01
    };
    let vertices: Vec<[f64; 8]> = (0..side * side)
        .map(|vertex| {
            let turn = |step: usize| step as f64 / side as f64 * std::f64::consts::TAU;
            let ((a, b), (c, d)) = (turn(vertex / side).sin_cos(), turn(vertex % side).sin_cos());
            let radius = 20.0 + (6.0 + bump()) * d;
            let uv = [(vertex % side) as f64 / side as f64, (vertex / side) as f64 / side as f64];
            [radius * b, (6.0 + bump()) * c, radius * a, uv[0], uv[1], b * d, c, a * d]
        })
        .collect();
    writeln!(out, "# A torus of {} quads\no torus", side * side).unwrap();
    for [x, y, z, ..] in &vertices {
        writeln!(out, "v {x:.6} {y:.6} {z:.6}").unwrap();
    }
    for [_, _, _, u, v, ..] in &vertices {
        writeln!(out, "vt {u:.6} {v:.6}").unwrap();
    }
    for [.., x, y, z] in &vertices {
        writeln!(out, "vn {x:.6} {y:.6} {z:.6}").unwrap();
    }
    for face in 0..side * side {
        let (row, column) = (face / side, face % side);
        let (next_row, next_column) = ((row + 1) % side, (column + 1) % side);
        let corners = [(row, column), (row, next_column), (next_row, next_column), (next_row, column)];
        write!(out, "f").unwrap();
        for (row, column) in corners {
            let vertex = row * side + column + 1;
            // Texture coordinates and normals are in an order of their own, as where an exporter wrote seams.
            let shifted = (vertex + 16) % (side * side) + 1;
            write!(out, " {vertex}/{shifted}/{vertex}").unwrap();
        }
        writeln!(out).unwrap();
    }
    out.flush().unwrap();
    path
}
