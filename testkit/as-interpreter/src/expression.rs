//! Expressions, and their parser.

use crate::lexer::Token;
use crate::names::{Names, Variable};

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Expression {
    Real(f32),
    Text(Vec<u8>),
    Variable(VariableRef),
    Not(Box<Expression>),
    Negative(Box<Expression>),
    Binary(Operator, Box<(Expression, Expression)>),
    Function(Function, Vec<Expression>),
}

/// A variable, or an element of an array.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct VariableRef {
    pub(crate) variable: Variable,
    pub(crate) index: Option<Box<Expression>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Operator {
    Or,
    And,
    Equal,
    NotEqual,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Plus,
    Minus,
    Times,
    Over,
    Modulo,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Function {
    Abs,
    Int,
    Len,
    Val,
    Instr,
    Left,
    Right,
    Mid,
    /// With the blank in a sign's place.
    Encode,
    /// `$ENCODE (/L, …)`
    EncodeLeft,
    Sig,
    Timer,
    Trans,
}

const FUNCTIONS: [(&str, Function, usize, usize); 12] = [
    ("ABS", Function::Abs, 1, 1),
    ("INT", Function::Int, 1, 1),
    ("LEN", Function::Len, 1, 1),
    ("VAL", Function::Val, 1, 1),
    ("INSTR", Function::Instr, 2, 2),
    ("$LEFT", Function::Left, 2, 2),
    ("$RIGHT", Function::Right, 2, 2),
    ("$MID", Function::Mid, 2, 3),
    ("$ENCODE", Function::Encode, 1, 1),
    ("SIG", Function::Sig, 1, 1),
    ("TIMER", Function::Timer, 1, 1),
    ("TRANS", Function::Trans, 1, 6),
];

/// Reads the tokens of a line from the left.
pub(crate) struct Reader<'a> {
    tokens: &'a [Token],
    pub(crate) names: &'a mut Names,
}

/// Operators from the weakest on.
const LEVELS: [&[(&str, Operator)]; 5] = [
    &[("OR", Operator::Or)],
    &[("AND", Operator::And)],
    &[
        ("==", Operator::Equal),
        ("<>", Operator::NotEqual),
        ("<", Operator::Less),
        ("<=", Operator::LessOrEqual),
        (">", Operator::Greater),
        (">=", Operator::GreaterOrEqual),
    ],
    &[("+", Operator::Plus), ("-", Operator::Minus)],
    &[("*", Operator::Times), ("/", Operator::Over), ("MOD", Operator::Modulo)],
];
const COMPARISONS: usize = 2;

impl<'a> Reader<'a> {
    pub(crate) fn new(tokens: &'a [Token], names: &'a mut Names) -> Self {
        Self { tokens, names }
    }

    pub(crate) fn is_at_end(&self) -> bool {
        self.tokens.is_empty()
    }

    /// Skips the next token if it is this mark or keyword; returns whether it was.
    pub(crate) fn takes(&mut self, word: &str) -> bool {
        let found = match self.tokens.first() {
            Some(Token::Mark(mark)) => *mark == word,
            Some(Token::Name(name)) => name == word,
            _ => false,
        };
        if found {
            self.skip();
        }
        found
    }

    pub(crate) fn needs(&mut self, word: &str) -> Result<(), String> {
        if self.takes(word) {
            Ok(())
        } else {
            Err(format!("{word} is missing before {:?}", self.tokens.first()))
        }
    }

    pub(crate) fn name(&mut self) -> Result<String, String> {
        let Some(Token::Name(name)) = self.tokens.first() else {
            return Err(format!("{:?} in place of a name", self.tokens.first()));
        };
        self.skip();
        Ok(name.clone())
    }

    /// Parses a name and its index, if it has one.
    pub(crate) fn place(&mut self) -> Result<VariableRef, String> {
        let name = self.name()?;
        if name.chars().all(|c| c.is_ascii_uppercase() || c == '$' || c == '_') {
            return Err(format!("{name} is no variable"));
        }
        let variable = self.names.variable(&name);
        let index = if self.takes("[") {
            let index = self.expression()?;
            self.needs("]")?;
            Some(Box::new(index))
        } else {
            None
        };
        Ok(VariableRef { variable, index })
    }

    pub(crate) fn expression(&mut self) -> Result<Expression, String> {
        self.level(0)
    }

    /// Expressions with a comma between.
    pub(crate) fn list(&mut self) -> Result<Vec<Expression>, String> {
        let mut list = vec![self.expression()?];
        while self.takes(",") {
            list.push(self.expression()?);
        }
        Ok(list)
    }

    fn level(&mut self, level: usize) -> Result<Expression, String> {
        let Some(operators) = LEVELS.get(level) else { return self.unary() };
        if level == COMPARISONS && self.takes("NOT") {
            return Ok(Expression::Not(Box::new(self.level(level)?)));
        }
        let mut left = self.level(level + 1)?;
        while let Some((_, operator)) = operators.iter().find(|(word, _)| self.takes(word)) {
            let right = self.level(level + 1)?;
            left = Expression::Binary(*operator, Box::new((left, right)));
        }
        Ok(left)
    }

    fn unary(&mut self) -> Result<Expression, String> {
        if self.takes("-") {
            return Ok(Expression::Negative(Box::new(self.unary()?)));
        }
        match self.tokens.first() {
            Some(Token::Real(real)) => {
                let real = Expression::Real(*real);
                self.skip();
                Ok(real)
            }
            Some(Token::Text(text)) => {
                let text = Expression::Text(text.clone());
                self.skip();
                Ok(text)
            }
            Some(Token::Mark("(")) => {
                self.skip();
                let inside = self.expression()?;
                self.needs(")")?;
                Ok(inside)
            }
            Some(Token::Name(name)) => {
                let function = FUNCTIONS.iter().find(|(word, ..)| word == name);
                match (name.as_str(), function) {
                    ("TRUE", _) => self.constant(-1.0),
                    ("FALSE", _) => self.constant(0.0),
                    (_, Some(&(_, function, least, most))) => self.function(function, least, most),
                    (_, None) => self.place().map(Expression::Variable),
                }
            }
            found => Err(format!("{found:?} in place of a value")),
        }
    }

    fn constant(&mut self, real: f32) -> Result<Expression, String> {
        self.skip();
        Ok(Expression::Real(real))
    }

    fn function(&mut self, function: Function, least: usize, most: usize) -> Result<Expression, String> {
        self.skip();
        self.needs("(")?;
        let function = if function == Function::Encode && self.takes("/") {
            self.needs("L")?;
            self.needs(",")?;
            Function::EncodeLeft
        } else {
            function
        };
        let arguments = self.list()?;
        self.needs(")")?;
        if !(least..=most).contains(&arguments.len()) {
            return Err(format!("{function:?} takes {least} to {most} values"));
        }
        Ok(Expression::Function(function, arguments))
    }

    fn skip(&mut self) {
        self.tokens = self.tokens.get(1..).unwrap_or_default();
    }
}
