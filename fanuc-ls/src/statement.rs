use crate::error::Reason;
use crate::instruction::Instruction;
use crate::text::{Fault, after_blanks, digits, indent, line_number};

/// A statement of `/MN` as it is in the text: its number, its instruction and its end.
///
/// Most are a line. A long one continues in lines that begin with `:`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Statement<'a> {
    text: &'a str,
    nested: bool,
}

impl<'a> Statement<'a> {
    pub(crate) fn new(text: &'a str, nested: bool) -> Self {
        Self { text, nested }
    }

    /// Returns the whole statement, without the end of its last line.
    pub fn text(&self) -> &'a str {
        self.text
    }

    /// Returns whether it is a line of the block that belongs to the motion above it (`TB`, `TA`). Such a line has a number of
    /// its own count, or no number.
    pub fn is_nested(&self) -> bool {
        self.nested
    }

    /// Returns the number of the statement. Post-processors leave it out.
    pub fn number(&self) -> Option<usize> {
        let (digits, _) = self.head().ok()?;
        line_number(digits)
    }

    /// Returns the text of the instruction between the first `:` and the last `;`, without the blanks around it.
    pub fn body(&self) -> &'a str {
        let body = self.head().map_or(self.text, |(_, body)| body);
        close(body).0.trim()
    }

    /// Returns [`body`](Self::body), or `None` without a `:` before it.
    pub(crate) fn place(&self) -> Option<&'a str> {
        self.head().ok().map(|_| self.body())
    }

    /// Returns the instruction as a value. An instruction that is not understood is [`Instruction::Other`].
    pub fn instruction(&self) -> Instruction {
        self.decode().unwrap_or_else(|_| Instruction::Other(crate::text::join_lines(self.body())))
    }

    /// Returns the instruction, or its fault.
    pub(crate) fn decode(&self) -> Result<Instruction, Fault<'a>> {
        if self.nested {
            return Ok(Instruction::Nested(self.text.trim_end().into()));
        }
        let (digits, body) = self.head()?;
        if digits.len() > 9 && line_number(digits).is_none() {
            return Err(Fault { at: digits, reason: Reason::LineNumber });
        }
        let (body, rest) = close(body);
        match rest {
            Some("") => Instruction::decode(body),
            Some(rest) => Err(Fault { at: rest, reason: Reason::AfterInstruction }),
            None => {
                let end = self.text.get(self.text.trim_end().len()..).unwrap_or("");
                Err(Fault { at: end, reason: Reason::InstructionEnd })
            }
        }
    }

    /// Returns the digits before the `:`, and the text after it.
    #[inline]
    fn head(&self) -> Result<(&'a str, &'a str), Fault<'a>> {
        let start = after_blanks(self.text);
        let (digits, rest) = start.split_at_checked(digits(start)).unwrap_or(("", start));
        match indent(rest).strip_prefix(':') {
            Some(body) => Ok((digits, body)),
            None => Err(Fault { at: start, reason: Reason::LineNumber }),
        }
    }
}

/// Returns the text before the `;` that closes an instruction, and the text after it on its line; `None` without a `;`.
fn close(body: &str) -> (&str, Option<&str>) {
    let trimmed = body.trim_end();
    if let Some(closed) = trimmed.strip_suffix(';') {
        return (closed, Some(""));
    }
    // A comment may contain semicolons.
    let last_line = trimmed.rfind('\n').map_or(0, |at| at + 1);
    match trimmed.rfind(';').filter(|&at| at >= last_line && !body.trim_start().starts_with('!')) {
        Some(at) => {
            let (closed, rest) = trimmed.split_at_checked(at).unwrap_or((trimmed, ""));
            (closed, Some(rest.get(1..).unwrap_or("").trim_start()))
        }
        None => (trimmed, None),
    }
}
