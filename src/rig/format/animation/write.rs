//! Writer of clips.

use std::fmt::{self, Write};

use crate::rig::{
    Uid,
    animation::{ClipLayer, Ease, Key, LayerMode, NodeNames, Property, RigClip, TrackTarget},
    template::quoted,
};

pub(super) fn write_file(
    out: &mut String,
    (rig, name): (Uid, &str),
    names: &NodeNames,
    clips: &[RigClip],
) -> fmt::Result {
    writeln!(out, "(\n    format: {},\n    rig: \"{rig}\",", super::FORMAT)?;
    if !name.is_empty() {
        writeln!(out, "    rig_name: {},", quoted(name))?;
    }
    writeln!(out, "    clips: [")?;
    write_clips(out, clips, names, "        ")?;
    writeln!(out, "    ],\n)")
}

/// Writes clips as elements of a list. Nodes without a name in `names` have those that the clips have for them.
pub(in crate::rig::format) fn write_clips(
    out: &mut String,
    clips: &[RigClip],
    names: &NodeNames,
    indent: &str,
) -> fmt::Result {
    for clip in clips {
        let RigClip { uid, name, frame_rate, range: [start, end], looped, markers, layers, names: own } = clip;
        writeln!(out, "{indent}(\n{indent}    uid: \"{uid}\",\n{indent}    name: {},", quoted(name))?;
        writeln!(out, "{indent}    frame_rate: {frame_rate:?},\n{indent}    range: ({start:?}, {end:?}),")?;
        if *looped {
            writeln!(out, "{indent}    looped: true,")?;
        }
        if !markers.is_empty() {
            writeln!(out, "{indent}    markers: [")?;
            for marker in markers {
                writeln!(out, "{indent}        (time: {:?}, name: {}),", marker.time, quoted(&marker.name))?;
            }
            writeln!(out, "{indent}    ],")?;
        }
        writeln!(out, "{indent}    layers: [")?;
        for layer in layers {
            write_layer(out, layer, [names, own], &format!("{indent}        "))?;
        }
        writeln!(out, "{indent}    ],\n{indent}),")?;
    }
    Ok(())
}

fn write_layer(out: &mut String, layer: &ClipLayer, names: [&NodeNames; 2], indent: &str) -> fmt::Result {
    let ClipLayer { uid, name, mode, weight, mask, muted, tracks } = layer;
    writeln!(out, "{indent}(\n{indent}    uid: \"{uid}\",\n{indent}    name: {},", quoted(name))?;
    if *mode == LayerMode::Additive {
        writeln!(out, "{indent}    mode: Additive,")?;
    }
    if *weight != 1.0 {
        writeln!(out, "{indent}    weight: {weight:?},")?;
    }
    if *muted {
        writeln!(out, "{indent}    muted: true,")?;
    }
    if !mask.is_empty() {
        writeln!(out, "{indent}    mask: [")?;
        for node in mask {
            write!(out, "{indent}        (")?;
            write_node(out, *node, names)?;
            writeln!(out, "),")?;
        }
        writeln!(out, "{indent}    ],")?;
    }
    writeln!(out, "{indent}    tracks: [")?;
    for (target, track) in tracks {
        let TrackTarget { node, property } = target;
        write!(out, "{indent}        (\n{indent}            ")?;
        write_node(out, *node, names)?;
        writeln!(out, ",\n{indent}            property: {},\n{indent}            keys: [", property_text(property))?;
        for key in &track.keys {
            write_key(out, key, property.width(), indent)?;
        }
        writeln!(out, "{indent}            ],\n{indent}        ),")?;
    }
    writeln!(out, "{indent}    ],\n{indent}),")
}

fn write_node(out: &mut String, node: Uid, names: [&NodeNames; 2]) -> fmt::Result {
    write!(out, "node: \"{node}\"")?;
    let Some(name) = names.iter().find_map(|names| names.0.get(&node)) else { return Ok(()) };
    if !name.label.is_empty() {
        write!(out, ", label: {}", quoted(&name.label))?;
    }
    if !name.role.is_empty() {
        write!(out, ", role: {}", quoted(&name.role))?;
    }
    Ok(())
}

fn property_text(property: &Property) -> String {
    match property {
        Property::Translation => "Translation".to_owned(),
        Property::Rotation => "Rotation".to_owned(),
        Property::Scale => "Scale".to_owned(),
        Property::Attribute(name) => format!("Attribute({})", quoted(name)),
    }
}

fn write_key(out: &mut String, key: &Key, width: usize, indent: &str) -> fmt::Result {
    write!(out, "{indent}                (t: {:?}, v: ", key.time)?;
    write_numbers(out, &key.value[..width])?;
    match &key.ease {
        Ease::Linear => {}
        Ease::Stepped => write!(out, ", ease: Stepped")?,
        Ease::Cubic { arrive, leave } => {
            write!(out, ", ease: Cubic(arrive: ")?;
            write_numbers(out, &arrive[..width])?;
            write!(out, ", leave: ")?;
            write_numbers(out, &leave[..width])?;
            write!(out, ")")?;
        }
    }
    writeln!(out, "),")
}

fn write_numbers(out: &mut String, numbers: &[f32]) -> fmt::Result {
    for (place, number) in numbers.iter().enumerate() {
        write!(out, "{}{number:?}", if place == 0 { "(" } else { ", " })?;
    }
    write!(out, ")")
}
