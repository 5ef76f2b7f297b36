//! Memory of commands on formats other than meshes and templates: weights, clips, projects, lists of gestures, and the
//! meshes of fits and faces.

use std::{f64::consts::PI, fmt::Write as _, fs, path::Path};

use super::{json_answer, memory_allowance, run, skeleton};

/// A ball of quads: `count` rings of `count` points.
fn ball(count: usize) -> String {
    let mut text = String::new();
    for ring in 0..=count {
        for at in 0..count {
            let (down, around) = (PI * ring as f64 / count as f64, 2.0 * PI * at as f64 / count as f64);
            let (radius, height) = (down.sin(), down.cos());
            let _ = writeln!(text, "v {:.4} {height:.4} {:.4}", radius * around.cos(), radius * around.sin());
        }
    }
    let point = |ring: usize, at: usize| ring * count + at % count + 1;
    for ring in 0..count {
        for at in 0..count {
            let [a, b] = [point(ring, at), point(ring, at + 1)];
            let [c, d] = [point(ring + 1, at + 1), point(ring + 1, at)];
            let _ = writeln!(text, "f {a} {b} {c} {d}");
        }
    }
    text
}

/// A clip with one track of many keys, of the joint that [`template`] has.
fn long_clip(keys: usize) -> String {
    let key = |number: usize| format!("(t: {:.3}, v: (0, 0, {}))", number as f64 / 1000.0, number % 7);
    let keys: Vec<String> = (0..keys).map(key).collect();
    format!(
        "(format: 1, rig: \"0000000000000099\", rig_name: \"n\", clips: [(uid: \"00000000c11b0001\", name: \"c\", \
         frame_rate: 30.0, range: (0.0, 10.0), layers: [(uid: \"00000000c11b0002\", name: \"Base\", tracks: [(node: \
         \"0000000000001001\", property: Translation, keys: [{}])])])])",
        keys.join(", ")
    )
}

fn template() -> String {
    "(format: 2, name: \"n\", joints: [(uid: \"0000000000001001\", label: \"j\", translation: (0, 0.1, 0))])".to_owned()
}

/// A project whose rig is a chain of joints.
fn project(joints: usize) -> String {
    let joint = |number: usize| {
        let uid = |number: usize| format!("\"{:016x}\"", 0x1001 + number);
        let parent = number.checked_sub(1).map(|above| format!("parent: {}, ", uid(above))).unwrap_or_default();
        format!("(uid: {}, label: \"j{number}\", {parent}translation: (0.0, 0.1, 0.0)),\n", uid(number))
    };
    let list: String = (0..joints).map(joint).collect();
    format!(
        "(format: 6, name: \"long\", meshes: [], rigs: [(rig: (format: 1, uid: \"00000000000000a0\", name: \"chain\", \
         version: \"\", kind: \"\", author: \"\", description: \"\", joint_count: {joints}, features: [], groups: [], \
         joints: [\n{list}]), skins: [], pose: [], poses: [], parts: [], faces: [])], templates: [], \
         view: (mode: \"\", shading: \"\", switches: {{}}, graph: {{}}))"
    )
}

/// Roots that say nothing but their labels: the shortest text for so many joints.
fn bare_joints(count: usize) -> String {
    let joints: Vec<String> = (0..count).map(|number| format!("(label:\"j{number}\")")).collect();
    format!("(format: 2, name: \"bare\", joints: [{}])", joints.join(", "))
}

/// A chain of joints that say all of their places.
fn placed_joints(count: usize) -> String {
    let joint = |number: usize| {
        let parent = number.checked_sub(1).map(|above| format!(", parent: \"j{above}\"")).unwrap_or_default();
        format!(
            "(label: \"j{number}\"{parent}, rotation: (0.0, 0.0, 0.0, 1.0), translation: (0.0, 0.1, 0.0), \
             scale: (1.0, 1.0, 1.0))"
        )
    };
    let joints: Vec<String> = (0..count).map(joint).collect();
    format!("(format: 2, name: \"placed\", joints: [{}])", joints.join(", "))
}

