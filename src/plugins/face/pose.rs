//! Expressions on a rig: strengths become pose offsets of facial joints.

use std::{borrow::Cow, collections::BTreeMap, sync::Arc};

use bevy::prelude::*;

use super::{ExpressError, ExpressRequest, Expressed, Expressions, Face, FaceExpressions, placed_bones::FaceRig};
use crate::{
    algo::face::{
        auto::{AutoSettings, FaceAnalysis, FaceError},
        expression::{BonePose, Expression, ExpressionSet, FittedFace, MAX_STRENGTH, Mix, apply},
    },
    mesh::model::Weights,
    plugins::{
        document::{Change, EditRequest},
        history::RigHistory,
        surface::{RigMesh, SkinOf},
    },
    rig::{PoseOffset, RestTransform, Rig, RigEdit, SkinData, Uid, nearest::did_you_mean, operations::Operation},
};

/// Rest frame of a facial joint, which converts motion in head space to pose offsets.
pub(super) struct Frame {
    to_rig: Quat,
    global: Quat,
    parent: bevy::math::Affine3,
    rest: RestTransform,
}

impl Frame {
    /// The frame of a joint of the rig, or of one that is about to be made.
    pub fn of(rig: &Rig, joint: Uid, analysis: &FaceAnalysis) -> Self {
        let to_rig = analysis.to_mesh();
        match rig.joint(joint) {
            Some(data) => Self {
                to_rig,
                global: rig.rest_global(joint).to_scale_rotation_translation().1.normalize(),
                parent: data.parent.map_or(bevy::math::Affine3::IDENTITY, |parent| rig.rest_global(parent)),
                rest: data.data.rest,
            },
            None => Self {
                to_rig,
                global: to_rig,
                parent: bevy::math::Affine3::IDENTITY,
                rest: RestTransform { rotation: to_rig, ..RestTransform::default() },
            },
        }
    }

    /// The pose offset of a movement and rotation in head space.
    pub fn offset(&self, pose: &BonePose) -> PoseOffset {
        let moved = self.to_rig * pose.translation;
        let in_parent = self.parent.inverse().transform_vector3(moved);
        let scale = self.rest.scale;
        let divided = |value: f32, by: f32| if by == 0.0 { 0.0 } else { value / by };
        let own = self.rest.rotation.inverse() * in_parent;
        let turn = self.to_rig * pose.rotation * self.to_rig.inverse();
        PoseOffset {
            translation: Vec3::new(divided(own.x, scale.x), divided(own.y, scale.y), divided(own.z, scale.z)),
            rotation: (self.global.inverse() * turn * self.global).normalize(),
            scale: Vec3::ONE,
        }
    }
}

/// Strengths that [`express`] wrote last to [`Expressions`], always together with them.
#[derive(Component)]
pub(super) struct OwnStrengths(BTreeMap<String, f32>);

/// Requests the expressions that others wrote to [`Expressions`]: what [`express`] wrote has the same tick and the same
/// strengths as [`OwnStrengths`].
pub(super) fn adopt(
    faces: Query<(Entity, Ref<Expressions>, Option<Ref<OwnStrengths>>), With<RigMesh>>,
    mut requests: MessageWriter<ExpressRequest>,
) {
    for (mesh, expressions, own) in &faces {
        let is_own = own.is_some_and(|own| own.last_changed() == expressions.last_changed() && own.0 == expressions.0);
        if expressions.is_changed() && !is_own {
            requests.write(ExpressRequest { mesh, strengths: expressions.0.clone(), preview: false });
        }
    }
}

/// Shows the strengths of the document: after an undo, a stored pose, or the opening of a project.
pub(super) fn follow_strengths(
    mut commands: Commands,
    meshes: Query<(Entity, Ref<RigMesh>, &SkinOf, Option<&Expressions>)>,
    rigs: Query<Ref<Rig>>,
) {
    for (entity, mesh, of, shown) in &meshes {
        let Ok(rig) = rigs.get(of.0) else { continue };
        if !rig.is_changed() && !mesh.is_changed() {
            continue;
        }
        let strengths = strengths_of(&rig, mesh.uid);
        if shown.map_or(!strengths.is_empty(), |shown| shown.0 != strengths) {
            commands.entity(entity).try_insert((Expressions(strengths.clone()), OwnStrengths(strengths)));
        }
    }
}

/// Strengths of a mesh's face in the document: values of attributes of the mesh, named as expressions and units are.
fn strengths_of(rig: &Rig, mesh: Uid) -> BTreeMap<String, f32> {
    rig.attribute_values().get(&mesh).cloned().unwrap_or_default()
}

