//! Facial bones: one at each centroid of the facial mask.

use glam::Vec3;

/// A side of the character.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Side {
    /// The character's left, +x.
    Left,
    /// On the plane of symmetry.
    Middle,
    /// The character's right.
    Right,
}

/// A region of the face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Region {
    /// Above the brows.
    Forehead,
    /// Eyebrows.
    Brow,
    /// Eyelids.
    Lid,
    /// Nose.
    Nose,
    /// Cheeks.
    Cheek,
    /// Lips.
    Lip,
    /// Chin and lower jaw.
    Jaw,
    /// Beside the eyes.
    Temple,
}

/// What a facial bone is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaceBoneKind {
    /// Moves a patch of skin.
    Skin,
    /// Turns the lower jaw.
    Jaw,
    /// Turns an eyeball.
    Eye,
}

/// One facial bone, a child of the head bone.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceBone {
    /// Where it is, in head space.
    pub position: Vec3,
    /// What it is for.
    pub kind: FaceBoneKind,
    /// The region it lies in.
    pub region: Region,
    /// The side it lies on.
    pub side: Side,
    /// A name such as `brow_01_l`, unique among the bones.
    pub label: String,
    /// Its mirror image among the bones.
    pub pair: Option<usize>,
    /// Which of the given fixed places it stands at.
    pub fixed: Option<usize>,
}