/// A stroke of many points, and clicks all over the ball.
fn gestures() -> [(&'static str, String); 2] {
    let point = |number: usize, side: usize| {
        let [x, y] = [number % side, number / side].map(|at| at as f64 / side as f64 - 0.5);
        format!("({x:.3}, {y:.3})")
    };
    let stroke: Vec<String> = (0..20_000).map(|number| point(number, 200)).collect();
    let clicks: Vec<String> = (0..400).map(|number| format!("Click({})", point(number, 20))).collect();
    [
        ("stroke.ron", format!("[Stroke(points: [{}], joints: 5)]", stroke.join(", "))),
        ("clicks.ron", format!("[{}]", clicks.join(", "))),
    ]
}

/// Runs commands, of which each ends with a result, within the memory that the files before it allow.
pub(super) fn check(folder: &Path, cases: &[(&[&str], &[&str])]) {
    for (files, args) in cases {
        let size: u64 = files.iter().map(|file| fs::metadata(folder.join(file)).unwrap().len()).sum();
        let (ended, answer) = json_answer(folder, args);
        assert_eq!(ended.code, Some(0), "{args:?}: {answer:.600}");
        let allowance = memory_allowance(size);
        assert!(ended.memory <= allowance, "{args:?}: {} KiB of {}", ended.memory >> 10, allowance >> 10);
    }
}

#[test]
fn weights_clips_and_projects_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    write("two.rig", skeleton(2, true));
    write("ball.obj", ball(100));
    write("box.obj", crate::cli::BOX.to_owned());
    write("j.rig.ron", template());
    write("long.anim.ron", long_clip(50_000));
    write("chain.rigsmith.ron", project(3_000));
    let (clip, weights, shot) = ("long.anim.ron", "ball.skin", "chain.rigsmith.ron");
    check(
        folder.path(),
        &[
            (&["ball.obj"], &["skin", "two.rig", "ball.obj", "-o", weights]),
            (&[weights], &["info", weights]),
            (&[weights], &["check", weights]),
            (&["ball.obj", weights], &["skin", "two.rig", "ball.obj", "--weights-from", weights, "-o", "a.glb"]),
            (&["box.obj", weights], &["skin", "two.rig", "box.obj", "--weights-from", weights, "-o", "b.glb"]),
            (&[clip], &["info", clip]),
            (&[clip], &["check", clip]),
            (&[clip], &["animate", "j.rig.ron", clip, "-o", "c.anim.ron"]),
            (&[clip], &["animate", "j.rig.ron", clip, "-o", "c.glb"]),
            (&[clip], &["animate", "j.rig.ron", clip, "-o", "c.rigclip"]),
            (&[shot], &["info", shot]),
            (&[shot], &["check", shot]),
            (&[shot], &["pose", shot, "-o", "posed.rig.ron"]),
        ],
    );
}

/// Hundreds of joints that all warm the whole of a mesh: what is found of each is not kept until the end.
#[test]
fn many_joints_are_bound_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let joints = 512;
    let joint = |number: i32| {
        let height = 1.8 * f64::from(number) / f64::from(joints - 1) - 0.9;
        format!("joint {number} {} 0 {height:.4} 0\n", number - 1)
    };
    let lines: String = (0..joints).map(joint).collect();
    fs::write(folder.path().join("many.rig"), format!("rig 1\n{lines}")).unwrap();
    fs::write(folder.path().join("ball.obj"), ball(170)).unwrap();
    check(folder.path(), &[(&["ball.obj", "many.rig"], &["skin", "many.rig", "ball.obj", "-o", "a.glb"])]);
}

/// Bytes of a joint beyond sixteen times its text, which `pose` takes over many short joints where values are written: its app
/// has entities, too.
const VALUES: u64 = 2_000;

#[test]
fn bare_joints_are_checked_without_a_build_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = "bare.rig.ron";
    fs::write(folder.path().join(file), bare_joints(60_000)).unwrap();
    check(folder.path(), &[(&[file], &["check", file])]);
}

/// Differences are told, and joints that came are written, without copies of the joints that stay as they are.
#[test]
fn bare_joints_are_compared_and_written_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let (one, large, file) = ("one.rig.ron", "large.rig.ron", "bare.rig.ron");
    let write = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    write(one, template());
    write(large, bare_joints(60_000));
    write(file, bare_joints(50_000));
    check(
        folder.path(),
        &[
            (&[large], &["diff", one, large]),
            (&[large], &["diff", large, large]),
            (&[file], &["inject", one, file, "--joints", "j7", "-o", "a.rig.ron"]),
            (&[file, file], &["update", file, "--from", file, "-o", "b.rig.ron"]),
        ],
    );
}

