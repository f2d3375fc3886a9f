//! The bytes that `socat -x`, or `socat -x -v`, has written of both directions: a line with the direction, the time and the
//! length, and lines of hex.

use std::io::{BufRead, BufReader, Read};
use std::time::{Duration, UNIX_EPOCH};

use anyhow::{Context, Result, bail, ensure};

use super::{CaptureItem, Fault, Flow, Line, Packet, Summary};

/// The longest line, in bytes: without -v, socat writes all bytes of a block in one.
const MAX_LINE: u64 = 1 << 24;

pub(super) fn read(
    mut input: BufReader<Box<dyn Read>>,
    mut take: impl FnMut(CaptureItem<'_>) -> Result<()>,
) -> Result<Summary> {
    let (mut packets, mut open, mut line) = (0, None::<Block>, Vec::new());
    for number in 1.. {
        line.clear();
        let length = input.by_ref().take(MAX_LINE).read_until(b'\n', &mut line);
        let length = length.with_context(|| format!("line {number}: cannot read the input"))? as u64;
        ensure!(length < MAX_LINE, "line {number} is longer than {MAX_LINE} bytes");
        let text = String::from_utf8_lossy(&line);
        let text = text.trim_end_matches(['\r', '\n']);
        if length > 0
            && let Some(block) = &mut open
            && block.extend(text)
        {
            if block.bytes.len() < block.length {
                continue;
            }
        } else if let Some(Block { bytes, length, .. }) = &open {
            // With -v alone the bytes are text, which does not show them all.
            ensure!(
                packets > 0 || !bytes.is_empty(),
                "line {number}: the bytes are not in hex: use `socat -x`"
            );
            let why = format!("{} of {length} bytes are in the block before it", bytes.len());
            take(CaptureItem::Fault(number, Fault::Line { why }))?;
        } else {
            open = Block::new(number, text);
            match length {
                0 => break,
                _ => continue,
            }
        }
        let Some(block) = open.take() else { continue };
        packets += 1;
        let Block { number: head, at, by_keeper, bytes, .. } = block;
        let flow = Flow::Kept(Line::Dump, by_keeper);
        take(CaptureItem::Packet(Packet {
            number: head,
            at,
            flow,
            segment: None,
            payload: &bytes,
            missing: 0,
        }))?;
        open = Block::new(number, text);
    }
    if packets == 0 {
        bail!("the input is not output of `socat -x`: no line has a direction, a time and a length");
    }
    Ok(Summary { packets, ..Summary::default() })
}

/// Returns whether a line begins a block: `> 2026/11/29 12:45:03.000206370  length=40 from=0 to=39`.
pub fn is_socat(line: &str) -> bool {
    Block::new(0, line).is_some()
}

/// Bytes of one direction.
struct Block {
    /// The line of its head, from 1.
    number: u64,
    at: Option<Duration>,
    /// The first address of socat's command line has sent them.
    by_keeper: bool,
    length: usize,
    bytes: Vec<u8>,
}

impl Block {
    fn new(number: u64, head: &str) -> Option<Self> {
        let mut words = head.split_whitespace();
        let by_keeper = match words.next()? {
            ">" => true,
            "<" => false,
            _ => return None,
        };
        let (day, clock) = (words.next()?, words.next()?);
        let length = words.next()?.strip_prefix("length=")?.parse().ok().filter(|length| *length > 0)?;
        words.next()?.strip_prefix("from=")?;
        Some(Self { number, at: time(day, clock), by_keeper, length, bytes: Vec::new() })
    }

    /// Appends the bytes of a line: a space and two digits for each, and after two spaces the same as text. False if it is
    /// another line.
    fn extend(&mut self, line: &str) -> bool {
        let Some(hex) = line.strip_prefix(' ') else { return false };
        let words = hex.split("  ").next().unwrap_or_default().split(' ');
        let bytes: Option<Vec<u8>> = words
            .map(|word| (word.len() == 2).then(|| u8::from_str_radix(word, 16).ok()).flatten())
            .collect();
        bytes.is_some_and(|bytes| {
            self.bytes.extend(&bytes);
            self.bytes.len() <= self.length
        })
    }
}

/// Returns the time since 1970, as if the machine of socat had UTC: socat names no zone. Its version 1.7.4 writes microseconds
/// with nine digits.
fn time(day: &str, clock: &str) -> Option<Duration> {
    let clock = match clock.split_once(".000") {
        Some((seconds, fraction)) if fraction.len() == 6 => format!("{seconds}.{fraction}"),
        _ => clock.into(),
    };
    let time = humantime::parse_rfc3339_weak(&format!("{} {clock}", day.replace('/', "-"))).ok()?;
    time.duration_since(UNIX_EPOCH).ok()
}

#[cfg(test)]
mod tests {
    use humantime::format_rfc3339_millis;

    use super::*;

    fn found(text: &str) -> Result<Vec<String>> {
        let mut found = Vec::new();
        let input: Box<dyn Read> = Box::new(std::io::Cursor::new(text.as_bytes().to_vec()));
        read(BufReader::new(input), |it| {
            found.push(match it {
                CaptureItem::Packet(Packet {
                    number, at, flow: Flow::Kept(_, by_keeper), payload, ..
                }) => {
                    let at = format_rfc3339_millis(UNIX_EPOCH + at.unwrap_or_default());
                    format!("{number} {at} {} {payload:02x?}", if by_keeper { ">" } else { "<" })
                }
                other => format!("{other:?}"),
            });
            Ok(())
        })?;
        Ok(found)
    }

    #[test]
    fn hex_with_and_without_text_is_read() {
        let plain = "2026/11/29 00:00:00 socat[7] N starting data transfer loop\n\
                     > 2026/11/29 00:00:03.000206370  length=3 from=0 to=2\n 0a 20 41\n\
                     < 2026/11/29 00:00:04.500000  length=1 from=0 to=0\n 05\n";
        let blocks = ["2 2026-11-29T00:00:03.206Z > [0a, 20, 41]", "4 2026-11-29T00:00:04.500Z < [05]"];
        assert_eq!(found(plain).unwrap(), blocks);
        let text = "2026/11/29 00:00:00 socat[7] N starting data transfer loop\n\
                    > 2026/11/29 00:00:03.000206370  length=3 from=0 to=2\n \
                    0a                                               .\n \
                    20 41                                             A\n--\n\
                    < 2026/11/29 00:00:04.500000  length=1 from=0 to=0\n \
                    05                                               .\n--\n";
        assert_eq!(found(text).unwrap(), [blocks[0], "6 2026-11-29T00:00:04.500Z < [05]"]);
    }

    #[test]
    fn a_block_that_is_not_whole_is_named() {
        let head = "> 2026/11/29 00:00:01.000000  length=3 from=0 to=2";
        let cut = format!("{head}\n 01 02\n{head}\n 03 04 05\n");
        let missing = "Fault(3, Line { why: \"2 of 3 bytes are in the block before it\" })";
        let at = "2026-11-29T00:00:01.000Z";
        let blocks = [format!("1 {at} > [01, 02]"), format!("3 {at} > [03, 04, 05]")];
        assert_eq!(found(&cut).unwrap(), [missing, &blocks[0], &blocks[1]]);
        let text = format!("{head}\nabc");
        assert_eq!(found(&text).unwrap_err().to_string(), "line 2: the bytes are not in hex: use `socat -x`");
        assert!(found("abc\n").is_err());
    }
}
