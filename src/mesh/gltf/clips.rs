//! Animation clips, their keys as in the file (sections 3.11 and 3.12).

use super::{
    GltfError,
    accessor::{Component, Source},
    budget::Notes,
    document::ChannelEntry,
    hierarchy::Hierarchy,
    json::copy,
};
use crate::mesh::model::{Channel, ChannelTarget, Clip, Interpolation, Model};

/// Reads all animations; `objects` are the objects of the file's nodes.
pub(super) fn read_clips(
    source: &Source,
    hierarchy: &Hierarchy,
    objects: &[Option<usize>],
    notes: &Notes,
    model: &mut Model,
) -> Result<(), GltfError> {
    for animation in &source.document.animations {
        let mut channels: Vec<Channel> = Vec::new();
        let mut taken = std::collections::BTreeSet::new();
        for entry in &animation.channels {
            let Some(target) = target(entry, hierarchy, objects) else {
                notes.add(format!("An animation channel for {:?} was not kept", shorten(entry.path)));
                continue;
            };
            if !taken.insert((entry.node, entry.path)) {
                notes.add("A second channel for the same property of a node was not kept");
                continue;
            }
            channels.extend(channel(source, entry, target, model, notes)?);
        }
        if channels.is_empty() {
            notes.add("An animation without channels was not kept");
            continue;
        }
        let (name, extras) = (
            animation.name.to_owned(),
            animation.extras.map(|extras| copy(extras, source.budget, "/animations")).transpose()?,
        );
        model.clips.push(Clip { name, channels, extras });
    }
    Ok(())
}

fn shorten(path: &str) -> String {
    path.chars().take(40).collect()
}

fn target(entry: &ChannelEntry, hierarchy: &Hierarchy, objects: &[Option<usize>]) -> Option<ChannelTarget> {
    match entry.path {
        "translation" => hierarchy.kept.get(entry.node).map(ChannelTarget::Translation),
        "rotation" => hierarchy.kept.get(entry.node).map(ChannelTarget::Rotation),
        "scale" => hierarchy.kept.get(entry.node).map(ChannelTarget::Scale),
        "weights" => objects[entry.node].map(ChannelTarget::MorphWeights),
        _ => None,
    }
}

/// The keys of a channel; `None` if it has none that can be kept.
fn channel(
    source: &Source,
    entry: &ChannelEntry,
    target: ChannelTarget,
    model: &Model,
    notes: &Notes,
) -> Result<Option<Channel>, GltfError> {
    let interpolation = match entry.interpolation {
        "LINEAR" => Interpolation::Linear,
        "STEP" => Interpolation::Step,
        "CUBICSPLINE" => Interpolation::CubicSpline,
        other => {
            notes.add(format!("The interpolation {:?} is unknown; it was read as LINEAR", shorten(other)));
            Interpolation::Linear
        }
    };
    let (element, components) = match target {
        ChannelTarget::Translation(_) | ChannelTarget::Scale(_) => (3, 3),
        ChannelTarget::Rotation(_) => (4, 4),
        ChannelTarget::MorphWeights(object) => (1, model.objects[object].morph_names.len()),
    };
    if components == 0 {
        notes.add("Animated weights of a mesh without morph targets were not kept");
        return Ok(None);
    }
    let format = |accessor: usize, what: &str| {
        GltfError::at(&*entry.place, format!("the {what} (accessor {accessor}) must be floats"))
    };
    let accessors = &source.document.accessors;
    if accessors[entry.input].component != Some(Component::F32) {
        return Err(format(entry.input, "times"));
    }
    let output = &accessors[entry.output];
    if output.component != Some(Component::F32) && !(output.normalized && element != 3) {
        return Err(format(entry.output, "values"));
    }
    let mut times = source.finite(entry.input, 1)?;
    let mut values = source.finite(entry.output, element)?;
    let per_key = components * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    if times.len().checked_mul(per_key) != Some(values.len()) {
        let what = format!("{} times need {} values each, there are {}", times.len(), per_key, values.len());
        return Err(GltfError::at(&*entry.place, what));
    }
    let rising = times.first().is_some_and(|time| *time >= 0.0) && times.windows(2).all(|pair| pair[0] < pair[1]);
    if !rising {
        keep_rising(&mut times, &mut values, per_key, notes);
    }
    if times.is_empty() {
        return Ok(None);
    }
    Ok(Some(Channel { target, interpolation, times, values }))
}

/// Drops keys before time zero and keys not later than the one before: glTF has neither.
fn keep_rising(times: &mut Vec<f32>, values: &mut Vec<f32>, per_key: usize, notes: &Notes) {
    let mut kept = 0;
    for key in 0..times.len() {
        let last = if kept == 0 { -1.0 } else { times[kept - 1] };
        if times[key] >= 0.0 && times[key] > last {
            times[kept] = times[key];
            values.copy_within(key * per_key..(key + 1) * per_key, kept * per_key);
            kept += 1;
        }
    }
    notes.add_times(
        "A key was not kept, since its time was before zero or not after the key before it",
        times.len() - kept,
    );
    times.truncate(kept);
    values.truncate(kept * per_key);
}
