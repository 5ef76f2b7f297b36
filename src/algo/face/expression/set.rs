//! Sets of units and expressions, with the bundled ones.

use std::{
    borrow::Cow,
    collections::BTreeSet,
    sync::{Arc, LazyLock},
};

use super::text::{Expression, ExpressionError, Sides, Unit, UnitUse, last_quoted, located};

/// The six basic expressions, in the order in which they are shown.
const SIX: [&str; 6] = ["happiness", "anger", "sadness", "fear", "disgust", "surprise"];

/// A bundled file: its name and its text.
macro_rules! bundled {
    ($name:literal) => {
        ($name, include_str!(concat!("../../../../assets/expressions/", $name)))
    };
}

/// The bundled files of units.
const UNITS: [(&str, &str); 6] = [
    bundled!("units/brows.units.ron"),
    bundled!("units/eyes.units.ron"),
    bundled!("units/cheeks.units.ron"),
    bundled!("units/jaw.units.ron"),
    bundled!("units/lips.units.ron"),
    bundled!("units/mouth.units.ron"),
];

/// The bundled expressions, and the visemes of Oculus: positions of the mouth for speech.
const EXPRESSIONS: [(&str, &str); 26] = [
    bundled!("neutral.expr.ron"),
    bundled!("happiness.expr.ron"),
    bundled!("anger.expr.ron"),
    bundled!("sadness.expr.ron"),
    bundled!("fear.expr.ron"),
    bundled!("disgust.expr.ron"),
    bundled!("surprise.expr.ron"),
    bundled!("contempt.expr.ron"),
    bundled!("pain.expr.ron"),
    bundled!("smirk.expr.ron"),
    bundled!("wink.expr.ron"),
    bundled!("visemes/viseme_sil.expr.ron"),
    bundled!("visemes/viseme_pp.expr.ron"),
    bundled!("visemes/viseme_ff.expr.ron"),
    bundled!("visemes/viseme_th.expr.ron"),
    bundled!("visemes/viseme_dd.expr.ron"),
    bundled!("visemes/viseme_kk.expr.ron"),
    bundled!("visemes/viseme_ch.expr.ron"),
    bundled!("visemes/viseme_ss.expr.ron"),
    bundled!("visemes/viseme_nn.expr.ron"),
    bundled!("visemes/viseme_rr.expr.ron"),
    bundled!("visemes/viseme_aa.expr.ron"),
    bundled!("visemes/viseme_e.expr.ron"),
    bundled!("visemes/viseme_ih.expr.ron"),
    bundled!("visemes/viseme_oh.expr.ron"),
    bundled!("visemes/viseme_ou.expr.ron"),
];

/// Units, each name once.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct UnitSet {
    units: Vec<Unit>,
}

impl UnitSet {
    /// The units, in the order in which they were added.
    pub fn units(&self) -> &[Unit] {
        &self.units
    }

    /// Index of a unit.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.units.iter().position(|unit| unit.name == name)
    }

    /// Index and side of the unit with a name of ARKit, such as `mouthSmileLeft` or `jawOpen`; `_L` and `_R` may stand
    /// for `Left` and `Right`, and restrict a shape of both sides to one.
    pub fn arkit(&self, name: &str) -> Option<(usize, Sides)> {
        self.arkit_shapes().find(|(known, ..)| *known == name).map(|(_, unit, side)| (unit, side)).or_else(|| {
            let (base, side) = one_side(name, ["_L", "_R"])?;
            let sided = format!("{base}{}", if side == Sides::Left { "Left" } else { "Right" });
            let unit = self.units.iter().position(|unit| match unit.arkit.as_slice() {
                [both] => both == base,
                names => names.contains(&sided),
            })?;
            Some((unit, side))
        })
    }

    /// The blend shapes of ARKit that the units have: name, index of the unit, and side.
    pub fn arkit_shapes(&self) -> impl Iterator<Item = (&str, usize, Sides)> {
        self.units.iter().enumerate().flat_map(|(index, unit)| {
            let sides: &[Sides] = if unit.arkit.len() == 1 { &[Sides::Both] } else { &[Sides::Left, Sides::Right] };
            unit.arkit.iter().zip(sides).map(move |(name, side)| (name.as_str(), index, *side))
        })
    }

    /// Adds the units of a file; adds none on an error (a malformed text or a name that is taken).
    pub fn add(&mut self, text: &str, file: &str) -> Result<(), ExpressionError> {
        let units = Unit::parse_list(text, file)?;
        if let Some(unit) = units.iter().find(|unit| self.index(&unit.name).is_some()) {
            let message = format!("another file has a unit {:?}, too; rename one of the two", unit.name);
            return Err(located(text, file, last_quoted(text, &unit.name), message));
        }
        self.units.extend(units);
        Ok(())
    }
}

/// Name of a file without its folder.
fn without_folder(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or(name)
}

/// A name without the ending of a side, and the side.
fn one_side<'a>(name: &'a str, [left, right]: [&str; 2]) -> Option<(&'a str, Sides)> {
    let left = name.strip_suffix(left).map(|base| (base, Sides::Left));
    left.or_else(|| name.strip_suffix(right).map(|base| (base, Sides::Right)))
}

/// The bundled set, read when it is first used. A test checks that its files have no errors.
static BUNDLED: LazyLock<Arc<ExpressionSet>> = LazyLock::new(|| {
    let files: Vec<(&str, &str)> = ExpressionSet::bundled_files().collect();
    Arc::new(ExpressionSet::parse(&files).unwrap_or_default())
});

