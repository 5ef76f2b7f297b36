//! `twist`: joints along a bone that take shares of its twist.

use glam::Vec3;

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{BuildScope, Creation, ModuleError, NodeId, RigModule},
    rig::{
        Constraint, NodeType, Scalar,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Shares the twist of a joint among others along a bone, which it can make.
    ///
    /// A forearm takes its twist from the hand at its end; an upper arm takes back its own twist at the shoulder, with
    /// `counter`.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::twist::Twist};
    /// let params = r#"(start: "@joint forearm_l#0000000000000002", end: "@joint hand_l#0000000000000003", count: 2)"#;
    /// # rigsmith::modules::all().load(Twist::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct Twist {
        /// The joint at the bone's start, such as an elbow; joints that are made hang on it.
        pub start: NodeRefs = NodeRef::this().into(),
        /// The joint at the bone's end, such as a wrist.
        pub end: NodeRefs = NodeRefs::NONE,
        /// The joint whose twist is shared; the end if left out, or the start with counter.
        pub source: NodeRefs = NodeRefs::NONE,
        /// The node against which the twist is measured; the parent of the source if left out.
        pub reference: NodeRefs = NodeRefs::NONE,
        /// Joints that take shares, from start to end; they are made if left out.
        pub driven: NodeRefs = NodeRefs::NONE,
        /// Number of joints, 1 to 64, spread evenly along the bone.
        pub count: u32 = 2,
        /// The share of the twist of each joint; evenly from start to end if left out.
        pub shares: Vec<f32> = Vec::new(),
        /// Takes the twist back, wholly at the start of the bone: for upper arms and thighs.
        pub counter: bool = false,
        /// Name, group and label of joints that are made.
        pub creation: Creation = Creation::default(),
    }
}

/// The most joints that one command makes.
const MOST: u32 = 64;

impl RigModule for Twist {
    const NAME: &'static str = "twist";
    const DOC: &'static str = "Shares the twist of a joint among joints along a bone, and makes those joints.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/twist.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/twist.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let start = scope.resolve_one("start", &self.start)?;
        let end = scope.resolve_one("end", &self.end)?;
        let bone = scope.kept_offset(end, start).translation;
        let axis = bone.try_normalize().ok_or_else(|| {
            ModuleError::parameter("end", "stands where start stands, so the bone has no direction; choose another")
        })?;
        let otherwise = if self.counter { start } else { end };
        let source = scope.resolve_maybe("source", &self.source)?.unwrap_or(otherwise);
        let reference = scope.resolve_maybe("reference", &self.reference)?;
        let driven = if self.driven.is_empty() { Vec::new() } else { scope.resolve_all("driven", &self.driven)? };
        let count = if driven.is_empty() { self.count } else { driven.len() as u32 };
        if count == 0 || count > MOST {
            return Err(ModuleError::parameter("count", format!("is {count}; write a number from 1 to {MOST}")));
        }
        if !self.shares.is_empty() && self.shares.len() != count as usize {
            return Err(ModuleError::parameter(
                "shares",
                format!("there are {} for {count} joints; write one for each, or none", self.shares.len()),
            ));
        }
        for share in &self.shares {
            scope.in_range("shares", *share, -10.0..=10.0)?;
        }
        let place = |number: u32| match self.counter {
            true => number as f32 / count as f32,
            false => (number + 1) as f32 / (count + 1) as f32,
        };
        let share = |number: u32| {
            let even = if self.counter { place(number) - 1.0 } else { place(number) };
            self.shares.get(number as usize).copied().unwrap_or(even)
        };
        let turned = scope.global(start).rotation;
        let source_axis = (scope.global(source).rotation.inverse() * (turned * axis)).normalize();
        let joints: Vec<NodeId> = if driven.is_empty() {
            let make = |number: u32| {
                // The axis is one for all, in the space of each: what is made stands as the source does.
                let rotation = (turned.inverse() * scope.global(source).rotation).normalize();
                let base = Trs { translation: bone * place(number), rotation, scale: Vec3::ONE };
                scope.spawn(NodeType::Joint, "twist", start, number, Some(start), base, &self.creation)
            };
            (0..count).map(make).collect::<Result<_, _>>()?
        } else {
            for joint in &driven {
                let own = scope.global(*joint).rotation * source_axis;
                if own.dot(turned * axis) < 0.999 {
                    let problem = format!(
                        "{} does not lie along the bone as {} does: orient the joints alike, with orient_joints",
                        scope.name(*joint),
                        scope.name(source)
                    );
                    return Err(ModuleError::reference("driven", &self.driven, problem));
                }
            }
            driven
        };
        let shares = joints.iter().zip(0..).map(|(joint, number)| (scope.uid(*joint), Scalar::Value(share(number))));
        let constraint = Constraint::Twist {
            source: scope.uid(source),
            reference: reference.map(|node| scope.uid(node)),
            axis: source_axis,
            driven: shares.collect(),
        };
        scope.constrain("share", start, 0, constraint)?;
        Ok(())
    }
}
