//! Modules: what a command tag can do, and the registry that finds them by name.

use std::{any::TypeId, borrow::Cow, collections::BTreeMap, sync::Arc};

use bevy::{
    math::ops,
    reflect::{Reflect, TypeInfo, Typed},
};
use glam::{Mat3, Quat, Vec3};
use serde::{Serialize, de::DeserializeOwned};

use super::{BuildProblem, BuildScope, Deadline, ModuleError, form::read_module_form, mirror};
use crate::rig::{SourceError, degrees, nearest::did_you_mean, parse_ron, ron_text};

/// Module of commands: its fields are the parameters of the tag, [`RigModule::construct`] is the work.
///
/// [`parameters!`](crate::parameters) declares the type with its parameters, their words and defaults. A type written by
/// hand needs `#[serde(default, deny_unknown_fields)]`, so that tags may leave parameters out and misspelt ones are
/// told. There is no destructor to write: everything that goes through the scope is taken back exactly.
pub trait RigModule: Reflect + Typed + Serialize + DeserializeOwned + Default + Send + Sync + 'static {
    /// The name in tags, in `snake_case`.
    const NAME: &'static str;
    /// Description in one or two sentences.
    const DOC: &'static str;
    /// A line about each parameter: (name, what it is, with its unit and range).
    const PARAMETERS: &'static [(&'static str, &'static str)];
    /// Names of the parameters whose values have a side, see [`RigModule::mirror`].
    const SIDED: &'static [&'static str] = &[];
    /// The form that edits its parameters, as text: see [`Form`](super::form::Form). Without one, a form is made
    /// from the parameters' types.
    const FORM: Option<&'static str> = None;
    /// Icon as SVG text: 24 by 24 units, lines in `currentColor`.
    const ICON: Option<&'static str> = None;

    /// Makes nodes and constraints.
    ///
    /// # Errors
    /// Whatever keeps it from doing so; nothing of what it did so far stays then.
    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError>;

    /// Turns values that have a side (axes, colours by side) into those of the other side of the character, for tags
    /// that are pasted mirrored: those of [`RigModule::SIDED`] and no others. Twice gives the first values back.
    /// References are mirrored already, and so are, for every module, names of attributes: each
    /// [`Amount`](super::Amount), and texts in fields called `attribute` or `SOMETHING_attribute`.
    fn mirror(&mut self) {}

    /// Brings lengths in the rig's units, and directions along the rig's axes, to a body of another size: for templates that
    /// are fitted to a mesh. Lengths that follow from joints need nothing.
    fn resize(&mut self, _change: &Resize) {}

    /// Takes the length by which its half joints leave a bend, as a share of the bone below, so that the mesh that was bound
    /// keeps its volume. Returns `false` if the module has no such length, or a person set it.
    fn set_push(&mut self, _push: f32) -> bool {
        false
    }
}

/// Difference between the body that a command was written for and another one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resize {
    /// Factor of lengths.
    pub factor: f32,
    /// Factor of heights above the floor: of the joint's own if it is a root, else as `factor`.
    pub floor_factor: f32,
    /// Rotation of the rig's axes.
    pub turn: Quat,
}

impl Resize {
    /// Direction along the rig's axes, turned with them.
    pub fn turned(&self, direction: Vec3) -> Vec3 {
        if self.turn == Quat::IDENTITY { direction } else { self.turn * direction }
    }

    /// Angles about X, Y and Z in degrees, against the rig's axes, turned with them.
    pub fn turned_angles(&self, angles: Vec3) -> Vec3 {
        if self.turn == Quat::IDENTITY {
            return angles;
        }
        let axes = Mat3::from_quat((self.turn * degrees(angles)).normalize());
        let [x, y, z] = [axes.x_axis, axes.y_axis, axes.z_axis];
        let level = (x.x * x.x + y.x * y.x).sqrt();
        let about_y = ops::atan2(z.x, level);
        // With Y at a right angle, X and Z turn about one line.
        let (about_x, about_z) =
            if level > 1e-4 { (ops::atan2(-z.y, z.z), ops::atan2(-y.x, x.x)) } else { (ops::atan2(y.z, y.y), 0.0) };
        // Right angles are written as such, not nearly so by rounding, and zero without a sign.
        [about_x, about_y, about_z].map(|angle| (angle.to_degrees() * 1e4).round() / 1e4 + 0.0).into()
    }
}