/// Expressions, each name once, and the units that they are made of.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ExpressionSet {
    units: UnitSet,
    expressions: Vec<Expression>,
}

impl ExpressionSet {
    /// The bundled set: neutral, the six basic expressions, a few others, the visemes, and their units.
    pub fn bundled() -> &'static Self {
        &BUNDLED
    }

    /// The [bundled](Self::bundled) set for owners who may exchange theirs: all of them share one.
    pub fn bundled_shared() -> Arc<Self> {
        Arc::clone(&BUNDLED)
    }

    /// Reads files, each a name and a text: those that end in `.units.ron` have units, all others an expression. Units
    /// may come after the expressions that use them.
    ///
    /// # Errors
    /// The first of: a malformed text, a name that is taken, an unknown unit.
    pub fn parse(files: &[(&str, &str)]) -> Result<Self, ExpressionError> {
        let mut set = Self::default();
        let are_units = |file: &str| file.ends_with(".units.ron");
        for (file, text) in files.iter().filter(|(file, _)| are_units(file)) {
            set.units.add(text, file)?;
        }
        for (file, text) in files.iter().filter(|(file, _)| !are_units(file)) {
            set.add(text, file)?;
        }
        Ok(set)
    }

    /// The bundled files: name and text, files of units first.
    pub fn bundled_files() -> impl Iterator<Item = (&'static str, &'static str)> {
        UNITS.into_iter().chain(EXPRESSIONS)
    }

    /// The bundled set with further files, each a name, with or without its folder, and a text. A file takes the place of a later
    /// or bundled one of its name.
    ///
    /// # Errors
    /// See [`parse`](Self::parse).
    pub fn bundled_with(own: &[(String, String)]) -> Result<Self, ExpressionError> {
        let mut names = BTreeSet::new();
        let own: Vec<(&str, &str)> = own
            .iter()
            .map(|(name, text)| (name.as_str(), text.as_str()))
            .filter(|&(name, _)| names.insert(without_folder(name)))
            .collect();
        let mut files: Vec<(&str, &str)> = Vec::new();
        for (name, text) in Self::bundled_files() {
            if !names.contains(without_folder(name)) {
                files.push((name, text));
            }
        }
        files.extend(own);
        Self::parse(&files)
    }

    /// The expressions, in the order in which they were added.
    pub fn expressions(&self) -> &[Expression] {
        &self.expressions
    }

    /// The units, in the order in which they were added.
    pub fn units(&self) -> &[Unit] {
        self.units.units()
    }

    /// The units as the set from which mixes are made.
    pub fn unit_set(&self) -> &UnitSet {
        &self.units
    }

    /// Happiness, anger, sadness, fear, disgust and surprise, those that the set has.
    pub fn six(&self) -> impl Iterator<Item = &Expression> {
        SIX.iter().filter_map(|name| self.get(name))
    }

    /// Names of the expressions, then of the units.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let expressions = self.expressions.iter().map(|expression| expression.name.as_str());
        expressions.chain(self.units().iter().map(|unit| unit.name.as_str()))
    }

    /// The expression of a name.
    pub fn get(&self, name: &str) -> Option<&Expression> {
        self.expressions.iter().find(|expression| expression.name == name)
    }

    /// The expression of a name, or a unit as an expression of its own: on both sides, or on one with `_l` or `_r`
    /// after its name. Units are found by their names in ARKit, too ([`UnitSet::arkit`]).
    pub fn find(&self, name: &str) -> Option<Cow<'_, Expression>> {
        if let Some(expression) = self.get(name) {
            return Some(Cow::Borrowed(expression));
        }
        let own = || {
            let (unit, side) = match self.units.index(name) {
                Some(_) => (name, Sides::Both),
                None => one_side(name, ["_l", "_r"])?,
            };
            Some((self.units.index(unit)?, side))
        };
        let (unit, side) = own().or_else(|| self.units.arkit(name))?;
        let unit = self.units.units.get(unit)?.name.clone();
        let units = vec![UnitUse { unit, side, strength: 1.0 }];
        Some(Cow::Owned(Expression { name: name.into(), about: String::new(), units }))
    }

    /// Adds the units of a file; see [`UnitSet::add`].
    pub fn add_units(&mut self, text: &str, file: &str) -> Result<(), ExpressionError> {
        self.units.add(text, file)
    }

    /// Adds the expression of a file.
    ///
    /// # Errors
    /// A malformed text, a name that is taken, a unit that the set does not have.
    pub fn add(&mut self, text: &str, file: &str) -> Result<(), ExpressionError> {
        let expression = Expression::parse(text, file)?;
        if self.get(&expression.name).is_some() {
            let message = format!("another file has an expression {:?}, too; rename one of the two", expression.name);
            return Err(located(text, file, last_quoted(text, &expression.name), message));
        }
        if let Some(used) = expression.units.iter().find(|used| self.units.index(&used.unit).is_none()) {
            let known: Vec<&str> = self.units.units().iter().map(|unit| unit.name.as_str()).collect();
            let message = format!("there is no unit {:?}; there are {}", used.unit, known.join(", "));
            return Err(located(text, file, last_quoted(text, &used.unit), message));
        }
        self.expressions.push(expression);
        Ok(())
    }
}
