//! Fields of what an update compares: how each is written, and how it is taken over.

use std::{collections::BTreeSet, sync::Arc};

use crate::rig::{
    GroupData, JointData, Rig, RigAbout, RigInput, RigJoint, StoredPose, TagData, TagKind, Uid,
    format::{
        template::{option_text, quaternion, quoted, socket_text, vector},
        tree::Tree,
    },
    part::HeaderSocket,
    reference::{given_name, refresh_names},
};

/// A field of something.
pub(super) struct Field<'a, T> {
    pub name: String,
    /// Value as it is written; `None` where it has none.
    pub text: Box<dyn Fn(&T) -> Option<String> + 'a>,
    /// Takes it over from another one.
    pub take: Box<dyn Fn(&mut T, &T) + 'a>,
    /// Returns `true` for values that differ by rounding alone.
    pub is_close: Box<dyn Fn(&T, &T) -> bool + 'a>,
    /// False for what is compared by itself, and says here only whether something is as it was.
    pub is_own: bool,
}

pub(super) fn field<'a, T>(
    name: &str,
    text: impl Fn(&T) -> Option<String> + 'a,
    take: impl Fn(&mut T, &T) + 'a,
) -> Field<'a, T> {
    let (name, is_close) = (name.to_owned(), Box::new(|_: &T, _: &T| false));
    Field { name, text: Box::new(text), take: Box::new(take), is_close, is_own: true }
}

/// Difference that places have by rounding, in proportion to their size: a place that follows from others, such as that of what
/// hangs on a chain of another length, is the same in all but its last digits.
const ROUNDING: f32 = 1e-6;

/// A field of numbers, which are as close as their rounding makes them.
fn rounded<'a, T>(field: Field<'a, T>, numbers: impl Fn(&T) -> Vec<f32> + 'a) -> Field<'a, T> {
    let is_close = move |a: &T, b: &T| {
        let close = |(a, b): (f32, f32)| (a - b).abs() <= ROUNDING * (1.0 + a.abs().max(b.abs()));
        numbers(a).into_iter().zip(numbers(b)).all(close)
    };
    Field { is_close: Box::new(is_close), ..field }
}

fn written(text: &str) -> Option<String> {
    (!text.is_empty()).then(|| quoted(text))
}

pub(super) fn about_fields() -> Vec<Field<'static, RigAbout>> {
    let listed = |elements: Vec<String>| (!elements.is_empty()).then(|| format!("[{}]", elements.join(", ")));
    let sockets = move |about: &RigAbout| {
        let text = |socket: &HeaderSocket| socket_text(socket, &socket.joint.to_string());
        listed(about.sockets.iter().map(text).collect())
    };
    let options = move |about: &RigAbout| listed(about.options.iter().map(option_text).collect());
    vec![
        field("name", |a: &RigAbout| written(&a.name), |a, b| a.name.clone_from(&b.name)),
        field("version", |a: &RigAbout| written(&a.version), |a, b| a.version.clone_from(&b.version)),
        field("kind", |a: &RigAbout| written(&a.kind), |a, b| a.kind.clone_from(&b.kind)),
        field("author", |a: &RigAbout| written(&a.author), |a, b| a.author.clone_from(&b.author)),
        field("description", |a: &RigAbout| written(&a.description), |a, b| a.description.clone_from(&b.description)),
        field("preview", |a: &RigAbout| a.preview.as_deref().map(quoted), |a, b| a.preview.clone_from(&b.preview)),
        field("sockets", sockets, |a, b| a.sockets.clone_from(&b.sockets)),
        field("options", options, |a, b| a.options.clone_from(&b.options)),
    ]
}

