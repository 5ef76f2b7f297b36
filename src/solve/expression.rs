//! Expressions: a small, safe arithmetic language over named numbers.
//!
//! `clamp(curl * 90, 0, 90) + if(side > 0, 1, -1)`. There are numbers, names, `+ - * / % ^`, comparisons, `&&` and `||`
//! (all of which give 1 or 0), parentheses and the functions of [`FUNCTIONS`]. Angles are in degrees. A sign binds
//! weaker than a power (`-2^2` is -4), `%` has the sign of the divisor. There are no loops and no assignments, so the
//! time of an evaluation is bounded by the expression's length.
//!
//! A scan of the text finds every error and its place, and writes an unambiguous form, which the crate `exmex` compiles
//! and evaluates.

mod operators;
mod scan;

use exmex::{Express, FlatEx};
use thiserror::Error;

pub use operators::{FUNCTIONS, Function};
use operators::{Literals, Operators, Pair};

/// The greatest number of characters of an expression.
pub const MOST_CHARACTERS: usize = 1000;

/// The greatest depth of parentheses and function calls.
pub const MOST_NESTED: usize = 32;

/// The greatest number of numbers and names in an expression. Expressions up to it are evaluated without allocating.
pub const MOST_OPERANDS: usize = 32;

/// Error in an expression, with its place.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("column {column}: {problem}")]
pub struct ExpressionError {
    /// The first character in question, counted from 1.
    pub column: usize,
    /// Kind of the error.
    pub problem: ExpressionProblem,
}

/// Kind of an error in an expression.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ExpressionProblem {
    /// The expression is empty.
    #[error("the expression is empty; write a number, a name or a formula")]
    Empty,
    /// The expression is too long.
    #[error("the expression has more than {MOST_CHARACTERS} characters; split it into several")]
    TooLong,
    /// The expression has too many numbers and names.
    #[error("the expression has more than {MOST_OPERANDS} numbers and names; split it into several")]
    TooManyOperands,
    /// The expression is nested too deeply.
    #[error("parentheses are nested more than {MOST_NESTED} deep; split the expression into several")]
    TooDeep,
    /// A character that the language does not have.
    #[error("`{0}` is not part of an expression; remove it")]
    Character(char),
    /// `=` or `!` alone.
    #[error("`{found}` alone means nothing here; write {instead}")]
    Alone {
        /// Character found.
        found: char,
        /// Operators that may be meant.
        instead: &'static str,
    },
    /// A malformed or too large number.
    #[error("`{0}` is not a number that can be held; write it like 12.5 or 1e-3")]
    Number(String),
    /// An unknown name.
    #[error("`{name}` is not known here{}", suggestion(.nearest))]
    Unknown {
        /// The name.
        name: String,
        /// Known names like it, nearest first.
        nearest: Vec<String>,
    },
    /// A function with the wrong number of arguments.
    #[error("`{function}` takes {takes}, but has {has}")]
    Arguments {
        /// The function.
        function: &'static str,
        /// Description of the arguments it takes.
        takes: &'static str,
        /// Number of arguments given.
        has: usize,
    },
    /// An operator, a comma or the end in place of a number, a name or a parenthesis.
    #[error("a number, a name or `(` must stand before {0}")]
    NoOperand(String),
    /// Two operands side by side.
    #[error("an operator must stand before `{0}`")]
    NoOperator(String),
    /// A parenthesis that is never closed.
    #[error("this `(` is never closed; add a `)`")]
    NotClosed,
    /// A parenthesis that was never opened.
    #[error("this `)` closes nothing; remove it")]
    NotOpened,
    /// A comma outside of a function's arguments.
    #[error("a comma may stand only between the arguments of a function")]
    Comma,
    /// Operators whose order of evaluation is ambiguous.
    #[error("`{0}` after `{0}` can be read two ways; use parentheses, or `&&` between comparisons")]
    Ambiguous(&'static str),
    /// A failure of the evaluator on an expression that the scan accepted.
    #[error("the expression cannot be evaluated: {0}; write it in a simpler form")]
    Evaluator(String),
}

fn suggestion(nearest: &[String]) -> String {
    let list: Vec<String> = nearest.iter().map(|name| format!("`{name}`")).collect();
    if list.is_empty() { "; check its spelling".to_owned() } else { format!("; is {} meant?", list.join(" or ")) }
}

/// Result of an evaluation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evaluation {
    /// The value; zero if it is not finite.
    pub value: f32,
    /// False if the value was not finite (a division by zero, the root of a negative number).
    pub is_finite: bool,
}

/// An expression, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct Expression {
    text: String,
    /// Indices of the variables that occur, ascending: as the evaluator sorts their names.
    used: Vec<usize>,
    compiled: Box<FlatEx<Pair, Operators, Literals>>,
}

impl Expression {
    /// Compiles an expression in which `variables` may occur: letters, digits, `_` and `.`, not beginning with a digit.
    /// A variable hides a constant of the same name.
    ///
    /// # Errors
    ///
    /// The first problem in the text; see [`ExpressionProblem`].
    pub fn new(text: &str, variables: &[&str]) -> Result<Self, ExpressionError> {
        let scanned = scan::scan(text, variables)?;
        let evaluator = |error: exmex::ExError| ExpressionError {
            column: 1,
            problem: ExpressionProblem::Evaluator(error.msg().to_owned()),
        };
        let compiled = Box::new(FlatEx::parse_wo_compile(&scanned.canonical).map_err(evaluator)?);
        let expression = Self { text: text.to_owned(), used: scanned.used, compiled };
        // A first evaluation runs the evaluator's own checks; later ones cannot fail.
        expression.compiled.eval(&vec![Pair::default(); expression.used.len()]).map_err(evaluator)?;
        Ok(expression)
    }

    /// Source text of the expression.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Indices of the variables that the expression depends on, ascending.
    pub fn used(&self) -> &[usize] {
        &self.used
    }

    /// The value for these values of the variables, in the order in which they were declared; missing ones are zero.
    /// Does not allocate.
    #[inline]
    pub fn evaluate(&self, values: &[f32]) -> Evaluation {
        let mut taken = [Pair::default(); MOST_OPERANDS];
        let count = self.used.len().min(MOST_OPERANDS);
        for (taken, index) in taken.iter_mut().zip(&self.used) {
            *taken = Pair::of(values.get(*index).copied().unwrap_or(0.0));
        }
        let value = self.compiled.eval(&taken[..count]).map_or(f32::NAN, |pair| pair.0);
        let is_finite = value.is_finite();
        Evaluation { value: if is_finite { value } else { 0.0 }, is_finite }
    }
}

impl PartialEq for Expression {
    /// Expressions are equal if their text and variables are.
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text && self.used == other.used
    }
}