pub(super) fn express(
    mut commands: Commands,
    mut requests: MessageReader<ExpressRequest>,
    meshes: Query<(&RigMesh, &SkinOf, Option<&Face>, Option<&PreparedFace>)>,
    rigs: Query<(&Rig, Option<&RigHistory>)>,
    set: Res<FaceExpressions>,
    mut told: MessageWriter<Expressed>,
) {
    for ExpressRequest { mesh: entity, strengths, preview } in requests.read() {
        let found = meshes
            .get(*entity)
            .ok()
            .and_then(|(mesh, of, face, prepared)| Some((mesh, of.0, rigs.get(of.0).ok()?, face, prepared)));
        let Some((mesh, rig_entity, (rig, history), face, prepared)) = found else {
            told.write(Expressed { mesh: *entity, result: Err(ExpressError::NoRig) });
            continue;
        };
        let analysed = match face {
            Some(face) if face.serves(&mesh.rest, &face.settings) => Ok(face.clone()),
            // An opened file has the positions of the bones, but not of the features.
            _ => analyse(mesh),
        };
        let result = analysed.map_err(ExpressError::from).and_then(|face| {
            // A preview is undone before the next preview or edit.
            let settled = history.map_or(Cow::Borrowed(rig), |history| history.settled(rig));
            let mix = mixed(&set.0, strengths)?;
            let prepared = PreparedFace::reused(prepared, &settled, mesh, &face.analysis, &set.0)?;
            let mut edits = expression_edits(&settled, &prepared, &mix);
            edits.extend(strength_edits(&settled, mesh.uid, strengths));
            // An expression that the face shows already adds no step to the history.
            let is_shown = edits.is_empty();
            let operation = Operation::Named { name: "Express", edits };
            if *preview {
                commands.write_message(EditRequest { rig: rig_entity, change: Change::Preview(operation) });
            } else {
                commands.write_message(EditRequest { rig: rig_entity, change: Change::CancelPreview });
                if !is_shown {
                    commands.write_message(EditRequest { rig: rig_entity, change: Change::Do(operation) });
                }
            }
            // What is shown is what the document says after the edit: see `follow_strengths`.
            let shown = (Expressions(strengths.clone()), OwnStrengths(strengths.clone()));
            commands.entity(*entity).insert((shown, face, prepared));
            Ok(())
        });
        told.write(Expressed { mesh: *entity, result });
    }
}

fn analyse(mesh: &RigMesh) -> Result<Face, FaceError> {
    let settings = AutoSettings::default();
    let analysis = FaceAnalysis::new(&mesh.rest.points, &mesh.triangles, &settings, &|_, _| true)?;
    Ok(Face { analysis: analysis.into(), settings, rest: mesh.rest.clone() })
}

/// A mesh's face as expressions take it, kept from one expression to the next: a slider that is dragged only sums up
/// movements that are solved already.
#[derive(Component, Clone)]
pub(super) struct PreparedFace(Arc<PreparedParts>);

struct PreparedParts {
    analysis: Arc<FaceAnalysis>,
    set: Arc<ExpressionSet>,
    skin: Arc<SkinData>,
    known: FaceRig,
    fitted: FittedFace,
}

/// The facial bones of a rig, and the skin of a mesh that is bound to them.
pub(super) fn facial_bones<'a>(rig: &'a Rig, mesh: &RigMesh) -> Result<(FaceRig, &'a Arc<SkinData>), ExpressError> {
    let known = FaceRig::read(rig);
    if known.bones.is_empty() {
        return Err(ExpressError::NoBones);
    }
    Ok((known, rig.skin(mesh.uid).ok_or(ExpressError::NotSkinned)?))
}

impl PreparedFace {
    /// The face that was prepared `before`, if rig, mesh, analysis and units are still the same, or a new one.
    fn reused(
        before: Option<&Self>,
        rig: &Rig,
        mesh: &RigMesh,
        analysis: &Arc<FaceAnalysis>,
        set: &Arc<ExpressionSet>,
    ) -> Result<Self, ExpressError> {
        let (known, skin) = facial_bones(rig, mesh)?;
        let serves = |parts: &PreparedParts| {
            Arc::ptr_eq(&parts.analysis, analysis)
                && Arc::ptr_eq(&parts.set, set)
                && Arc::ptr_eq(&parts.skin, skin)
                && parts.known == known
        };
        if let Some(before) = before.filter(|before| serves(&before.0)) {
            return Ok(before.clone());
        }
        let weights = analysed_weights(skin, &known, analysis);
        let fitted = analysis.fitted(&known.face_bones(analysis), &weights, set.unit_set());
        let (analysis, set, skin) = (analysis.clone(), set.clone(), skin.clone());
        Ok(Self(Arc::new(PreparedParts { analysis, set, skin, known, fitted })))
    }
}

