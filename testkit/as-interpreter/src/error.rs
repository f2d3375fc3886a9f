use core::fmt;

/// The reason that a statement cannot be executed. The controller stops the task and shows a number; these numbers are the
/// project's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Error {
    /// The variable has no value.
    Undefined,
    /// A real where a string is needed, or vice versa.
    Type,
    /// An index that is not a whole number from 0 to 9999.
    Index,
    /// An argument that the function does not take.
    Argument,
    /// More nested calls of programs than the stack allows.
    Depth,
    /// A division by zero.
    Division,
}

impl Error {
    /// Returns the error's number, which is negative.
    pub const fn number(self) -> i32 {
        match self {
            Error::Undefined => -101,
            Error::Type => -102,
            Error::Index => -103,
            Error::Argument => -104,
            Error::Depth => -105,
            Error::Division => -106,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self {
            Error::Undefined => "a variable has no value",
            Error::Type => "a value is of another type",
            Error::Index => "an index is not a whole number from 0 to 9999",
            Error::Argument => "a function does not take this value",
            Error::Depth => "too many programs call one another",
            Error::Division => "division by zero",
        };
        write!(f, "({}) {text}", self.number())
    }
}

/// An error, and where the task has stopped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The kind of error.
    pub error: Error,
    /// The name of the program that has stopped.
    pub program: String,
    /// The line of the source, from 1.
    pub line: usize,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} in {} at line {}", self.error, self.program, self.line)
    }
}

impl core::error::Error for Fault {}

/// A line that cannot be loaded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ParseError {
    /// The number of the line, from 1; 0 for the whole source.
    pub line: usize,
    /// The reason, in words.
    pub why: String,
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.why)
    }
}

impl core::error::Error for ParseError {}
