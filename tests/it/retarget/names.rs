//! Names of single joints that mean bones.

use rigsmith::rig::animation::humanoid::{BodySide, Finger, HumanBone, LimbBone, SkeletonJoint, named_bones};

#[test]
fn names_of_further_programs_mean_bones() {
    let (left, right) = (BodySide::Left, BodySide::Right);
    let finger = |side, finger, number| Some(HumanBone::Finger(side, finger, number));
    let limb = |side, bone| Some(HumanBone::Limb(side, bone));
    let names = [
        ("LeftFinger1Metacarpal", finger(left, Finger::Thumb, 1)),
        ("LeftFinger1Proximal", finger(left, Finger::Thumb, 2)),
        ("RightFinger2Medial", finger(right, Finger::Index, 2)),
        ("RightFinger5Distal", finger(right, Finger::Little, 3)),
        ("LeftFinger2Metacarpal", None),
        ("LeftFinger2Tip", None),
        ("RightFirstMC", finger(right, Finger::Thumb, 1)),
        ("RightFirstPP", finger(right, Finger::Thumb, 2)),
        ("LeftSecondPP", finger(left, Finger::Index, 1)),
        ("LeftFifthDP", finger(left, Finger::Little, 3)),
        ("LeftThirdMC", None),
        ("Bip01 L Finger0", finger(left, Finger::Thumb, 1)),
        ("Bip01 L Finger02", finger(left, Finger::Thumb, 3)),
        ("Bip001_R_Finger1", finger(right, Finger::Index, 1)),
        ("Bip001_R_Finger42", finger(right, Finger::Little, 3)),
        ("Bip01 L Finger1Nub", None),
        ("CC_Base_L_Thigh", limb(left, LimbBone::UpperLeg)),
        ("CC_Base_R_Upperarm", limb(right, LimbBone::UpperArm)),
        ("CC_Base_R_Mid2", finger(right, Finger::Middle, 2)),
        ("CC_Base_Pelvis", Some(HumanBone::Hips)),
        ("lThighBend", limb(left, LimbBone::UpperLeg)),
        ("lThighTwist", None),
        ("rShldrBend", limb(right, LimbBone::UpperArm)),
        ("rForearmBend", limb(right, LimbBone::LowerArm)),
        ("rMid3", finger(right, Finger::Middle, 3)),
        ("finger2-1.L", finger(left, Finger::Index, 1)),
        ("LeftFingerBase", None),
    ];
    for (name, bone) in names {
        let found = named_bones(&[SkeletonJoint { name: name.into(), ..SkeletonJoint::default() }]);
        assert_eq!(
            found.into_iter().collect::<Vec<_>>(),
            bone.map(|bone| (bone, 0)).into_iter().collect::<Vec<_>>(),
            "{name}"
        );
    }
    // Unity calls the joints of a thumb as those of other fingers, VRM 1.0 begins at the wrist.
    for words in [["Proximal", "Intermediate", "Distal"], ["Metacarpal", "Proximal", "Distal"]] {
        let joint = |(at, word): (usize, &str)| SkeletonJoint {
            name: format!("LeftThumb{word}"),
            parent: at.checked_sub(1),
            ..SkeletonJoint::default()
        };
        let joints: Vec<SkeletonJoint> = words.into_iter().enumerate().map(joint).collect();
        let found = named_bones(&joints);
        for number in 1..=3 {
            let bone = HumanBone::Finger(BodySide::Left, Finger::Thumb, number);
            assert_eq!(found.get(&bone), Some(&(usize::from(number) - 1)), "{words:?}");
        }
    }
}
