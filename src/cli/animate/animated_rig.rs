//! The rig that clips move: in an app, or built without one where nothing asks the app.

use std::sync::Arc;

use crate::{
    cli::{
        ExportArgs, Failure, SEED, build, limits,
        pose::{built_with, is_still},
    },
    headless::{Workbench, posing::PoseError},
    mesh::{
        gltf::GltfWriteSettings,
        model::{Model, Trs},
    },
    plugins::commands::BuildStep,
    rig::{
        BuiltRig, Rig, UidSource,
        animation::RigClip,
        operations::{ClipOperation, Operation},
    },
    solve::program::{CompileOptions, RigProgram},
};

/// A built rig that clips move.
pub(super) enum AnimatedRig {
    /// The rig of an app.
    App(Box<Workbench>),
    /// A rig without an app, whose entities take several times the memory of the rig.
    Still(Box<StillRig>),
}

/// A rig without commands and pose, built and compiled.
pub(super) struct StillRig {
    rig: Rig,
    built: BuiltRig,
    program: Arc<RigProgram>,
    /// The source of uids that an app has beside the same rig.
    uids: UidSource,
}

/// Workbench with a rig that is built and runs.
pub(super) fn running(rig: Rig) -> Result<Workbench, Failure> {
    let mut bench = limits::workbench(rig);
    if let Some(error) = bench.build(BuildStep::All).error {
        return Err(Failure::Input(Box::new(error)));
    }
    limits::check_time("building the rig")?;
    bench.runtime()?;
    Ok(bench)
}

impl AnimatedRig {
    /// Builds a rig: in an app if that is needed, or if the rig has commands or a pose.
    pub fn new(rig: Rig, needs_app: bool) -> Result<Self, Failure> {
        // An app tells why a rig cannot be built.
        let still = if needs_app || !is_still(&rig) { None } else { StillRig::parts(&rig) };
        let Some((built, program)) = still else { return Ok(Self::App(Box::new(running(rig)?))) };
        limits::check_time("building the rig")?;
        let mut uids = UidSource::seeded(UidSource::seed_beside(SEED, &rig));
        // The first uid of an app is that of the empty rig with which it begins.
        uids.next_uid();
        Ok(Self::Still(Box::new(StillRig { rig, built, program: Arc::new(program), uids })))
    }

    /// The rig in its current state.
    pub fn rig(&self) -> &Rig {
        match self {
            Self::App(bench) => bench.rig(),
            Self::Still(still) => &still.rig,
        }
    }

    /// Result of the rig's commands.
    pub fn built(&self) -> Option<&BuiltRig> {
        match self {
            Self::App(bench) => bench.built(),
            Self::Still(still) => Some(&still.built),
        }
    }

    /// Program of the built rig.
    pub fn program(&self) -> Result<&Arc<RigProgram>, PoseError> {
        match self {
            Self::App(bench) => Ok(bench.runtime()?.state().program()),
            Self::Still(still) => Ok(&still.program),
        }
    }

    /// Adds the clips of a file to the document; returns them as the document has them. Nobody takes them back: a step of the
    /// history and its request would hold them twice more.
    pub fn add_all(&mut self, clips: Vec<RigClip>) -> Result<Vec<RigClip>, Failure> {
        let before = self.rig().clips().len();
        if !clips.is_empty() {
            let operation = Operation::Clips(ClipOperation::AddAll(clips));
            match self {
                Self::App(bench) => carry_out(&operation, bench)?,
                Self::Still(still) => still.rig = changed(&operation, std::mem::take(&mut still.rig), &mut still.uids)?,
            }
        }
        Ok(self.rig().clips()[before..].to_vec())
    }
}

impl StillRig {
    /// Result of the commands of a rig, and its program; `None` for a rig that cannot be built or cannot run.
    fn parts(rig: &Rig) -> Option<(BuiltRig, RigProgram)> {
        let built = built_with(rig, limits::modules()).ok()?;
        let program = RigProgram::compile(&built, &CompileOptions::default()).ok()?;
        Some((built, program))
    }

