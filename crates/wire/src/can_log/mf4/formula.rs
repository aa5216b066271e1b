//! Formulas of algebraic conversions: one variable, `+ - * / ^`, parentheses and functions.

/// Deepest nesting of a formula.
const DEPTH_MAX: u32 = 32;
/// Longest formula, bytes.
const LENGTH_MAX: usize = 4096;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Number(f64),
    Variable,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Negate,
    Function(Function),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Function {
    Abs,
    Acos,
    Asin,
    Atan,
    Cos,
    Exp,
    Ln,
    Log10,
    Sin,
    Sqrt,
    Tan,
}

impl Function {
    fn of(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "abs" => Self::Abs,
            "acos" => Self::Acos,
            "asin" => Self::Asin,
            "atan" => Self::Atan,
            "cos" => Self::Cos,
            "exp" => Self::Exp,
            "log" | "ln" => Self::Ln,
            "log10" => Self::Log10,
            "sin" => Self::Sin,
            "sqrt" => Self::Sqrt,
            "tan" => Self::Tan,
            _ => return None,
        })
    }

    fn apply(self, x: f64) -> f64 {
        match self {
            Self::Abs => x.abs(),
            Self::Acos => math::acos(x),
            Self::Asin => math::asin(x),
            Self::Atan => math::atan(x),
            Self::Cos => math::cos(x),
            Self::Exp => math::exp(x),
            Self::Ln => math::ln(x),
            Self::Log10 => math::log10(x),
            Self::Sin => math::sin(x),
            Self::Sqrt => x.sqrt(),
            Self::Tan => math::tan(x),
        }
    }
}

/// A formula in postfix order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Formula(Vec<Step>);

impl Formula {
    /// Reads a formula; `None` if it has another form.
    pub fn parse(text: &str) -> Option<Self> {
        if text.len() > LENGTH_MAX {
            return None;
        }
        let mut parser = Parser {
            rest: text.trim(),
            steps: Vec::new(),
            depth: 0,
        };
        parser.sum()?;
        parser.rest.is_empty().then_some(Self(parser.steps))
    }

    pub fn apply(&self, x: f64) -> f64 {
        let mut stack = Vec::new();
        for step in &self.0 {
            let value = match step {
                Step::Number(number) => *number,
                Step::Variable => x,
                Step::Negate => -stack.pop().unwrap_or(f64::NAN),
                Step::Function(function) => function.apply(stack.pop().unwrap_or(f64::NAN)),
                operator => {
                    let right = stack.pop().unwrap_or(f64::NAN);
                    let left = stack.pop().unwrap_or(f64::NAN);
                    match operator {
                        Step::Add => left + right,
                        Step::Subtract => left - right,
                        Step::Multiply => left * right,
                        Step::Divide => left / right,
                        _ => math::powf(left, right),
                    }
                }
            };
            stack.push(value);
        }
        stack.pop().unwrap_or(f64::NAN)
    }
}

struct Parser<'t> {
    rest: &'t str,
    steps: Vec<Step>,
    depth: u32,
}

impl Parser<'_> {
    /// Takes a sign, and the space behind it.
    fn take(&mut self, sign: &str) -> bool {
        let Some(rest) = self.rest.strip_prefix(sign) else {
            return false;
        };
        self.rest = rest.trim_start();
        true
    }

    fn sum(&mut self) -> Option<()> {
        self.product()?;
        loop {
            if self.take("+") {
                self.product()?;
                self.steps.push(Step::Add);
            } else if self.take("-") {
                self.product()?;
                self.steps.push(Step::Subtract);
            } else {
                return Some(());
            }
        }
    }

    fn product(&mut self) -> Option<()> {
        self.factor()?;
        loop {
            if self.take("*") {
                self.factor()?;
                self.steps.push(Step::Multiply);
            } else if self.take("/") {
                self.factor()?;
                self.steps.push(Step::Divide);
            } else {
                return Some(());
            }
        }
    }

    fn factor(&mut self) -> Option<()> {
        self.depth += 1;
        if self.depth > DEPTH_MAX {
            return None;
        }
        if self.take("-") {
            self.factor()?;
            self.steps.push(Step::Negate);
        } else {
            self.atom()?;
            if self.take("^") || self.take("**") {
                self.factor()?;
                self.steps.push(Step::Power);
            }
        }
        self.depth -= 1;
        Some(())
    }

    fn atom(&mut self) -> Option<()> {
        if self.take("(") {
            self.sum()?;
            return self.take(")").then_some(());
        }
        let is_word = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
        if self
            .rest
            .starts_with(|letter: char| letter.is_ascii_alphabetic())
        {
            let end = self.rest.find(|letter| !is_word(letter));
            let (word, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
            self.rest = rest.trim_start();
            if matches!(word, "X" | "X1" | "x" | "x1") {
                self.steps.push(Step::Variable);
                return Some(());
            }
            let function = Function::of(word)?;
            if !self.take("(") {
                return None;
            }
            self.sum()?;
            self.steps.push(Step::Function(function));
            return self.take(")").then_some(());
        }
        let bytes = self.rest.as_bytes();
        let mut end = 0;
        while end < bytes.len() {
            let exponent = end > 0 && matches!(bytes[end - 1], b'e' | b'E');
            match bytes[end] {
                b'0'..=b'9' | b'.' | b'e' | b'E' => {}
                b'+' | b'-' if exponent => {}
                _ => break,
            }
            end += 1;
        }
        let (number, rest) = self.rest.split_at(end);
        self.steps.push(Step::Number(number.parse().ok()?));
        self.rest = rest.trim_start();
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_have_the_usual_order() {
        for (text, at_3) in [
            ("X*X+1", 10.0),
            ("2 + 3 * X1 ^ 2", 29.0),
            ("-(x - 1) / 4e-1", -5.0),
            ("sqrt(X*3) - abs(-2)", 1.0),
            ("2**X", 8.0),
        ] {
            let formula = Formula::parse(text).expect(text);
            assert!((formula.apply(3.0) - at_3).abs() < 1e-12, "{text}");
        }
        let deep = "(".repeat(10_000);
        for text in ["", "X+", "Y", "sin", "1 2", "(X", "ä", deep.as_str()] {
            assert_eq!(Formula::parse(text), None, "{text}");
        }
    }
}