pub(super) fn group_fields() -> Vec<Field<'static, GroupData>> {
    let color = |group: &GroupData| {
        let [r, g, b] = group.color;
        Some(format!("({r:?}, {g:?}, {b:?})"))
    };
    vec![
        field("name", |a: &GroupData| Some(quoted(&a.name)), |a, b| a.name.clone_from(&b.name)),
        field("color", color, |a, b| a.color = b.color),
        field("enabled", |a: &GroupData| Some(a.enabled.to_string()), |a, b| a.enabled = b.enabled),
    ]
}

pub(super) fn input_fields() -> Vec<Field<'static, RigInput>> {
    let rotation = |input: &RigInput| Some(quaternion(input.rest.rotation));
    vec![
        field("name", |a: &RigInput| Some(quoted(&a.name)), |a, b| a.name.clone_from(&b.name)),
        rounded(
            field(
                "translation",
                |a: &RigInput| Some(vector(a.rest.translation)),
                |a, b| a.rest.translation = b.rest.translation,
            ),
            |a: &RigInput| a.rest.translation.to_array().to_vec(),
        ),
        rounded(field("rotation", rotation, |a, b| a.rest.rotation = b.rest.rotation), |a: &RigInput| {
            a.rest.rotation.to_array().to_vec()
        }),
        rounded(
            field("scale", |a: &RigInput| Some(vector(a.rest.scale)), |a, b| a.rest.scale = b.rest.scale),
            |a: &RigInput| a.rest.scale.to_array().to_vec(),
        ),
    ]
}

pub(super) fn pose_fields() -> Vec<Field<'static, StoredPose>> {
    vec![
        field("name", |a: &StoredPose| Some(quoted(&a.name)), |a, b| a.name.clone_from(&b.name)),
        field("offsets", |a: &StoredPose| Some(format!("{:?}", a.offsets)), |a, b| a.offsets.clone_from(&b.offsets)),
        field("values", |a: &StoredPose| Some(format!("{:?}", a.values)), |a, b| a.values.clone_from(&b.values)),
    ]
}

/// A joint as a field refers to it: with its label in the rig now, else in the file.
pub(super) fn joint_title(now: &Rig, file: &Rig, uid: Uid) -> String {
    let label = [now, file].into_iter().find_map(|rig| rig.joint(uid)?.data.label.clone());
    format!("{}#{uid}", label.unwrap_or_default())
}

/// Fields of a joint and its parent. Others are told by their names in the rig now, else in the file.
pub(super) fn joint_fields<'a>(now: &'a Rig, file: &'a Rig) -> Vec<Field<'a, Arc<RigJoint>>> {
    type Joint = Arc<RigJoint>;
    let titled = move |uid: Uid| joint_title(now, file, uid);
    let group = move |uid: Uid| {
        let name = [now, file].into_iter().find_map(|rig| Some(rig.group(uid)?.name.clone()));
        format!("{}#{uid}", name.unwrap_or_default())
    };
    let face = |a: &Joint| a.data.face.as_ref().map(|face| format!("{face:?}"));
    let parent = |a: &mut Joint, b: &Joint| Arc::make_mut(a).parent = b.parent;
    vec![
        field("label", |a: &Joint| a.data.label.as_deref().map(quoted), |a, b| own(a).label.clone_from(&b.data.label)),
        field("parent", move |a: &Joint| a.parent.map(titled), parent),
        field("group", move |a: &Joint| a.data.group.map(group), |a, b| own(a).group = b.data.group),
        field("mirror", move |a: &Joint| a.data.mirror.map(titled), |a, b| own(a).mirror = b.data.mirror),
        field("kind", |a: &Joint| Some(format!("{:?}", a.data.kind)), |a, b| own(a).kind = b.data.kind),
        field("locked", |a: &Joint| Some(a.data.locked.to_string()), |a, b| own(a).locked = b.data.locked),
        rounded(
            field(
                "translation",
                |a: &Joint| Some(vector(a.data.rest.translation)),
                |a, b| own(a).rest.translation = b.data.rest.translation,
            ),
            |a: &Joint| a.data.rest.translation.to_array().to_vec(),
        ),
        rounded(
            field(
                "rotation",
                |a: &Joint| Some(quaternion(a.data.rest.rotation)),
                |a, b| own(a).rest.rotation = b.data.rest.rotation,
            ),
            |a: &Joint| a.data.rest.rotation.to_array().to_vec(),
        ),
        rounded(
            field("scale", |a: &Joint| Some(vector(a.data.rest.scale)), |a, b| own(a).rest.scale = b.data.rest.scale),
            |a: &Joint| a.data.rest.scale.to_array().to_vec(),
        ),
        field("face", face, |a, b| own(a).face.clone_from(&b.data.face)),
        Field { is_own: false, ..field("tags", |a: &Joint| Some(format!("{:?}", a.data.tags)), |_, _| {}) },
    ]
}

