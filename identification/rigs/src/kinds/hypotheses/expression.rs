//! Expressions of people: arithmetic over named values, without loops, files or anything else that a program
//! can do.
//!
//! `+ - * / ^`, comparisons (1 where true, 0 elsewhere), parentheses, [`FUNCTIONS`], `if(condition, a, b)` and
//! `delay(name, seconds)`, the value of a name that long ago. `^` binds to the right and closer than a sign.

use super::parser::Parser;

/// Names of functions with the number of their arguments.
pub const FUNCTIONS: [(&str, usize); 21] = [
    ("abs", 1),
    ("sign", 1),
    ("sqrt", 1),
    ("exp", 1),
    ("ln", 1),
    ("sin", 1),
    ("cos", 1),
    ("tan", 1),
    ("asin", 1),
    ("acos", 1),
    ("atan", 1),
    ("sinh", 1),
    ("cosh", 1),
    ("tanh", 1),
    ("floor", 1),
    ("ceil", 1),
    ("min", 2),
    ("max", 2),
    ("hypot", 2),
    ("atan2", 2),
    ("clamp", 3),
];

/// What is wrong with an expression, and at which character, counted from 1.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("at character {at}: {what}")]
pub struct ExpressionError {
    /// The character.
    pub at: usize,
    /// What is wrong and what was expected.
    pub what: String,
}

