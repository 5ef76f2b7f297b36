//! Commands with parameters: for every registered module a usual set that builds, with values of each parameter's own type
//! put in, and now and then values of another.

use rigsmith::processor::{
    ModuleInfo, Modules,
    form::{FormElement, read_module_form},
};

use super::{Choices, choices::text_of};

/// Names of attributes, morph targets and nodes.
pub const NAMES: [&str; 8] = ["value", "soft", "ik_fk", "smile", "hand_l", "arm_r", "a b", ""];

/// Things of a rig that references can name.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Joints as references write them, by label or by uid.
    pub joints: Vec<String>,
    /// Place of each joint's parent.
    pub parents: Vec<Option<usize>>,
    /// Groups, as references write them.
    pub groups: Vec<String>,
    /// Commands, as references write them.
    pub commands: Vec<String>,
    /// Inputs, as references write them.
    pub inputs: Vec<String>,
    /// Commands of controls that stand apart from all chains; without them, commands refer to whatever controls there are.
    pub goals: Option<[String; 2]>,
}

impl Scene {
    fn joint(&self, choices: &mut Choices) -> &str {
        let at = choices.below(self.joints.len());
        self.joints.get(at).map_or("nothing", String::as_str)
    }

    /// Places of joints on one line downwards, `bones` bones at most.
    fn chain(&self, choices: &mut Choices, bones: usize) -> Vec<usize> {
        let mut ends = Vec::new();
        for end in 0..self.joints.len() {
            let above = std::iter::successors(Some(end), |at| self.parents.get(*at).copied().flatten());
            let mut line: Vec<usize> = above.take(bones + 1).collect();
            line.reverse();
            if line.len() == bones + 1 {
                ends.push(line);
            }
        }
        if ends.is_empty() {
            return (0..self.joints.len().min(1)).collect();
        }
        let at = choices.below(ends.len());
        ends.swap_remove(at)
    }

    /// A reference as a text without quotation marks.
    pub fn reference(&self, choices: &mut Choices) -> String {
        let mut text = self.source(choices);
        if choices.chance(6) {
            text.push_str(&self.filter(choices));
        }
        if choices.chance(8) {
            text = format!("{text} + {}", self.source(choices));
        }
        text
    }

    fn source(&self, choices: &mut Choices) -> String {
        match choices.below(12) {
            0..=2 => "@this".to_owned(),
            3 | 4 => format!("@joint {}", self.joint(choices)),
            5 => format!("@hierarchy {}", self.joint(choices)),
            6 => "@joints".to_owned(),
            7 => "@root".to_owned(),
            8 => format!("@module {}", choices.pick(&["control", "null", "twist", "insert_joints", "nothing"])),
            9 => match self.commands.is_empty() {
                true => "@module control".to_owned(),
                false => {
                    let at = choices.below(self.commands.len());
                    format!("@command {}", self.commands[at])
                }
            },
            10 => match self.inputs.is_empty() {
                true => "@any".to_owned(),
                false => {
                    let at = choices.below(self.inputs.len());
                    format!("@input {}", self.inputs[at])
                }
            },
            _ => choices.pick(&["@any", "@none", "@hierarchy this"]).to_owned(),
        }
    }

    fn filter(&self, choices: &mut Choices) -> String {
        match choices.below(6) {
            0 => format!(" pick:{}", choices.pick(&["START", "MIDDLE", "END", "0", "1,0", "9", "none", "all"])),
            1 => format!(" type:{}", choices.pick(&["joint", "control", "null", "joint,null", "nothing"])),
            2 => format!(" role:{}", choices.pick(&["control", "offset", "ik", "nothing"])),
            3 => format!(" label:{}", self.joint(choices)),
            4 => " group:own".to_owned(),
            _ => match self.groups.is_empty() {
                true => " group:any".to_owned(),
                false => {
                    let at = choices.below(self.groups.len());
                    format!(" group:{}", self.groups[at])
                }
            },
        }
    }
}

