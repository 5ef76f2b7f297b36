//! Appearance of modules as nodes: their titles, and the parameters that take references.

use std::collections::BTreeMap;

use crate::processor::{ModuleInfo, Modules, form::read_module_form};

/// Appearance of a module.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ModuleLook {
    /// Title of the module's form, or its name with blanks.
    pub title: String,
    /// Names of the parameters that take references.
    pub inputs: Vec<String>,
}

/// Appearances of modules, each made when it is first needed.
#[derive(Debug, Default)]
pub(super) struct ModuleLooks(BTreeMap<String, ModuleLook>);

impl ModuleLooks {
    /// The appearance of a module; that of its name where no such module is known.
    pub fn of(&mut self, module: &str, modules: &Modules) -> &ModuleLook {
        self.0.entry(module.to_owned()).or_insert_with(|| look(module, modules.get(module)))
    }

    /// Forgets all: other modules are registered.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

fn look(name: &str, module: Option<&ModuleInfo>) -> ModuleLook {
    let form = module.and_then(|module| read_module_form(module.form.as_ref()?.as_bytes(), module).ok());
    let title = form.map(|form| form.title).filter(|title| !title.is_empty()).unwrap_or_else(|| spaced(name));
    let inputs = module.map(reference_parameters).unwrap_or_default();
    ModuleLook { title, inputs }
}

/// Names of the parameters of a module that take references.
pub(super) fn reference_parameters(module: &ModuleInfo) -> Vec<String> {
    let takes = |kind: &str| matches!(kind, "NodeRef" | "NodeRefs");
    let taking = module.parameters.iter().filter(|parameter| takes(&parameter.kind));
    taking.map(|parameter| parameter.name.to_owned()).collect()
}

/// A name in `snake_case` with blanks and a capital.
fn spaced(name: &str) -> String {
    let name = name.replace('_', " ");
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
