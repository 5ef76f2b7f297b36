//! Shells: the loose parts of a head mesh, skin, eyes and what lies inside.

/// What a shell is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShellKind {
    /// The outer surface.
    Skin,
    /// The eyeball on the character's left.
    LeftEye,
    /// The eyeball on the character's right.
    RightEye,
    /// Teeth, tongue, lashes and all else.
    Inside,
}

/// The loose parts of a head.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Shells {
    /// The shell of each point.
    pub shell_of: Vec<u32>,
    /// What each shell is.
    pub kinds: Vec<ShellKind>,
}

impl Shells {
    /// What the shell of a point is.
    pub fn kind(&self, point: usize) -> ShellKind {
        self.shell_of.get(point).and_then(|&shell| self.kinds.get(shell as usize)).copied().unwrap_or(ShellKind::Inside)
    }
}
