//! Lines as statements.

use crate::error::ParseError;
use crate::expression::{Expression, Reader, VariableRef};
use crate::lexer::tokens;
use crate::names::{Names, Variable};
use crate::routine::{Body, Routine};
use crate::statement::{Statement, StatementKind};

/// Parses one program: its parameters and its statements, with blocks resolved to indices.
pub(crate) fn routine(body: &Body<'_>, names: &mut Names) -> Result<Routine, ParseError> {
    names.locals.clear();
    let fail = |line: usize| move |why: String| ParseError { line, why };
    let (name, parameters) = head(body.head, names).map_err(fail(body.line))?;
    let mut blocks = Blocks { statements: Vec::new(), open: Vec::new() };
    for (line, text) in &body.lines {
        if *text == ".END" {
            blocks.statements.push(Statement { line: *line, what: StatementKind::Return });
            continue;
        }
        let tokens = tokens(text).map_err(fail(*line))?;
        if !tokens.is_empty() {
            let mut reader = Reader::new(&tokens, names);
            let what = blocks.statement(&mut reader).map_err(fail(*line))?;
            if !reader.is_at_end() {
                return Err(fail(*line)("more than one statement".into()));
            }
            blocks.statements.push(Statement { line: *line, what });
        }
    }
    if !blocks.open.is_empty() || body.lines.last().is_none_or(|(_, text)| *text != ".END") {
        return Err(fail(body.line)("a block or the program has no end".into()));
    }
    Ok(Routine { name, parameters, locals: names.locals.len(), statements: blocks.statements })
}

/// Parses `name (.a, .$b)`
fn head(head: &str, names: &mut Names) -> Result<(String, Vec<usize>), String> {
    let tokens = tokens(head)?;
    let mut reader = Reader::new(&tokens, names);
    let name = reader.name()?;
    let mut parameters = Vec::new();
    reader.needs("(")?;
    while !reader.takes(")") {
        let VariableRef { variable: Variable::Local(at), index: None } = reader.place()? else {
            return Err("a parameter is a local variable".into());
        };
        parameters.push(at);
        reader.takes(",");
    }
    Ok((name, parameters))
}

struct Blocks {
    statements: Vec<Statement>,
    open: Vec<Block>,
}

/// A block that has no end yet, and where its statement is.
enum Block {
    If(usize),
    Else(usize),
    While(usize),
    Do(usize),
    For(usize),
}

impl Blocks {
    fn statement(&mut self, reader: &mut Reader<'_>) -> Result<StatementKind, String> {
        let at = self.statements.len();
        for (word, is_loop) in [("IF", false), ("WHILE", true)] {
            if reader.takes(word) {
                let condition = reader.expression()?;
                reader.needs(if is_loop { "DO" } else { "THEN" })?;
                self.open.push(if is_loop { Block::While(at) } else { Block::If(at) });
                return Ok(StatementKind::Unless(condition, usize::MAX));
            }
        }
        if reader.takes("ELSE") {
            let Some(Block::If(begin)) = self.open.pop() else { return Err("ELSE without its IF".into()) };
            self.resolve(begin, at + 1);
            self.open.push(Block::Else(at));
            return Ok(StatementKind::GoTo(usize::MAX));
        }
        if reader.takes("DO") {
            self.open.push(Block::Do(at));
            return Ok(StatementKind::Nothing);
        }
        if reader.takes("UNTIL") {
            let Some(Block::Do(begin)) = self.open.pop() else { return Err("UNTIL without its DO".into()) };
            return Ok(StatementKind::Unless(reader.expression()?, begin));
        }
        if reader.takes("FOR") {
            return self.begin_for(reader, at);
        }
        if reader.takes("END") {
            return self.end(at);
        }
        simple(reader)
    }

    fn begin_for(&mut self, reader: &mut Reader<'_>, at: usize) -> Result<StatementKind, String> {
        let variable = reader.place()?;
        reader.needs("=")?;
        let from = reader.expression()?;
        reader.needs("TO")?;
        let to = reader.expression()?;
        let kept = reader.names.locals.len();
        reader.names.locals.insert(format!("FOR {at}"), kept);
        self.open.push(Block::For(at));
        Ok(StatementKind::For { variable, from, to, kept, end: usize::MAX })
    }

    fn end(&mut self, at: usize) -> Result<StatementKind, String> {
        match self.open.pop().ok_or("END without a block")? {
            Block::If(begin) | Block::Else(begin) => {
                self.resolve(begin, at);
                Ok(StatementKind::Nothing)
            }
            Block::While(begin) => {
                self.resolve(begin, at + 1);
                Ok(StatementKind::GoTo(begin))
            }
            Block::For(begin) => {
                self.resolve(begin, at + 1);
                let Some(Statement { what: StatementKind::For { variable, kept, .. }, .. }) =
                    self.statements.get(begin)
                else {
                    return Err("END without its FOR".into());
                };
                Ok(StatementKind::Next { variable: variable.clone(), kept: *kept, begin })
            }
            Block::Do(_) => Err("a DO ends with UNTIL".into()),
        }
    }

