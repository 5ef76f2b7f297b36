//! Binding of a mesh for every command that skins: joints and parts by name, and what the weights report tells.

use std::collections::{BTreeMap, HashMap, HashSet};

use serde_json::{Value, json};

use super::{
    Failure, Report,
    progress::Progress,
    report::{counted, is_json},
};
use crate::{
    algo::weights::{IdleReason, WeightSettings},
    headless::Workbench,
    plugins::skinning::{BindRequest, IdleJoint, MeshPart, MeshParts, PartBinding, RigidPart, SkinningReport},
    rig::{Uid, deform::DeformSkeleton, nearest::did_you_mean},
};

/// Names that a line for people lists.
const LISTED: usize = 3;
/// Lines about rigid parts, one a joint.
const LINES: usize = 6;

/// Choices for parts of a mesh.
pub(super) type PartChoices = Vec<(MeshPart, PartBinding)>;

/// Binds the mesh of a workbench with automatic weights. Joints with the labels in `claims` hold skin although they would be
/// idle.
pub(super) fn bind(
    bench: &mut Workbench,
    settings: WeightSettings,
    claims: &[String],
    parts: PartChoices,
    report: &mut Report,
) -> Result<(), Failure> {
    let names = JointNames::new(bench);
    let claims = names.claims(claims)?;
    let mut progress = Progress::new("skinning");
    let ask = |request: &mut BindRequest| {
        (request.settings, request.parts, request.claims) = (settings, parts, claims.clone());
    };
    let bound = bench.skin_with(ask, &mut |part| progress.at(part))?;
    drop(progress);
    describe(report, &names, &bound, &claims);
    Ok(())
}

/// Adds what was told of one of several meshes: lines and notes with its name, and an entry of the list `meshes` for
/// programs.
pub(super) fn add_of_mesh(report: &mut Report, name: &str, told: Report) {
    report.lines.extend(told.lines.iter().map(|line| format!("{name}: {line}")));
    report.notes.extend(told.notes.iter().map(|note| format!("{name}: {note}")));
    let mut entry = told.json;
    entry.insert("mesh".to_owned(), name.into());
    let list = report.json.entry("meshes").or_insert_with(|| Value::Array(Vec::new()));
    if let Value::Array(list) = list {
        list.push(Value::Object(entry));
    }
}

/// Labels of the joints that can hold skin, and the names of those without a label.
pub(super) struct JointNames {
    list: Vec<(Uid, String)>,
    /// Place in the list of each joint, and of the first joint with each name.
    joints: HashMap<Uid, usize>,
    names: HashMap<String, usize>,
}

impl JointNames {
    /// Names of the joints of a workbench's rig.
    pub fn new(bench: &Workbench) -> Self {
        let (rig, built) = (bench.rig(), bench.built());
        let mut made: HashMap<Uid, &str> = HashMap::new();
        for node in built.into_iter().flat_map(|built| built.nodes.iter()) {
            let name: &str = node.label.as_ref().unwrap_or(&node.name);
            made.entry(node.uid).or_insert(name);
        }
        let name = |uid: Uid| {
            let label = rig.joint(uid).and_then(|joint| joint.data.label.clone());
            let created = || made.get(&uid).map(|name| (*name).to_owned());
            label.or_else(created).unwrap_or_else(|| uid.to_string())
        };
        let skeleton = DeformSkeleton::new(rig, built);
        let list: Vec<(Uid, String)> = skeleton.joints().iter().map(|joint| (joint.uid, name(joint.uid))).collect();
        let (mut joints, mut names) = (HashMap::new(), HashMap::new());
        for (at, (uid, name)) in list.iter().enumerate() {
            joints.entry(*uid).or_insert(at);
            names.entry(name.clone()).or_insert(at);
        }
        Self { list, joints, names }
    }

    /// Joint with a name; `option` names the option in the error.
    pub fn find(&self, option: &str, name: &str) -> Result<Uid, Failure> {
        let found = self.names.get(name).map(|at| self.list[*at].0);
        found.ok_or_else(|| {
            let nearest = did_you_mean(name, self.list.iter().map(|(_, name)| name));
            Failure::Input(format!("{option}: the rig has no joint with the label {name:?}{nearest}").into())
        })
    }

