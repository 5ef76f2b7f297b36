//! Material libraries: the `.mtl` files next to an OBJ.
//!
//! The reader takes the statements of Wavefront's appendix B2 that a glTF material has a place for, and the physically
//! based ones that exporters added (`Pr`, `Pm`, `Ke`, `norm` and their maps). A statement that does not parse keeps its
//! default: a material that looks a little wrong is better than a mesh that does not open.

/// A material as its library describes it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjMaterial {
    /// Name that `usemtl` refers to.
    pub name: String,
    /// `Kd`: base colour, taken as linear.
    pub diffuse: Option<[f32; 3]>,
    /// `Ke`: emitted colour, taken as linear.
    pub emissive: Option<[f32; 3]>,
    /// `d`, or 1 less `Tr` where there is no `d`: 1 is opaque.
    pub opacity: Option<f32>,
    /// `Ns`: Phong exponent, 0 to 1000.
    pub shininess: Option<f32>,
    /// `Pr`: roughness, 0 to 1.
    pub roughness: Option<f32>,
    /// `Pm`: metalness, 0 to 1.
    pub metallic: Option<f32>,
    /// `map_Kd`.
    pub diffuse_map: Option<ObjTexture>,
    /// `map_Ke`.
    pub emissive_map: Option<ObjTexture>,
    /// `map_d`.
    pub opacity_map: Option<ObjTexture>,
    /// `map_Pr`.
    pub roughness_map: Option<ObjTexture>,
    /// `map_Pm`.
    pub metallic_map: Option<ObjTexture>,
    /// `norm`, or else `map_Bump` or `bump`, which exporters use for normal maps as well.
    pub normal_map: Option<ObjTexture>,
    /// Marks a material with `d`, whose opacity `Tr` does not change.
    pub(super) has_dissolve: bool,
    /// Marks a material with `norm`, whose normal map `bump` does not change.
    pub(super) has_norm: bool,
}

/// A texture file and its placement.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjTexture {
    /// The path as written.
    pub path: String,
    /// `-s`: number of repeats along u and v.
    pub scale: [f32; 2],
    /// `-o`: shift along u and v.
    pub offset: [f32; 2],
    /// `-bm`: strength of a bump or normal map.
    pub strength: f32,
    /// `-clamp on`: the texture does not repeat.
    pub clamp: bool,
}

/// Largest number of materials in a library.
const MOST_MATERIALS: usize = 1 << 14;

/// Reads a material library. Unknown and malformed statements are skipped, and so is the rest after the 16,384th
/// material.
pub fn read_mtl(bytes: &[u8]) -> Vec<ObjMaterial> {
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    let mut materials: Vec<ObjMaterial> = Vec::new();
    for line in text.split(['\n', '\r']).map(str::trim) {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        if keyword == "newmtl" {
            if materials.len() == MOST_MATERIALS {
                break;
            }
            materials.push(ObjMaterial { name: rest.into(), ..ObjMaterial::default() });
        } else if let Some(material) = materials.last_mut() {
            material.set(keyword, rest);
        }
    }
    materials
}

impl ObjMaterial {
    fn set(&mut self, keyword: &str, rest: &str) {
        match keyword {
            "Kd" => self.diffuse = color(rest).or(self.diffuse),
            "Ke" => self.emissive = color(rest).or(self.emissive),
            "Ns" => self.shininess = number(rest).or(self.shininess),
            "Pr" => self.roughness = number(rest).or(self.roughness),
            "Pm" => self.metallic = number(rest).or(self.metallic),
            "d" => {
                let value = rest.strip_prefix("-halo").unwrap_or(rest);
                self.opacity = number(value).or(self.opacity);
                self.has_dissolve = true;
            }
            "Tr" if !self.has_dissolve => self.opacity = number(rest).map(|tr| 1.0 - tr).or(self.opacity),
            "map_Kd" => self.diffuse_map = texture(rest),
            "map_Ke" => self.emissive_map = texture(rest),
            "map_d" => self.opacity_map = texture(rest),
            "map_Pr" => self.roughness_map = texture(rest),
            "map_Pm" => self.metallic_map = texture(rest),
            "norm" | "map_Kn" => {
                self.normal_map = texture(rest);
                self.has_norm = true;
            }
            "map_Bump" | "map_bump" | "bump" if !self.has_norm => self.normal_map = texture(rest),
            _ => {}
        }
    }
}

fn number(text: &str) -> Option<f32> {
    text.split_whitespace().next()?.parse().ok().filter(|value: &f32| value.is_finite())
}

/// Three numbers, or one number for all three components.
fn color(text: &str) -> Option<[f32; 3]> {
    let mut tokens = text.split_whitespace();
    let red = number(tokens.next()?)?;
    let mut next = || tokens.next().map_or(Some(red), number);
    Some([red, next()?, next()?])
}

/// Options before or after a file name that may hold blanks.
fn texture(text: &str) -> Option<ObjTexture> {
    let mut texture =
        ObjTexture { path: String::new(), scale: [1.0; 2], offset: [0.0; 2], strength: 1.0, clamp: false };
    let mut rest = texture.options(text);
    let mut words = rest.match_indices(char::is_whitespace).map(|(at, blank)| at + blank.len());
    if let Some(start) = words.find(|start| is_option(&rest[*start..])) {
        texture.options(&rest[start..]);
        rest = &rest[..start];
    }
    texture.path = rest.trim().trim_matches('"').into();
    (!texture.path.is_empty()).then_some(texture)
}

/// Returns `true` if the text starts with an option of a texture.
fn is_option(text: &str) -> bool {
    text.starts_with('-') && arguments(split_word(text).0).is_some()
}

/// Least and largest number of arguments of an option.
fn arguments(option: &str) -> Option<(usize, usize)> {
    match option {
        "-o" | "-s" | "-t" => Some((1, 3)),
        "-mm" => Some((2, 2)),
        "-blendu" | "-blendv" | "-cc" | "-clamp" | "-boost" | "-bm" | "-texres" | "-imfchan" | "-type" => Some((1, 1)),
        _ => None,
    }
}

impl ObjTexture {
    /// Removes options from the front and returns the rest.
    fn options<'a>(&mut self, text: &'a str) -> &'a str {
        let mut rest = text.trim();
        loop {
            let (option, mut after) = split_word(rest);
            let Some((least, most)) = arguments(option) else { return rest };
            let mut values = [None; 3];
            let mut word = "";
            for (taken, value) in values.iter_mut().enumerate().take(most) {
                let (argument, more) = split_word(after);
                // An optional argument must be a number and must not be the file's name.
                if taken >= least && (number(argument).is_none() || more.is_empty()) {
                    break;
                }
                *value = number(argument);
                word = argument;
                after = more;
            }
            match (option, values) {
                ("-o", [u, v, _]) => self.offset = [u.unwrap_or(0.0), v.unwrap_or(0.0)],
                ("-s", [u, v, _]) => self.scale = [u.unwrap_or(1.0), v.unwrap_or(1.0)],
                ("-bm", [Some(strength), ..]) => self.strength = strength,
                ("-clamp", _) => self.clamp = word == "on",
                _ => {}
            }
            rest = after;
        }
    }
}

fn split_word(text: &str) -> (&str, &str) {
    let text = text.trim_start();
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}
