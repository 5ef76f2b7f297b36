//! Names that skeletons give to the bones of a human.
//!
//! Known are the names of Mixamo (`mixamorig:LeftUpLeg`), Unreal (`thigh_l`), VRM (`J_Bip_L_UpperLeg`, `leftUpperLeg`), CMU
//! (`LeftUpLeg`, `LHipJoint`; `LeftHip`, `LeftKnee`; `lfemur`, `ltibia`), MakeHuman (`upperleg01.L`, `UpLeg_L`), Rigify
//! (`DEF-thigh.L`), Biped (`Bip01 L Thigh`), SMPL (`L_Knee`, `m_avg_L_Knee`), Motive (`LThigh`, `LUArm`), Rokoko
//! (`LeftThigh`, `LeftFinger2Medial`), Xsens (`LeftHip`, `LeftSecondPP`), Character Creator (`CC_Base_L_Thigh`), Daz
//! (`lThighBend`) and the templates of this crate (`thigh_l`).

use super::{BodySide, Finger, HeadBone, HumanBone, LimbBone};

/// Beginnings of names that say which tool made the skeleton.
const PREFIXES: [&[&str]; 11] = [
    &["j", "bip"],
    &["mixamorig"],
    &["def"],
    &["org"],
    &["bip", "1"],
    &["bip", "01"],
    &["bip", "001"],
    &["bip"],
    &["m", "avg"],
    &["f", "avg"],
    &["cc", "base"],
];

/// Words that the names of CMU's ASF files glue to the letter of their side: `lfemur`.
const GLUED: [&str; 9] = ["clavicle", "humerus", "radius", "wrist", "hand", "femur", "tibia", "foot", "toes"];

/// Fingers in the order in which skeletons number them.
const FINGERS: [Finger; 5] = [Finger::Thumb, Finger::Index, Finger::Middle, Finger::Ring, Finger::Little];

/// Name without the namespace before it.
fn without_namespace(name: &str) -> &str {
    name.rsplit([':', '|']).next().unwrap_or(name)
}

/// Words of a name without namespace and without the tool's prefix.
fn own_words(name: &str) -> Vec<String> {
    let mut words = words(without_namespace(name));
    for prefix in PREFIXES {
        if words.len() > prefix.len() && words.iter().zip(prefix).all(|(word, known)| word == known) {
            words.drain(..prefix.len());
            // Several rigs of a scene have numbers: `mixamorig9Hips`.
            if prefix == ["mixamorig"] && words.len() > 1 && words[0].parse::<u32>().is_ok() {
                words.remove(0);
            }
        }
    }
    motive_arm(&words).map_or(words, |arm| arm.to_vec())
}

/// Words of an arm's bone in the motions of Motive, which glues its first letter to that of the side: `LUArm`, `RFArm`.
fn motive_arm(words: &[String]) -> Option<[String; 2]> {
    let [glued, arm] = words else { return None };
    let words = match (glued.as_str(), arm.as_str()) {
        ("lu", "arm") => ["l", "upperarm"],
        ("lf", "arm") => ["l", "forearm"],
        ("ru", "arm") => ["r", "upperarm"],
        ("rf", "arm") => ["r", "forearm"],
        _ => return None,
    };
    Some(words.map(str::to_owned))
}

/// Name before the number behind its last underscore, and that number: `LeftUpLeg_058`.
pub(super) fn node_number(name: &str) -> Option<(&str, u32)> {
    let (stem, number) = name.rsplit_once('_')?;
    let is_number = number.bytes().all(|byte| byte.is_ascii_digit());
    let number = number.parse().ok().filter(|_| is_number && !stem.is_empty())?;
    Some((stem, number))
}

/// Number of a joint of a numbered spine that goes on to the head, as Rigify has it (`DEF-spine.006`); 0 for the first.
pub(super) fn spine_number(name: &str) -> Option<u32> {
    match own_words(name).as_slice() {
        [word] if word == "spine" => Some(0),
        [word, number] if word == "spine" => number.parse().ok(),
        _ => None,
    }
}

