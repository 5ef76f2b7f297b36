//! Expressions on a rig: strengths become pose offsets of facial joints.

use std::{borrow::Cow, collections::BTreeMap, sync::Arc};

use bevy::prelude::*;

use super::{
    ExpressError, ExpressRequest, ExpressionAnswer, Expressions, Face, FaceExpressions,
    placed_bones::FaceRig,
    posing::{BackgroundPosing, FacePosing},
    preparation::{FacePreparation, PreparedFace, PreparedParts},
};
use crate::{
    algo::face::{
        auto::FaceAnalysis,
        expression::{BonePose, Expression, ExpressionSet, MAX_STRENGTH, Mix, apply},
    },
    mesh::model::Weights,
    plugins::{
        document::{Change, EditRequest, awaited_steps::AwaitedSteps},
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

/// Poses faces as they are asked for. A preview is computed in the background, and so is what is asked for while one is
/// computed; with [`BackgroundPosing`], everything is. Without it everything else shows in the same frame, or in the next one where
/// it follows a step of the same frame.
pub(super) fn express(
    mut commands: Commands,
    mut requests: MessageReader<ExpressRequest>,
    mut meshes: Query<(
        &RigMesh,
        &SkinOf,
        Option<&Face>,
        Option<&PreparedFace>,
        Option<&mut FacePreparation>,
        Option<&mut FacePosing>,
    )>,
    rigs: Query<(&Rig, Option<&RigHistory>)>,
    (set, background): (Res<FaceExpressions>, Option<Res<BackgroundPosing>>),
    mut told: MessageWriter<ExpressionAnswer>,
    mut awaited: ResMut<AwaitedSteps>,
) {
    awaited.landed.clear();
    let mut asked: Vec<(ExpressRequest, bool)> = Vec::new();
    for (.., posing) in &mut meshes {
        asked.extend(posing.map(|mut posing| posing.bypass_change_detection().land()).unwrap_or_default());
    }
    asked.extend(requests.read().map(|request| (request.clone(), false)));
    for (number, (request, has_waited)) in asked.iter().enumerate() {
        let ExpressRequest { mesh: entity, strengths, preview } = request;
        let found = meshes.get_mut(*entity).ok().and_then(|(mesh, of, face, prepared, preparation, posing)| {
            Some((mesh, of.0, rigs.get(of.0).ok()?, face, prepared.zip(posing), preparation))
        });
        let Some((mesh, rig_entity, (rig, history), face, mut prepared, preparation)) = found else {
            told.write(ExpressionAnswer { mesh: *entity, result: Err(ExpressError::NoRig) });
            continue;
        };
        // Steps of the history keep their order, also where bones or weights change while one of them is computed.
        if let Some((_, posing)) = &mut prepared
            && posing.bypass_change_detection().has_step()
        {
            posing.bypass_change_detection().wait(request.clone());
            continue;
        }
        // A preview is undone before the next preview or edit.
        let settled = history.map_or(Cow::Borrowed(rig), |history| history.settled(rig));
        let checked = mixed(&set.0, strengths).and_then(|mix| Ok((mix, facial_bones(&settled, mesh)?)));
        let (mix, (known, skin)) = match checked {
            Ok(checked) => checked,
            Err(error) => {
                told.write(ExpressionAnswer { mesh: *entity, result: Err(error) });
                continue;
            }
        };
        let face_of_now = face.filter(|face| face.serves(&mesh.rest, &face.settings));
        let kept = prepared.as_ref().map(|(kept, _)| *kept);
        let parts = face_of_now.zip(kept).and_then(|(face, kept)| kept.parts(&face.analysis, &set.0, &known, skin));
        let Some((parts, (_, posing))) = parts.zip(prepared.as_mut()) else {
            // A preview of other bones or weights would come back in place of this request.
            if let Some((_, posing)) = &mut prepared {
                posing.bypass_change_detection().stop();
            }
            // The request is repeated when the face is prepared; of several, the last one counts.
            match preparation {
                Some(mut preparation) => preparation.wanted = Some(request.clone()),
                None => {
                    let (wanted, cut) = (Some(request.clone()), settled.face_cut(mesh.uid));
                    let preparation = FacePreparation::start(mesh, face, known, skin, &set.0, wanted, cut);
                    commands.entity(*entity).insert(preparation);
                }
            }
            continue;
        };
        let posing = posing.bypass_change_detection();
        let is_replaced = *preview && asked[number + 1..].iter().any(|(later, _)| later.mesh == *entity);
        // A step of this frame is not in the document yet: what follows it is worked out when it is.
        let follows_step = awaited.landed.contains(&rig_entity);
        let may_end_here = !*preview && !follows_step && posing.is_running();
        let ends_where_it_began = may_end_here && strengths_of(&settled, mesh.uid) == *strengths;
        let is_computed_apart = *preview || *has_waited || background.is_some();
        let mut edits = match posing.posed(parts, strengths).filter(|_| !follows_step) {
            Some(poses) => expression_edits(&settled, parts, poses),
            None if is_replaced => continue,
            // A drag that ends where it began leaves the document as it is.
            None if ends_where_it_began => Vec::new(),
            None if posing.is_running() => {
                posing.wait(request.clone());
                continue;
            }
            None if is_computed_apart => {
                posing.start(parts, mix, request.clone());
                continue;
            }
            None if follows_step => {
                posing.hold(parts, parts.fitted.pose(&mix), request.clone());
                continue;
            }
            None => expression_edits(&settled, parts, &parts.fitted.pose(&mix)),
        };
        posing.stop();
        edits.extend(strength_edits(&settled, mesh.uid, strengths));
        // An expression that the face shows already adds no step to the history.
        let is_shown = edits.is_empty();
        let operation = Operation::Named { name: "Express", edits };
        if *preview {
            commands.write_message(EditRequest { rig: rig_entity, change: Change::Preview(operation) });
        } else {
            commands.write_message(EditRequest { rig: rig_entity, change: Change::CancelPreview });
            if !is_shown {
                awaited.landed.insert(rig_entity);
                commands.write_message(EditRequest { rig: rig_entity, change: Change::Do(operation) });
            }
        }
        // What is shown is what the document says after the edit: see `follow_strengths`.
        commands.entity(*entity).insert((Expressions(strengths.clone()), OwnStrengths(strengths.clone())));
        told.write(ExpressionAnswer { mesh: *entity, result: Ok(()) });
    }
}

/// Notes the rigs that get a step once it is computed, so that undo and redo wait for it.
pub(super) fn await_steps(
    faces: Query<
        (&SkinOf, Option<&FacePosing>, Option<&FacePreparation>),
        Or<(With<FacePosing>, With<FacePreparation>)>,
    >,
    mut awaited: ResMut<AwaitedSteps>,
) {
    let has_step = |posing: Option<&FacePosing>, preparation: Option<&FacePreparation>| {
        posing.is_some_and(FacePosing::has_step) || preparation.is_some_and(FacePreparation::has_step)
    };
    let rigs = faces.iter().filter(|(_, posing, preparation)| has_step(*posing, *preparation)).map(|(of, ..)| of.0);
    awaited.computed = rigs.collect();
}

/// The facial bones of a rig, and the skin of a mesh that is bound to them.
pub(super) fn facial_bones<'a>(rig: &'a Rig, mesh: &RigMesh) -> Result<(FaceRig, &'a Arc<SkinData>), ExpressError> {
    let known = FaceRig::read(rig);
    if known.bones.is_empty() {
        return Err(ExpressError::NoBones);
    }
    Ok((known, rig.skin(mesh.uid).ok_or(ExpressError::NotSkinned)?))
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

/// The edits that pose the facial joints by poses of all bones. Facial joints that are not moved are reset to rest.
fn expression_edits(rig: &Rig, prepared: &PreparedParts, poses: &[BonePose]) -> Vec<RigEdit> {
    let PreparedParts { analysis, known, .. } = prepared;
    let poses = known.joint_poses(analysis, poses);
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
