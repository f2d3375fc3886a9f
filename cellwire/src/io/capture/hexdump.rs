//! Hex dumps as text2pcap reads them, and as Wireshark writes them when it follows a stream: an offset, and bytes.
//!
//! The two ends are distinguished by `O` and `I` before the bytes, or by the indentation of lines: Wireshark indents those of the
//! server.

use std::io::{BufReader, Read};
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail, ensure};

use super::{CaptureItem, Fault, Flow, Line, Packet, Summary};

/// The largest dump, in bytes: the leftmost line may be the last one.
const MAX_DUMP: u64 = 1 << 28;
/// A line of bytes and characters has this many bytes.
const BYTES_A_LINE: usize = 16;
/// The lines of the other end stand at least this far to the right.
const SHIFT: usize = 4;
/// The most bytes that a line `*` stands for.
const MAX_REPEATED: u64 = 1 << 24;

pub(super) fn read(
    input: BufReader<Box<dyn Read>>,
    mut take: impl FnMut(CaptureItem<'_>) -> Result<()>,
) -> Result<Summary> {
    let mut text = Vec::new();
    let length = input.take(MAX_DUMP).read_to_end(&mut text).context("cannot read the input")?;
    ensure!((length as u64) < MAX_DUMP, "the dump is larger than {MAX_DUMP} bytes");
    let text = String::from_utf8_lossy(&text);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    if let Some((number, why)) = refused(text) {
        bail!("line {number}: {why}");
    }
    let margin = rows(text).map(|(_, row)| row.indent).min();
    let margin =
        margin.ok_or_else(|| anyhow!("the input is not a hex dump: no line has an offset and bytes"))?;
    let radix = radix(text);
    let mut dump = Dump { margin, radix: radix.unwrap_or(16), by_keeper: true, ..Dump::default() };
    for (number, line) in lines(text) {
        match Row::new(&line) {
            Some(row) => dump.take(number, &row, &mut take)?,
            None if line.trim() == "*" => {
                // The offsets of od have seven digits, octal ones by default.
                ensure!(
                    radix.is_some() || dump.digits != 7,
                    "line {number}: the dump does not show whether its offsets are octal: dump again with -v"
                );
                dump.is_repeated = true;
            }
            None => dump.about(number, line.trim(), &mut take)?,
        }
    }
    Ok(Summary { packets: dump.packets, ..Summary::default() })
}

/// Returns whether a text begins as a dump: a line with bytes has an offset of four digits or more, 0 in the first, and the
/// end of the previous one in the next. So does a dump that is refused for the form of its bytes.
pub fn is_dump(text: &str) -> bool {
    let found: Vec<Row> = rows(text).map(|(_, row)| row).take(3).collect();
    if refused(text).is_some() {
        // Plain hex may have words, too. The offsets of od and hexdump have six or seven digits, those of xxd a colon.
        let begins = |first: &Row| {
            let has_offset = first.has_colon || first.widest == 2 || matches!(first.offset.len(), 6 | 7);
            has_offset && first.at(16) == Some(0)
        };
        return found.first().is_none_or(begins);
    }
    let Some(first) = found.first() else { return false };
    // With as many digits in each offset, the second line begins a packet, continues, or is the other end's.
    first.offset.len() >= 4
        && first.at(16) == Some(0)
        && found.get(1).is_none_or(|second| {
            second.offset.len() == first.offset.len()
                && (second.at(16) == Some(0)
                    || RADIXES.iter().any(|radix| second.at(*radix) == Some(first.bytes.len() as u64)))
        })
}

/// Returns the lines of a dump with their numbers, without comments.
fn lines(text: &str) -> impl Iterator<Item = (u64, String)> {
    let lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim_start().starts_with('#'));
    lines.map(|(number, line)| (number, line.replace('\t', "    ").trim_end().to_owned()))
}

fn rows(text: &str) -> impl Iterator<Item = (u64, Row)> {
    lines(text).filter_map(|(number, line)| Some((number, Row::new(&line)?)))
}

