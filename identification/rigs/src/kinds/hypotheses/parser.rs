//! From the text of an expression to its parts.

use super::expression::{ExpressionError, FUNCTIONS, Node, One, Two};

/// Depth and number of parts at most: an expression is a line and not a program.
const DEEPEST: usize = 64;
const MOST: usize = 2000;

/// Reads one expression.
pub(super) struct Parser<'a> {
    text: Vec<char>,
    names: &'a [String],
    at: usize,
    depth: usize,
    parts: usize,
}

type Parsed = Result<Node, ExpressionError>;

impl<'a> Parser<'a> {
    pub(super) fn new(text: &str, names: &'a [String]) -> Self {
        Self {
            text: text.chars().collect(),
            names,
            at: 0,
            depth: 0,
            parts: 0,
        }
    }

    pub(super) fn whole(mut self) -> Parsed {
        let node = self.comparison()?;
        self.blank();
        if self.at < self.text.len() {
            return Err(self.unexpected());
        }
        Ok(node)
    }

    fn error<T>(&self, at: usize, what: impl Into<String>) -> Result<T, ExpressionError> {
        Err(ExpressionError {
            at: at + 1,
            what: what.into(),
        })
    }

    fn unexpected(&self) -> ExpressionError {
        let rest = &self.text[self.at..];
        let is_word = |c: &&char| c.is_alphanumeric() || **c == '_';
        let word: String = rest.iter().take_while(is_word).collect();
        let shown = match rest.first() {
            Some(first) if word.is_empty() => first.to_string(),
            _ => word,
        };
        let remedy = if shown == "=" {
            "; expected `==` to compare"
        } else {
            "; expected an operator such as `*` or the end"
        };
        ExpressionError {
            at: self.at + 1,
            what: format!("`{shown}` is not expected here{remedy}"),
        }
    }

    fn blank(&mut self) {
        while self.text.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
    }

    /// Whether `symbol` is next, which is then passed.
    fn passes(&mut self, symbol: &str) -> bool {
        self.blank();
        let next = self.text[self.at..].iter().take(symbol.len());
        let is_next = next.copied().eq(symbol.chars());
        if is_next {
            self.at += symbol.len();
        }
        is_next
    }

    fn expect(&mut self, symbol: &str) -> Result<(), ExpressionError> {
        if self.passes(symbol) {
            return Ok(());
        }
        match self.text.get(self.at) {
            None => self.error(self.at, format!("the expression ends; expected `{symbol}`")),
            Some(found) => self.error(self.at, format!("`{found}` here; expected `{symbol}`")),
        }
    }

    /// A part that holds others, if there are not too many.
    fn counted(&mut self, node: Node) -> Parsed {
        self.parts += 1;
        if self.parts > MOST {
            return self.error(
                self.at,
                format!("more than {MOST} parts; expected one line"),
            );
        }
        Ok(node)
    }

    fn two(&mut self, two: Two, a: Node, b: Node) -> Parsed {
        self.counted(Node::Two(two, Box::new(a), Box::new(b)))
    }

    fn comparison(&mut self) -> Parsed {
        let a = self.sum()?;
        for (symbol, two) in [
            ("<=", Two::LessOrEqual),
            (">=", Two::GreaterOrEqual),
            ("==", Two::Equal),
            ("!=", Two::Other),
            ("<", Two::Less),
            (">", Two::Greater),
        ] {
            if self.passes(symbol) {
                let b = self.sum()?;
                return self.two(two, a, b);
            }
        }
        Ok(a)
    }

    fn sum(&mut self) -> Parsed {
        let mut a = self.product()?;
        loop {
            let two = if self.passes("+") {
                Two::Plus
            } else if self.passes("-") {
                Two::Minus
            } else {
                return Ok(a);
            };
            let b = self.product()?;
            a = self.two(two, a, b)?;
        }
    }

    fn product(&mut self) -> Parsed {
        let mut a = self.signed()?;
        loop {
            let two = if self.passes("*") {
                Two::Times
            } else if self.passes("/") {
                Two::Over
            } else {
                return Ok(a);
            };
            let b = self.signed()?;
            a = self.two(two, a, b)?;
        }
    }

    fn signed(&mut self) -> Parsed {
        self.depth += 1;
        if self.depth > DEEPEST {
            return self.error(self.at, format!("nested more than {DEEPEST} deep"));
        }
        let node = if self.passes("-") {
            let a = self.signed()?;
            self.counted(Node::One(One::Minus, Box::new(a)))
        } else if self.passes("+") {
            self.signed()
        } else {
            self.power()
        };
        self.depth -= 1;
        node
    }

