//! `cone_reader`: a number that says how near a direction of a node is to another.

use glam::Vec3;

use crate::{
    parameters,
    processor::{Axis, BuildScope, ModuleError, RigModule, check_finite, mirrored_direction},
    rig::{
        Channel, Constraint,
        label::mirror_label,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Drives a number by how near a direction of a node is to the middle of a cone: 1 within the inner cone, 0 outside
    /// of the outer one. For corrective shapes and joints of shoulders and hips.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::cone_reader::ConeReader};
    /// let params = r#"(
    ///     source: "@joint upper_arm_l#0000000000000001",
    ///     towards: (0.0, 1.0, 0.0),
    ///     outer: 80.0,
    ///     morph: "shoulder_up_l",
    /// )"#;
    /// # rigsmith::modules::all().load(ConeReader::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct ConeReader {
        /// The node whose direction counts.
        pub source: NodeRefs = NodeRef::this().into(),
        /// Axis of the node that looks: x, y, z, neg_x, neg_y or neg_z.
        pub axis: Axis = Axis::Y,
        /// The node that carries the cone; the parent of the source if left out.
        pub reference: NodeRefs = NodeRefs::NONE,
        /// Middle of the cone as a direction in the rig's space at rest; where the axis looks as built, if left out.
        pub towards: Option<Vec3> = None,
        /// Half the opening in degrees within which the number is 1.
        pub inner: f32 = 0.0,
        /// Half the opening in degrees outside of which the number is 0, up to 180.
        pub outer: f32 = 90.0,
        /// The nodes that are driven; none for a morph target.
        pub output: NodeRefs = NodeRefs::NONE,
        /// Name of the attribute of the nodes that is driven.
        pub output_attribute: String = String::new(),
        /// Channel of the nodes that is driven, in place of an attribute; added to the value that they were built with.
        pub output_channel: Option<Channel> = None,
        /// Name of the morph target whose weight is driven on every mesh of the rig, in place of nodes.
        pub morph: String = String::new(),
    }
}

impl RigModule for ConeReader {
    const NAME: &'static str = "cone_reader";
    const DOC: &'static str = "Drives channels, attributes or a morph target by how near a node looks to a direction.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["axis", "towards", "output_attribute", "morph"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/cone_reader.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/cone_reader.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let source = scope.resolve_one("source", &self.source)?;
        let reference = scope.resolve_maybe("reference", &self.reference)?;
        scope.in_range("inner", self.inner, 0.0..=180.0)?;
        scope.in_range("outer", self.outer, self.inner..=180.0)?;
        let carrier = reference.or_else(|| scope.parent(source));
        let towards = match self.towards {
            Some(towards) => {
                check_finite("towards", &towards.to_array())?;
                towards.try_normalize().ok_or_else(|| {
                    ModuleError::parameter("towards", "has no direction; write one, such as (0.0, 1.0, 0.0)")
                })?
            }
            None => scope.global(source).rotation * self.axis.vector(),
        };
        let back = match carrier {
            Some(carrier) => scope.global(carrier).rotation.inverse(),
            None => glam::Quat::IDENTITY,
        };
        let outputs =
            scope.driven_numbers("output", &self.output, &self.output_attribute, self.output_channel, &self.morph)?;
        let joint = scope.joint();
        for (output, number) in outputs.into_iter().zip(0..) {
            let constraint = Constraint::Cone {
                source: scope.uid(source),
                axis: self.axis.vector(),
                reference: reference.map(|node| scope.uid(node)),
                towards: (back * towards).normalize(),
                inner: self.inner,
                outer: self.outer,
                output,
            };
            scope.constrain("reader", joint, number, constraint)?;
        }
        Ok(())
    }

    fn mirror(&mut self) {
        self.axis = self.axis.mirrored();
        self.towards = self.towards.map(mirrored_direction);
        mirror_label(&mut self.morph);
    }
}