/// Data of a joint that gets values of its own; another rig may share it until then.
fn own(joint: &mut Arc<RigJoint>) -> &mut JointData {
    &mut Arc::make_mut(joint).data
}

/// Module or kind of feature, and the name that the tag gives.
pub(super) fn tag_title(tag: &TagData) -> String {
    match &tag.kind {
        TagKind::Command { module, params, .. } => match given_name(params) {
            Some(name) => format!("{module}/{name}"),
            None => module.clone(),
        },
        TagKind::Feature { kind, name, switch, .. } => {
            let parts = [kind.as_str(), name, switch];
            parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("/")
        }
    }
}

/// Fields of a tag, with each parameter that one of the three versions has. Tags of different kind or module differ in the
/// field `module`, and are taken over as a whole.
pub(super) fn tag_fields<'a>(versions: &[Option<&TagData>; 3], now: &'a Rig, file: &'a Rig) -> Vec<Field<'a, TagData>> {
    let feature = move |uid: Uid| {
        let title = [now, file].into_iter().find_map(|rig| Some(tag_title(rig.find_tag(uid)?.1)));
        format!("{}#{uid}", title.unwrap_or_default())
    };
    let kind = |tag: &TagData| match &tag.kind {
        TagKind::Command { module, .. } => Some(quoted(module)),
        TagKind::Feature { kind, .. } => Some(format!("feature {}", quoted(kind))),
    };
    let whole = |a: &mut TagData, b: &TagData| a.kind.clone_from(&b.kind);
    let mut list = vec![
        field("enabled", |a: &TagData| Some(a.enabled.to_string()), |a, b| a.enabled = b.enabled),
        field("comment", |a: &TagData| written(&a.comment), |a, b| a.comment.clone_from(&b.comment)),
    ];
    let there: Vec<&TagData> = versions.iter().copied().flatten().collect();
    let alike = there.windows(2).all(|pair| kind(pair[0]) == kind(pair[1]));
    if !alike {
        list.push(field("module", kind, whole));
        return list;
    }
    if !there.iter().any(|tag| matches!(tag.kind, TagKind::Command { .. })) {
        for (place, name) in ["name", "switch", "choice"].into_iter().enumerate() {
            let text = move |tag: &TagData| feature_texts(&tag.kind).and_then(|texts| written(texts[place]));
            let take = move |a: &mut TagData, b: &TagData| {
                if let (Some(a), Some(b)) = (feature_texts_mut(&mut a.kind), feature_texts(&b.kind)) {
                    a[place].clone_from(b[place]);
                }
            };
            list.push(field(name, text, take));
        }
        return list;
    }
    let of_feature = move |tag: &TagData| match &tag.kind {
        TagKind::Command { feature: Some(uid), .. } => Some(feature(*uid)),
        _ => None,
    };
    let take_feature = |a: &mut TagData, b: &TagData| {
        if let (TagKind::Command { feature: a, .. }, TagKind::Command { feature: b, .. }) = (&mut a.kind, &b.kind) {
            *a = *b;
        }
    };
    list.push(field("feature", of_feature, take_feature));
    let params: Vec<&str> = there.iter().map(|tag| params_of(tag)).collect();
    let keys: Option<BTreeSet<String>> = params
        .iter()
        .map(|params| keys(params))
        .collect::<Option<Vec<_>>>()
        .map(|keys| keys.into_iter().flatten().collect());
    let Some(keys) = keys else {
        // Parameters that are no struct are one value.
        let all = move |tag: &TagData| Some(refresh_names(params_of(tag), now).into_owned());
        list.push(field("params", all, whole));
        return list;
    };
    for key in keys {
        let (own, name) = (key.clone(), format!("params.{key}"));
        let value =
            move |tag: &TagData| parameter(params_of(tag), &own).map(|text| refresh_names(&text, now).into_owned());
        let same = key.clone();
        let is_close = move |a: &TagData, b: &TagData| {
            let [a, b] = [a, b].map(|tag| parameter(params_of(tag), &same));
            matches!((a, b), (Some(a), Some(b)) if without_spaces(&a) == without_spaces(&b))
        };
        let take = move |a: &mut TagData, b: &TagData| {
            let value = parameter(params_of(b), &key);
            if let TagKind::Command { params, .. } = &mut a.kind {
                *params = with_parameter(params, &key, value.as_deref());
            }
        };
        list.push(Field { is_close: Box::new(is_close), ..field(&name, value, take) });
    }
    list
}

