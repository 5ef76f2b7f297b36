//! Promises that every model, every set of weights and every error text keeps.

use glam::Vec3;
use rigsmith::mesh::model::{ChannelTarget, Interpolation, Model, Weights};

/// Fails unless everything that `Model` documents holds.
pub fn model(model: &Model) {
    let (points, nodes) = (model.points.len(), model.nodes.len());
    assert!(model.points.iter().all(|point| point.is_finite()));
    for (i, node) in model.nodes.iter().enumerate() {
        assert!(node.parent.is_none_or(|parent| parent < i));
        assert!(node.rest.affine().is_finite() && (node.rest.rotation.length() - 1.0).abs() < 1e-4);
    }
    assert!(model.rest_globals().iter().all(|global| global.is_finite()));
    for skin in &model.skins {
        assert_eq!(skin.joints.len(), skin.inverse_binds.len());
        assert!(skin.joints.iter().all(|joint| *joint < nodes && model.nodes[*joint].joint));
        assert!(skin.inverse_binds.iter().all(|matrix| matrix.is_finite()));
    }
    for object in &model.objects {
        assert!(object.skin.is_none_or(|skin| skin < model.skins.len()));
        assert!(object.node.is_none_or(|node| node < nodes) && (object.skin.is_none() || object.node.is_none()));
        assert!(object.morph_weights.is_empty() || object.morph_weights.len() == object.morph_names.len());
    }
    for part in &model.parts {
        let count = part.vertices.len();
        let fits = |length: usize| length == 0 || length == count;
        let object = &model.objects[part.object];
        assert!(part.material.is_none_or(|material| material < model.material_set.materials.len()));
        assert!(part.vertices.iter().all(|point| (*point as usize) < points));
        assert!(!part.triangles.is_empty() && part.triangles.iter().flatten().all(|vertex| (*vertex as usize) < count));
        assert!(part.normals.len() == count && part.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-3));
        assert!(fits(part.tangents.len()) && fits(part.colors.len()) && part.uvs.iter().all(|set| fits(set.len())));
        assert!(
            part.tangents
                .iter()
                .all(|tangent| (tangent.truncate().length() - 1.0).abs() < 1e-3 && tangent.w.abs() == 1.0)
        );
        assert!(
            part.colors.iter().all(|color| color.cmpge(glam::Vec4::ZERO).all() && color.cmple(glam::Vec4::ONE).all())
        );
        assert!(part.uvs.iter().flatten().all(|uv| uv.is_finite()));
        assert_eq!(part.morphs.len(), object.morph_names.len());
        for morph in &part.morphs {
            for list in [&morph.positions, &morph.normals, &morph.tangents] {
                assert!(fits(list.len()) && list.iter().all(|offset: &Vec3| offset.is_finite()));
            }
        }
    }
    let skinned = model.objects.iter().any(|object| object.skin.is_some());
    assert_eq!(model.weights.is_some(), skinned);
    if let Some(list) = &model.weights {
        weights(list, points, nodes, 1e-7);
    }
    for channel in model.clips.iter().flat_map(|clip| &clip.channels) {
        let width = match channel.target {
            ChannelTarget::Translation(node) | ChannelTarget::Scale(node) if node < nodes => 3,
            ChannelTarget::Rotation(node) if node < nodes => 4,
            ChannelTarget::MorphWeights(object) => model.objects[object].morph_names.len(),
            ref target => panic!("{target:?}"),
        };
        let per_key = width * if channel.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        assert_eq!(channel.values.len(), channel.times.len() * per_key);
        assert!(!channel.times.is_empty() && channel.times.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(channel.times.iter().chain(&channel.values).all(|value| value.is_finite()));
    }
}

/// Fails unless the weights of each point are positive, strongest first, of joints that exist, and one in sum or none, but for
/// `tolerance` each.
pub fn weights(weights: &Weights, points: usize, joints: usize, tolerance: f64) {
    assert_eq!(weights.len(), points);
    for point in 0..points {
        let list: Vec<_> = weights.of(point).collect();
        assert!(list.iter().all(|(joint, weight)| (*joint as usize) < joints && *weight > 0.0), "{list:?}");
        assert!(list.windows(2).all(|pair| pair[0].1 >= pair[1].1), "{list:?}");
        let sum: f64 = list.iter().map(|(_, weight)| f64::from(*weight)).sum();
        assert!(list.is_empty() || (sum - 1.0).abs() <= tolerance * list.len() as f64, "{list:?}");
    }
}

/// Fails unless an error is a sentence that a terminal can show. What it quotes of a file is shown by the command with
/// escapes, and cut there.
pub fn error(error: &dyn std::error::Error) {
    let text = error.to_string();
    assert!(!text.trim().is_empty(), "an error without words: {error:?}");
    let mut source = error.source();
    for _ in 0..32 {
        let Some(inner) = source else { return };
        source = inner.source();
    }
    panic!("an error without an end: {text}");
}