/// Returns the first line of a dump that has other text than bytes in sequence, and the reason.
fn refused(text: &str) -> Option<(u64, &'static str)> {
    let (mut words, mut is_proved) = (None, false);
    for (number, line) in lines(text) {
        let Some((offset, rest)) = line.trim_start_matches(['>', ' ']).split_once(' ') else { continue };
        let first = rest.split_whitespace().next().unwrap_or_default();
        let is_zero = |digits: &str| !digits.is_empty() && digits.bytes().all(|digit| digit == b'0');
        let is_hex = |word: &str| word.bytes().all(|digit| digit.is_ascii_hexdigit());
        if offset.strip_suffix(':').and_then(|it| it.strip_prefix("0x")).is_some_and(is_zero) && is_hex(first)
        {
            return Some((
                number,
                "a dump of tcpdump has whole packets: write them to a file with `tcpdump -w`",
            ));
        }
        let mut words_of_line = rest.trim_start().split("  ").next().unwrap_or_default().split(' ');
        let is_bits = |word: &str| word.len() == 8 && word.bytes().all(|digit| matches!(digit, b'0' | b'1'));
        if offset.ends_with(':') && words_of_line.all(is_bits) {
            return Some((number, "a dump of bits: dump bytes with `xxd`"));
        }
        let is_od = matches!(offset.len(), 6 | 7) && is_zero(offset);
        if is_od && (!is_hex(first) || !matches!(first.len(), 2 | 4 | 8)) {
            return Some((
                number,
                "a dump of octal or decimal numbers or of characters: dump bytes with `hexdump -C`",
            ));
        }
        let Some(row) = Row::new(&line) else { continue };
        if row.has_wide_gap {
            return Some((number, "a dump of decimal numbers, or of words: dump bytes with `hexdump -C`"));
        }
        if row.widest == 2 {
            continue;
        }
        match row.order() {
            Some(true) => is_proved = true,
            Some(false) => {
                return Some((number, "words in little-endian order: dump bytes with `xxd`, without -e"));
            }
            None => {}
        }
        // The words of xxd are bytes in their order, those of hexdump and od are not.
        if row.widest > 4 || !row.has_colon {
            words = words.or(Some(number));
        }
    }
    words.filter(|_| !is_proved).map(|number| {
        (number, "words of two or four bytes, whose byte order the dump does not show: dump bytes with `hexdump -C` or `xxd`")
    })
}

/// The number systems of offsets: od writes octal ones, or decimal ones with `-A d`.
const RADIXES: [u32; 3] = [16, 8, 10];

/// Returns the number system in which the offset of the second line is the end of the first, if the dump shows it.
fn radix(text: &str) -> Option<u32> {
    let mut last: Option<Row> = None;
    for (_, row) in rows(text) {
        if let Some(last) = last.filter(|last| last.at(16) == Some(0) && row.at(16) != Some(0)) {
            let fits = |radix: &&u32| row.at(**radix) == Some(last.bytes.len() as u64);
            return RADIXES.iter().find(fits).copied();
        }
        last = Some(row);
    }
    None
}

/// A line with bytes.
struct Row {
    /// The characters before the offset.
    indent: usize,
    /// The digits of the offset.
    offset: String,
    has_colon: bool,
    bytes: Vec<u8>,
    /// The digits of the longest word.
    widest: usize,
    /// Two spaces or more stand between the first two words.
    has_wide_gap: bool,
    /// The same bytes as characters.
    characters: String,
}

impl Row {
    fn new(text: &str) -> Option<Self> {
        // A letter may have cited it.
        let line = text.trim_start_matches(['>', ' ']);
        let (word, mut rest) = line.split_once(' ')?;
        let offset = word.trim_end_matches(':');
        let has_colon = word != offset;
        if offset.len() < 3 || !offset.bytes().all(|digit| digit.is_ascii_hexdigit()) {
            return None;
        }
        let (mut bytes, mut widest, mut words, mut has_wide_gap) = (Vec::new(), 0, 0, false);
        loop {
            let word = rest.trim_start();
            let gap = rest.len() - word.len();
            let (digits, after) = word.find(' ').map_or((word, ""), |end| word.split_at(end));
            let is_hex = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
            if !is_hex || ![2, 4, 8].contains(&digits.len()) {
                break;
            }
            // The same bytes as characters follow a wider gap.
            let is_full = bytes.len() >= BYTES_A_LINE || has_colon && widest > 2;
            if words > 0 && (gap > 2 || gap > 1 && is_full) {
                break;
            }
            has_wide_gap |= words == 1 && gap > 1;
            bytes.extend(cellwire_links::vectors::unhex(digits).ok()?);
            widest = widest.max(digits.len());
            words += 1;
            rest = after;
        }
        let characters = rest.trim_start().to_owned();
        let (indent, offset) = (text.len() - line.len(), offset.to_owned());
        (!bytes.is_empty()).then_some(Self {
            indent,
            offset,
            has_colon,
            bytes,
            widest,
            has_wide_gap,
            characters,
        })
    }

