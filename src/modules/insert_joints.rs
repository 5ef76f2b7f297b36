//! `insert_joints`: joints between a joint and the next.

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{BuildScope, Creation, ModuleError, RigModule},
    rig::{
        NodeType,
        reference::{NodeRef, NodeRefs},
    },
};

/// The most joints that one command inserts.
const MOST: u32 = 64;

parameters! {
    /// Puts joints evenly between a joint and its child, which is hung below the last of them. Role: `joint`.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::insert_joints::InsertJointsModule};
    /// let params = r#"(joint: "@this", count: 3)"#;
    /// # assert!(rigsmith::modules::all().load(InsertJointsModule::NAME, params).is_ok());
    /// ```
    pub struct InsertJointsModule {
        /// The upper joint.
        pub joint: NodeRefs = NodeRef::this().into(),
        /// The lower joint, a child of the upper; its only child joint if left out.
        pub child: NodeRefs = NodeRefs::NONE,
        /// Number of joints, 1 to 64.
        pub count: u32 = 1,
        /// Name, groups and label; by default those of the upper joint.
        pub creation: Creation = Creation::default(),
    }
}

impl RigModule for InsertJointsModule {
    const NAME: &'static str = "insert_joints";
    const DOC: &'static str = "Puts joints evenly between a joint and the next, which is hung below the last of them.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/insert_joints.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/insert_joints.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        if !(1..=MOST).contains(&self.count) {
            let problem = format!("{} is out of range; write a number from 1 to {MOST}", self.count);
            return Err(ModuleError::parameter("count", problem));
        }
        let joint = scope.resolve_one("joint", &self.joint)?;
        let child = match scope.resolve_maybe("child", &self.child)? {
            Some(child) if scope.parent(child) == Some(joint) => child,
            Some(child) => {
                let (child, joint) = (scope.name(child), scope.name(joint));
                let problem = format!("{child} is not a child of {joint}; refer to one of its children");
                return Err(ModuleError::reference("child", &self.child, problem));
            }
            None => scope.only_child("child", joint)?,
        };
        // Along the way to the child, turned like the upper joint, so that the bone goes on as it began.
        let step = scope.base(child).translation / (self.count + 1) as f32;
        let creation = scope.creation_for(&self.creation, joint, 0);
        let mut last = joint;
        for number in 0..self.count {
            let base = Trs { translation: step, ..Trs::IDENTITY };
            last = scope.spawn(NodeType::Joint, "joint", joint, number, Some(last), base, &creation)?;
        }
        scope.set_parent(child, Some(last))
    }
}