/// A blend of expressions and units by name; a unit's name may end in `_l` or `_r` for one side.
///
/// # Errors
/// [`ExpressError::Unknown`] and [`ExpressError::Strength`].
pub fn mixed(set: &ExpressionSet, strengths: &BTreeMap<String, f32>) -> Result<Mix, ExpressError> {
    let mut wanted = Vec::new();
    for (name, strength) in strengths {
        if !strength.is_finite() {
            return Err(ExpressError::Strength { name: name.clone() });
        }
        let expression = set.find(name).ok_or_else(|| {
            let nearest = did_you_mean(name, set.names());
            ExpressError::Unknown { name: name.clone(), nearest }
        })?;
        wanted.push((expression, strength.clamp(0.0, MAX_STRENGTH)));
    }
    let wanted: Vec<(&Expression, f32)> = wanted.iter().map(|(expression, s)| (expression.as_ref(), *s)).collect();
    Ok(Mix::of(&wanted, set.unit_set()))
}

/// The edits that pose the facial joints for a mix. Facial joints that are not moved are reset to rest.
fn expression_edits(rig: &Rig, prepared: &PreparedFace, mix: &Mix) -> Vec<RigEdit> {
    let PreparedParts { analysis, known, fitted, .. } = prepared.0.as_ref();
    let poses = fitted.pose(mix);
    let edits = known.bones.iter().zip(&poses).filter_map(|(bone, pose)| {
        let offset = Frame::of(rig, bone.uid, analysis).offset(pose);
        let offset = (!offset.is_rest(1e-7)).then_some(offset);
        (rig.offset(bone.uid) != offset.as_ref()).then_some(RigEdit::SetOffset(bone.uid, offset))
    });
    edits.collect()
}

/// The edits that put strengths into the document, in place of the present ones.
fn strength_edits(rig: &Rig, mesh: Uid, strengths: &BTreeMap<String, f32>) -> Vec<RigEdit> {
    let before = strengths_of(rig, mesh);
    let names = before.keys().chain(strengths.keys().filter(|name| !before.contains_key(*name)));
    let changed = names.filter(|name| before.get(*name) != strengths.get(*name));
    changed.map(|name| RigEdit::SetAttributeValue(mesh, name.clone(), strengths.get(name).copied())).collect()
}

/// Positions of the analysed points of a rig's face, in head space, with expressions by name, each with a strength from
/// 0 to [`MAX_STRENGTH`].
///
/// # Errors
/// See [`ExpressError`]: no facial bones, no weights, no such expression.
pub fn expressed_points(
    rig: &Rig,
    mesh: &RigMesh,
    analysis: &FaceAnalysis,
    set: &ExpressionSet,
    strengths: &BTreeMap<String, f32>,
) -> Result<Vec<Vec3>, ExpressError> {
    let mix = mixed(set, strengths)?;
    let (known, skin) = facial_bones(rig, mesh)?;
    let weights = analysed_weights(skin, &known, analysis);
    let bones = known.face_bones(analysis);
    let poses = analysis.fitted(&bones, &weights, set.unit_set()).pose(&mix);
    Ok(apply(&analysis.points, &weights, &bones, &poses))
}

/// The weights of the analysed points over neck (0), head (1, with all other joints) and the facial bones (from 2).
pub(super) fn analysed_weights(skin: &SkinData, known: &FaceRig, analysis: &FaceAnalysis) -> Weights {
    let numbers: Vec<u32> = skin
        .joints
        .iter()
        .map(|uid| match known.bones.iter().position(|bone| bone.uid == *uid) {
            Some(number) => number as u32 + 2,
            None if Some(*uid) == known.neck => 0,
            None => 1,
        })
        .collect();
    let mut weights = Weights::default();
    for point in 0..analysis.points.len() {
        let point = analysis.mesh_point(point);
        let known = point < skin.weights.len();
        let influences = known.then(|| skin.weights.of(point)).into_iter().flatten();
        weights.push(influences.map(|(joint, weight)| (numbers[joint as usize], weight)));
    }
    weights
}