/// A [`RigModule`] whose type is not known: parameters, ready to be carried out.
pub trait DynModule: Send + Sync {
    /// See [`RigModule::construct`].
    ///
    /// # Errors
    /// See [`RigModule::construct`].
    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError>;
}

impl<M: RigModule> DynModule for M {
    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        RigModule::construct(self, scope)
    }
}

/// One parameter of a module.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// The name.
    pub name: &'static str,
    /// Rust type, without the path.
    pub kind: String,
    /// Description.
    pub doc: &'static str,
    /// The value where a tag leaves it out, as RON.
    pub default: String,
    /// True if its value has a side, and is another one on the other side of the character.
    pub sided: bool,
}

type Parse = fn(&str) -> Result<Arc<dyn DynModule>, SourceError>;
type Mirror = fn(&str) -> Result<String, SourceError>;
type ResizeText = fn(&str, &Resize) -> Result<String, SourceError>;
type CompleteText = fn(&str) -> Result<String, SourceError>;
type PushText = fn(&str, f32) -> Result<Option<String>, SourceError>;

/// Reason for which a module does not take a form.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FormError {
    /// No module has the name.
    #[error("there is no module \"{0}\"; the form of a module is called as the module, `NAME.ui.ron`")]
    NoModule(String),
    /// The text is no form of the module.
    #[error(transparent)]
    Source(#[from] SourceError),
}

/// A registered module.
#[derive(Debug, Clone)]
pub struct ModuleInfo {
    /// The name in tags.
    pub name: &'static str,
    /// Description.
    pub doc: &'static str,
    /// Parameters in order.
    pub parameters: Vec<Parameter>,
    /// Text of the form: [`RigModule::FORM`], unless [another](Modules::set_form) was given.
    pub form: Option<Cow<'static, str>>,
    /// See [`RigModule::ICON`].
    pub icon: Option<&'static str>,
    /// Identity of its type, for reflection.
    pub type_id: TypeId,
    /// Type, for forms made by reflection.
    pub type_info: &'static TypeInfo,
    parse: Parse,
    mirror: Mirror,
    resize: ResizeText,
    push: PushText,
    /// Gives parameters with all values, those that are left out, too.
    pub(super) complete: CompleteText,
}

impl ModuleInfo {
    /// Reads a tag's parameters.
    ///
    /// # Errors
    /// [`SourceError`] with line and column in the text.
    pub fn parse(&self, params: &str) -> Result<Arc<dyn DynModule>, SourceError> {
        (self.parse)(params)
    }

    /// The parameters for the other side of the character: as they are written, with other values where those have a
    /// side. References are left as they are.
    ///
    /// # Errors
    /// [`SourceError`] with line and column in the text.
    pub fn mirrored(&self, params: &str) -> Result<String, SourceError> {
        (self.mirror)(params)
    }

    /// The parameters for a body of another size, as they are written, with other values where those are lengths.
    ///
    /// # Errors
    /// [`SourceError`] with line and column in the text.
    pub fn resized(&self, params: &str, change: &Resize) -> Result<String, SourceError> {
        (self.resize)(params, change)
    }

    /// The parameters with the length by which half joints leave a bend, as they are written otherwise; `None` where
    /// [`RigModule::set_push`] declines.
    ///
    /// # Errors
    /// [`SourceError`] with line and column in the text.
    pub fn pushed(&self, params: &str, push: f32) -> Result<Option<String>, SourceError> {
        (self.push)(params, push)
    }
}

/// All modules by name.
#[derive(Debug, Clone, Default, bevy::ecs::resource::Resource)]
pub struct Modules {
    by_name: BTreeMap<&'static str, ModuleInfo>,
    /// Limits of what the commands of one rig may make.
    pub limits: BuildLimits,
    /// End of the time for builds; no command begins after it.
    pub deadline: Option<Deadline>,
}

/// Limits of the work and the results of the commands of one rig. Without limits, a few tags that refer to everything,
/// created nodes included, would fill the memory. A character has some hundreds of nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuildLimits {
    /// The most nodes and constraints together.
    pub made: usize,
    /// The most attributes of one node.
    pub attributes: usize,
    /// The most values that commands read and write in one run. A character takes some ten thousands.
    pub work: u64,
}