/// Bone that a name means, and a rank: among several joints for a bone the lowest counts.
pub(super) fn bone_of(name: &str) -> Option<(HumanBone, usize)> {
    // MakeHuman's motions have helpers of that form, from a joint to where the next one begins.
    if name.starts_with("__") {
        return None;
    }
    if let Some(bone) = biped_finger(name) {
        return Some((bone, 0));
    }
    let words = own_words(name);
    let (words, side) = unglued(without_side(&words));
    let (number, stem) = numbered(&words);
    let side_of = |bone: LimbBone, rank: usize| Some((HumanBone::Limb(side?, bone), rank));
    if let Some((finger, number)) = finger(&words) {
        return (1..=3)
            .contains(&number)
            .then_some(())
            .and(side)
            .map(|side| (HumanBone::Finger(side, finger, number), 0));
    }
    // MakeHuman: `toe2-1` begins the second toe, which stands for all of them.
    if let ["toe", toe, "1"] = words[..] {
        let rank = 1 + usize::from(toe.parse::<u8>().ok()?.abs_diff(2));
        return Some((HumanBone::Limb(side?, LimbBone::Toes), rank));
    }
    if number > 1 && side.is_some() {
        return None;
    }
    match (stem.as_str(), side) {
        ("hips" | "pelvis", None) => Some((HumanBone::Hips, 0)),
        ("hip" | "cog", None) => Some((HumanBone::Hips, 1)),
        ("head", None) if number <= 1 => Some((HumanBone::Head, 0)),
        ("neck", None) if number <= 1 => Some((HumanBone::Neck, 0)),
        ("upperarm" | "uparm" | "uarm" | "shldr" | "shldrbend", _) => side_of(LimbBone::UpperArm, 0),
        ("arm", _) => side_of(LimbBone::UpperArm, 1),
        ("clavicle" | "collar" | "collarbone", _) => side_of(LimbBone::Shoulder, 0),
        ("shoulder", _) => side_of(LimbBone::Shoulder, 1),
        ("forearm" | "forearmbend" | "lowerarm" | "loarm" | "lowarm" | "larm", _) => side_of(LimbBone::LowerArm, 0),
        ("humerus", _) => side_of(LimbBone::UpperArm, 2),
        ("elbow" | "radius", _) => side_of(LimbBone::LowerArm, 1),
        ("hand", _) => side_of(LimbBone::Hand, 0),
        ("wrist", _) => side_of(LimbBone::Hand, 1),
        ("thigh" | "thighbend" | "upleg" | "upperleg" | "uleg", _) => side_of(LimbBone::UpperLeg, 0),
        ("shin" | "calf" | "shank" | "lowerleg" | "loleg" | "lowleg" | "lleg", _) => side_of(LimbBone::LowerLeg, 0),
        ("leg", _) => side_of(LimbBone::LowerLeg, 1),
        ("hip" | "femur", _) => side_of(LimbBone::UpperLeg, 1),
        ("knee" | "tibia", _) => side_of(LimbBone::LowerLeg, 2),
        ("foot", _) => side_of(LimbBone::Foot, 0),
        ("ankle", _) => side_of(LimbBone::Foot, 1),
        ("toebase" | "toes" | "toe" | "ball", _) => side_of(LimbBone::Toes, 0),
        _ => None,
    }
}

/// Joint of an arm whose bone depends on the other names of the skeleton.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ArmWord {
    /// A collarbone, or the upper arm.
    Shoulder,
    /// A hand, or its joint before another one that is called hand.
    Wrist,
}

/// Side and word of such a joint.
pub(super) fn arm_word_of(name: &str) -> Option<(BodySide, ArmWord)> {
    let words = own_words(name);
    let (words, side) = unglued(without_side(&words));
    let word = match words[..] {
        ["shoulder"] => ArmWord::Shoulder,
        ["wrist"] => ArmWord::Wrist,
        _ => return None,
    };
    Some((side?, word))
}

/// Side of a joint that is called ankle.
pub(super) fn ankle_side_of(name: &str) -> Option<BodySide> {
    let words = own_words(name);
    let (words, side) = unglued(without_side(&words));
    side.filter(|_| words == ["ankle"])
}

/// Side of the joint of a thumb that is called intermediate: the one that carries it is the first, although the second one of
/// VRM 1.0 has its name.
pub(super) fn middle_thumb_side_of(name: &str) -> Option<BodySide> {
    let words = own_words(name);
    let (words, side) = without_side(&words);
    side.filter(|_| words == ["thumb", "intermediate"])
}

/// Bone of the head that a name means.
pub(super) fn head_bone_of(name: &str) -> Option<HeadBone> {
    // VRoid: `J_Adj_L_FaceEye`; Character Creator: `CC_Base_L_Eye`; MetaHuman: `FACIAL_L_Eye`.
    const HELPERS: [&str; 6] = ["j", "adj", "face", "cc", "base", "facial"];
    let words = own_words(name);
    let (words, side) = without_side(&words);
    let own: Vec<&str> = words.into_iter().skip_while(|word| HELPERS.contains(word)).collect();
    match (own.concat().as_str(), side) {
        ("eye" | "eyeball", Some(side)) => Some(HeadBone::Eye(side)),
        ("jaw" | "jawroot" | "lowerjaw" | "mandible", None) => Some(HeadBone::Jaw),
        _ => None,
    }
}

