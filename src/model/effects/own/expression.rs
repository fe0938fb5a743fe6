//! Expressions as a small flat program, which a step can run without allocating.
//!
//! `+ - * / ^`, comparisons (1 or 0), parentheses, functions, numbers such as `1.5e-3`, names. `^` binds to the right
//! and before a sign: `-v^2` is −(v²), as in mathematics and unlike in the crate `exmex`, which takes no exponents either.

/// Numbers that an expression may hold back at once.
const STACK: usize = 24;
/// Parentheses within parentheses deeper than this are a mistake.
const DEEPEST: usize = 40;
/// Longer expressions are a mistake.
const LONGEST_CHARS: usize = 2000;

/// What can be wrong with the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It breaks off, or goes on with something else than expected.
    Syntax {
        /// Where, counted from 1.
        column: usize,
        /// What was found and what is expected.
        message: String,
    },
    /// A name that means nothing here.
    Name(String),
    /// Something called that is no function.
    Function(String),
}

type Unary = fn(f64) -> f64;
type Binary = fn(f64, f64) -> f64;

const UNARY: &[(&str, Unary)] = &[
    ("abs", f64::abs),
    ("sign", |x| if x == 0.0 { 0.0 } else { x.signum() }),
    ("sqrt", f64::sqrt),
    ("exp", f64::exp),
    ("ln", f64::ln),
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("atan", f64::atan),
    ("tanh", f64::tanh),
    ("floor", f64::floor),
    ("round", f64::round),
];

const BINARY: &[(&str, Binary)] = &[("min", f64::min), ("max", f64::max), ("hypot", f64::hypot)];

/// `if(condition, then, else)`: the condition holds where it is not 0.
const IF: &str = "if";
/// `clamp(value, low, high)`.
const CLAMP: &str = "clamp";

/// All functions.
pub(crate) fn functions() -> impl Iterator<Item = &'static str> {
    UNARY.iter().map(|(name, _)| *name).chain(BINARY.iter().map(|(name, _)| *name)).chain([IF, CLAMP])
}

#[derive(Clone, Copy, Debug)]
enum Op {
    Number(f64),
    Name(usize),
    Unary(Unary),
    Binary(Binary),
    If,
    Clamp,
}

/// A compiled expression.
#[derive(Clone, Debug)]
pub struct Expression {
    ops: Vec<Op>,
}

impl Expression {
    /// Compiles a text in which `place` gives each name its place, or `None` where it means nothing.
    ///
    /// # Errors
    /// When the text is no expression, or a name means nothing.
    pub fn new(text: &str, place: &dyn Fn(&str) -> Option<usize>) -> Result<Self, Fault> {
        let mut parser = Parser { text, at: 0, place, ops: Vec::new(), held: 0, depth: 0 };
        if text.len() > LONGEST_CHARS {
            return Err(parser.fault(format!("longer than {LONGEST_CHARS} characters")));
        }
        parser.level(0)?;
        match parser.peek() {
            None => Ok(Self { ops: parser.ops }),
            Some(_) => Err(parser.unexpected("an operator or the end")),
        }
    }

    /// Whether it uses the name at this place.
    pub(crate) fn uses(&self, place: usize) -> bool {
        self.ops.iter().any(|op| matches!(op, Op::Name(known) if *known == place))
    }

