//! A line of source as tokens.

/// The most characters of a name, without the marks before it.
pub(crate) const MAX_NAME_LEN: usize = 15;

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Token {
    Real(f32),
    Text(Vec<u8>),
    /// A name or a keyword, with its marks: `.` of a local one, `$` of a string.
    Name(String),
    /// An operator, or a mark between others.
    Mark(&'static str),
}

const MARKS: [&str; 18] =
    ["==", "<>", "<=", ">=", "=<", "=>", "(", ")", "[", "]", ",", ":", "=", "<", ">", "+", "-", "*"];

/// Parses the tokens of a line; a comment ends it.
pub(crate) fn tokens(line: &str) -> Result<Vec<Token>, String> {
    let mut tokens = Vec::new();
    let mut rest = line.trim_start();
    while let Some(first) = rest.chars().next() {
        if first == ';' {
            break;
        }
        let (token, after) = match first {
            '"' => text(rest)?,
            '0'..='9' => number(rest)?,
            '.' | '$' | '_' | 'a'..='z' | 'A'..='Z' => name(rest)?,
            _ => mark(rest)?,
        };
        tokens.push(token);
        rest = after.trim_start();
    }
    Ok(tokens)
}

fn text(rest: &str) -> Result<(Token, &str), String> {
    let (text, after) =
        rest.get(1..).and_then(|rest| rest.split_once('"')).ok_or("a string without its end")?;
    Ok((Token::Text(text.bytes().collect()), after))
}

fn number(rest: &str) -> Result<(Token, &str), String> {
    let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
    let (digits, after) = rest.split_at(end);
    let number = digits.parse().map_err(|_| format!("{digits} is not a number"))?;
    Ok((Token::Real(number), after))
}

fn name(rest: &str) -> Result<(Token, &str), String> {
    let begin = rest.find(|c| c != '.' && c != '$').unwrap_or(rest.len());
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '.' || c == '_';
    let end = rest.find(|c| !is_name(c) && c != '$').unwrap_or(rest.len());
    let (found, after) = rest.split_at(end);
    if found.get(begin..).is_none_or(|name| name.is_empty() || !name.chars().all(is_name)) {
        return Err(format!("{found} is not a name"));
    }
    if end - begin > MAX_NAME_LEN {
        return Err(format!("{found} has more than {MAX_NAME_LEN} characters"));
    }
    if found.eq_ignore_ascii_case(".end") || found.eq_ignore_ascii_case(".program") {
        return Err(format!("{found} is a mark of the file"));
    }
    Ok((Token::Name(found.into()), after))
}

fn mark(rest: &str) -> Result<(Token, &str), String> {
    let found = MARKS.into_iter().chain(["/"]).find_map(|mark| Some((mark, rest.strip_prefix(mark)?)));
    let (mark, after) = found.ok_or_else(|| format!("{rest} cannot be read"))?;
    let mark = match mark {
        "=<" => "<=",
        "=>" => ">=",
        mark => mark,
    };
    Ok((Token::Mark(mark), after))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_cut_into_tokens() {
        let line = "  IF (.$a == \"x;\") AND x.ok[.i+1] <> -2.5 THEN ; why";
        let words: Vec<String> = tokens(line).unwrap().iter().map(|token| format!("{token:?}")).collect();
        assert_eq!(words.len(), 17, "{words:?}");
        for wrong in ["\"open", "a.name.of.sixteen", "3.4.5", "x = &1", ". = 1", "a = .end"] {
            assert!(tokens(wrong).is_err(), "{wrong}");
        }
        assert!(tokens(".$name.of.fifteen = 1").is_ok());
    }
}
