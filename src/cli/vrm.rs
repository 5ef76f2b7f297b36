//! Avatars in VRM 1.0, written by the commands that write characters.

use std::path::Path;

use clap::Args;
use serde_json::json;

use super::{Failure, Report, expressions, progress::spinning, report::counted};
use crate::{
    algo::face::expression::vrm_mixes,
    files::{FileKind, RealDisk, stem, store_avatar},
    mesh::{gltf::GltfWriteSettings, model::Model, vrm::VrmMeta},
    rig::{
        BuiltRig, Rig, Uid,
        bake::baked,
        vrm::{AvatarError, AvatarSource, ExpressionRecipe, avatar_meta, hang_half_joints},
    },
    solve::avatar::make_avatar,
};

/// Options of avatars.
#[derive(Args, Debug, Clone, Default)]
pub(super) struct VrmArgs {
    /// Author of an avatar (.vrm), in place of the one in the template's header; may be repeated
    #[arg(long = "author", value_name = "NAME")]
    authors: Vec<String>,
}

impl From<AvatarError> for Failure {
    fn from(error: AvatarError) -> Self {
        Self::Input(Box::new(error))
    }
}

/// True if an avatar is to be written.
fn is_avatar(output: &Path) -> bool {
    FileKind::of(output) == Some(FileKind::Vrm)
}

impl VrmArgs {
    /// Refuses authors of a file that names none.
    pub fn check(&self, output: Option<&Path>) -> Result<(), Failure> {
        if self.authors.is_empty() || output.is_some_and(is_avatar) {
            return Ok(());
        }
        Err(Failure::Usage("--author is for an avatar; write one with -o NAME.vrm".to_owned()))
    }

    /// Meta data of the avatar of a rig, for an output that is one.
    pub fn meta(&self, rig: &Rig, output: &Path) -> Result<Option<VrmMeta>, Failure> {
        if !is_avatar(output) {
            return Ok(None);
        }
        Ok(Some(avatar_meta(rig.about(), &self.authors, &stem(output))?))
    }
}

/// A model that is to be an avatar, with the rig that it came from.
pub(super) struct AvatarDraft<'a> {
    rig: &'a Rig,
    built: Option<&'a BuiltRig>,
    joints: Vec<Uid>,
}

impl<'a> AvatarDraft<'a> {
    /// Takes the pose from a model whose nodes are those of a rig, and hangs half joints beside their joints. Clips are
    /// baked afterwards.
    pub fn new(rig: &'a Rig, built: Option<&'a BuiltRig>, model: &mut Model) -> Self {
        let bare = built.map(|built| baked(rig, built));
        let mut joints = Vec::with_capacity(model.nodes.len());
        for (joint, node) in bare.as_ref().unwrap_or(rig).walk().zip(&mut model.nodes) {
            joints.push(joint.data.uid);
            node.rest = joint.data.rest.into();
        }
        let draft = Self { rig, built, joints };
        hang_half_joints(model, &draft.source());
        draft
    }

    fn source(&self) -> AvatarSource<'_> {
        AvatarSource { rig: self.rig, built: self.built, joints: &self.joints }
    }

    /// Writes the avatar, and tells what it has. The model is dropped before what is written is read back.
    pub fn store(
        &self,
        mut model: Model,
        meta: VrmMeta,
        output: &Path,
        settings: &GltfWriteSettings,
        report: &mut Report,
    ) -> Result<(), Failure> {
        let recipe = |(preset, shapes)| ExpressionRecipe { preset, shapes };
        let recipes: Vec<ExpressionRecipe> =
            vrm_mixes(&*expressions::of_site(report)?).into_iter().map(recipe).collect();
        let made = make_avatar(&mut model, &self.source(), meta, &recipes)?;
        report.notes(&made.notes);
        let (vrm, springs) = (&made.avatar.vrm, &made.avatar.springs);
        let bones: Vec<&String> = vrm.humanoid.human_bones.keys().collect();
        report.line(format!(
            "VRM 1.0: {}, {}, {}",
            counted(bones.len(), "bone of a human", "bones of a human"),
            counted(
                vrm.expressions.preset.len() + vrm.expressions.custom.len(),
                "expression of the face",
                "expressions of the face"
            ),
            counted(springs.springs.len(), "spring", "springs"),
        ));
        if made.pose.turned > 0 {
            report.line(format!(
                "T-pose: {} turned, by up to {:.1} degrees",
                counted(made.pose.turned, "joint was", "joints were"),
                made.pose.largest
            ));
        }
        report.set(
            "vrm",
            json!({
                "name": vrm.meta.name,
                "authors": vrm.meta.authors,
                "bones": bones,
                "expressions": vrm.expressions.preset.keys().collect::<Vec<_>>(),
                "custom_expressions": vrm.expressions.custom.len(),
                "look_at": vrm.look_at.map(|look| look.kind),
                "springs": springs.springs.len(),
                "colliders": springs.colliders.len(),
                "constraints": made.avatar.constraints.len(),
                "turned_joints": made.pose.turned,
                "largest_turn": made.pose.largest,
                "scale": made.scale,
            }),
        );
        // Bones of the human are written whether skin hangs on them or not.
        let settings = GltfWriteSettings { all_joints: true, ..settings.clone() };
        spinning("writing", || store_avatar(&RealDisk, output, model, &made.avatar, &settings))?;
        Ok(())
    }
}