    fn power(&mut self) -> Parsed {
        let base = self.atom()?;
        if self.passes("^") {
            let exponent = self.signed()?;
            return self.two(Two::Power, base, exponent);
        }
        Ok(base)
    }

    fn atom(&mut self) -> Parsed {
        if self.passes("(") {
            let node = self.comparison()?;
            self.expect(")")?;
            return Ok(node);
        }
        match self.text.get(self.at) {
            Some(c) if c.is_ascii_digit() || *c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || *c == '_' => self.named(),
            Some(c) => self.error(
                self.at,
                format!("`{c}` is not expected here; expected a number, a name or `(`"),
            ),
            None => self.error(
                self.at,
                "the expression ends; expected a number, a name or `(`",
            ),
        }
    }

    fn number(&mut self) -> Parsed {
        let from = self.at;
        while let Some(c) = self.text.get(self.at) {
            let after_exponent =
                matches!(self.text[self.at - usize::from(self.at > from)], 'e' | 'E');
            let is_sign = self.at > from && after_exponent && matches!(c, '+' | '-');
            if !(c.is_ascii_digit() || matches!(c, '.' | 'e' | 'E') || is_sign) {
                break;
            }
            self.at += 1;
        }
        let text: String = self.text[from..self.at].iter().collect();
        match text.parse() {
            Ok(number) => self.counted(Node::Number(number)),
            Err(_) => self.error(from, format!("`{text}` is not a number")),
        }
    }

    fn named(&mut self) -> Parsed {
        let from = self.at;
        let is_word = |c: &char| c.is_alphanumeric() || *c == '_';
        while self.text.get(self.at).is_some_and(is_word) {
            self.at += 1;
        }
        let name: String = self.text[from..self.at].iter().collect();
        if self.passes("(") {
            return self.function(from, &name);
        }
        if let Some(place) = self.place(&name) {
            return self.counted(Node::Slot(place));
        }
        if name == "pi" {
            return self.counted(Node::Number(std::f64::consts::PI));
        }
        let known = self.names.iter().map(String::as_str);
        let hint = units::hint(&name, known);
        self.error(from, format!("`{name}` is unknown{hint}"))
    }

    fn place(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|own| own == name)
    }

    fn function(&mut self, from: usize, name: &str) -> Parsed {
        if name == "delay" {
            return self.delay();
        }
        let mut arguments = vec![self.comparison()?];
        while self.passes(",") {
            arguments.push(self.comparison()?);
        }
        self.expect(")")?;
        let count = arguments.len();
        let wrong = |expected: usize| ExpressionError {
            at: from + 1,
            what: format!(
                "`{name}` takes {expected} argument{}, not {count}",
                if expected == 1 { "" } else { "s" }
            ),
        };
        if name == "if" {
            let parts = <[Node; 3]>::try_from(arguments).map_err(|_| wrong(3))?;
            return self.counted(Node::If(Box::new(parts)));
        }
        let Some((_, expected)) = FUNCTIONS.iter().find(|(own, _)| *own == name) else {
            let known = FUNCTIONS.iter().map(|(own, _)| *own);
            let hint = units::hint(name, known.chain(["if", "delay"]));
            return self.error(from, format!("`{name}` is not a function{hint}"));
        };
        if count != *expected {
            return Err(wrong(*expected));
        }
        let mut arguments = arguments.into_iter();
        let mut next = || Box::new(arguments.next().unwrap_or(Node::Number(f64::NAN)));
        let node = if let Some(one) = One::called(name) {
            Node::One(one, next())
        } else if let Some(two) = Two::called(name) {
            Node::Two(two, next(), next())
        } else {
            let (a, low, high) = (next(), next(), next());
            Node::Two(Two::Min, Box::new(Node::Two(Two::Max, a, low)), high)
        };
        self.counted(node)
    }

    fn delay(&mut self) -> Parsed {
        self.blank();
        let from = self.at;
        let first = self.comparison()?;
        let Node::Slot(place) = first else {
            return self.error(
                from,
                "`delay` takes the name of a value first, then seconds: `delay(u, 0.01)`",
            );
        };
        self.expect(",")?;
        let by = self.comparison()?;
        self.expect(")")?;
        self.counted(Node::Delay(place, Box::new(by)))
    }
}