/// A value of a control brings the app, whose entities take several times the memory of joints; a joint whose scale is uneven
/// does not.
#[test]
fn uneven_scales_and_values_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let joints = 40_000;
    let (uneven, posed) = ("uneven.rig.ron", "posed.rig.ron");
    let write = |name: &str, first: &str| {
        let text = bare_joints(joints).replacen("(label:\"j0\")", first, 1);
        assert!(text.contains(first));
        fs::write(folder.path().join(name), &text).unwrap();
        text.len() as u64
    };
    let sizes =
        [write(uneven, "(label:\"j0\", scale: (1.0, 2.0, 1.0))"), write(posed, "(label:\"j0\", tags: [control()])")];
    check(folder.path(), &[(&[uneven], &["pose", uneven, "--frames", "1", "-o", "a.glb"])]);
    let args = ["pose", posed, "--set", "j0.translate=(1,0,0)", "-o", "b.glb"];
    let allowance = memory_allowance(sizes[1]) + joints as u64 * VALUES;
    let (ended, answer) = json_answer(folder.path(), &args);
    assert_eq!(ended.code, Some(0), "{args:?}: {answer:.600}");
    assert!(ended.memory <= allowance, "{args:?}: {} KiB of {}", ended.memory >> 10, allowance >> 10);
    let ended = run(folder.path(), &["watch", uneven, "--count", "1", "-o", "c.glb"]);
    let allowance = memory_allowance(sizes[0]);
    assert_eq!(ended.code, Some(0), "{}", ended.err);
    assert!(ended.memory <= allowance, "watch: {} KiB of {}", ended.memory >> 10, allowance >> 10);
}

#[test]
fn templates_of_bare_and_placed_joints_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let one = "one.rig.ron";
    fs::write(folder.path().join(one), template()).unwrap();
    for (file, text) in [("bare.rig.ron", bare_joints(40_000)), ("placed.rig.ron", placed_joints(20_000))] {
        fs::write(folder.path().join(file), &text).unwrap();
        let laid_out = format!("laid_out_{file}");
        fs::write(folder.path().join(&laid_out), &text).unwrap();
        check(
            folder.path(),
            &[
                (&[file], &["format", &laid_out]),
                (&[file], &["check", file]),
                (&[file], &["info", file]),
                (&[file], &["build", file, "-o", "a.rig.ron"]),
                (&[file], &["convert", file, "b.glb"]),
                (&[file], &["diff", file, file]),
                (&[file], &["diff", one, file]),
                (&[file], &["extract", file, "--joints", "j7", "-o", "c.rig.ron"]),
                (&[file, file], &["update", file, "--from", file, "-o", "e.rig.ron"]),
                (&[file], &["build", file, "-o", "a.glb"]),
                (&[file], &["inject", one, file, "--joints", "j7", "-o", "h.rig.ron"]),
                (&[file], &["merge", one, file, "-o", "d.rig.ron"]),
                (&[file], &["pose", file, "-o", "f.glb"]),
                (&[file], &["pose", file, "-o", "f.rig.ron"]),
                (&[file], &["pose", file, "--frames", "1", "-o", "g.glb"]),
            ],
        );
        let ended = run(folder.path(), &["watch", file, "--count", "1", "-o", "w.glb"]);
        let allowance = memory_allowance(text.len() as u64);
        println!("watch: {} KiB of {}", ended.memory >> 10, allowance >> 10);
        assert_eq!(ended.code, Some(0), "{}", ended.err);
        assert!(ended.memory <= allowance, "watch: {} KiB of {}", ended.memory >> 10, allowance >> 10);
    }
}

