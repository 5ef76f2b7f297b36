//! Operators and functions of expressions, in the evaluator's terms.
//!
//! The evaluator knows operators with one and two operands. A third argument travels in the second half of a pair.

use std::str::FromStr;

use bevy::math::ops;
use exmex::{BinOp, MakeOperators, MatchLiteral, Operator};

/// A value, and the argument that follows it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pair(pub f32, pub f32);

impl Pair {
    pub fn of(value: f32) -> Self {
        Self(value, 0.0)
    }
}

/// The literal form: `#` and the bits in hexadecimal.
impl FromStr for Pair {
    type Err = std::num::ParseIntError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        u32::from_str_radix(text.trim_start_matches('#'), 16).map(|bits| Self::of(f32::from_bits(bits)))
    }
}

/// A number as a literal.
pub(super) fn literal(number: f32) -> String {
    format!("#{:08x}", number.to_bits())
}

/// Matcher of literals.
#[derive(Debug, Clone, Copy)]
pub struct Literals;

impl MatchLiteral for Literals {
    fn is_literal(text: &str) -> Option<&str> {
        text.get(..9).filter(|literal| literal.starts_with('#'))
    }
}

/// Number of arguments of a function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arity {
    One,
    Two,
    Three,
    TwoOrMore,
}

impl Arity {
    pub(super) fn allows(self, count: usize) -> bool {
        match self {
            Self::One => count == 1,
            Self::Two => count == 2,
            Self::Three => count == 3,
            Self::TwoOrMore => count >= 2,
        }
    }

    pub(super) fn words(self) -> &'static str {
        match self {
            Self::One => "one argument",
            Self::Two => "two arguments",
            Self::Three => "three arguments",
            Self::TwoOrMore => "two or more arguments",
        }
    }
}

/// A function of the language.
#[derive(Debug, Clone, Copy)]
pub struct Function {
    /// Name of the function.
    pub name: &'static str,
    /// Names of the arguments, and the result.
    pub doc: &'static str,
    pub(super) symbol: &'static str,
    pub(super) arity: Arity,
    apply: Apply,
}

#[derive(Debug, Clone, Copy)]
enum Apply {
    One(fn(Pair) -> Pair),
    More(fn(Pair, Pair) -> Pair),
}

macro_rules! one {
    ($name:literal, $doc:literal, |$x:ident| $result:expr) => {
        Function {
            name: $name,
            doc: $doc,
            symbol: concat!("@", $name),
            arity: Arity::One,
            apply: Apply::One(|Pair($x, _)| Pair::of($result)),
        }
    };
}

macro_rules! more {
    ($name:literal, $arity:ident, $doc:literal, |$a:ident, $b:ident, $c:ident| $result:expr) => {
        Function {
            name: $name,
            doc: $doc,
            symbol: concat!("@", $name),
            arity: Arity::$arity,
            apply: Apply::More(|Pair($a, _), Pair($b, $c)| Pair::of($result)),
        }
    };
    ($name:literal, $arity:ident, $doc:literal, |$a:ident, $b:ident| $result:expr) => {
        more!($name, $arity, $doc, |$a, $b, _unused| $result)
    };
}

/// Functions of the language.
pub const FUNCTIONS: &[Function] = &[
    one!("abs", "(x): x without its sign", |x| x.abs()),
    one!("sign", "(x): -1, 0 or 1", |x| if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }),
    one!("floor", "(x): the next whole number below", |x| x.floor()),
    one!("ceil", "(x): the next whole number above", |x| x.ceil()),
    one!("round", "(x): the nearest whole number, halves away from zero", |x| x.round()),
    one!("sqrt", "(x): the square root", |x| x.sqrt()),
    one!("exp", "(x): e to the power of x", |x| ops::exp(x)),
    one!("log", "(x): the natural logarithm", |x| ops::ln(x)),
    one!("sin", "(degrees): the sine", |x| ops::sin(x.to_radians())),
    one!("cos", "(degrees): the cosine", |x| ops::cos(x.to_radians())),
    one!("tan", "(degrees): the tangent", |x| ops::tan(x.to_radians())),
    one!("asin", "(x): the angle in degrees with that sine", |x| ops::asin(x).to_degrees()),
    one!("acos", "(x): the angle in degrees with that cosine", |x| ops::acos(x).to_degrees()),
    one!("atan", "(x): the angle in degrees with that tangent", |x| ops::atan(x).to_degrees()),
    one!("not", "(x): 1 if x is zero, else 0", |x| truth(x == 0.0)),
    more!("atan2", Two, "(y, x): the angle in degrees of that direction", |y, x| ops::atan2(y, x).to_degrees()),
    more!("min", TwoOrMore, "(a, b, ...): the least", |a, b| if b < a { b } else { a }),
    more!("max", TwoOrMore, "(a, b, ...): the greatest", |a, b| if b > a { b } else { a }),
    more!("clamp", Three, "(x, low, high): x within bounds; low where they cross", |x, low, high| {
        let x = if x > high { high } else { x };
        if x < low { low } else { x }
    }),
    more!("lerp", Three, "(a, b, t): a share t of the way from a to b", |a, b, t| a + (b - a) * t),
    more!("smoothstep", Three, "(x, low, high): 0 up to low, 1 from high, smooth between", |x, low, high| {
        let t = (x - low) / (high - low);
        let t = if high > low { t.clamp(0.0, 1.0) } else { truth(x >= low) };
        t * t * (3.0 - 2.0 * t)
    }),
    more!("if", Three, "(c, a, b): a if c is not zero, else b", |c, a, b| if c == 0.0 { b } else { a }),
];