/// Words that name no side, and the side that the others name.
fn without_side(words: &[String]) -> (Vec<&str>, Option<BodySide>) {
    let mut words: Vec<&str> = words.iter().map(String::as_str).collect();
    let mut side = None;
    words.retain(|word| {
        let of = match *word {
            "l" | "left" | "lft" => BodySide::Left,
            "r" | "right" | "rgt" | "rt" => BodySide::Right,
            // The centre of VRM's names.
            "c" => return false,
            _ => return true,
        };
        side = Some(of);
        false
    });
    (words, side)
}

/// A word and its side, where a letter before it says which.
fn unglued((words, side): (Vec<&str>, Option<BodySide>)) -> (Vec<&str>, Option<BodySide>) {
    if let ([word], None) = (&words[..], side) {
        let of = [("l", BodySide::Left), ("r", BodySide::Right)]
            .into_iter()
            .find_map(|(letter, side)| Some((word.strip_prefix(letter).filter(|rest| GLUED.contains(rest))?, side)));
        if let Some((rest, side)) = of {
            return (vec![rest], Some(side));
        }
    }
    (words, side)
}

/// Words of a name in small letters: split at signs, before capitals and around numbers.
fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut before = ' ';
    let chars: Vec<char> = name.chars().collect();
    for (at, c) in chars.iter().copied().enumerate() {
        if !c.is_alphanumeric() {
            before = c;
            continue;
        }
        let is_new = !before.is_alphanumeric()
            || c.is_numeric() != before.is_numeric()
            || (c.is_uppercase() && before.is_lowercase())
            // The side in `LFoot`.
            || (c.is_uppercase()
                && before.is_uppercase()
                && chars.get(at + 1).is_some_and(|next| next.is_lowercase()));
        if is_new {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut() {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words
}

/// Number at the end of a name, 0 without one, and the words before it as one.
fn numbered(words: &[&str]) -> (u32, String) {
    let number = words.last().and_then(|word| word.parse::<u32>().ok());
    let stem = &words[..words.len() - usize::from(number.is_some())];
    (number.unwrap_or(0), stem.concat())
}

/// Finger and number of its joint.
fn finger(words: &[&str]) -> Option<(Finger, u8)> {
    // VRM and Rigify: `indexProximal`, `f_index`; Mixamo: `HandIndex1`.
    let rest: Vec<&str> = words.iter().copied().filter(|word| !matches!(*word, "f" | "hand" | "finger")).collect();
    let [word, bone] = rest[..] else { return None };
    let kind = match word {
        "thumb" => Finger::Thumb,
        "index" => Finger::Index,
        "middle" | "mid" => Finger::Middle,
        "ring" => Finger::Ring,
        "little" | "pinky" => Finger::Little,
        // MakeHuman: `finger2-1` is the index finger; Rokoko: `Finger2Proximal`.
        number if words.first() == Some(&"finger") => numbered_finger(number.parse().ok()?)?,
        // Xsens: `SecondPP` is the index finger.
        word if matches!(bone, "mc" | "pp" | "mp" | "dp") => {
            let place = ["first", "second", "third", "fourth", "fifth"].iter().position(|known| *known == word);
            FINGERS[place?]
        }
        _ => return None,
    };
    Some((kind, finger_bone(kind, bone)?))
}

/// Finger with that number, counted from 1 at the thumb.
fn numbered_finger(number: usize) -> Option<Finger> {
    FINGERS.get(number.checked_sub(1)?).copied()
}

/// Number of a finger's joint by the name of its bone, or as it is written.
fn finger_bone(finger: Finger, bone: &str) -> Option<u8> {
    let is_thumb = finger == Finger::Thumb;
    match bone {
        "metacarpal" | "mc" => is_thumb.then_some(1),
        "proximal" | "pp" => Some(1 + u8::from(is_thumb)),
        "intermediate" | "medial" | "mp" => Some(2),
        "distal" | "dp" => Some(3),
        number => number.parse().ok(),
    }
}

/// Joint of a finger in a Biped of 3ds Max, which counts from 0 at the thumb: `Bip01 L Finger1` carries `Bip01 L Finger11`.
fn biped_finger(name: &str) -> Option<HumanBone> {
    let words = words(without_namespace(name));
    let (words, side) = without_side(&words);
    let ["bip", .., "finger", digits] = words[..] else { return None };
    let (finger, joint) = match *digits.as_bytes() {
        [finger] => (finger, b'0'),
        [finger, joint] => (finger, joint),
        _ => return None,
    };
    let finger = FINGERS.get(usize::from(finger.checked_sub(b'0')?)).copied()?;
    let joint = joint.checked_sub(b'0').filter(|joint| *joint < 3)?;
    Some(HumanBone::Finger(side?, finger, joint + 1))
}