/// A rig of joints alone is animated without an app.
#[test]
fn tracks_of_thousands_of_joints_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let uid = |number: usize| format!("{:016x}", 0x1001 + number);
    let list = |one: &dyn Fn(usize) -> String| (0..20_000).map(one).collect::<Vec<String>>().join(", ");
    let joints = list(&|number| format!("(uid:\"{}\",label:\"j{number}\")", uid(number)));
    let tracks =
        list(&|number| format!("(node: \"{}\", property: Translation, keys: [(t: 0.0, v: (0, 0, 1))])", uid(number)));
    let clip = format!(
        "(format: 1, rig: \"0000000000000099\", rig_name: \"n\", clips: [(uid: \"00000000c11b0001\", name: \"c\", \
         frame_rate: 30.0, range: (0.0, 1.0), layers: [(uid: \"00000000c11b0002\", name: \"Base\", tracks: [{tracks}])])])"
    );
    let files = ["many.rig.ron", "many.anim.ron"];
    fs::write(folder.path().join(files[0]), format!("(format: 2, name: \"n\", joints: [{joints}])")).unwrap();
    fs::write(folder.path().join(files[1]), clip).unwrap();
    for output in ["out.glb", "out.anim.ron", "out.rigclip"] {
        check(folder.path(), &[(&files[..], &["animate", files[0], files[1], "-o", output])]);
    }
}

/// Meshes and skins of one character many times over, which share all accessors of the file.
fn shared_accessors(count: usize) -> String {
    let list = |one: &dyn Fn(usize) -> String| (0..count).map(one).collect::<Vec<String>>().join(",");
    let nodes = list(&|number| format!(r#"{{"mesh":0,"skin":{number}}}"#));
    let skins = list(&|_| r#"{"joints":[0],"inverseBindMatrices":4}"#.to_owned());
    let roots = list(&|number| (number + 1).to_string());
    // Positions, weights and a matrix of floats, joints and corners of bytes.
    let floats: [f32; 37] = std::array::from_fn(|at| match at {
        3 | 7 | 9 | 13 | 17 | 21 | 26 | 31 | 36 => 1.0,
        _ => 0.0,
    });
    let mut bytes: Vec<u8> = floats.iter().flat_map(|number| number.to_le_bytes()).collect();
    bytes.extend([0; 12]);
    bytes.extend([0, 1, 2]);
    let hex: String = bytes.iter().map(|byte| format!("%{byte:02x}")).collect();
    let view = |offset: usize, length: usize| format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#);
    let views = [view(0, 36), view(36, 48), view(84, 64), view(148, 12), view(160, 3)].join(",");
    let accessor = |view: usize, component: usize, count: usize, kind: &str| {
        format!(r#"{{"bufferView":{view},"componentType":{component},"count":{count},"type":"{kind}"}}"#)
    };
    let accessors = [
        accessor(0, 5126, 3, "VEC3"),
        accessor(1, 5126, 3, "VEC4"),
        accessor(3, 5121, 3, "VEC4"),
        accessor(4, 5121, 3, "SCALAR"),
        accessor(2, 5126, 1, "MAT4"),
    ];
    let attributes = r#"{"POSITION":0,"WEIGHTS_0":1,"JOINTS_0":2}"#;
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,{roots}]}}],"nodes":[{{"name":"j"}},{nodes}],
        "meshes":[{{"primitives":[{{"attributes":{attributes},"indices":3}}]}}],"skins":[{skins}],"accessors":[{}],
        "bufferViews":[{views}],"buffers":[{{"byteLength":{},"uri":"data:application/octet-stream,{hex}"}}]}}"#,
        accessors.join(","),
        bytes.len()
    )
}

#[test]
fn skins_that_share_accessors_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let skins = "skins.gltf";
    fs::write(folder.path().join(skins), shared_accessors(30_000)).unwrap();
    check(folder.path(), &[(&[skins], &["info", skins]), (&[skins], &["convert", skins, "out.glb"])]);
    let size = |file: &str| fs::metadata(folder.path().join(file)).unwrap().len();
    assert!(size("out.glb") < 2 * size(skins), "{} bytes of {}", size("out.glb"), size(skins));
}

/// A mesh of one triangle, shown again and again by nodes that say nothing else.
fn shown_again(count: usize) -> String {
    let nodes = vec![r#"{"mesh":0}"#; count].join(",");
    let roots = (0..count).map(|node| node.to_string()).collect::<Vec<String>>().join(",");
    let hex: String = [0, 0, 0, 1, 0, 0, 0, 1, 0]
        .iter()
        .flat_map(|number| (*number as f32).to_le_bytes())
        .map(|byte| format!("%{byte:02x}"))
        .collect();
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[{roots}]}}],"nodes":[{nodes}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream,{hex}"}}]}}"#
    )
}

