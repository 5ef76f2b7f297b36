//! The rig on the screen.