impl Default for BuildLimits {
    fn default() -> Self {
        Self { made: 16_384, attributes: 1024, work: 1_000_000_000 }
    }
}

impl Modules {
    /// No module at all.
    pub fn new() -> Self {
        Self::default()
    }

    /// Registers a module; one of the same name is replaced.
    pub fn add<M: RigModule>(&mut self) -> &mut Self {
        let info = ModuleInfo {
            name: M::NAME,
            doc: M::DOC,
            parameters: parameters::<M>(),
            form: M::FORM.map(Cow::Borrowed),
            icon: M::ICON,
            type_id: TypeId::of::<M>(),
            type_info: M::type_info(),
            parse: |text| Ok(Arc::new(read::<M>(text)?)),
            mirror: |text| {
                let before = ron_text(&read::<M>(text)?);
                let mut module = read::<M>(text)?;
                module.mirror();
                mirror::mirror_attributes(&mut module);
                Ok(mirror::with_changes(text, &before, &ron_text(&module)))
            },
            resize: |text, change| {
                let before = ron_text(&read::<M>(text)?);
                let mut module = read::<M>(text)?;
                module.resize(change);
                Ok(mirror::with_changes(text, &before, &ron_text(&module)))
            },
            push: |text, push| {
                let before = ron_text(&read::<M>(text)?);
                let mut module = read::<M>(text)?;
                let takes_it = module.set_push(push);
                Ok(takes_it.then(|| mirror::with_changes(text, &before, &ron_text(&module))))
            },
            complete: |text| Ok(ron_text(&read::<M>(text)?)),
        };
        self.by_name.insert(M::NAME, info);
        self
    }

    /// Gives a module another form, which has to fit its parameters.
    ///
    /// # Errors
    /// Faults of the text with their place; [`FormError::NoModule`] for a name that no module has.
    pub fn set_form(&mut self, name: &str, text: &str) -> Result<(), FormError> {
        let module = self.by_name.get_mut(name).ok_or_else(|| FormError::NoModule(name.to_owned()))?;
        read_module_form(text.as_bytes(), module)?;
        module.form = Some(Cow::Owned(text.to_owned()));
        Ok(())
    }

    /// The module of that name.
    pub fn get(&self, name: &str) -> Option<&ModuleInfo> {
        self.by_name.get(name)
    }

    /// All modules, sorted by name.
    pub fn iter(&self) -> impl Iterator<Item = &ModuleInfo> {
        self.by_name.values()
    }

    /// The module of that name with its parameters read.
    ///
    /// # Errors
    /// If there is no such module, or its parameters cannot be read.
    pub fn load(&self, name: &str, params: &str) -> Result<Arc<dyn DynModule>, BuildProblem> {
        let Some(info) = self.get(name) else {
            let nearest = did_you_mean(name, self.by_name.keys());
            return Err(BuildProblem::NoModule { module: name.to_owned(), nearest });
        };
        Ok(info.parse(params)?)
    }
}

fn read<M: RigModule>(text: &str) -> Result<M, SourceError> {
    parse_ron(if text.trim().is_empty() { "()" } else { text })
}

fn parameters<M: RigModule>() -> Vec<Parameter> {
    let TypeInfo::Struct(info) = M::type_info() else { return Vec::new() };
    let default = M::default();
    let parameter = |field: &bevy::reflect::NamedField| {
        let doc = M::PARAMETERS.iter().find(|(name, _)| *name == field.name()).map_or("", |(_, doc)| doc.trim());
        let kind = field.type_path_table().short_path().to_owned();
        let default = default_text(&default, field.name());
        Parameter { name: field.name(), kind, doc, default, sided: M::SIDED.contains(&field.name()) }
    };
    info.iter().map(parameter).collect()
}

/// The default of one field as RON, as it may stand in a tag.
fn default_text<M: RigModule>(default: &M, field: &str) -> String {
    let text = ron_text(default);
    let fields = crate::rig::fields(&text);
    let found = fields.iter().find(|known| known.depth == 1 && known.name == field);
    found.map_or_else(String::new, |found| text[found.value..found.end].trim().trim_end_matches(',').to_owned())
}
