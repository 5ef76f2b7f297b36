//! The scan of an expression: finds every error and its place, and writes the form that the evaluator reads.
//!
//! In that form numbers are bits, variables are numbered, and arguments stand in parentheses around two-sided
//! operators, so nothing in it depends on how the evaluator reads text.

use super::{
    ExpressionError, ExpressionProblem as Problem, MOST_CHARACTERS, MOST_NESTED, MOST_OPERANDS,
    operators::{Arity, CONSTANTS, FUNCTIONS, Function, INFIX, Infix, JOIN, MINUS, NEGATIVE, literal},
};
use crate::rig::nearest::nearest;

/// Result of a scan.
pub(super) struct ScanResult {
    /// The evaluator's form.
    pub(super) canonical: String,
    /// Indices of variables that occur, ascending.
    pub(super) used: Vec<usize>,
}

/// Scans a whole expression.
pub(super) fn scan(text: &str, variables: &[&str]) -> Result<ScanResult, ExpressionError> {
    // Characters past the limit are not counted.
    let chars: Vec<char> = text.chars().take(MOST_CHARACTERS + 1).collect();
    if chars.len() > MOST_CHARACTERS {
        return Err(ExpressionError { column: MOST_CHARACTERS + 1, problem: Problem::TooLong });
    }
    let mut scan = Scan {
        chars: &chars,
        variables,
        at: 0,
        out: String::with_capacity(4 * chars.len()),
        used: Vec::new(),
        open: vec![OpenParenthesis::new(0, None)],
        operands: 0,
        due: true,
        negative: false,
        after_power: false,
    };
    scan.run()?;
    scan.used.sort_unstable();
    Ok(ScanResult { canonical: scan.out, used: scan.used })
}

/// An open parenthesis, or the whole expression.
struct OpenParenthesis {
    at: usize,
    function: Option<&'static Function>,
    commas: usize,
    /// Marks a part whose last operator was a power, or that has a comparison in it.
    power: bool,
    comparison: bool,
}

impl OpenParenthesis {
    fn new(at: usize, function: Option<&'static Function>) -> Self {
        Self { at, function, commas: 0, power: false, comparison: false }
    }
}

struct Scan<'a> {
    chars: &'a [char],
    variables: &'a [&'a str],
    at: usize,
    out: String,
    used: Vec<usize>,
    /// Open parentheses, never empty: the first entry is the whole expression.
    open: Vec<OpenParenthesis>,
    operands: usize,
    /// Marks that an operand must come next.
    due: bool,
    /// Marks an odd number of minus signs before the expected operand.
    negative: bool,
    /// Marks the expected operand as an exponent.
    after_power: bool,
}

