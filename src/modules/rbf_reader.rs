//! `rbf_reader`: numbers that say how near the rotation of a node is to each of some poses.

use bevy::reflect::Reflect;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    parameters,
    processor::{BuildScope, ModuleError, RigModule, check_finite, mirrored_angles},
    rig::{
        Channel, Constraint, Output, degrees,
        label::mirror_label,
        reference::{NodeRef, NodeRefs},
    },
    solve::pose_reader::{PoseReader, PoseReaderError},
};

parameters! {
    /// Drives a number for each of some poses of a node: at a pose its number is 1 and those of the others are 0, and
    /// between poses they blend smoothly. For corrective shapes that belong to poses.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::rbf_reader::RbfReader};
    /// let params = r#"(
    ///     source: "@joint upper_arm_l#0000000000000001",
    ///     poses: [
    ///         (rotate: (0.0, 0.0, 0.0), attribute: "rest"),
    ///         (rotate: (0.0, 0.0, 90.0), morph: "shoulder_up_l"),
    ///     ],
    ///     output: "@command null/readers#00000000000000aa",
    /// )"#;
    /// # rigsmith::modules::all().load(RbfReader::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct RbfReader {
        /// The node whose rotation counts.
        pub source: NodeRefs = NodeRef::this().into(),
        /// The node against which the rotation is measured; the parent of the source if left out.
        pub reference: NodeRefs = NodeRefs::NONE,
        /// Poses: angles about X, Y and Z in degrees from how the source was built, each with what it drives.
        pub poses: Vec<ReaderPose> = Vec::new(),
        /// Angle in degrees over which the influence of a pose fades, above 0; from the nearest two poses if left out.
        pub radius: Option<f32> = None,
        /// The node that carries the attributes and channels that poses drive.
        pub output: NodeRefs = NodeRefs::NONE,
    }
}

/// A pose, and what its number drives.
#[derive(Reflect, Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReaderPose {
    /// Angles about X, Y and Z in degrees, from how the node was built.
    pub rotate: Vec3,
    /// Name of the attribute that is driven; added to the output, from 0 to 1, if it lacks it.
    pub attribute: String,
    /// Channel of the output that is driven, in place of an attribute.
    pub channel: Option<Channel>,
    /// Name of the morph target that is driven, in place of an attribute or a channel.
    pub morph: String,
}

impl RigModule for RbfReader {
    const NAME: &'static str = "rbf_reader";
    const DOC: &'static str = "Drives a number for each of some poses of a node: 1 at the pose, 0 at the others.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["poses"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/rbf_reader.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/rbf_reader.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let source = scope.resolve_one("source", &self.source)?;
        let reference = scope.resolve_maybe("reference", &self.reference)?;
        let carrier = reference.or_else(|| scope.parent(source));
        let back = carrier.map_or(Quat::IDENTITY, |carrier| scope.global(carrier).rotation.inverse());
        let built = (back * scope.global(source).rotation).normalize();
        let mut poses = Vec::with_capacity(self.poses.len());
        for pose in &self.poses {
            check_finite("poses", &pose.rotate.to_array())?;
            poses.push(((built * degrees(pose.rotate)).normalize(), self.output(scope, pose)?));
        }
        let rotations: Vec<Quat> = poses.iter().map(|(rotation, _)| *rotation).collect();
        let radius = self.radius.unwrap_or_else(|| nearest(&rotations).to_degrees());
        PoseReader::new(&rotations, radius.to_radians())
            .map_err(|error| ModuleError::parameter(parameter(error), error.to_string()))?;
        let constraint = Constraint::PoseReader {
            source: scope.uid(source),
            reference: reference.map(|node| scope.uid(node)),
            poses,
            radius,
        };
        let joint = scope.joint();
        scope.constrain("reader", joint, 0, constraint)?;
        Ok(())
    }

    fn mirror(&mut self) {
        for pose in &mut self.poses {
            pose.rotate = mirrored_angles(pose.rotate);
            mirror_label(&mut pose.morph);
        }
    }
}

impl RbfReader {
    /// Destination of the number of a pose.
    fn output(&self, scope: &mut BuildScope<'_>, pose: &ReaderPose) -> Result<Output, ModuleError> {
        match (pose.attribute.as_str(), pose.channel, pose.morph.as_str()) {
            ("", None, morph) if !morph.is_empty() => Ok(Output::Morph(morph.into())),
            ("", Some(channel), "") => {
                let node = scope.resolve_one("output", &self.output)?;
                Ok(Output::Channel(scope.uid(node), channel))
            }
            (name, None, "") if !name.is_empty() => {
                let node = scope.resolve_one("output", &self.output)?;
                let kind = crate::rig::AttributeKind::Number { min: Some(0.0), max: Some(1.0) };
                scope.ensure_attribute(node, name, kind, 0.0)?;
                Ok(Output::Attribute(scope.uid(node), name.into()))
            }
            _ => Err(ModuleError::parameter(
                "poses",
                "each drives one thing: write an attribute, a channel such as RotateX, or a morph target",
            )),
        }
    }
}

/// Parameter that an error is about.
fn parameter(error: PoseReaderError) -> &'static str {
    match error {
        PoseReaderError::Radius(_) => "radius",
        PoseReaderError::Count(_) | PoseReaderError::Alike(..) => "poses",
    }
}

/// Smallest angle between two of the rotations in radians; half a turn for fewer than two.
fn nearest(rotations: &[Quat]) -> f32 {
    let pairs = rotations.iter().enumerate().flat_map(|(at, a)| rotations[at + 1..].iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| a.angle_between(*b)).fold(std::f32::consts::PI, f32::min)
}
