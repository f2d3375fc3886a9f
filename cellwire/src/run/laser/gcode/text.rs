//! Faults of a program's text that the parser of G-code does not report, but reads as another program.

/// The longest number of a G, M or T word. The parser overflows with ten digits.
const MAX_DIGITS: usize = 6;

/// Returns the faults of a text, each with its line.
pub(super) fn faults(text: &str) -> impl Iterator<Item = (u64, String)> {
    let (mut has_begun, mut has_ended) = (false, false);
    (1..).zip(text.split('\n')).filter_map(move |(number, line)| {
        let line = line.strip_suffix('\r').unwrap_or(line);
        let code = match code(line) {
            Ok(code) => code,
            Err(why) => return Some((number, why.to_owned())),
        };
        let code = code.trim();
        let fault = if line.contains('\r') {
            Some("a carriage return without a line feed: end each line with a line feed".into())
        } else if has_ended && !code.is_empty() {
            Some("text after the % that ends the program".into())
        } else if code.contains('%') && code != "%" {
            Some("% is not alone in its line".into())
        } else if code.starts_with('/') {
            Some("a line that begins with / is optional, which is not supported".into())
        } else {
            too_long(code).map(|word| format!("{word} is not supported"))
        };
        has_ended |= code == "%" && has_begun;
        has_begun |= !code.is_empty();
        fault.map(|fault| (number, fault))
    })
}

/// Returns a line without its comments. The parser reads on after the end of a line until the `)`, and counts each `(`
/// within a comment.
fn code(line: &str) -> Result<String, &'static str> {
    let (mut code, mut rest) = (String::new(), line);
    while let Some((before, comment)) = rest.find(['(', ';']).and_then(|at| rest.split_at_checked(at)) {
        code.push_str(before);
        let Some(comment) = comment.strip_prefix('(') else { return Ok(code) };
        let (comment, after) =
            comment.split_once(')').ok_or("a comment begins with ( and has no ) in its line")?;
        if comment.contains('(') {
            return Err("a comment has a ( within it");
        }
        code.push(' ');
        rest = after;
    }
    code.push_str(rest);
    Ok(code)
}

fn too_long(code: &str) -> Option<String> {
    code.match_indices(['G', 'g', 'M', 'm', 'T', 't']).find_map(|(at, letter)| {
        let number = code.get(at + 1..)?.trim_start();
        let digits = number.split(|c: char| !c.is_ascii_digit()).next()?;
        (digits.len() > MAX_DIGITS).then(|| format!("{letter}{digits}"))
    })
}
