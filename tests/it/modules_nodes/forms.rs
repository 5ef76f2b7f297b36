//! Documentation and forms of modules, and the shapes of controls.

use super::*;

#[test]
fn every_module_is_documented_and_its_defaults_load() {
    for module in modules::all().iter() {
        assert!(!module.doc.is_empty() && module.doc.ends_with('.'), "{}", module.name);
        for parameter in &module.parameters {
            let name = format!("{}.{}", module.name, parameter.name);
            assert!(parameter.doc.ends_with('.'), "{name}: {:?}", parameter.doc);
            let params = format!("({}: {})", parameter.name, parameter.default);
            assert!(module.parse(&params).is_ok(), "{name}: {params}: {:?}", module.parse(&params).err());
        }
        assert!(module.parse("").is_ok(), "{}", module.name);
        assert!(module.mirrored("()").is_ok(), "{}", module.name);
        // Modules that differ only in their channels stand in one file.
        let follow = matches!(module.name, "orient" | "point" | "scale" | "parent");
        let file = if follow { "follow" } else { module.name };
        let file = format!("{}/src/modules/{file}.rs", env!("CARGO_MANIFEST_DIR"));
        let source = std::fs::read_to_string(&file).unwrap_or_else(|error| panic!("{file}: {error}"));
        assert!(source.contains("/// ```"), "{} has no example", module.name);
    }
}

#[test]
fn every_form_edits_parameters_that_exist_and_all_of_them() {
    for module in modules::all().iter() {
        let Some(text) = &module.form else { panic!("{} has no form", module.name) };
        let form = read_module_form(text.as_bytes(), module).unwrap_or_else(|error| panic!("{}: {error}", module.name));
        assert!(!form.title.is_empty());
        for parameter in &module.parameters {
            let edits = |param: &str| param.split('.').next() == Some(parameter.name);
            let is_there = form.elements().iter().any(|element| element.bound().is_some_and(|(param, _)| edits(param)));
            assert!(is_there, "the form of {} leaves out {}", module.name, parameter.name);
        }
        let icon = module.icon.unwrap_or_default();
        assert!(icon.contains("viewBox=\"0 0 24 24\"") && icon.contains("currentColor"), "icon of {}", module.name);
        let folder = format!("{}/assets/modules/{}", env!("CARGO_MANIFEST_DIR"), module.name);
        assert_eq!(std::fs::read_to_string(format!("{folder}.ui.ron")).unwrap(), text.as_ref());
    }
}

#[test]
fn wrong_forms_are_told_with_their_place() {
    let modules = modules::all();
    let control: &ModuleInfo = modules.get("control").unwrap();
    let form = |element: &str| format!("(\n    title: \"x\",\n    content: [\n        {element},\n    ],\n)");
    for (element, place, expected) in [
        ("Text(param: \"shap\")", "line 4, column 14", "did you mean \"shape\""),
        ("Text(param: \"creation.nam\")", "line 4, column 14", "did you mean \"name\""),
        ("Text(param: \"size.x\")", "line 4, column 14", "has no parts"),
        ("Check(param: \"shape\")", "line 4, column 15", "use Text or Menu"),
        ("Node(param: \"follow\")", "line 4, column 14", "use Check"),
        ("Menu(param: \"axes\", options: [\"node\", \"rigg\"])", "line 4, column 14", "cannot be \"rigg\""),
        ("Slider(param: \"relative_size\", min: 1.0, max: 1.0)", "line 4, column 16", "`min` has to be below `max`"),
        ("Frame(label: \"\", content: [Check(param: \"follow\"), Check(param: \"follow\")])", "line 4", "twice"),
        ("Slide(param: \"size\")", "line 4", "Slide"),
    ] {
        let message = read_module_form(form(element).as_bytes(), control).unwrap_err().to_string();
        assert!(message.contains(place) && message.contains(expected), "{element}: {message}");
    }
    assert!(read_form(b"").is_err());
}

#[test]
fn shapes_are_in_unit_size() {
    let names: Vec<&str> = shapes::names().collect();
    assert!(names.len() >= 16, "{names:?}");
    for name in names {
        let lines = shapes::shape(name).unwrap();
        let widest = lines.iter().flatten().map(|point| point.abs().max_element()).fold(0.0, f32::max);
        assert!((0.95..=1.5).contains(&widest), "{name} reaches to {widest}");
        assert!(lines.iter().all(|line| line.len() >= 2 && line.iter().all(|point| point.is_finite())), "{name}");
    }
    assert_eq!(shapes::shape("blob"), None);
}