/// A part of an expression.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Node {
    Number(f64),
    Slot(usize),
    One(One, Box<Node>),
    Two(Two, Box<Node>, Box<Node>),
    If(Box<[Node; 3]>),
    Delay(usize, Box<Node>),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum One {
    Minus,
    Abs,
    Sign,
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Floor,
    Ceil,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Two {
    Plus,
    Minus,
    Times,
    Over,
    Power,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    Other,
    Min,
    Max,
    Hypot,
    Atan2,
}

impl One {
    pub(super) fn called(name: &str) -> Option<Self> {
        Some(match name {
            "abs" => Self::Abs,
            "sign" => Self::Sign,
            "sqrt" => Self::Sqrt,
            "exp" => Self::Exp,
            "ln" => Self::Ln,
            "sin" => Self::Sin,
            "cos" => Self::Cos,
            "tan" => Self::Tan,
            "asin" => Self::Asin,
            "acos" => Self::Acos,
            "atan" => Self::Atan,
            "sinh" => Self::Sinh,
            "cosh" => Self::Cosh,
            "tanh" => Self::Tanh,
            "floor" => Self::Floor,
            "ceil" => Self::Ceil,
            _ => return None,
        })
    }

    fn of(self, a: f64) -> f64 {
        match self {
            Self::Minus => -a,
            Self::Abs => a.abs(),
            // Of zero it is zero, unlike that of `f64`.
            Self::Sign if a == 0.0 => 0.0,
            Self::Sign => a.signum(),
            Self::Sqrt => a.sqrt(),
            Self::Exp => a.exp(),
            Self::Ln => a.ln(),
            Self::Sin => a.sin(),
            Self::Cos => a.cos(),
            Self::Tan => a.tan(),
            Self::Asin => a.asin(),
            Self::Acos => a.acos(),
            Self::Atan => a.atan(),
            Self::Sinh => a.sinh(),
            Self::Cosh => a.cosh(),
            Self::Tanh => a.tanh(),
            Self::Floor => a.floor(),
            Self::Ceil => a.ceil(),
        }
    }
}

impl Two {
    pub(super) fn called(name: &str) -> Option<Self> {
        Some(match name {
            "min" => Self::Min,
            "max" => Self::Max,
            "hypot" => Self::Hypot,
            "atan2" => Self::Atan2,
            _ => return None,
        })
    }

    fn of(self, a: f64, b: f64) -> f64 {
        let truth = |is: bool| f64::from(u8::from(is));
        match self {
            Self::Plus => a + b,
            Self::Minus => a - b,
            Self::Times => a * b,
            Self::Over => a / b,
            Self::Power => a.powf(b),
            Self::Less => truth(a < b),
            Self::LessOrEqual => truth(a <= b),
            Self::Greater => truth(a > b),
            Self::GreaterOrEqual => truth(a >= b),
            Self::Equal => truth(a == b),
            Self::Other => truth(a != b),
            Self::Min => a.min(b),
            Self::Max => a.max(b),
            Self::Hypot => a.hypot(b),
            Self::Atan2 => a.atan2(b),
        }
    }
}

/// An expression over values by place.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression(pub(super) Node);

impl Expression {
    /// Reads an expression; `names` are those of the values that it is given, in their order.
    ///
    /// # Errors
    /// The place at which it cannot be read, or an unknown name with the nearest known one.
    pub fn parse(text: &str, names: &[String]) -> Result<Self, ExpressionError> {
        Parser::new(text, names).whole().map(Self)
    }

    /// Its value (not a number where an argument is outside of a function's domain). `past` gives the value at
    /// a place some seconds ago.
    pub fn value(&self, values: &[f64], past: &dyn Fn(usize, f64) -> f64) -> f64 {
        value(&self.0, values, past)
    }

    /// Whether the value at this place counts.
    pub fn reads(&self, place: usize) -> bool {
        any(
            &self.0,
            &|node| matches!(node, Node::Slot(own) | Node::Delay(own, _) if *own == place),
        )
    }

    /// The place of a name whose past counts, if there is one.
    pub fn delays(&self) -> Option<usize> {
        let found = std::cell::Cell::new(None);
        any(&self.0, &|node| {
            if let Node::Delay(place, _) = node {
                found.set(Some(*place));
            }
            false
        });
        found.get()
    }
}

fn any(node: &Node, is_wanted: &dyn Fn(&Node) -> bool) -> bool {
    is_wanted(node)
        || match node {
            Node::Number(_) | Node::Slot(_) => false,
            Node::One(_, a) | Node::Delay(_, a) => any(a, is_wanted),
            Node::Two(_, a, b) => any(a, is_wanted) || any(b, is_wanted),
            Node::If(parts) => parts.iter().any(|part| any(part, is_wanted)),
        }
}

fn value(node: &Node, values: &[f64], past: &dyn Fn(usize, f64) -> f64) -> f64 {
    match node {
        Node::Number(number) => *number,
        Node::Slot(place) => values.get(*place).copied().unwrap_or(f64::NAN),
        Node::One(one, a) => one.of(value(a, values, past)),
        Node::Two(two, a, b) => two.of(value(a, values, past), value(b, values, past)),
        Node::If(parts) => {
            let [condition, then, other] = parts.as_ref();
            let holds = value(condition, values, past) != 0.0;
            value(if holds { then } else { other }, values, past)
        }
        Node::Delay(place, by) => past(*place, value(by, values, past)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> f64 {
        let names = ["u", "v"].map(String::from);
        let expression = Expression::parse(text, &names).unwrap();
        expression.value(&[2.0, -3.0], &|place, by| 100.0 * place as f64 + by)
    }

    fn error(text: &str) -> String {
        let names = ["speed", "force"].map(String::from);
        Expression::parse(text, &names).unwrap_err().to_string()
    }

    #[test]
    fn operators_bind_as_in_mathematics() {
        for (text, value) in [
            ("1 + 2 * 3", 7.0),
            ("(1 + 2) * 3", 9.0),
            ("2 - 3 - 4", -5.0),
            ("16 / 4 / 2", 2.0),
            ("-u^2", -4.0),
            ("2^3^2", 512.0),
            ("2^-1", 0.5),
            ("- -u", 2.0),
            ("1.5e-3 * u", 3e-3),
            (".5 * u", 1.0),
            ("u < v", 0.0),
            ("u > v", 1.0),
            ("u + 1 >= 3", 1.0),
            ("u == 2", 1.0),
            ("u != 2", 0.0),
            ("abs(v) * sign(v)", -3.0),
            ("sign(0)", 0.0),
            ("clamp(v, -1, 1)", -1.0),
            ("min(u, v) + max(u, v)", -1.0),
            ("hypot(3, 4)", 5.0),
            ("if(u > 0, v, 1 / 0)", -3.0),
            ("sin(pi / 2)", 1.0),
            ("delay(v, 2 * u)", 104.0),
        ] {
            assert_eq!(of(text), value, "{text}");
        }
        assert!(of("sqrt(v)").is_nan());
    }

    #[test]
    fn mistakes_are_told_by_place() {
        for (text, expected) in [
            ("", "at character 1: the expression ends; expected a number"),
            (
                "1 +",
                "at character 4: the expression ends; expected a number",
            ),
            ("2 spede", "at character 3: `spede` is not expected here"),
            (
                "2 * spede",
                "at character 5: `spede` is unknown; did you mean `speed`?",
            ),
            ("min(1)", "at character 1: `min` takes 2 arguments, not 1"),
            (
                "sqr(2)",
                "at character 1: `sqr` is not a function; did you mean `sqrt`?",
            ),
            (
                "(1 + 2",
                "at character 7: the expression ends; expected `)`",
            ),
            ("1 < 2 < 3", "at character 7: `<` is not expected here"),
            (
                "delay(2, 3)",
                "at character 7: `delay` takes the name of a value first",
            ),
            ("speed; force", "at character 6: `;` is not expected here"),
            ("1..2", "at character 1: `1..2` is not a number"),
            (
                "2 = speed",
                "at character 3: `=` is not expected here; expected `==` to compare",
            ),
        ] {
            let found = error(text);
            assert!(found.starts_with(expected), "{text}: {found}");
        }
        let deep = "(".repeat(100_000);
        assert!(error(&deep).contains("nested"), "{}", error(&deep));
        let long = "1+".repeat(100_000) + "1";
        assert!(error(&long).contains("parts"), "{}", error(&long));
    }
}