impl Scan<'_> {
    fn run(&mut self) -> Result<(), ExpressionError> {
        while let Some(&c) = self.chars.get(self.at) {
            match c {
                _ if c.is_whitespace() => self.at += 1,
                '(' => self.open(self.at, None)?,
                ')' => self.close()?,
                ',' => self.comma()?,
                _ if c.is_ascii_digit() || c == '.' => self.number()?,
                _ if c.is_alphabetic() || c == '_' => self.name()?,
                _ => self.operator(c)?,
            }
        }
        if let [_, .., last] = self.open.as_slice() {
            return error(last.at, Problem::NotClosed);
        }
        if self.operands == 0 {
            return error(0, Problem::Empty);
        }
        if self.due {
            return error(self.at, Problem::NoOperand("the end".to_owned()));
        }
        Ok(())
    }

    fn text(&self, from: usize) -> String {
        self.chars[from..self.at].iter().collect()
    }

    fn count(&mut self, at: usize) -> Result<(), ExpressionError> {
        self.operands += 1;
        if self.operands > MOST_OPERANDS { error(at, Problem::TooManyOperands) } else { Ok(()) }
    }

    /// Begins an operand at `from`, quoted as `shown`; writes its sign, unless a power may bind more strongly.
    fn begin(&mut self, from: usize, shown: String, is_simple: bool) -> Result<(), ExpressionError> {
        if !self.due {
            return error(from, Problem::NoOperator(shown));
        }
        let next = self.chars[self.at..].iter().find(|c| !c.is_whitespace());
        if std::mem::take(&mut self.negative) {
            if self.after_power || (is_simple && next != Some(&'^')) {
                self.out.push_str(NEGATIVE);
            } else {
                self.count(from)?;
                self.out.push_str(&literal(0.0));
                self.out.push_str(MINUS);
            }
        }
        self.due = !is_simple;
        self.after_power = false;
        Ok(())
    }

    fn number(&mut self) -> Result<(), ExpressionError> {
        let from = self.at;
        let digits = |scan: &mut Self| {
            while scan.chars.get(scan.at).is_some_and(|c| c.is_ascii_digit() || *c == '.') {
                scan.at += 1;
            }
        };
        digits(self);
        if matches!(self.chars.get(self.at), Some('e' | 'E')) {
            let sign = usize::from(matches!(self.chars.get(self.at + 1), Some('+' | '-')));
            if self.chars.get(self.at + 1 + sign).is_some_and(char::is_ascii_digit) {
                self.at += 1 + sign;
                digits(self);
            }
        }
        let text = self.text(from);
        let Some(number) = text.parse::<f32>().ok().filter(|number| number.is_finite()) else {
            return error(from, Problem::Number(text));
        };
        self.begin(from, text, true)?;
        self.count(from)?;
        self.out.push_str(&literal(number));
        Ok(())
    }

    fn name(&mut self) -> Result<(), ExpressionError> {
        let from = self.at;
        while self.chars.get(self.at).is_some_and(|c| c.is_alphanumeric() || matches!(c, '_' | '.')) {
            self.at += 1;
        }
        let name = self.text(from);
        let mut next = self.at;
        while self.chars.get(next).is_some_and(|c| c.is_whitespace()) {
            next += 1;
        }
        if self.chars.get(next) == Some(&'(') {
            let Some(function) = FUNCTIONS.iter().find(|function| function.name == name) else {
                let nearest = nearest(&name, FUNCTIONS.iter().map(|function| function.name), 3);
                return error(from, Problem::Unknown { name, nearest });
            };
            self.at = next;
            return self.open(from, Some(function));
        }
        let index = self.variables.iter().position(|variable| *variable == name);
        let constant = CONSTANTS.iter().find(|(constant, _)| *constant == name);
        let written = match (index, constant) {
            (Some(index), _) => {
                if !self.used.contains(&index) {
                    self.used.push(index);
                }
                // All numbers have equally many digits, so that the evaluator's order of names is that of numbers.
                format!("{{v{index:010}}}")
            }
            (None, Some((_, value))) => literal(*value),
            (None, None) => {
                let known = self.variables.iter().copied().chain(CONSTANTS.iter().map(|(constant, _)| *constant));
                return error(from, Problem::Unknown { nearest: nearest(&name, known, 3), name });
            }
        };
        self.begin(from, name, true)?;
        self.count(from)?;
        self.out.push_str(&written);
        Ok(())
    }

    /// Opens a parenthesis at [`Scan::at`], of a function whose name begins at `from`.
    fn open(&mut self, from: usize, function: Option<&'static Function>) -> Result<(), ExpressionError> {
        let shown = function.map_or("(", |function| function.name);
        self.begin(from, shown.to_owned(), false)?;
        if self.open.len() > MOST_NESTED {
            return error(self.at, Problem::TooDeep);
        }
        self.open.push(OpenParenthesis::new(self.at, function));
        self.at += 1;
        match function {
            Some(function) if function.arity == Arity::One => {
                self.out.push('(');
                self.out.push_str(function.symbol);
                self.out.push('(');
            }
            _ => self.out.push_str("(("),
        }
        Ok(())
    }

    fn comma(&mut self) -> Result<(), ExpressionError> {
        let at = self.at;
        let Some(open) = self.open.last_mut() else { return Ok(()) };
        let Some(function) = open.function else { return error(at, Problem::Comma) };
        if self.due {
            return error(at, Problem::NoOperand("`,`".to_owned()));
        }
        open.commas += 1;
        (open.power, open.comparison) = (false, false);
        let written = match (function.arity, open.commas) {
            (Arity::Three, 1) => [")", function.symbol, "(("],
            (Arity::Three, 2) => [")", JOIN, "("],
            // A wrong number of arguments is reported at the closing parenthesis.
            (Arity::One | Arity::Three, _) => ["", "", ""],
            _ => [")", function.symbol, "("],
        };
        self.out.extend(written);
        self.due = true;
        self.at += 1;
        Ok(())
    }

    fn close(&mut self) -> Result<(), ExpressionError> {
        let at = self.at;
        if self.open.len() < 2 {
            return error(at, Problem::NotOpened);
        }
        let Some(open) = self.open.pop() else { return Ok(()) };
        let has = match open.function {
            Some(_) if self.due && open.commas == 0 && self.is_empty_since(open.at) => 0,
            _ if self.due => return error(at, Problem::NoOperand("`)`".to_owned())),
            _ => open.commas + 1,
        };
        if let Some(function) = open.function
            && !function.arity.allows(has)
        {
            let Function { name, arity, .. } = function;
            return error(open.at, Problem::Arguments { function: name, takes: arity.words(), has });
        }
        let three = open.function.is_some_and(|function| function.arity == Arity::Three);
        self.out.push_str(if three { ")))" } else { "))" });
        self.at += 1;
        Ok(())
    }

    /// Returns `true` if only blanks follow the parenthesis at `open`.
    fn is_empty_since(&self, open: usize) -> bool {
        self.chars[open + 1..self.at].iter().all(|c| c.is_whitespace())
    }

    fn operator(&mut self, c: char) -> Result<(), ExpressionError> {
        let from = self.at;
        if self.due && matches!(c, '+' | '-') {
            self.negative ^= c == '-';
            self.at += 1;
            return Ok(());
        }
        let is_here = |infix: &&Infix| infix.text.chars().eq(self.chars[from..].iter().copied().take(infix.text.len()));
        let Some(infix) = INFIX.iter().find(is_here) else {
            return error(
                from,
                match c {
                    '=' => Problem::Alone { found: c, instead: "`==` to compare" },
                    '!' => Problem::Alone { found: c, instead: "`not(...)`, or `!=` to compare" },
                    '&' => Problem::Alone { found: c, instead: "`&&`" },
                    '|' => Problem::Alone { found: c, instead: "`||`" },
                    _ => Problem::Character(c),
                },
            );
        };
        if self.due {
            return error(from, Problem::NoOperand(format!("`{}`", infix.text)));
        }
        let is_power = infix.text == "^";
        if let Some(open) = self.open.last_mut() {
            if (is_power && open.power) || (infix.is_comparison() && open.comparison) {
                return error(from, Problem::Ambiguous(infix.text));
            }
            open.power = is_power;
            open.comparison = infix.is_comparison() || (open.comparison && !infix.joins_truths());
        }
        self.after_power = is_power;
        self.out.push_str(infix.text);
        self.at += infix.text.len();
        self.due = true;
        Ok(())
    }
}

fn error<T>(at: usize, problem: Problem) -> Result<T, ExpressionError> {
    Err(ExpressionError { column: at + 1, problem })
}
