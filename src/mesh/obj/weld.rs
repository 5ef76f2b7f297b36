//! Conversion of arrays into a [`Model`]: objects, parts, and vertices in place of corners.

use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::{
    NONE, ObjArrays,
    color::to_linear,
    corner_table::CornerTable,
    materials::{Sidecar, material_set},
    normals::{SmoothNormals, face_normal, given, group_numbers, is_flat, position},
    triangulate::Triangulator,
};
use crate::mesh::model::{Faces, Model, Object, Part};

/// Largest number of corners for ear clipping; larger faces are cut into plain fans, which take no memory.
const LARGEST_POLYGON: usize = 1 << 20;

/// Faces that become one [`Part`].
struct Plan {
    object: usize,
    material: Option<usize>,
    /// Runs that contain faces of the part.
    runs: Vec<usize>,
}

pub(super) fn model(arrays: &ObjArrays, name: &str, sidecar: &mut Sidecar) -> Model {
    let mut notes = arrays.notes.clone();
    let (material_set, materials) = material_set(arrays, sidecar, &mut notes);
    let (objects, plans) = plan(arrays, &materials, &mut notes);
    let colors = linear_colors(arrays, &mut notes);
    let groups = group_numbers(arrays);
    let mut welder = Welder {
        arrays,
        colors,
        table: CornerTable::new(if arrays.corners.is_empty() { 0 } else { arrays.positions.len() }),
        smooth: SmoothNormals::new(arrays, &groups),
        groups,
        triangulator: Triangulator::default(),
    };
    let parts = plans.iter().map(|plan| welder.part(plan)).collect();
    let fans = welder.triangulator.fans;
    if fans > 0 {
        notes.push(format!("{fans} very large or tangled polygon(s) were cut into plain fans"));
    }
    let points = arrays.positions.iter().copied().map(Vec3::from).collect();
    Model { name: name.into(), points, objects, parts, material_set, notes, ..Model::default() }
}

/// Objects and parts in the order of their first faces.
fn plan(arrays: &ObjArrays, materials: &HashMap<u32, usize>, notes: &mut Vec<String>) -> (Vec<Object>, Vec<Plan>) {
    let by_object = arrays.runs.iter().any(|run| run.object != NONE);
    let most = arrays.most_parts();
    for split in [Split { objects: true, materials: true }, Split { objects: false, materials: true }] {
        if let Some(planned) = try_plan(arrays, materials, by_object, split, most) {
            if !split.objects {
                notes.push(format!("more than {most} objects or groups in a file of this size: taken as one object"));
            }
            return planned;
        }
    }
    notes.push(format!("more than {most} materials in a file of this size: left out"));
    let split = Split { objects: false, materials: false };
    try_plan(arrays, materials, by_object, split, most).unwrap_or_default()
}

#[derive(Clone, Copy)]
struct Split {
    objects: bool,
    materials: bool,
}

fn try_plan(
    arrays: &ObjArrays,
    materials: &HashMap<u32, usize>,
    by_object: bool,
    split: Split,
    most: usize,
) -> Option<(Vec<Object>, Vec<Plan>)> {
    let mut objects = Vec::new();
    let mut plans: Vec<Plan> = Vec::new();
    let mut object_numbers = HashMap::new();
    let mut plan_numbers = HashMap::new();
    for (number, run) in arrays.runs.iter().enumerate() {
        let name = match split.objects {
            true if by_object => run.object,
            true => run.group,
            false => NONE,
        };
        let object = *object_numbers.entry(name).or_insert_with(|| {
            objects.push(Object { name: arrays.names.get(name).into(), ..Object::default() });
            objects.len() - 1
        });
        let material = materials.get(&run.material).copied().filter(|_| split.materials);
        let plan = *plan_numbers.entry((object, material)).or_insert_with(|| {
            plans.push(Plan { object, material, runs: Vec::new() });
            plans.len() - 1
        });
        plans[plan].runs.push(number);
        if plans.len() > most {
            return None;
        }
    }
    Some((objects, plans))
}

/// Linear colours of the positions. Exporters write sRGB, most from 0 to 1, some from 0 to 255.
fn linear_colors(arrays: &ObjArrays, notes: &mut Vec<String>) -> Vec<Vec4> {
    let largest = arrays.colors.iter().flatten().fold(0.0_f32, |largest, value| largest.max(*value));
    let scale = if largest > 1.0 { 255.0 } else { 1.0 };
    if largest > 1.0 {
        notes.push("vertex colours go past 1 and were taken as 0 to 255".into());
    }
    let linear = |value: f32| to_linear((f64::from(value) / scale).clamp(0.0, 1.0)) as f32;
    arrays.colors.iter().map(|[r, g, b]| Vec4::new(linear(*r), linear(*g), linear(*b), 1.0)).collect()
}

