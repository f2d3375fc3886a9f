//! Hex dumps as text2pcap reads them, and as Wireshark writes them when it follows a stream: an offset, and bytes.
//!
//! Both ends are told apart by `O` and `I` before the bytes, or by lines that stand further to the right, as Wireshark has those of the server.

use std::io::{BufRead, BufReader, Read};
use std::time::Duration;

use anyhow::{Context, Result, ensure};

use super::{Fault, Flow, Found, Line, Packet, Summary};

/// No line is longer.
const MAX_LINE: u64 = 1 << 16;
/// A line of bytes and characters has this many bytes.
const BYTES_A_LINE: usize = 16;
/// So far to the right are the lines of the other end.
const SHIFT: usize = 4;

pub(super) fn read(
    input: BufReader<Box<dyn Read>>,
    mut take: impl FnMut(Found<'_>) -> Result<()>,
) -> Result<Summary> {
    let (mut lines, mut dump) = (Lines::new(input), Dump { by_keeper: true, ..Dump::default() });
    while let Some(text) = lines.next()? {
        let text = text.replace('\t', "    ");
        let text = text.trim_end();
        if text.trim_start().starts_with('#') {
            continue;
        }
        if let Some((indent, offset, bytes)) = bytes(text) {
            dump.take(lines.number, indent, offset, &bytes, &mut take)?;
        } else {
            dump.about(text);
        }
    }
    ensure!(dump.packets > 0, "the input is not a hex dump: no line has an offset and bytes");
    Ok(Summary { packets: dump.packets, ..Summary::default() })
}

/// Whether a text begins as a dump: a line with bytes has an offset of four digits or more, 0 in the first, and what follows in the next.
pub fn is_dump(text: &str) -> bool {
    let offset = |line: &str| {
        line.trim_start_matches(['>', ' '])
            .split(' ')
            .next()
            .map_or(0, |word| word.trim_end_matches(':').len())
    };
    let found = text.lines().filter_map(|line| {
        let line = line.replace('\t', "    ");
        Some((offset(&line), bytes(line.trim_end())?))
    });
    let found: Vec<_> = found.take(3).collect();
    let Some((digits, (_, 0, first))) = found.first() else { return false };
    // With as many digits in each offset, the second line begins a packet, goes on, or is the other end's.
    *digits >= 4
        && found
            .get(1)
            .is_none_or(|(second, (_, at, _))| second == digits && (*at == 0 || *at == first.len() as u64))
}

/// The lines of a text.
pub(super) struct Lines {
    input: BufReader<Box<dyn Read>>,
    text: Vec<u8>,
    /// Of the last line, from 1.
    pub(super) number: u64,
}

impl Lines {
    pub(super) fn new(input: BufReader<Box<dyn Read>>) -> Self {
        Self { input, text: Vec::new(), number: 0 }
    }

    pub(super) fn next(&mut self) -> Result<Option<String>> {
        self.text.clear();
        self.number += 1;
        let read = self.input.by_ref().take(MAX_LINE).read_until(b'\n', &mut self.text);
        let read = read.with_context(|| format!("line {}: cannot read the input", self.number))?;
        Ok((read > 0).then(|| String::from_utf8_lossy(&self.text).into_owned()))
    }
}

#[derive(Default)]
struct Dump {
    packets: u64,
    at: Option<Duration>,
    by_keeper: bool,
    /// `O` or `I` has said who sends.
    is_marked: bool,
    /// Where the first line begins.
    margin: Option<usize>,
    /// The offset of the next byte of each end.
    next: [u64; 2],
}

impl Dump {
    fn take(
        &mut self,
        number: u64,
        indent: usize,
        offset: u64,
        bytes: &[u8],
        take: &mut impl FnMut(Found<'_>) -> Result<()>,
    ) -> Result<()> {
        let margin = *self.margin.get_or_insert(indent);
        if !self.is_marked {
            self.by_keeper = indent < margin + SHIFT;
        }
        let flow = Flow::Kept(Line::Dump, self.by_keeper);
        let [first, second] = &mut self.next;
        let next = if self.by_keeper { first } else { second };
        // A packet begins, or the last one goes on.
        self.packets += u64::from(offset == 0 || self.packets == 0);
        if offset != 0 && offset != *next {
            let why = format!("the offset is {offset:x}, expected 0 or {next:x}");
            take(Found::Fault(number, Fault::Line { why }))?;
        }
        *next = offset + bytes.len() as u64;
        take(Found::Packet(Packet { number, at: self.at, flow, segment: None, payload: bytes, missing: 0 }))
    }

    /// What stands between packets: who sends the next, and when.
    fn about(&mut self, text: &str) {
        for word in text.split_whitespace() {
            match word {
                "O" | "o" | "I" | "i" => {
                    (self.by_keeper, self.is_marked) = (word.eq_ignore_ascii_case("O"), true);
                }
                _ => self.at = time(word).or(self.at),
            }
        }
    }
}

/// A line with bytes: how far to the right it begins, its offset, and they.
fn bytes(text: &str) -> Option<(usize, u64, Vec<u8>)> {
    // A letter may have cited it.
    let line = text.trim_start_matches(['>', ' ']);
    let (word, mut rest) = line.split_once(' ')?;
    let offset = word.trim_end_matches(':');
    if offset.len() < 3 {
        return None;
    }
    let offset = u64::from_str_radix(offset, 16).ok()?;
    let mut bytes = Vec::new();
    loop {
        let word = rest.trim_start();
        let gap = rest.len() - word.len();
        // What follows a wider gap are the same bytes as characters.
        if !bytes.is_empty() && (gap > 2 || gap > 1 && bytes.len() >= BYTES_A_LINE) {
            break;
        }
        let (digits, after) = word.find(' ').map_or((word, ""), |end| word.split_at(end));
        let is_hex = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
        if !is_hex || ![2, 4, 8].contains(&digits.len()) {
            break;
        }
        bytes.extend(cellwire_links::vectors::unhex(digits).ok()?);
        rest = after;
    }
    (!bytes.is_empty()).then_some((text.len() - line.len(), offset, bytes))
}

/// A time of the day, or seconds.
pub(super) fn time(word: &str) -> Option<Duration> {
    let parts: Vec<&str> = word.split(':').collect();
    let (whole, seconds) = match *parts {
        [hours, minutes, seconds] => {
            (hours.parse::<u64>().ok()? * 3600 + minutes.parse::<u64>().ok()? * 60, seconds)
        }
        [seconds] if seconds.contains('.') => (0, seconds),
        _ => return None,
    };
    let (seconds, fraction) = seconds.split_once('.').unwrap_or((seconds, ""));
    let nanoseconds = format!("{fraction:0<9}");
    let nanoseconds: u32 = nanoseconds.get(..9)?.parse().ok()?;
    Some(Duration::new(whole.checked_add(seconds.parse().ok()?)?, nanoseconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dump(text: &str) -> Vec<String> {
        let mut found = Vec::new();
        let input: Box<dyn Read> = Box::new(std::io::Cursor::new(text.as_bytes().to_vec()));
        read(BufReader::new(input), |it| {
            found.push(match it {
                Found::Packet(Packet { at, flow: Flow::Kept(_, by_keeper), payload, .. }) => {
                    let at = at.map_or_else(String::new, |at| format!("{} ", at.as_secs_f64()));
                    format!("{at}{} {payload:02x?}", if by_keeper { ">" } else { "<" })
                }
                other => format!("{other:?}"),
            });
            Ok(())
        })
        .unwrap();
        found
    }

    #[test]
    fn the_forms_of_other_programs_are_read() {
        assert_eq!(dump("0000 05\n"), ["> [05]"]);
        assert_eq!(dump("000000 61 62 63 ........\n000003 64\n"), ["> [61, 62, 63]", "> [64]"]);
        let marked = "I\n10:00:01.5\n0000 05\nO 10:00:02\n0000 06 07\n";
        assert_eq!(dump(marked), ["36001.5 < [05]", "36002 > [06, 07]"]);
        // xxd, hexdump -C, and Wireshark's stream.
        assert_eq!(dump("00000000: 4142 43                                  AB\n"), ["> [41, 42, 43]"]);
        assert_eq!(dump("00000000  41 42 43  |ABC|\n00000003\n"), ["> [41, 42, 43]"]);
        let sixteen = "00000000  41 42 43 44 45 46 47 48  41 42 43 44 45 46 47 48  ab cd ef";
        assert_eq!(dump(sixteen), [format!("> {:02x?}", b"ABCDEFGHABCDEFGH")]);
        let stream = "00000000  01 02   ..\n    00000000  03   .\n00000002  04   .\n    00000001  05   .\n";
        assert_eq!(dump(stream), ["> [01, 02]", "< [03]", "> [04]", "< [05]"]);
    }

    #[test]
    fn an_offset_that_is_not_the_next_is_said() {
        let found = dump("0000 01 02\n0008 03\n");
        assert!(found[1].contains("the offset is 8, expected 0 or 2"), "{found:?}");
        let input: Box<dyn Read> = Box::new(&b"nothing"[..]);
        assert!(read(BufReader::new(input), |_| Ok(())).is_err());
    }
}