    fn at(&self, radix: u32) -> Option<u64> {
        u64::from_str_radix(&self.offset, radix).ok()
    }

    /// Returns whether the characters show the bytes in their order: false if those of each word are reversed, `None` if
    /// they show neither.
    fn order(&self) -> Option<bool> {
        let shows = |bytes: &[u8]| {
            let shown = |(byte, character): (&u8, char)| {
                character == if byte.is_ascii_graphic() { *byte as char } else { character }
            };
            self.characters.chars().count() >= bytes.len()
                && bytes.iter().zip(self.characters.chars()).all(shown)
        };
        let reversed: Vec<u8> =
            self.bytes.chunks(self.widest / 2).flat_map(|word| word.iter().rev().copied()).collect();
        match (shows(&self.bytes), shows(&reversed)) {
            (true, false) => Some(true),
            (false, true) => Some(false),
            _ => None,
        }
    }
}

#[derive(Default)]
struct Dump {
    packets: u64,
    at: Option<Duration>,
    by_keeper: bool,
    /// `O` or `I` has stated the sender.
    is_marked: bool,
    /// The least indent.
    margin: usize,
    radix: u32,
    /// The offset of the next byte of each end.
    next: [u64; 2],
    /// The digits of the last offset.
    digits: usize,
    /// The last bytes, and whether a line `*` has repeated them.
    last: Vec<u8>,
    is_repeated: bool,
}

impl Dump {
    fn take(
        &mut self,
        number: u64,
        row: &Row,
        take: &mut impl FnMut(CaptureItem<'_>) -> Result<()>,
    ) -> Result<()> {
        if !self.is_marked {
            self.by_keeper = row.indent < self.margin + SHIFT;
        }
        let Some(offset) = row.at(self.radix) else {
            let why = format!("the offset {} is not a number in base {}", row.offset, self.radix);
            return take(CaptureItem::Fault(number, Fault::Line { why }));
        };
        self.repeat(number, offset, take)?;
        // A packet begins, or the last one continues.
        self.packets += u64::from(offset == 0 || self.packets == 0);
        let next = *self.next();
        if offset != 0 && offset != next {
            let why = format!("the offset is {offset:x}, expected 0 or {next:x}");
            take(CaptureItem::Fault(number, Fault::Line { why }))?;
        }
        *self.next() = offset + row.bytes.len() as u64;
        self.last.clone_from(&row.bytes);
        self.digits = row.offset.len();
        take(CaptureItem::Packet(self.packet(number, &row.bytes)))
    }

    /// Takes the bytes that a line `*` stands for, up to this offset.
    fn repeat(
        &mut self,
        number: u64,
        to: u64,
        take: &mut impl FnMut(CaptureItem<'_>) -> Result<()>,
    ) -> Result<()> {
        if !core::mem::take(&mut self.is_repeated) {
            return Ok(());
        }
        let length = to.saturating_sub(*self.next());
        let last = self.last.len() as u64;
        ensure!(length <= MAX_REPEATED, "line {number}: more than {MAX_REPEATED} repeated bytes");
        if last == 0 || !length.is_multiple_of(last) {
            let why =
                format!("the line * before it does not repeat the line before that to the offset {to:x}");
            return take(CaptureItem::Fault(number, Fault::Line { why }));
        }
        for _ in 0..length / last {
            take(CaptureItem::Packet(self.packet(number, &self.last)))?;
        }
        *self.next() += length;
        Ok(())
    }

    fn packet<'a>(&self, number: u64, payload: &'a [u8]) -> Packet<'a> {
        let flow = Flow::Kept(Line::Dump, self.by_keeper);
        Packet { number, at: self.at, flow, segment: None, payload, missing: 0 }
    }