#[test]
fn nodes_that_share_a_mesh_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let nodes = "nodes.gltf";
    fs::write(folder.path().join(nodes), shown_again(55_000)).unwrap();
    check(
        folder.path(),
        &[
            (&[nodes], &["info", nodes]),
            (&[nodes], &["check", nodes]),
            (&[nodes], &["convert", nodes, "out.glb"]),
            (&[nodes], &["convert", nodes, "out.gltf"]),
        ],
    );
}

/// Memory that a file may take counts that of the command itself, too: a file is refused before both are over the bound.
#[test]
fn morph_targets_without_data_are_refused_within_the_memory() {
    let folder = tempfile::tempdir().unwrap();
    let target = |number: usize| format!(r#"{{"POSITION":{}}}"#, number + 1);
    let targets: Vec<String> = (0..3_000).map(target).collect();
    let accessors = vec![r#"{"componentType":5126,"count":3000,"type":"VEC3","min":[0,0,0],"max":[0,0,0]}"#; 3_001];
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"accessors":[{}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{}]}}]}}]}}"#,
        accessors.join(","),
        targets.join(",")
    );
    fs::write(folder.path().join("targets.gltf"), &text).unwrap();
    for args in [&["info", "targets.gltf"][..], &["convert", "targets.gltf", "out.glb"]] {
        let (ended, answer) = json_answer(folder.path(), args);
        assert_eq!(ended.code, Some(1), "{answer}");
        assert!(answer.to_string().contains("bytes of memory"), "{answer}");
        let allowance = memory_allowance(text.len() as u64);
        assert!(ended.memory <= allowance, "{args:?}: {} KiB of {}", ended.memory >> 10, allowance >> 10);
    }
}

/// Bytes of the sections of a kind in a program of 64 bits, low bytes first, as the ELF format numbers them.
#[cfg(all(has_packed_relocations, target_arch = "x86_64"))]
fn section_bytes(program: &[u8], kind: u32) -> u64 {
    let number = |at: usize, bytes: usize| {
        let low_first = program[at..at + bytes].iter().rev();
        low_first.fold(0_u64, |value, byte| (value << 8) | u64::from(*byte)) as usize
    };
    let (first, size, count) = (number(0x28, 8), number(0x3a, 2), number(0x3c, 2));
    let sections = (0..count).map(|section| first + section * size);
    sections.filter(|at| number(at + 4, 4) == kind as usize).map(|at| number(at + 0x20, 8) as u64).sum()
}

/// The loader reads the whole table of relocations before a command begins; a table that is not packed takes megabytes.
#[cfg(all(has_packed_relocations, target_arch = "x86_64"))]
#[test]
fn relocations_of_the_program_are_packed() {
    let program = fs::read(env!("CARGO_BIN_EXE_rigsmith")).unwrap();
    // The numbers of the kinds RELA and RELR.
    let [whole, packed] = [4, 19].map(|kind| section_bytes(&program, kind));
    assert!(packed > 0 && whole < 1 << 20 && packed < 1 << 20, "{whole} bytes whole, {packed} packed");
}

#[test]
fn sketches_fits_and_faces_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("ball.obj"), ball(100)).unwrap();
    for (name, text) in gestures() {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models");
    fs::copy(models.join("biped.obj"), folder.path().join("body.obj")).unwrap();
    check(
        folder.path(),
        &[
            (&["ball.obj", "stroke.ron"], &["sketch", "ball.obj", "stroke.ron", "-o", "a.rig.ron"]),
            (&["ball.obj", "stroke.ron"], &["sketch", "ball.obj", "stroke.ron", "-o", "a.glb"]),
            (&["ball.obj", "clicks.ron"], &["sketch", "ball.obj", "clicks.ron", "-o", "b.glb"]),
            (&["ball.obj"], &["face", "ball.obj", "--whole", "-o", "c.glb"]),
            (&["body.obj"], &["fit", "body.obj", "--template", "biped", "-o", "d.rig.ron"]),
        ],
    );
}
