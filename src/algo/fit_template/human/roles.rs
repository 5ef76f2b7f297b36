//! Roles: which joint of a template is which bone of the body model.
//!
//! Labels come first; where they say nothing, the order in the limb does.

use super::{
    super::{
        TemplateJoint,
        limbs::{LimbKind, TemplateLimbs},
    },
    model::bone,
};

/// A place on the body model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) enum Role {
    /// The head of a bone.
    Bone(usize),
    /// A point between the heads of two bones.
    Between(usize, usize, f32),
}

/// Words of labels (without the side) and the bones that they mean.
const WORDS: [(&str, &str); 26] = [
    ("upperarm", "upperarm"),
    ("uparm", "upperarm"),
    ("forearm", "lowerarm"),
    ("lowerarm", "lowerarm"),
    ("elbow", "lowerarm"),
    ("clavicle", "clavicle"),
    ("collar", "clavicle"),
    ("shoulder", "clavicle"),
    ("wrist", "hand"),
    ("hand", "hand"),
    ("thigh", "thigh"),
    ("upleg", "thigh"),
    ("upperleg", "thigh"),
    ("shin", "calf"),
    ("calf", "calf"),
    ("knee", "calf"),
    ("lowerleg", "calf"),
    ("ankle", "foot"),
    ("foot", "foot"),
    ("toe", "ball"),
    ("ball", "ball"),
    ("neck", "neck_01"),
    ("head", "head"),
    ("hip", "pelvis"),
    ("pelvis", "pelvis"),
    ("arm", "upperarm"),
];
const FINGERS: [(&str, &str); 6] = [
    ("thumb", "thumb"),
    ("index", "index"),
    ("middle", "middle"),
    ("ring", "ring"),
    ("pinky", "pinky"),
    ("little", "pinky"),
];

/// The role of each joint of a template that has one.
pub(in super::super) fn roles(joints: &[TemplateJoint], template: &TemplateLimbs) -> Vec<Option<Role>> {
    let mut roles = vec![None; joints.len()];
    let spine = [bone("pelvis"), bone("spine_01"), bone("spine_02"), bone("spine_03")];
    // The trunk, root to chest, is spread over the model's spine.
    let last = template.trunk.len().saturating_sub(1).max(1) as f32;
    for (i, &joint) in template.trunk.iter().enumerate() {
        let along = i as f32 / last * 3.0;
        let from = (along as usize).min(2);
        let share = along - from as f32;
        roles[joint] = Some(if share < 1e-4 {
            Role::Bone(spine[from])
        } else if share > 1.0 - 1e-4 {
            Role::Bone(spine[from + 1])
        } else {
            Role::Between(spine[from], spine[from + 1], share)
        });
    }
    for limb in &template.limbs {
        let side = if template.positions[limb.joints[0]].x > 0.0 { "l" } else { "r" };
        let path: Vec<usize> = limb.joints.clone();
        let sided = |name: &str| bone(&format!("{name}_{side}"));
        let names: Vec<usize> = match limb.kind {
            LimbKind::Head => vec![bone("neck_01"), bone("head")],
            LimbKind::Arm => ["clavicle", "upperarm", "lowerarm", "hand"].iter().map(|n| sided(n)).collect(),
            LimbKind::Leg => ["thigh", "calf", "foot", "ball"].iter().map(|n| sided(n)).collect(),
            _ => continue,
        };
        let said: Vec<Option<usize>> = path.iter().map(|&j| word(joints[j].label, side)).collect();
        let mut taken = Vec::new();
        for (&joint, said) in path.iter().zip(&said) {
            if let Some(b) = said.filter(|b| names.contains(b) && !taken.contains(b)) {
                taken.push(b);
                roles[joint] = Some(Role::Bone(b));
            }
        }
        if taken.len() < 2 {
            by_order(template, &path, &names, limb.kind, &mut roles);
        }
    }
    for (joint, template_joint) in joints.iter().enumerate() {
        let side = if template.positions[joint].x > 0.0 { "l" } else { "r" };
        if let Some(b) = finger(template_joint.label, side) {
            roles[joint] = Some(Role::Bone(b));
        }
    }
    roles
}

/// Roles by the order of joints in a limb.
fn by_order(template: &TemplateLimbs, path: &[usize], names: &[usize], kind: LimbKind, roles: &mut [Option<Role>]) {
    let skip = match kind {
        // An arm of three joints has no clavicle.
        LimbKind::Arm if path.len() < 4 => 1,
        LimbKind::Arm => {
            let lengths: Vec<f32> = (1..4).map(|i| template.length(path[i - 1], path[i])).collect();
            usize::from(lengths[0] > 0.8 * lengths[1])
        }
        LimbKind::Head if path.len() == 1 => 1,
        _ => 0,
    };
    if kind == LimbKind::Head && path.len() > 2 {
        roles[path[0]] = Some(Role::Bone(names[0]));
        roles[path[path.len() - 1]] = Some(Role::Bone(names[1]));
        return;
    }
    for (&joint, &name) in path.iter().zip(&names[skip..]) {
        roles[joint] = Some(Role::Bone(name));
    }
}

/// A label in lower case without marks and without its side.
fn plain(label: &str) -> String {
    let lower = label.to_lowercase();
    let mut text = lower.as_str();
    for end in ["_l", "_r", ".l", ".r", "-l", "-r", "_left", "_right"] {
        text = text.strip_suffix(end).unwrap_or(text);
    }
    text.chars().filter(char::is_ascii_alphanumeric).collect()
}

fn word(label: &str, side: &str) -> Option<usize> {
    let text = plain(label);
    // A joint in the middle of a bone is no end of one.
    if text.contains("twist") || text.contains("half") {
        return None;
    }
    let (_, name) = WORDS.iter().find(|(word, _)| text.contains(word))?;
    let central = ["pelvis", "neck_01", "head"].contains(name);
    Some(if central { bone(name) } else { bone(&format!("{name}_{side}")) })
}

fn finger(label: &str, side: &str) -> Option<usize> {
    let text = plain(label);
    if text.contains("toe") || text.contains("twist") || text.contains("half") {
        return None;
    }
    let (_, name) = FINGERS.iter().find(|(word, _)| text.contains(word))?;
    let number: usize = text.chars().filter(char::is_ascii_digit).collect::<String>().parse().ok()?;
    (1..=3).contains(&number).then(|| bone(&format!("{name}_0{number}_{side}")))
}
