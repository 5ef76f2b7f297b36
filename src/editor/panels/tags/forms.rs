//! Forms of modules: those that they come with, or made of their parameters.

use crate::processor::{
    ModuleInfo,
    form::{Form, FormBinding, FormElement, read_module_form},
};

/// The form of a module; one made of its parameters if it has none, or none that can be read.
pub(super) fn form_of(module: &ModuleInfo) -> Form {
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
