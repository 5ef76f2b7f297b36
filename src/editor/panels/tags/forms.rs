//! Forms of modules: those that they come with, or made of their parameters.

use std::{collections::HashMap, sync::Arc};

use crate::processor::{
    ModuleInfo, Modules,
    form::{Form, FormBinding, FormElement, read_module_form},
};

/// Forms of modules, each read when it is first needed.
#[derive(Default)]
pub(super) struct Forms {
    /// Modules that the forms are of.
    modules: Option<Arc<Modules>>,
    read: HashMap<&'static str, Arc<Form>>,
}

impl Forms {
    /// Drops the forms if these are other modules than before, as after a form was saved; returns true then.
    pub fn follow(&mut self, modules: &Arc<Modules>) -> bool {
        if self.modules.as_ref().is_some_and(|known| Arc::ptr_eq(known, modules)) {
            return false;
        }
        self.modules = Some(modules.clone());
        self.read.clear();
        true
    }

    /// The form of a module.
    pub fn of(&mut self, module: &ModuleInfo) -> Arc<Form> {
        self.read.entry(module.name).or_insert_with(|| Arc::new(form_of(module))).clone()
    }
}

/// The form of a module; one made of its parameters if it has none, or none that can be read.
fn form_of(module: &ModuleInfo) -> Form {
    let form = module.form.as_ref().and_then(|form| read_module_form(form.as_bytes(), module).ok());
    form.unwrap_or_else(|| made_form(module))
}

fn made_form(module: &ModuleInfo) -> Form {
    let element = |name: &str, kind: &str| {
        let bound = FormBinding { param: name.to_owned(), label: String::new() };
        match kind {
            "bool" => FormElement::Check(bound),
            "f32" => {
                FormElement::Number { param: name.to_owned(), label: String::new(), step: 0.01, unit: String::new() }
            }
            "Vec3" => FormElement::Vector(bound),
            "NodeRef" | "NodeRefs" => FormElement::Node(bound),
            "String" => FormElement::Text(bound),
            "Amount" => FormElement::Amount(bound),
            "Vec<(f32, f32)>" => FormElement::Curve(bound),
            _ => FormElement::List(bound),
        }
    };
    let content = module.parameters.iter().map(|parameter| element(parameter.name, &parameter.kind)).collect();
    Form { title: module.name.to_owned(), content }
}
