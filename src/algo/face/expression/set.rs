//! Sets of units and expressions, those that come with the program among them.

use super::text::{Expression, ExpressionError, Unit, last_quoted, located};

/// The bundled files of units: name and text.
const UNITS: [(&str, &str); 4] = [
    ("units/brows.units.ron", include_str!("../../../../assets/expressions/units/brows.units.ron")),
    ("units/eyes.units.ron", include_str!("../../../../assets/expressions/units/eyes.units.ron")),
    ("units/middle.units.ron", include_str!("../../../../assets/expressions/units/middle.units.ron")),
    ("units/mouth.units.ron", include_str!("../../../../assets/expressions/units/mouth.units.ron")),
];

/// The bundled expressions: name and text.
const EXPRESSIONS: [(&str, &str); 7] = [
    ("neutral.expr.ron", include_str!("../../../../assets/expressions/neutral.expr.ron")),
    ("happiness.expr.ron", include_str!("../../../../assets/expressions/happiness.expr.ron")),
    ("anger.expr.ron", include_str!("../../../../assets/expressions/anger.expr.ron")),
    ("sadness.expr.ron", include_str!("../../../../assets/expressions/sadness.expr.ron")),
    ("fear.expr.ron", include_str!("../../../../assets/expressions/fear.expr.ron")),
    ("disgust.expr.ron", include_str!("../../../../assets/expressions/disgust.expr.ron")),
    ("surprise.expr.ron", include_str!("../../../../assets/expressions/surprise.expr.ron")),
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

    /// The place of a unit.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.units.iter().position(|unit| unit.name == name)
    }

    /// Adds the units of a file; none if there is an error: a malformed text or a name that is taken.
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

/// Expressions, each name once, and the units that they are made of.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ExpressionSet {
    /// The units.
    pub units: UnitSet,
    expressions: Vec<Expression>,
}

impl ExpressionSet {
    /// What comes with the program: neutral, happiness, anger, sadness, fear, disgust, surprise.
    ///
    /// The error is for those who change the files; a test reads them all.
    pub fn bundled() -> Result<Self, ExpressionError> {
        let mut set = Self::default();
        for (file, text) in UNITS {
            set.units.add(text, file)?;
        }
        for (file, text) in EXPRESSIONS {
            set.add(text, file)?;
        }
        Ok(set)
    }

    /// The bundled files: name and text, those of units first.
    pub fn bundled_files() -> impl Iterator<Item = (&'static str, &'static str)> {
        UNITS.into_iter().chain(EXPRESSIONS)
    }

    /// The expressions, in the order in which they were added.
    pub fn expressions(&self) -> &[Expression] {
        &self.expressions
    }

    /// The expression of a name.
    pub fn get(&self, name: &str) -> Option<&Expression> {
        self.expressions.iter().find(|expression| expression.name == name)
    }

    /// Adds the expression of a file.
    ///
    /// # Errors
    /// A malformed text, a name that is taken, a unit that [`units`](Self::units) does not have.
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