    /// Its value; `look` gives the value of the name at a place.
    #[inline]
    pub fn value(&self, look: impl Fn(usize) -> f64) -> f64 {
        let mut stack = [0.0; STACK];
        let mut top = 0;
        for op in &self.ops {
            // The parser counted the stack's depth, so that no place is outside.
            let (arguments, value) = match *op {
                Op::Number(value) => (0, value),
                Op::Name(place) => (0, look(place)),
                Op::Unary(law) => (1, law(stack[top - 1])),
                Op::Binary(law) => (2, law(stack[top - 2], stack[top - 1])),
                Op::If => (3, if stack[top - 3] == 0.0 { stack[top - 1] } else { stack[top - 2] }),
                Op::Clamp => (3, stack[top - 3].max(stack[top - 2]).min(stack[top - 1])),
            };
            top -= arguments;
            stack[top] = value;
            top += 1;
        }
        stack[0]
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    place: &'a dyn Fn(&str) -> Option<usize>,
    ops: Vec<Op>,
    held: usize,
    depth: usize,
}

/// Operators by level, the loosest first; longer ones before their beginnings.
const LEVELS: [&[(&str, Binary)]; 3] = [
    &[
        ("<=", |a, b| f64::from(u8::from(a <= b))),
        (">=", |a, b| f64::from(u8::from(a >= b))),
        ("<", |a, b| f64::from(u8::from(a < b))),
        (">", |a, b| f64::from(u8::from(a > b))),
    ],
    &[("+", |a, b| a + b), ("-", |a, b| a - b)],
    &[("*", |a, b| a * b), ("/", |a, b| a / b)],
];

impl Parser<'_> {
    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text[self.at..].chars().next()
    }

    fn eat(&mut self, token: &str) -> bool {
        let found = self.peek().is_some() && self.text[self.at..].starts_with(token);
        if found {
            self.at += token.len();
        }
        found
    }

    fn fault(&self, message: String) -> Fault {
        Fault::Syntax { column: self.text[..self.at].chars().count() + 1, message }
    }

    fn unexpected(&mut self, expected: &str) -> Fault {
        let found = self.peek().map_or_else(|| "the end".to_owned(), |c| format!("`{}`", c.escape_default()));
        self.fault(format!("expected {expected}, found {found}"))
    }

    fn push(&mut self, op: Op, arguments: usize) -> Result<(), Fault> {
        self.ops.push(op);
        self.held = self.held + 1 - arguments;
        if self.held > STACK {
            return Err(self.fault("too many operations wait for each other; split the expression".to_owned()));
        }
        Ok(())
    }

    fn level(&mut self, level: usize) -> Result<(), Fault> {
        let Some(operators) = LEVELS.get(level) else { return self.signed() };
        self.level(level + 1)?;
        while let Some((_, law)) = operators.iter().find(|(token, _)| self.eat(token)) {
            self.level(level + 1)?;
            self.push(Op::Binary(*law), 2)?;
        }
        Ok(())
    }

    fn signed(&mut self) -> Result<(), Fault> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.fault(format!("nested deeper than {DEEPEST}")));
        }
        if self.eat("-") {
            self.signed()?;
            self.push(Op::Unary(|x| -x), 1)?;
        } else if self.eat("+") {
            self.signed()?;
        } else {
            self.atom()?;
            if self.eat("^") {
                self.signed()?;
                self.push(Op::Binary(f64::powf), 2)?;
            }
        }
        self.depth -= 1;
        Ok(())
    }

    fn atom(&mut self) -> Result<(), Fault> {
        match self.peek() {
            Some('(') => {
                self.at += 1;
                self.level(0)?;
                self.close()
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => self.name(),
            _ => Err(self.unexpected("a number, a name or `(`")),
        }
    }

    fn close(&mut self) -> Result<(), Fault> {
        if self.eat(")") { Ok(()) } else { Err(self.unexpected("an operator or `)`")) }
    }

    fn number(&mut self) -> Result<(), Fault> {
        let rest = &self.text.as_bytes()[self.at..];
        let digits = |from: usize| rest[from..].iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
        let mut length = digits(0);
        if let Some(b'e' | b'E') = rest.get(length) {
            let sign = usize::from(matches!(rest.get(length + 1), Some(b'+' | b'-')));
            length += 1 + sign + digits(length + 1 + sign);
        }
        let text = &self.text[self.at..self.at + length];
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => {
                self.at += length;
                self.push(Op::Number(number), 0)
            }
            _ => Err(self.fault(format!("`{text}` is not a number"))),
        }
    }

    fn name(&mut self) -> Result<(), Fault> {
        let rest = &self.text[self.at..];
        let length = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(rest.len());
        let name = &rest[..length];
        self.at += length;
        if !self.eat("(") {
            if name == "pi" {
                return self.push(Op::Number(std::f64::consts::PI), 0);
            }
            let place = (self.place)(name).ok_or_else(|| Fault::Name(name.to_owned()))?;
            return self.push(Op::Name(place), 0);
        }
        let unary = UNARY.iter().find(|(known, _)| *known == name).map(|(_, law)| (Op::Unary(*law), 1));
        let binary = || BINARY.iter().find(|(known, _)| *known == name).map(|(_, law)| (Op::Binary(*law), 2));
        let (op, arguments) = match name {
            IF => (Op::If, 3),
            CLAMP => (Op::Clamp, 3),
            _ => unary.or_else(binary).ok_or_else(|| Fault::Function(name.to_owned()))?,
        };
        for k in 0..arguments {
            if k > 0 && !self.eat(",") {
                return Err(self.unexpected(&format!("`,`: `{name}` takes {arguments} arguments")));
            }
            self.level(0)?;
        }
        self.close()?;
        self.push(op, arguments)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn compile(text: &str) -> Result<Expression, Fault> {
        Expression::new(text, &|name| ["x", "y"].iter().position(|known| *known == name))
    }

    fn value(text: &str) -> f64 {
        compile(text).unwrap().value(|place| [3.0, -2.0][place])
    }

    #[test]
    fn it_reads_as_mathematics_does() {
        for (text, expected) in [
            ("1 + 2 * 3", 7.0),
            ("2 - 3 - 4", -5.0),
            ("8 / 2 / 2 * 3", 6.0),
            ("-x^2", -9.0),
            ("2^-1", 0.5),
            ("2^3^2", 512.0),
            ("(-x)^2", 9.0),
            ("5.0e4*x", 1.5e5),
            ("1e-3 + .5", 0.501),
            ("x - -y", 1.0),
            ("--x", 3.0),
            ("x*y < 0", 1.0),
            ("1 <= 1", 1.0),
            ("if(x > 5, 1, 2 + y)", 0.0),
            ("clamp(x, -1, 2.5)", 2.5),
            ("min(x, y) + max(x, y) + hypot(3, 4)", 6.0),
            ("sign(y) + sign(0)", -1.0),
            ("2*pi", std::f64::consts::TAU),
            ("-1e3*tanh(y/2e-1)", 1e3 * (10.0_f64).tanh()),
        ] {
            assert!((value(text) - expected).abs() < 1e-12, "{text}: {}, not {expected}", value(text));
        }
    }

    #[test]
    fn slips_say_where() {
        for (text, column, words) in [
            ("", 1, "found the end"),
            ("1 +", 4, "expected a number, a name or `(`, found the end"),
            ("2x", 2, "expected an operator or the end, found `x`"),
            ("(1", 3, "expected an operator or `)`"),
            ("1..2", 1, "`1..2` is not a number"),
            ("1e999", 1, "not a number"),
            ("1e", 1, "not a number"),
            ("x é", 3, "found `\\u{e9}`"),
            ("min(x)", 6, "`min` takes 2 arguments"),
            ("abs(x, y)", 6, "expected an operator or `)`, found `,`"),
        ] {
            match compile(text).unwrap_err() {
                Fault::Syntax { column: found, message } => {
                    assert!(found == column && message.contains(words), "{text}: {found}: {message}");
                }
                other => panic!("{text}: {other:?}"),
            }
        }
        assert_eq!(compile("x + z").unwrap_err(), Fault::Name("z".to_owned()));
        assert_eq!(compile("sgn(x)").unwrap_err(), Fault::Function("sgn".to_owned()));
    }

    #[test]
    fn depth_is_bounded() {
        for text in ["(".repeat(500), "-".repeat(500), "x^".repeat(500), "1+(".repeat(30) + "1", "x".repeat(5000)] {
            assert!(compile(&text).is_err());
        }
        assert!(value(&format!("{}x{}", "(1+".repeat(20), ")".repeat(20))).is_finite());
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "[-+*/^()<>=., xye0-9a-zé]{0,60}") {
            if let Ok(expression) = compile(&text) {
                let _ = expression.value(|_| 1.0);
            }
        }
    }
}