    fn resolve(&mut self, begin: usize, target: usize) {
        if let Some(Statement {
            what: StatementKind::Unless(_, to) | StatementKind::GoTo(to) | StatementKind::For { end: to, .. },
            ..
        }) = self.statements.get_mut(begin)
        {
            *to = target;
        }
    }
}

/// Parses a statement that is not part of a block.
fn simple(reader: &mut Reader<'_>) -> Result<StatementKind, String> {
    if reader.takes("CALL") {
        return call(reader);
    }
    if reader.takes("TIMER") {
        let timer = reader.expression()?;
        reader.needs("=")?;
        return Ok(StatementKind::SetTimer(timer, reader.expression()?));
    }
    if reader.takes("SPEED") || reader.takes("ACCURACY") {
        reader.expression()?;
        let _ = reader.takes("MM") && reader.takes("/") && reader.takes("S");
        let _ = reader.takes("ALWAYS");
        return Ok(StatementKind::Nothing);
    }
    let what = if reader.takes("RETURN") {
        StatementKind::Return
    } else if reader.takes("BREAK") {
        StatementKind::Arrive
    } else if reader.takes("WAIT") {
        StatementKind::Wait(reader.expression()?)
    } else if reader.takes("TWAIT") {
        StatementKind::WaitTime(reader.expression()?)
    } else if reader.takes("SIGNAL") {
        StatementKind::Signal(reader.list()?)
    } else if reader.takes("LMOVE") {
        StatementKind::Move { straight: true, to: reader.expression()? }
    } else if reader.takes("JMOVE") {
        StatementKind::Move { straight: false, to: reader.expression()? }
    } else if reader.takes("PRINT") {
        StatementKind::Print(reader.list()?)
    } else if let Some(network) = network(reader)? {
        network
    } else {
        reader.takes("POINT");
        let place = reader.place()?;
        reader.needs("=")?;
        StatementKind::Assign(place, reader.expression()?)
    };
    Ok(what)
}

fn call(reader: &mut Reader<'_>) -> Result<StatementKind, String> {
    let name = reader.name()?;
    let called = *reader.names.programs.get(&name).ok_or_else(|| format!("there is no program {name}"))?;
    let arguments = if reader.takes("(") {
        let list = if reader.takes(")") { Vec::new() } else { reader.list()? };
        if !list.is_empty() {
            reader.needs(")")?;
        }
        list
    } else {
        Vec::new()
    };
    Ok(StatementKind::Call(called, arguments))
}

fn network(reader: &mut Reader<'_>) -> Result<Option<StatementKind>, String> {
    let what = if reader.takes("TCP_CONNECT") {
        let socket = reader.place()?;
        let port = next(reader)?;
        StatementKind::Connect { socket, port, ip: next_place(reader)?, timeout: next(reader)? }
    } else if reader.takes("TCP_SEND") {
        let result = reader.place()?;
        let (socket, strings) = (next(reader)?, next_place(reader)?);
        StatementKind::Send { result, socket, strings, count: next(reader)?, timeout: next(reader)? }
    } else if reader.takes("TCP_RECV") {
        let result = reader.place()?;
        let (socket, strings) = (next(reader)?, next_place(reader)?);
        let (count, timeout) = (next_place(reader)?, next(reader)?);
        StatementKind::Receive { result, socket, strings, count, timeout, longest: next(reader)? }
    } else if reader.takes("TCP_CLOSE") {
        StatementKind::Close { result: reader.place()?, socket: next(reader)? }
    } else if reader.takes("TCP_STATUS") {
        let count = reader.place()?;
        let mut column = || next_place(reader);
        StatementKind::Status { count, columns: [column()?, column()?, column()?, column()?, column()?] }
    } else {
        return Ok(None);
    };
    Ok(Some(what))
}

fn next(reader: &mut Reader<'_>) -> Result<Expression, String> {
    reader.needs(",")?;
    reader.expression()
}

fn next_place(reader: &mut Reader<'_>) -> Result<VariableRef, String> {
    reader.needs(",")?;
    reader.place()
}

#[cfg(test)]
mod tests {
    use crate::Program;

    fn why(lines: &str) -> String {
        Program::parse(&format!(".PROGRAM p ()\n{lines}\n.END")).unwrap_err().to_string()
    }

    #[test]
    fn what_breaks_a_limit_is_not_loaded() {
        assert_eq!(why("a = 1 b = 2"), "line 2: more than one statement");
        assert_eq!(why("x\na.name.of.sixteen = 1"), "line 2: = is missing before None");
        assert_eq!(why("a.name.of.sixteen = 1"), "line 2: a.name.of.sixteen has more than 15 characters");
        assert_eq!(why("IF a THEN"), "line 1: a block or the program has no end");
        assert_eq!(why("CALL q"), "line 2: there is no program q");
        assert_eq!(why("FREE a"), "line 2: FREE is no variable");
        assert_eq!(why("a = $LEFT (b)"), "line 2: Left takes 2 to 2 values");
        assert!(Program::parse("a = 1").is_err() && Program::parse(".PROGRAM p ()\na = 1").is_err());
    }
}
