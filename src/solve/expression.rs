//! Expressions: a small, safe arithmetic language over named numbers.
//!
//! `clamp(curl * 90, 0, 90) + if(side > 0, 1, -1)`. There are numbers, names, `+ - * / % ^`, comparisons, `&&` and `||`
//! (all of which give 1 or 0), parentheses and the functions of [`FUNCTIONS`]. Angles are in degrees. A sign binds
//! weaker than a power (`-2^2` is -4), `%` has the sign of the divisor. There are no loops and no assignments, so an
//! expression is finished in a time given by its length.
//!
//! A scan of the text finds every error and its place, and hands an unambiguous form to the crate `exmex`, which keeps
//! and evaluates it.

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

/// The greatest number of numbers and names in an expression. So many are evaluated without allocating.
pub const MOST_OPERANDS: usize = 32;

/// What is wrong with an expression, and where.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("column {column}: {problem}")]
pub struct ExpressionError {
    /// The first character in question, counted from 1.
    pub column: usize,
    /// What is wrong.
    pub problem: ExpressionProblem,
}

/// What can be wrong with an expression.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ExpressionProblem {
    /// There is nothing.
    #[error("the expression is empty; write a number, a name or a formula")]
    Empty,
    /// It is too long.
    #[error("the expression has more than {MOST_CHARACTERS} characters; split it into several")]
    TooLong,
    /// It has too many numbers and names.
    #[error("the expression has more than {MOST_OPERANDS} numbers and names; split it into several")]
    TooManyOperands,
    /// It is nested too deeply.
    #[error("parentheses are nested more than {MOST_NESTED} deep; split the expression into several")]
    TooDeep,
    /// A character that the language does not have.
    #[error("`{0}` is not part of an expression; remove it")]
    Character(char),
    /// `=` or `!` alone.
    #[error("`{found}` alone means nothing here; write {instead}")]
    Alone {
        /// What is there.
        found: char,
        /// What may be meant.
        instead: &'static str,
    },
    /// A number that is none, or too large.
    #[error("`{0}` is not a number that can be held; write it like 12.5 or 1e-3")]
    Number(String),
    /// A name that is not known.
    #[error("`{name}` is not known here{}", known(.nearest))]
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
        /// What it takes, in words.
        takes: &'static str,
        /// What it has.
        has: usize,
    },
    /// An operator, a comma or the end where a number, a name or a parenthesis is due.
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
    /// Operators whose order is not agreed on.
    #[error("`{0}` after `{0}` can be read two ways; use parentheses, or `&&` between comparisons")]
    Ambiguous(&'static str),
    /// The evaluator does not take the expression although the scan did.
    #[error("the expression cannot be evaluated: {0}; write it in a simpler form")]
    Evaluator(String),
}

fn known(nearest: &[String]) -> String {
    let list: Vec<String> = nearest.iter().map(|name| format!("`{name}`")).collect();
    if list.is_empty() { "; check its spelling".to_owned() } else { format!("; is {} meant?", list.join(" or ")) }
}

/// What an expression comes to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evaluated {
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
    /// See [`ExpressionProblem`]; the first in the text.
    pub fn new(text: &str, variables: &[&str]) -> Result<Self, ExpressionError> {
        let scanned = scan::scan(text, variables)?;
        let evaluator = |error: exmex::ExError| ExpressionError {
            column: 1,
            problem: ExpressionProblem::Evaluator(error.msg().to_owned()),
        };
        let compiled = Box::new(FlatEx::parse_wo_compile(&scanned.canonical).map_err(evaluator)?);
        let expression = Self { text: text.to_owned(), used: scanned.used, compiled };
        // Only here can the evaluator's own checks fail, so that later evaluations need not tell.
        expression.compiled.eval(&vec![Pair::default(); expression.used.len()]).map_err(evaluator)?;
        Ok(expression)
    }

    /// The text that it was made of.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Indices of the variables that it depends on, ascending.
    pub fn used(&self) -> &[usize] {
        &self.used
    }

    /// The value for these values of the variables, in the order in which they were declared; missing ones are zero.
    /// Does not allocate.
    #[inline]
    pub fn evaluate(&self, values: &[f32]) -> Evaluated {
        let mut taken = [Pair::default(); MOST_OPERANDS];
        let count = self.used.len().min(MOST_OPERANDS);
        for (taken, index) in taken.iter_mut().zip(&self.used) {
            *taken = Pair::of(values.get(*index).copied().unwrap_or(0.0));
        }
        let value = self.compiled.eval(&taken[..count]).map_or(f32::NAN, |pair| pair.0);
        let is_finite = value.is_finite();
        Evaluated { value: if is_finite { value } else { 0.0 }, is_finite }
    }
}

impl PartialEq for Expression {
    /// Equal text over equal variables.
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text && self.used == other.used
    }
}