    fn next(&mut self) -> &mut u64 {
        let [first, second] = &mut self.next;
        if self.by_keeper { first } else { second }
    }

    /// Handles a line between packets: the sender of the next one, and its time, or the offset of the end.
    fn about(
        &mut self,
        number: u64,
        text: &str,
        take: &mut impl FnMut(CaptureItem<'_>) -> Result<()>,
    ) -> Result<()> {
        if self.is_repeated
            && let Ok(end) = u64::from_str_radix(text, self.radix)
        {
            return self.repeat(number, end, take);
        }
        for word in text.split_whitespace() {
            match word {
                "O" | "o" | "I" | "i" => {
                    (self.by_keeper, self.is_marked) = (word.eq_ignore_ascii_case("O"), true);
                }
                _ => self.at = time(word).or(self.at),
            }
        }
        Ok(())
    }
}

/// Parses a time of the day, or seconds.
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
                CaptureItem::Packet(Packet { at, flow: Flow::Kept(_, by_keeper), payload, .. }) => {
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
    fn the_leftmost_lines_are_of_the_end_that_was_recorded() {
        let stream = "    00000000  03   .\n00000000  01 02   ..\n    00000001  05   .\n";
        assert_eq!(dump(stream), ["< [03]", "> [01, 02]", "< [05]"]);
        let shifted: String = stream.lines().map(|line| format!("> {line}\n")).collect();
        assert_eq!(dump(&shifted), ["< [03]", "> [01, 02]", "< [05]"]);
    }

    #[test]
    fn repeated_lines_and_offsets_of_od_are_read() {
        let repeated = "00000000  01 02\n*\n00000006  03\n00000007\n";
        assert_eq!(dump(repeated), ["> [01, 02]", "> [01, 02]", "> [01, 02]", "> [03]"]);
        let at_the_end = "0000000 01 02 03 04 05 06 07 08\n*\n0000020\n";
        let input: Box<dyn Read> = Box::new(at_the_end.as_bytes());
        let why = read(BufReader::new(input), |_| Ok(())).unwrap_err().to_string();
        assert_eq!(why, "line 2: the dump does not show whether its offsets are octal: dump again with -v");
        let octal = "0000000 01 02 03 04 05 06 07 08\n0000010 01 02 03 04 05 06 07 09\n*\n0000030\n";
        assert_eq!(dump(octal).len(), 3);
        assert!(dump("00000000  01 02\n*\n00000007  03\n")[1].contains("does not repeat"));
    }

    #[test]
    fn characters_show_the_order_of_words() {
        assert_eq!(dump("00000000: 61626364 65            abcde\n"), ["> [61, 62, 63, 64, 65]"]);
        let refused = |text: &str| refused(text).map(|(line, _)| line);
        assert_eq!(
            refused("00000000: 61626364 65666768  abcdefgh\n00000008: 00000000 00010203  ........\n"),
            None
        );
        assert_eq!(
            refused("00000000: 00000000 00010203  ........\n00000008: 64636261 68676665  abcdefgh\n"),
            Some(2)
        );
        assert_eq!(refused("00000000: 00000002 00010203  ........\n"), Some(1));
        assert_eq!(refused("00000000: 6162 6364  badc\n"), Some(1));
    }

    #[test]
    fn plain_hex_is_no_dump() {
        for text in ["0103 0000 000a c5cd\n", "8405  1234 abcd\n", "00000000 41424344 00000000\n"] {
            assert!(!is_dump(text), "{text}");
        }
        for text in ["0000000 0103 0a00\n0000004\n", "00000000: 0103 000a  ....\n", "00000000  01 03\n"] {
            assert!(is_dump(text), "{text}");
        }
    }

    #[test]
    fn an_offset_that_is_not_the_next_is_said() {
        let found = dump("0000 01 02\n0008 03\n");
        assert!(found[1].contains("the offset is 8, expected 0 or 2"), "{found:?}");
        let input: Box<dyn Read> = Box::new(&b"nothing"[..]);
        assert!(read(BufReader::new(input), |_| Ok(())).is_err());
    }
}