/// Named constants.
pub(super) const CONSTANTS: &[(&str, f32)] = &[("pi", std::f32::consts::PI), ("tau", std::f32::consts::TAU)];

/// Operator that joins the second and the third argument.
pub(super) const JOIN: &str = "@,";

/// Sign in front of a parenthesis: zero minus.
pub(super) const MINUS: &str = "@-";

/// Sign in front of an operand, which binds more strongly than all else.
pub(super) const NEGATIVE: &str = "@~";

fn truth(is: bool) -> f32 {
    f32::from(u8::from(is))
}

/// A binary operator: its text, its strength, and its function.
pub(super) struct Infix {
    pub(super) text: &'static str,
    strength: i64,
    apply: fn(Pair, Pair) -> Pair,
}

macro_rules! infix {
    ($text:literal, $strength:expr, |$a:ident, $b:ident| $result:expr) => {
        Infix { text: $text, strength: $strength, apply: |Pair($a, _), Pair($b, _)| Pair::of($result) }
    };
}

/// Binary operators. Longer texts come first, so that the scan takes `<=` for one.
pub(super) const INFIX: &[Infix] = &[
    infix!("||", 1, |a, b| truth(a != 0.0 || b != 0.0)),
    infix!("&&", 2, |a, b| truth(a != 0.0 && b != 0.0)),
    infix!("==", 3, |a, b| truth(a == b)),
    infix!("!=", 3, |a, b| truth(a != b)),
    infix!("<=", 3, |a, b| truth(a <= b)),
    infix!(">=", 3, |a, b| truth(a >= b)),
    infix!("<", 3, |a, b| truth(a < b)),
    infix!(">", 3, |a, b| truth(a > b)),
    infix!("+", 4, |a, b| a + b),
    infix!("-", 4, |a, b| a - b),
    infix!("*", 5, |a, b| a * b),
    infix!("/", 5, |a, b| a / b),
    infix!("%", 5, |a, b| a - b * (a / b).floor()),
    infix!("^", 7, |a, b| ops::powf(a, b)),
];

impl Infix {
    pub(super) fn is_comparison(&self) -> bool {
        self.strength == 3
    }

    pub(super) fn joins_truths(&self) -> bool {
        self.strength < 3
    }
}

/// The evaluator's list of operators.
#[derive(Debug, Clone, Copy)]
pub struct Operators;

impl MakeOperators<Pair> for Operators {
    fn make<'a>() -> Vec<Operator<'a, Pair>> {
        // No operator is marked commutative: the evaluator would reorder operators of equal strength.
        let binary = |apply, prio| BinOp { apply, prio, is_commutative: false };
        // All operators can be binary, or the evaluator would search for names with regular expressions.
        let never: fn(Pair, Pair) -> Pair = |_, _| Pair::of(f32::NAN);
        let infix = INFIX.iter().map(|infix| Operator::make_bin(infix.text, binary(infix.apply, infix.strength)));
        let functions = FUNCTIONS.iter().map(|function| match function.apply {
            Apply::One(apply) => Operator::make_bin_unary(function.symbol, binary(never, 8), apply),
            Apply::More(apply) => Operator::make_bin(function.symbol, binary(apply, 8)),
        });
        let own = [
            Operator::make_bin(JOIN, binary(|Pair(a, _), Pair(b, _)| Pair(a, b), 8)),
            Operator::make_bin(MINUS, binary(|Pair(a, _), Pair(b, _)| Pair::of(a - b), 6)),
            Operator::make_bin_unary(NEGATIVE, binary(never, 8), |Pair(a, _)| Pair::of(-a)),
        ];
        infix.chain(functions).chain(own).collect()
    }
}
