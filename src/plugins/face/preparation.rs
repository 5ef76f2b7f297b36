//! Faces prepared for expressions, in the background: what an expression needs costs time with the size of the mesh.
//!
//! A face is prepared when its bones and weights change: when it was placed, or when a file with a face was opened. A
//! request that comes earlier waits for it.

use std::{
    collections::BTreeMap,
    sync::{Arc, Weak},
};

use bevy::{
    ecs::entity::EntityHashMap,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{
    ExpressError, ExpressRequest, ExpressionAnswer, Face, FaceExpressions,
    job::analysed,
    placed_bones::FaceRig,
    pose::{analysed_weights, facial_bones},
    posing::FacePosing,
    with_cut,
};
use crate::{
    algo::face::{
        auto::{AutoSettings, FaceAnalysis, FaceError},
        expression::{ExpressionSet, FittedFace},
    },
    plugins::surface::{RigMesh, SkinOf},
    rig::{FaceCut, Rig, SkinData},
};

/// Preparation of a mesh's face for expressions; gone when it is prepared.
#[derive(Component)]
pub struct FacePreparation {
    task: Task<Result<(Face, PreparedFace), FaceError>>,
    /// The request that waits for it.
    pub(super) wanted: Option<ExpressRequest>,
}

/// A mesh's face as expressions take it, kept from one expression to the next: a slider that is dragged only sums up
/// movements that are solved already.
#[derive(Component, Clone)]
#[require(FacePosing)]
pub(super) struct PreparedFace(Arc<PreparedParts>);

pub(super) struct PreparedParts {
    pub analysis: Arc<FaceAnalysis>,
    set: Arc<ExpressionSet>,
    skin: Arc<SkinData>,
    pub known: FaceRig,
    pub fitted: FittedFace,
}

impl PreparedFace {
    /// The prepared parts, if analysis, units, bones and weights are still the same.
    pub fn parts(
        &self,
        analysis: &Arc<FaceAnalysis>,
        set: &Arc<ExpressionSet>,
        known: &FaceRig,
        skin: &Arc<SkinData>,
    ) -> Option<&Arc<PreparedParts>> {
        let parts = &self.0;
        let serves = Arc::ptr_eq(&parts.analysis, analysis)
            && Arc::ptr_eq(&parts.set, set)
            && Arc::ptr_eq(&parts.skin, skin)
            && parts.known == *known;
        serves.then_some(parts)
    }
}

/// Largest share of each unit's movement that mending of folds takes on a mesh's face, by the unit's name; see
/// [`FittedFace::taken_of_units`]. Nothing while the face is not prepared. Cost: a pose of each unit and expression.
pub fn mended_shares(world: &World, mesh: Entity) -> BTreeMap<String, f32> {
    let prepared = world.get::<PreparedFace>(mesh).map(|prepared| prepared.0.clone());
    prepared.map(|parts| parts.fitted.taken_of_units(&parts.set)).unwrap_or_default()
}

impl FacePreparation {
    /// True if the request that waits becomes a step of the history.
    pub(super) fn has_step(&self) -> bool {
        self.wanted.as_ref().is_some_and(|request| !request.preview)
    }

    /// Starts to prepare a face; a mesh whose analysis is not `ready` is analysed first, with the cut of the document.
    pub(super) fn start(
        mesh: &RigMesh,
        ready: Option<&Face>,
        known: FaceRig,
        skin: &Arc<SkinData>,
        set: &Arc<ExpressionSet>,
        wanted: Option<ExpressRequest>,
        cut: Option<FaceCut>,
    ) -> Self {
        // An opened file has the positions of the bones, but not of the features.
        let ready = ready.filter(|face| face.serves(&mesh.rest, &face.settings)).cloned();
        let (rest, triangles, skin, set) = (mesh.rest.clone(), mesh.triangles.clone(), skin.clone(), set.clone());
        let work = move || -> Result<(Face, PreparedFace), FaceError> {
            let face = match ready {
                Some(face) => face,
                None => {
                    let settings = with_cut(AutoSettings::default(), cut);
                    let analysis = analysed(&rest, &triangles, &settings, &|_, _| true)?;
                    Face { analysis: analysis.into(), settings, rest }
                }
            };
            let analysis = face.analysis.clone();
            let weights = analysed_weights(&skin, &known, &analysis);
            let fitted = analysis.fitted(&known.face_bones(&analysis), &weights, set.unit_set());
            let prepared = PreparedFace(Arc::new(PreparedParts { analysis, set, skin, known, fitted }));
            Ok((face, prepared))
        };
        Self { task: AsyncComputeTaskPool::get().spawn(async move { work() }), wanted }
    }
}

/// Skins whose faces were prepared ahead, by mesh.
#[derive(Resource, Default)]
pub(super) struct PreparedSkins(EntityHashMap<Weak<SkinData>>);

/// Starts to prepare faces whose weights have changed.
pub(super) fn prepare(
    mut commands: Commands,
    meshes: Query<(Entity, &RigMesh, &SkinOf, Option<&Face>), Without<FacePreparation>>,
    rigs: Query<Ref<Rig>>,
    set: Res<FaceExpressions>,
    mut prepared: ResMut<PreparedSkins>,
) {
    for (entity, mesh, of, face) in &meshes {
        let Some(rig) = rigs.get(of.0).ok().filter(|rig| rig.is_changed()) else { continue };
        let Some(skin) = rig.skin(mesh.uid) else { continue };
        let known = prepared.0.get(&entity).is_some_and(|known| known.as_ptr() == Arc::as_ptr(skin));
        if known {
            continue;
        }
        prepared.0.insert(entity, Arc::downgrade(skin));
        if let Ok((bones, skin)) = facial_bones(&rig, mesh) {
            let cut = rig.face_cut(mesh.uid);
            commands.entity(entity).insert(FacePreparation::start(mesh, face, bones, skin, &set.0, None, cut));
        }
    }
}

/// Forgets the skins of meshes that are gone.
pub(super) fn forget(removed: On<Remove, RigMesh>, mut prepared: ResMut<PreparedSkins>) {
    prepared.0.remove(&removed.entity);
}

/// Keeps faces whose preparation has ended, and repeats the requests that waited for them.
pub(super) fn keep(
    mut commands: Commands,
    mut preparations: Query<(Entity, &mut FacePreparation, &RigMesh)>,
    mut requests: MessageWriter<ExpressRequest>,
    mut told: MessageWriter<ExpressionAnswer>,
) {
    for (entity, mut preparation, mesh) in &mut preparations {
        let Some(finished) = check_ready(&mut preparation.task) else { continue };
        let wanted = preparation.wanted.take();
        commands.entity(entity).remove::<FacePreparation>();
        match finished {
            Ok((face, prepared)) => {
                // The mesh may have been loaded again meanwhile.
                if face.serves(&mesh.rest, &face.settings) {
                    commands.entity(entity).insert((face, prepared));
                }
                if let Some(request) = wanted {
                    requests.write(request);
                }
            }
            Err(error) if wanted.is_some() => {
                told.write(ExpressionAnswer { mesh: entity, result: Err(ExpressError::from(error)) });
            }
            Err(_) => {}
        }
    }
}