/// A module and its parameters.
pub fn command(choices: &mut Choices, scene: &Scene, modules: &Modules) -> (String, String) {
    let known: Vec<&ModuleInfo> = modules.iter().collect();
    // Controls are what most others refer to.
    let plain = known.iter().position(|info| info.name == "control").unwrap_or_default();
    let at = if choices.chance(3) { plain } else { (plain + choices.below(known.len())) % known.len() };
    let info = known[at];
    let mut fields = usual(choices, scene, info.name);
    // A template in which most is to build has few values that are not the usual ones.
    let (one_in, one_in_wrong) = if scene.goals.is_some() { (60, 0) } else { (10, 64) };
    for parameter in &info.parameters {
        if !choices.chance(one_in) {
            continue;
        }
        let menu = menu(info, parameter.name);
        // A value of another parameter's type now and then.
        let kind = match choices.chance(24) {
            true => info.parameters[choices.below(info.parameters.len())].kind.clone(),
            false => parameter.kind.clone(),
        };
        let value = value(choices, scene, &kind, &parameter.default, &menu);
        fields.retain(|(name, _)| name != parameter.name);
        fields.push((parameter.name.to_owned(), value));
    }
    if choices.chance(one_in_wrong) {
        fields.push((choices.pick(&["nothing", "at", "uid"]).to_owned(), "1".to_owned()));
    }
    let name = if choices.chance(one_in_wrong) { "nothing".to_owned() } else { info.name.to_owned() };
    let fields: Vec<String> = fields.into_iter().map(|(name, value)| format!("{name}: {value}")).collect();
    (name, format!("({})", fields.join(", ")))
}

/// Values that the module's form offers for a parameter.
fn menu(info: &ModuleInfo, parameter: &str) -> Vec<String> {
    let form = info.form.as_ref().and_then(|form| read_module_form(form.as_bytes(), info).ok());
    let Some(form) = form else { return Vec::new() };
    let options = form.elements().into_iter().find_map(|element| match element {
        FormElement::Menu { param, options, .. } if param == parameter => Some(options.clone()),
        _ => None,
    });
    options.unwrap_or_default()
}

/// A value of a type, as RON.
fn value(choices: &mut Choices, scene: &Scene, kind: &str, default: &str, menu: &[String]) -> String {
    let one_of_menu = |choices: &mut Choices| match menu.is_empty() {
        true => None,
        false => Some(menu[choices.below(menu.len())].clone()),
    };
    let inner = |of: &str| kind.strip_prefix(of).and_then(|rest| rest.strip_suffix('>'));
    if let Some(of) = inner("Option<") {
        return if choices.chance(3) { "None".to_owned() } else { value(choices, scene, of, default, menu) };
    }
    if let Some(of) = inner("Vec<") {
        let count = choices.below(4);
        let list: Vec<String> = (0..count).map(|_| value(choices, scene, of, "()", menu)).collect();
        return format!("[{}]", list.join(", "));
    }
    let vector = |choices: &mut Choices| {
        let [x, y, z] = [(); 3].map(|()| text_of(choices.any_number()));
        format!("({x}, {y}, {z})")
    };
    let flags = |choices: &mut Choices| {
        let [x, y, z] = [(); 3].map(|()| !choices.chance(2));
        format!("({x}, {y}, {z})")
    };
    let quoted = |text: &str| format!("{text:?}");
    match kind {
        "bool" => choices.chance(2).to_string(),
        "f32" => text_of(choices.any_number()),
        "u32" => choices.pick(&["1", "2", "3", "0", "7", "64", "1000", "4294967295"]).to_owned(),
        "String" => match one_of_menu(choices) {
            Some(option) => quoted(&option),
            None => quoted(choices.pick(&NAMES)),
        },
        "NodeRefs" => quoted(&scene.reference(choices)),
        "Amount" => match choices.chance(3) {
            true => quoted(choices.pick(&["soft", "-soft", "value", ""])),
            false => text_of(choices.unit()),
        },
        "Vec3" | "[f32; 3]" => vector(choices),
        "[bool; 3]" => flags(choices),
        "(f32, f32)" => format!("({}, {})", text_of(choices.any_number()), text_of(choices.any_number())),
        "Channels" => format!("(translate: {}, scale: {})", flags(choices), flags(choices)),
        "Limits" => {
            let mut ends = || {
                let low = if choices.chance(2) { "None".to_owned() } else { text_of(choices.any_number()) };
                let high = if choices.chance(2) { "None".to_owned() } else { text_of(choices.any_number() + 8.0) };
                format!("({low}, {high})")
            };
            let [x, y, z] = [(); 3].map(|()| ends());
            format!("(rotate: ({x}, {y}, {z}))")
        }
        "Creation" => format!("(name: {:?}, label: {:?})", choices.pick(&NAMES), choices.pick(&NAMES)),
        "HingeRange" => format!("(min: {}, max: {})", text_of(choices.any_number()), text_of(90.0)),
        "Input" => format!("(name: \"x\", node: {:?}, channel: TranslateX)", scene.reference(choices)),
        "ReaderPose" => format!("(rotate: {}, attribute: {:?})", vector(choices), choices.pick(&NAMES)),
        _ => one_of_menu(choices).unwrap_or_else(|| default.to_owned()),
    }
}