struct Welder<'a> {
    arrays: &'a ObjArrays,
    colors: Vec<Vec4>,
    table: CornerTable,
    smooth: SmoothNormals,
    groups: Vec<u32>,
    triangulator: Triangulator,
}

/// Bit that marks the lower half of a key as a smoothing group instead of a normal.
const MADE: u32 = 1 << 31;

impl Welder<'_> {
    fn part(&mut self, plan: &Plan) -> Part {
        let arrays = self.arrays;
        let ranges = || plan.runs.iter().map(|run| arrays.run_faces(*run));
        let face_count: usize = ranges().map(|faces| faces.len()).sum();
        let corner_count: usize =
            ranges().map(|faces| (arrays.face_starts[faces.end] - arrays.face_starts[faces.start]) as usize).sum();
        let mut part = Part { object: plan.object, material: plan.material, ..Part::default() };
        let mut faces = Faces { starts: Vec::with_capacity(face_count + 1), corners: Vec::with_capacity(corner_count) };
        faces.starts.push(0);
        for run in &plan.runs {
            let smoothing = arrays.runs[*run].smoothing;
            let group = self.groups[*run];
            for face in arrays.run_faces(*run) {
                self.face(face, smoothing, group, &mut part, &mut faces.corners);
                faces.starts.push(faces.corners.len() as u32);
            }
        }
        self.attributes(&mut part);
        self.table.clear(&part.vertices);
        if corner_count == 3 * face_count {
            let (triangles, _) = faces.corners.as_chunks::<3>();
            part.triangles = triangles.to_vec();
        } else {
            part.triangles = self.triangles(&part, &faces, corner_count - 2 * face_count);
            part.faces = faces;
        }
        part
    }

    /// Makes or finds the vertices of one face. Computed normals of one `group` are shared.
    fn face(&mut self, face: usize, smoothing: u32, group: u32, part: &mut Part, corners: &mut Vec<u32>) {
        let arrays = self.arrays;
        let mut flat = None;
        for corner in arrays.face(face) {
            let point = arrays.corners[corner];
            let texcoord = u64::from(arrays.corner_texcoords.get(corner).copied().unwrap_or(NONE)) << 32;
            let (vertex, known, normal) = match given(arrays, corner) {
                Some((index, normal)) => {
                    let (vertex, known) = self.table.vertex(point, texcoord | u64::from(index));
                    (vertex, known, Some(normal))
                }
                None if is_flat(smoothing) => (self.table.push(texcoord | u64::from(NONE), NONE), false, None),
                None => {
                    let (vertex, known) = self.table.vertex(point, texcoord | u64::from(MADE | group));
                    let normal = if known { None } else { self.smooth.at(point, group) };
                    (vertex, known, normal)
                }
            };
            corners.push(vertex);
            if !known {
                let fallback = |flat: &mut Option<Vec3>| {
                    *flat.get_or_insert_with(|| {
                        let normal = face_normal(arrays, face);
                        // A face without area faces up by convention.
                        if normal == DVec3::ZERO { Vec3::Y } else { normal.as_vec3() }
                    })
                };
                part.vertices.push(point);
                part.normals.push(normal.unwrap_or_else(|| fallback(&mut flat)));
            }
        }
    }

    /// Fills the attributes that the vertices' keys refer to.
    fn attributes(&self, part: &mut Part) {
        let texcoord = |vertex: usize| (self.table.key(vertex) >> 32) as u32;
        let count = self.table.len();
        if (0..count).any(|vertex| texcoord(vertex) != NONE) {
            let uv = |vertex| match self.arrays.texcoords.get(texcoord(vertex) as usize) {
                Some([u, v]) => Vec2::new(*u, 1.0 - v),
                None => Vec2::ZERO,
            };
            part.uvs.push((0..count).map(uv).collect());
        }
        if !self.colors.is_empty() {
            part.colors = part.vertices.iter().map(|point| self.colors[*point as usize]).collect();
        }
    }

    fn triangles(&mut self, part: &Part, faces: &Faces, count: usize) -> Vec<[u32; 3]> {
        let mut triangles = Vec::with_capacity(count);
        let mut points = Vec::new();
        for face in faces.iter() {
            if face.len() > LARGEST_POLYGON {
                triangles.extend((2..face.len()).map(|corner| [face[0], face[corner - 1], face[corner]]));
                self.triangulator.fans += 1;
                continue;
            }
            points.clear();
            points.extend(face.iter().map(|vertex| position(self.arrays, part.vertices[*vertex as usize])));
            let start = triangles.len();
            self.triangulator.polygon(&points, &mut triangles);
            for corner in triangles[start..].iter_mut().flatten() {
                *corner = face[*corner as usize];
            }
        }
        triangles
    }
}
