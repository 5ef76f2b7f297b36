//! The bundled models and rest skeletons: closed, even, of the promised size, and with every joint inside.

use std::{collections::BTreeMap, fs, path::PathBuf};

use glam::{DVec3, dvec3};

fn text(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/models").join(name);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Positions (as written, so that mirror images can be compared to the digit) and polygons of an object.
struct Mesh {
    written: Vec<[String; 3]>,
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    objects: BTreeMap<String, Vec<Vec<usize>>>,
}

fn mesh(name: &str) -> Mesh {
    let mut mesh = Mesh { written: vec![], points: vec![], normals: vec![], objects: BTreeMap::new() };
    let mut object = String::new();
    for line in text(name).lines() {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let numbers = || fields[1..4].iter().map(|x| x.parse::<f64>().unwrap()).collect::<Vec<_>>();
        match fields.first() {
            Some(&"v") => {
                let n = numbers();
                mesh.points.push(dvec3(n[0], n[1], n[2]));
                mesh.written.push([fields[1].into(), fields[2].into(), fields[3].into()]);
            }
            Some(&"vn") => {
                let n = numbers();
                mesh.normals.push(dvec3(n[0], n[1], n[2]));
            }
            Some(&"o") => object = fields[1].into(),
            Some(&"f") => mesh.objects.entry(object.clone()).or_default().push(
                fields[1..]
                    .iter()
                    .map(|corner| {
                        let (v, n) = corner.split_once("//").unwrap();
                        assert_eq!(v, n);
                        v.parse::<usize>().unwrap() - 1
                    })
                    .collect(),
            ),
            _ => {}
        }
    }
    mesh
}

fn joints(name: &str) -> Vec<(i64, DVec3, String)> {
    let text = text(name);
    assert_eq!(text.lines().next(), Some("rig 1"));
    let lines = text.lines().filter(|line| line.starts_with("joint "));
    lines
        .enumerate()
        .map(|(i, line)| {
            let f: Vec<&str> = line.split_whitespace().collect();
            assert_eq!(f[1].parse::<usize>().unwrap(), i);
            let at = dvec3(f[3].parse().unwrap(), f[4].parse().unwrap(), f[5].parse().unwrap());
            (f[2].parse().unwrap(), at, f[6].to_owned())
        })
        .collect()
}

/// True if a ray from `p` in an odd direction leaves through an odd number of triangles.
fn inside(mesh: &Mesh, faces: &[Vec<usize>], p: DVec3) -> bool {
    let direction = dvec3(0.2631, 0.1147, 0.9579);
    let mut crossings = 0;
    for face in faces {
        for k in 1..face.len() - 1 {
            let [a, b, c] = [face[0], face[k], face[k + 1]].map(|i| mesh.points[i]);
            let (ab, ac, ap) = (b - a, c - a, p - a);
            let n = direction.cross(ac);
            let det = ab.dot(n);
            let u = ap.dot(n) / det;
            let m = ap.cross(ab);
            let v = direction.dot(m) / det;
            let t = ac.dot(m) / det;
            crossings += usize::from(u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0);
        }
    }
    crossings % 2 == 1
}

/// Every edge belongs to two faces that run along it in opposite directions, and every vertex to one fan of faces.
fn assert_closed_manifold(name: &str, faces: &[Vec<usize>]) {
    let mut edges: BTreeMap<(usize, usize), u32> = BTreeMap::new();
    let mut next: BTreeMap<usize, BTreeMap<usize, usize>> = BTreeMap::new();
    for face in faces {
        for k in 0..face.len() {
            let (before, at, after) = (face[(k + face.len() - 1) % face.len()], face[k], face[(k + 1) % face.len()]);
            *edges.entry((at, after)).or_default() += 1;
            assert_eq!(next.entry(at).or_default().insert(after, before), None, "{name}: vertex {at}");
        }
    }
    for (&(a, b), &count) in &edges {
        assert_eq!((count, edges.get(&(b, a))), (1, Some(&1)), "{name}: edge {a} {b}");
    }
    for (vertex, fan) in &next {
        let start = *fan.keys().next().unwrap();
        let (mut at, mut steps) = (start, 0);
        loop {
            at = fan[&at];
            steps += 1;
            if at == start {
                break;
            }
        }
        assert_eq!(steps, fan.len(), "{name}: the faces around vertex {vertex} are not one fan");
    }
}

fn shells(faces: &[Vec<usize>]) -> usize {
    let mut parent: BTreeMap<usize, usize> = BTreeMap::new();
    fn root(parent: &mut BTreeMap<usize, usize>, i: usize) -> usize {
        let up = *parent.entry(i).or_insert(i);
        if up == i {
            return i;
        }
        let top = root(parent, up);
        parent.insert(i, top);
        top
    }
    for face in faces {
        let first = root(&mut parent, face[0]);
        for &i in &face[1..] {
            let other = root(&mut parent, i);
            parent.insert(other, first);
        }
    }
    parent.iter().filter(|(i, up)| i == up).count()
}

fn volume(mesh: &Mesh, faces: &[Vec<usize>]) -> f64 {
    let fan = |f: &Vec<usize>| {
        (1..f.len() - 1)
            .map(|k| mesh.points[f[0]].dot(mesh.points[f[k]].cross(mesh.points[f[k + 1]])) / 6.0)
            .sum::<f64>()
    };
    faces.iter().map(fan).sum()
}

#[test]
fn shells_are_closed_and_of_the_promised_size() {
    // Name, objects with their shells, least and greatest corner (metres), volume range (cubic metres).
    type Row = (&'static str, &'static [(&'static str, usize)], [f64; 3], [f64; 3], [f64; 2]);
    let table: [Row; 3] = [
        ("biped.obj", &[("body", 1)], [-0.75, 0.0, -0.20], [0.75, 1.75, 0.30], [0.055, 0.095]),
        ("hand.obj", &[("hand", 1)], [-0.10, 0.0, -0.06], [0.08, 0.30, 0.08], [0.0004, 0.0012]),
        ("head.obj", &[("eyes", 2), ("head", 1)], [-0.12, 0.0, -0.14], [0.12, 0.345, 0.14], [0.0035, 0.0075]),
    ];
    for (name, objects, low, high, volumes) in table {
        let mesh = mesh(name);
        let count: usize = mesh.objects.values().map(Vec::len).sum();
        assert!((5_000..=20_000).contains(&count), "{name}: {count} faces");
        assert!(mesh.objects.values().flatten().all(|face| face.len() == 4), "{name}: quads only");
        assert_eq!(mesh.points.len(), mesh.normals.len(), "{name}");
        assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 0.002), "{name}: unit normals");
        for (object, wanted) in objects {
            let faces = &mesh.objects[*object];
            assert_closed_manifold(name, faces);
            assert_eq!(shells(faces), *wanted, "{name}: {object}");
        }
        assert_eq!(mesh.objects.len(), objects.len(), "{name}");
        let (mut least, mut most) = (DVec3::MAX, DVec3::MIN);
        for &p in &mesh.points {
            least = least.min(p);
            most = most.max(p);
        }
        let (low, high) = (DVec3::from(low), DVec3::from(high));
        assert!(least.cmpge(low - 1e-3).all() && most.cmple(high + 1e-2).all(), "{name}: {least} to {most}");
        assert!(least.y.abs() < 2e-3, "{name} stands on the ground: {}", least.y);
        assert!((most.y - high.y).abs() < 0.02, "{name}: {} m high", most.y);
        let volume = volume(&mesh, &mesh.objects[objects[objects.len() - 1].0]);
        assert!(volume > volumes[0] && volume < volumes[1], "{name}: {volume} cubic metres, outside in if negative");
    }
}

#[test]
fn quads_are_sound() {
    for name in ["biped.obj", "hand.obj", "head.obj"] {
        let mesh = mesh(name);
        let (mut slivers, mut turned, mut all) = (0, 0, 0);
        for face in mesh.objects.values().flatten() {
            let p: Vec<DVec3> = face.iter().map(|&i| mesh.points[i]).collect();
            let edges: Vec<f64> = (0..4).map(|k| p[k].distance(p[(k + 1) % 4])).collect();
            let normal = (p[2] - p[0]).cross(p[3] - p[1]).normalize_or_zero();
            let mean: DVec3 = face.iter().map(|&i| mesh.normals[i]).sum();
            let (short, long) = edges.iter().fold((f64::MAX, 0f64), |(s, l), &e| (s.min(e), l.max(e)));
            all += 1;
            slivers += usize::from(long > 8.0 * short);
            turned += usize::from(normal.dot(mean) <= 0.0);
        }
        assert_eq!(turned, 0, "{name}: faces against their normals");
        assert!(slivers * 500 <= all, "{name}: {slivers} of {all} faces are slivers");
    }
}

#[test]
fn bodies_are_symmetric_to_the_digit() {
    for name in ["biped.obj", "head.obj"] {
        let mesh = mesh(name);
        let mut count: BTreeMap<[String; 3], i64> = BTreeMap::new();
        let mut on_plane = 0;
        for v in &mesh.written {
            if v[0] == "0.00000" {
                on_plane += 1;
                continue;
            }
            let mirrored = v[0].strip_prefix('-');
            let key = [mirrored.unwrap_or(&v[0]).to_owned(), v[1].clone(), v[2].clone()];
            *count.entry(key).or_default() += if mirrored.is_some() { -1 } else { 1 };
        }
        assert!(count.values().all(|&n| n == 0), "{name}: every vertex has its mirror image");
        assert!(on_plane > 100, "{name}: {on_plane} vertices on the plane");
    }
    let rig = joints("biped.rig");
    for (_, at, label) in rig.iter().filter(|(_, _, label)| label.ends_with("_l")) {
        let twin = format!("{}_r", label.trim_end_matches("_l"));
        let other = rig.iter().find(|joint| joint.2 == twin).unwrap_or_else(|| panic!("no {twin}"));
        assert_eq!(other.1, dvec3(-at.x, at.y, at.z), "{twin}");
    }
}

#[test]
fn joints_lie_inside() {
    for (rig, model, object, least, roots) in
        [("biped.rig", "biped.obj", "body", 50, 1), ("hand.rig", "hand.obj", "hand", 17, 1)]
    {
        let (joints, mesh) = (joints(rig), mesh(model));
        assert!(joints.len() >= least, "{rig}: {} joints", joints.len());
        assert_eq!(joints.iter().filter(|joint| joint.0 == -1).count(), roots, "{rig}");
        let faces = &mesh.objects[object];
        for (i, (parent, at, label)) in joints.iter().enumerate() {
            assert!(*parent < i as i64, "{rig}: {label} comes before its parent");
            assert_eq!(joints.iter().filter(|joint| joint.2 == *label).count(), 1, "{rig}: {label} is unique");
            assert!(inside(&mesh, faces, *at), "{rig}: {label} at {at} is outside");
        }
        assert!(!inside(&mesh, faces, DVec3::new(0.5, 1.7, 0.0)), "a point beside the model is outside");
    }
}