    /// Joints of lists of labels with commas between them.
    fn claims(&self, lists: &[String]) -> Result<Vec<Uid>, Failure> {
        let is_name = |text: &str| self.names.contains_key(text);
        let labels = lists.iter().flat_map(|list| separated(list, is_name));
        labels.map(|label| self.find("--claim", label)).collect()
    }

    /// Name of a joint; its uid if it has none.
    pub fn of(&self, uid: Uid) -> String {
        self.joints.get(&uid).map_or_else(|| uid.to_string(), |at| self.list[*at].1.clone())
    }
}

/// Parts that `--rigid PART=JOINT` and `--blend PART[,PART...]` decide about.
pub(super) fn chosen_parts(rigid: &[String], blend: &[String], bench: &Workbench) -> Result<PartChoices, Failure> {
    let Some(mesh) = bench.mesh().filter(|_| !rigid.is_empty() || !blend.is_empty()) else { return Ok(Vec::new()) };
    let parts = MeshParts::new(mesh);
    let names = JointNames::new(bench);
    let find = |option: &str, part: &str| {
        parts.find(part).ok_or_else(|| {
            let nearest = did_you_mean(part, parts.all_names());
            Failure::Input(format!("{option}: the mesh has no part {part:?}{nearest}").into())
        })
    };
    let rigid = rigid.iter().map(|text| {
        let option = format!("--rigid {text}");
        let wrong = || Failure::Usage(format!("{option}: write PART=JOINT, both by name"));
        let (part, joint) = text.split_once('=').ok_or_else(wrong)?;
        Ok((find(&option, part)?, PartBinding::Rigid(names.find(&option, joint)?)))
    });
    let blended = blend.iter().flat_map(|list| separated(list, |text| parts.find(text).is_some()));
    let blended = blended.map(|part| Ok((find("--blend", part)?, PartBinding::Bends)));
    rigid.chain(blended).collect()
}

/// Names of a list with commas between them, unless all of it is one name.
fn separated(list: &str, is_name: impl Fn(&str) -> bool) -> Vec<&str> {
    if is_name(list) { vec![list] } else { list.split(',').map(str::trim).collect() }
}

/// Adds what the computation of weights found to the report.
fn describe(report: &mut Report, names: &JointNames, bound: &SkinningReport, claims: &[Uid]) {
    let weights = &bound.weights;
    report.line(format!(
        "{} weighted: {} over the surface, {} through voxels, {} filled, {} by the nearest bone, {} given",
        counted(weights.points, "point", "points"),
        weights.by_surface,
        weights.by_voxels,
        weights.by_fill,
        weights.by_nearest,
        weights.given
    ));
    report.set(
        "weights",
        json!({
            "points": weights.points,
            "by_surface": weights.by_surface,
            "by_voxels": weights.by_voxels,
            "by_fill": weights.by_fill,
            "by_nearest": weights.by_nearest,
            "given": weights.given,
            "stiff": weights.stiff,
        }),
    );
    report.lines.extend(rigid_lines(names, &bound.rigid_parts));
    report.lines.extend(idle_lines(names, &bound.idle_joints, claims));
    if !is_json() {
        // A soup has as many rigid parts as triangles, and each takes more memory here than its points.
        return;
    }
    let part = |rigid: &RigidPart| {
        let joint = names.of(rigid.joint);
        json!({ "part": rigid.name, "points": rigid.points, "joint": joint, "share": rigid.share })
    };
    report.set("rigid_parts", bound.rigid_parts.iter().map(part).collect::<Vec<Value>>());
    let idle = |idle: &IdleJoint| {
        let (reason, distance) = reason_word(idle.reason);
        json!({ "joint": names.of(idle.joint), "reason": reason, "distance": distance })
    };
    report.set("idle_joints", bound.idle_joints.iter().map(idle).collect::<Vec<Value>>());
}

/// Word of a reason for programs, and the distance from the mesh.
fn reason_word(reason: IdleReason) -> (&'static str, Option<f32>) {
    match reason {
        IdleReason::Outside { distance } => ("outside", Some(distance)),
        IdleReason::NoSurface => ("no_surface", None),
        IdleReason::Slot => ("slot", None),
        IdleReason::NotDeforming => ("not_deforming", None),
        IdleReason::Locked => ("locked", None),
    }
}

