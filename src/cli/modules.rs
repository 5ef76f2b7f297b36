//! `rigsmith modules`: description of the command modules.

use clap::Args;
use serde_json::json;

use super::{Report, explanation::Explanation};
use crate::{modules, rig::nearest::did_you_mean};

/// Arguments of `rigsmith modules`.
#[derive(Args, Debug)]
pub(super) struct ModulesArgs {
    /// Names of the modules; all without any
    names: Vec<String>,
}

pub(super) fn run(args: &ModulesArgs) -> Report {
    let modules = modules::all();
    let chosen = modules.iter().filter(|module| args.names.is_empty() || args.names.iter().any(|n| n == module.name));
    let mut report = Report::default();
    let mut list = Vec::new();
    for module in chosen {
        report.line(format!("{}: {}", module.name, module.doc));
        for parameter in &module.parameters {
            let sided = if parameter.sided { " Has a side: mirrored." } else { "" };
            report.line(format!("    {} = {}    {}{sided}", parameter.name, parameter.default, parameter.doc));
        }
        list.push(json!({ "name": module.name, "doc": module.doc, "parameters": module.parameters }));
    }
    for name in args.names.iter().filter(|name| modules.get(name).is_none()) {
        let nearest = did_you_mean(name, modules.iter().map(|module| module.name));
        let fault = format!("there is no module \"{name}\"{nearest}; `rigsmith modules` lists all");
        report.fault.get_or_insert_with(|| Explanation::at("command line".to_owned(), &fault));
        report.notes.push(fault);
        report.at_fault = true;
    }
    report.set("modules", list);
    report
}