    /// The skeleton at rest as a model without a mesh, and the settings for writing it.
    pub fn skeleton(&self, export: &ExportArgs) -> (Model, GltfWriteSettings) {
        let rest: Vec<Trs> = self.built.nodes.iter().map(|node| node.base).collect();
        build::skeleton_in_pose(&self.rig, &self.built, &rest, export)
    }
}

/// Carries out an operation on the rig of an app.
fn carry_out(operation: &Operation, bench: &mut Workbench) -> Result<(), Failure> {
    let (entity, app) = (bench.rig_entity(), bench.app_mut());
    let world = app.world_mut();
    let rig = world.get_mut::<Rig>(entity).map(|mut rig| std::mem::take(&mut *rig)).unwrap_or_default();
    let rig = changed(operation, rig, &mut world.resource_mut::<UidSource>())?;
    if let Some(mut document) = world.get_mut::<Rig>(entity) {
        *document = rig;
    }
    app.update();
    Ok(())
}

fn changed(operation: &Operation, rig: Rig, uids: &mut UidSource) -> Result<Rig, Failure> {
    let (rig, _) = operation.run_on(rig, uids).map_err(|error| Failure::Input(Box::new(error)))?;
    Ok(rig)
}

#[cfg(test)]
mod tests {
    use bevy::{diagnostic::FrameCount, prelude::Messages};

    use super::*;
    use crate::{
        plugins::{document::EditRequest, history::RigHistory},
        rig::{JointData, RigEdit, Uid},
    };

    fn clip(number: u64) -> RigClip {
        let text = number.to_string();
        let uid = |kind: &str| Uid::derived([kind, text.as_str()]);
        RigClip::new(uid("clip"), uid("layer"), "walk")
    }

    #[test]
    fn clips_of_a_file_take_one_frame_of_the_app() {
        let mut animated = AnimatedRig::App(Box::new(limits::empty_workbench("n")));
        let frames = |animated: &mut AnimatedRig| match animated {
            AnimatedRig::App(bench) => bench.app_mut().world().resource::<FrameCount>().0,
            AnimatedRig::Still(_) => 0,
        };
        let before = frames(&mut animated);
        let Ok(added) = animated.add_all((0..300).map(clip).collect()) else { panic!("no clip is refused") };
        assert_eq!(frames(&mut animated) - before, 1);
        assert_eq!((added.len(), added[299].name.as_str()), (300, "walk 300"));
        // Nothing holds them beside the document.
        let AnimatedRig::App(bench) = &mut animated else { panic!("the rig has an app") };
        let rig = bench.rig_entity();
        let world = bench.app_mut().world();
        assert!(world.resource::<Messages<EditRequest>>().is_empty());
        assert!(world.get::<RigHistory>(rig).is_some_and(|history| history.steps().0.is_empty()));
    }

    #[test]
    fn rigs_without_an_app_are_those_of_an_app() {
        let mut rig = Rig::new(Uid(7), "still");
        for (uid, parent) in [(1, None), (2, Some(Uid(1)))] {
            let joint = Box::new(JointData { uid: Uid(uid), ..JointData::default() });
            rig.apply(&RigEdit::AddJoint { joint, parent, index: 0 }).unwrap();
        }
        let animated = [false, true].map(|needs_app| {
            let Ok(mut animated) = AnimatedRig::new(rig.clone(), needs_app) else { panic!("the rig runs") };
            assert_eq!(matches!(animated, AnimatedRig::App(_)), needs_app);
            // The second clip has the uids of the first.
            let Ok(added) = animated.add_all(vec![clip(1), clip(1)]) else { panic!("no clip is refused") };
            let Ok(program) = animated.program().map(|program| program.hash()) else { panic!("the rig runs") };
            (added, program, animated)
        });
        let [(clips, program, still), (others, other_program, app)] = animated;
        assert_eq!(clips, others);
        assert_eq!(program, other_program);
        assert_eq!(still.rig(), app.rig());
    }
}