/// Lines about rigid parts for people, one for each joint that holds some.
fn rigid_lines(names: &JointNames, parts: &[RigidPart]) -> Vec<String> {
    let mut by_joint: BTreeMap<String, Vec<&RigidPart>> = BTreeMap::new();
    for part in parts {
        by_joint.entry(names.of(part.joint)).or_default().push(part);
    }
    let line = |(joint, parts): (&String, &Vec<&RigidPart>)| {
        let names = parts.iter().map(|part| format!("{} ({})", part.name, counted(part.points, "point", "points")));
        format!("moving as one with {joint}: {}", shortened(names))
    };
    let mut lines: Vec<String> = by_joint.iter().take(LINES).map(line).collect();
    let rest: usize = by_joint.values().skip(LINES).map(Vec::len).sum();
    if rest > 0 {
        let joints = counted(by_joint.len() - LINES, "other joint", "other joints");
        lines.push(format!("moving as one with {joints}: {}", counted(rest, "part", "parts")));
    }
    lines
}

/// Lines about idle joints for people, one for each reason; joints that were to claim skin have a line of their own.
fn idle_lines(names: &JointNames, idle: &[IdleJoint], claims: &[Uid]) -> Vec<String> {
    let claims: HashSet<Uid> = claims.iter().copied().collect();
    let of = |reason: &str| -> Vec<&IdleJoint> {
        let is_one = |idle: &&IdleJoint| reason_word(idle.reason).0 == reason && !claims.contains(&idle.joint);
        idle.iter().filter(is_one).collect()
    };
    let kinds = [
        ("outside", "hold no skin, outside of the mesh (--claim lets them)"),
        ("no_surface", "hold no skin, all of it belongs to other joints (--claim lets those beside the body)"),
        ("slot", "hold no skin, carry or steer things by their names (--claim lets them)"),
        ("not_deforming", "hold no skin, do not deform"),
        ("locked", "hold no skin, locked without weights"),
    ];
    let mut groups: Vec<(&str, Vec<&IdleJoint>)> = kinds.map(|(reason, text)| (text, of(reason))).into();
    let claimed = idle.iter().filter(|idle| claims.contains(&idle.joint)).collect();
    groups.push(("hold no skin although they claim it, all of it is nearer to other joints", claimed));
    let groups = groups.iter().filter(|(_, joints)| !joints.is_empty());
    groups.map(|(text, joints)| format!("{text}: {}", shortened(named_once(names, joints).into_iter()))).collect()
}

/// Each name of some joints once, in their order: with the number of joints if several have the name, and with their
/// distances from the mesh if they lie outside of it.
fn named_once(names: &JointNames, joints: &[&IdleJoint]) -> Vec<String> {
    let mut by_name: Vec<(String, Vec<&IdleJoint>)> = Vec::new();
    let mut places: HashMap<String, usize> = HashMap::new();
    for &joint in joints {
        let name = names.of(joint.joint);
        let at = *places.entry(name.clone()).or_insert(by_name.len());
        match by_name.get_mut(at) {
            Some((_, group)) => group.push(joint),
            None => by_name.push((name, vec![joint])),
        }
    }
    let text = |(name, group): (String, Vec<&IdleJoint>)| {
        let distances = group.iter().filter_map(|idle| reason_word(idle.reason).1);
        let nearest = distances.clone().fold(f32::INFINITY, f32::min);
        let furthest = distances.fold(f32::NEG_INFINITY, f32::max);
        let mut remarks = Vec::new();
        if group.len() > 1 {
            remarks.push(counted(group.len(), "joint", "joints"));
        }
        if nearest < furthest {
            remarks.push(format!("{nearest:.3} to {furthest:.3} away"));
        } else if nearest.is_finite() {
            remarks.push(format!("{nearest:.3} away"));
        }
        if remarks.is_empty() { name } else { format!("{name} ({})", remarks.join(", ")) }
    };
    by_name.into_iter().map(text).collect()
}

/// The first of some names, and the number of the others.
pub(super) fn shortened(names: impl ExactSizeIterator<Item = String>) -> String {
    let rest = names.len().saturating_sub(LISTED);
    let listed = names.take(LISTED).collect::<Vec<String>>().join(", ");
    if rest > 0 { format!("{listed} and {rest} more") } else { listed }
}