/// A value without the white space between its parts, by which nothing differs. Raw strings keep theirs.
fn without_spaces(text: &str) -> String {
    if text.contains('#') {
        return text.to_owned();
    }
    let (mut is_quoted, mut is_escaped) = (false, false);
    let kept = text.chars().filter(|letter| {
        if is_escaped {
            is_escaped = false;
            return true;
        }
        is_escaped = is_quoted && *letter == '\\';
        is_quoted ^= *letter == '"';
        is_quoted || !letter.is_whitespace()
    });
    kept.collect()
}

fn params_of(tag: &TagData) -> &str {
    match &tag.kind {
        TagKind::Command { params, .. } => params,
        TagKind::Feature { .. } => "",
    }
}

/// Names of the fields of parameters; `None` if they are no struct.
fn keys(params: &str) -> Option<Vec<String>> {
    let tree = Tree::parse(params)?;
    let root = tree.node(tree.root());
    let is_struct = root.bracket == Some('(') && root.name.is_empty();
    let keys: Option<Vec<String>> = root.items.iter().map(|item| item.key.map(str::to_owned)).collect();
    keys.filter(|_| is_struct)
}

/// Text of a parameter.
fn parameter(params: &str, key: &str) -> Option<String> {
    let tree = Tree::parse(params)?;
    let field = tree.field(tree.root(), key)?;
    Some(tree.written(field.value).to_owned())
}

/// Parameters with another value of one of them, or without it.
fn with_parameter(params: &str, key: &str, value: Option<&str>) -> String {
    let Some(tree) = Tree::parse(params) else { return params.to_owned() };
    let root = tree.node(tree.root());
    let mut list: Vec<String> = Vec::new();
    for item in root.items {
        let text = if item.key == Some(key) { value } else { Some(tree.written(item.value)) };
        list.extend(text.map(|text| format!("{}: {text}", item.key.unwrap_or_default())));
    }
    if let (Some(value), None) = (value, tree.field(tree.root(), key)) {
        list.push(format!("{key}: {value}"));
    }
    format!("({})", list.join(", "))
}

/// Name, switch and choice of a feature.
fn feature_texts(kind: &TagKind) -> Option<[&String; 3]> {
    match kind {
        TagKind::Feature { name, switch, choice, .. } => Some([name, switch, choice]),
        TagKind::Command { .. } => None,
    }
}

fn feature_texts_mut(kind: &mut TagKind) -> Option<[&mut String; 3]> {
    match kind {
        TagKind::Feature { name, switch, choice, .. } => Some([name, switch, choice]),
        TagKind::Command { .. } => None,
    }
}