/// Parameters with which a command of a module can be built, where it needs more than its defaults.
fn usual(choices: &mut Choices, scene: &Scene, module: &str) -> Vec<(String, String)> {
    let bones = if choices.chance(3) { 3 } else { 2 };
    let chain = scene.chain(choices, bones);
    let joint = |at: usize| {
        let name = chain.get(at.min(chain.len().saturating_sub(1))).and_then(|at| scene.joints.get(*at));
        format!("@joint {}", name.map_or("nothing", String::as_str))
    };
    let (start, middle, end) = (joint(0), joint(1), joint(chain.len()));
    let (control, other) = match &scene.goals {
        Some(goals) => {
            let [control, other] = goals.each_ref().map(|goal| format!("@command {goal} role:control"));
            (control, other)
        }
        None => ("@module control pick:START".to_owned(), "@module control pick:END".to_owned()),
    };
    let all: Vec<String> = (0..chain.len()).map(joint).collect();
    let reference = if scene.goals.is_some() { start.clone() } else { scene.reference(choices) };
    let name = choices.pick(&NAMES[..4]).to_owned();
    let quoted = |pairs: &[(&str, &String)]| -> Vec<(String, String)> {
        pairs.iter().map(|(name, text)| ((*name).to_owned(), format!("{text:?}"))).collect()
    };
    let with = |mut fields: Vec<(String, String)>, more: &[(&str, &str)]| {
        fields.extend(more.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())));
        fields
    };
    let prefer = ("prefer", "(0.0, 0.0, 1.0)");
    match module {
        "control" | "null" if choices.chance(2) => quoted(&[("at", &reference)]),
        "attribute" => quoted(&[("name", &name)]),
        "layer" => with(quoted(&[("nodes", &reference), ("name", &name)]), &[("use_existing", "true")]),
        "insert_joints" => quoted(&[("joint", &start)]),
        "duplicate_chain" | "mirror_joints" | "orient_joints" => {
            quoted(&[("joints", &start.replacen("@joint", "@hierarchy", 1))])
        }
        "parent" | "point" | "orient" | "scale" | "aim" => quoted(&[("node", &middle), ("targets", &control)]),
        "pole_vector" => with(quoted(&[("chain", &all.join(" + "))]), &[prefer]),
        "blend" => quoted(&[("nodes", &end), ("a", &control), ("b", &other)]),
        "limit" if scene.goals.is_some() => {
            let limits = "(rotate: ((-10.0, 10.0), (None, None), (None, None)))";
            with(quoted(&[("nodes", &middle)]), &[("limits", limits)])
        }
        "limit" => quoted(&[("nodes", &middle)]),
        "ik_handle" => with(quoted(&[("start", &start), ("end", &end), ("goal", &other)]), &[prefer]),
        "ik_fk_switch" => {
            let fk = format!("{control} + {other} + @module null pick:START");
            with(quoted(&[("start", &start), ("end", &end), ("fk", &fk), ("goal", &other)]), &[prefer])
        }
        "spline_ik" => quoted(&[("start", &start), ("end", &end), ("points", &format!("{control} + {other}"))]),
        "space_switch" => quoted(&[("control", &control), ("spaces", &format!("{start} + {other}"))]),
        "reverse_foot" => quoted(&[("ankle", &start), ("ball", &middle), ("toe", &end), ("control", &control)]),
        "twist" => quoted(&[("start", &middle), ("end", &end)]),
        "half_joint" => quoted(&[("at", &middle)]),
        "stretch" => quoted(&[("start", &control), ("end", &other), ("driven", &end)]),
        "spring" => quoted(&[("nodes", &middle)]),
        "driven_key" => with(
            quoted(&[("driver", &control), ("output", &middle)]),
            &[("driver_channel", "RotateX"), ("output_channel", "RotateY")],
        ),
        "expression" => with(
            quoted(&[("output", &middle)]),
            &[
                ("text", "\"x * 2\""),
                ("inputs", "[(name: \"x\", node: \"@module control pick:START\", channel: TranslateX)]"),
                ("output_channel", "TranslateZ"),
            ],
        ),
        "cone_reader" => with(quoted(&[("source", &middle), ("output", &control)]), &[("output_channel", "RotateY")]),
        "rbf_reader" => with(
            quoted(&[("source", &middle), ("output", &control)]),
            &[("poses", "[(attribute: \"bent\"), (rotate: (0.0, 80.0, 0.0), channel: RotateX)]")],
        ),
        "piston" => quoted(&[("first", &control), ("second", &other)]),
        "wheel" => with(quoted(&[("source", &control), ("output", &middle)]), &[("radius", "0.5")]),
        "path" => quoted(&[("node", &middle), ("points", &format!("{control} + {other}"))]),
        "rivet" => quoted(&[("node", &middle), ("corners", &format!("{control} + {other} + {end}"))]),
        "morph" => quoted(&[("control", &control), ("morph", &name)]),
        _ => Vec::new(),
    }
}
