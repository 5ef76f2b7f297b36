//! The camera of the viewport.

use bevy::prelude::*;

use crate::plugins::viewport::Sight;

/// What the viewport sees of the active rig; `None` while there is nothing to see it with.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Default)]
pub struct ViewportSight(pub Option<Sight>);
