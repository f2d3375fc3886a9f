//! The format of an input, by its first bytes.

use std::io::{BufRead, Cursor, Read};

use anyhow::{Context, Result, bail};

use super::Format;
use crate::io::capture::{is_dump, is_socat, unreadable};
use cellwire_io::trace::{parse_line, parse_name};

/// The maximum number of bytes by which the format is decided.
const MAX_PROBE_LEN: usize = 4096;

/// The first bytes of pcap, in microseconds and in nanoseconds, in both byte orders, with Kuznetzov's changes, and of pcapng.
const PACKETS: [[u8; 4]; 7] = [
    [0xA1, 0xB2, 0xC3, 0xD4],
    [0xD4, 0xC3, 0xB2, 0xA1],
    [0xA1, 0xB2, 0x3C, 0x4D],
    [0x4D, 0x3C, 0xB2, 0xA1],
    [0xA1, 0xB2, 0xCD, 0x34],
    [0x34, 0xCD, 0xB2, 0xA1],
    [0x0A, 0x0D, 0x0D, 0x0A],
];

/// Detects the format of `input`; returns it with the whole input.
///
/// # Errors
/// If it cannot be read, or is not bytes of a link.
pub(super) fn detect(mut input: Box<dyn BufRead>) -> Result<(Format, Box<dyn BufRead>)> {
    let mut begin = Vec::new();
    let format = loop {
        let taken = input.fill_buf().context("cannot read the input")?;
        let length = taken.len();
        begin.extend_from_slice(taken);
        input.consume(length);
        let is_all = length == 0 || begin.len() >= MAX_PROBE_LEN;
        if let Some(format) = of(&begin, is_all)? {
            break format;
        }
    };
    Ok((format, Box::new(std::io::BufReader::new(Cursor::new(begin).chain(input)))))
}

/// Returns the format of an input with this beginning; `None` if more bytes are needed.
fn of(begin: &[u8], is_all: bool) -> Result<Option<Format>> {
    if begin.len() < 4 && !is_all {
        return Ok(None);
    }
    if PACKETS.iter().any(|magic| begin.starts_with(magic)) {
        return Ok(Some(Format::Pcap));
    }
    if let Some(why) = unreadable(begin) {
        bail!(why);
    }
    let begin = begin.get(..MAX_PROBE_LEN).unwrap_or(begin);
    let begin = begin.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(begin);
    if begin.iter().any(|byte| *byte < b' ' && !matches!(byte, b'\t' | b'\r' | b'\n')) {
        return Ok(Some(Format::Raw));
    }
    let text = String::from_utf8_lossy(begin);
    // The last line may continue.
    let whole = if is_all { &text } else { text.rsplit_once('\n').map_or("", |(whole, _)| whole) };
    let lines = || whole.lines().map(str::trim_end).filter(|line| !line.is_empty());
    let mut bytes = lines().filter(|line| !line.starts_with('#'));
    if lines().next().and_then(parse_name).is_some()
        && lines().nth(1).is_some_and(|line| parse_line(line).is_some())
    {
        return Ok(Some(Format::Trace));
    }
    if lines().any(is_call) {
        return Ok(Some(Format::Strace));
    }
    if lines().any(is_socat) {
        return Ok(Some(Format::Socat));
    }
    let first = bytes.next();
    if first
        .is_some_and(|line| line.starts_with('{') && serde_json::from_str::<serde_json::Value>(line).is_ok())
    {
        bail!("the input has lines of JSON: cellwire encode makes bytes of message objects");
    }
    if is_dump(whole) {
        return Ok(Some(Format::Hexdump));
    }
    if first.is_some_and(is_hex) {
        return Ok(Some(Format::Hex));
    }
    // A text in none of these formats may be bytes of a link.
    Ok(is_all.then_some(Format::Raw))
}

/// Returns whether a line of a hex file has only bytes before a `#`.
fn is_hex(line: &str) -> bool {
    let bytes = line.split('#').next().unwrap_or_default();
    let words = || bytes.split([' ', '\t', ',']).filter(|word| !word.is_empty());
    let digits = |word: &str| word.trim_start_matches("0x").trim_start_matches("0X").len();
    words().all(|word| word.bytes().all(|byte| byte.is_ascii_hexdigit() || byte.eq_ignore_ascii_case(&b'x')))
        && words().map(digits).sum::<usize>() > 0
}

/// Returns whether a line is a call in the output of strace, with its result, or without it if another thread was traced
/// meanwhile.
fn is_call(line: &str) -> bool {
    const CALLS: [&str; 16] = [
        "read", "readv", "recv", "recvfrom", "recvmsg", "pread64", "write", "writev", "send", "sendto",
        "sendmsg", "pwrite64", "open", "openat", "close", "execve",
    ];
    let has_end = line.contains(") = ") || line.ends_with("<unfinished ...>");
    has_end
        && line.split_once('(').is_some_and(|(before, _)| {
            let name = before.rsplit(' ').next().unwrap_or_default();
            CALLS.contains(&name)
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(begin: &[u8]) -> Option<Format> {
        let whole = of(begin, true).unwrap();
        // A pipe may have given only a part of it so far: that decides the same, or not yet.
        for length in 0..begin.len() {
            if let Ok(Some(early)) = of(&begin[..length], false) {
                assert_eq!(Some(early), whole, "{length} bytes of {:?}", String::from_utf8_lossy(begin));
            }
        }
        whole
    }

    #[test]
    fn the_first_bytes_decide() {
        for magic in PACKETS {
            assert_eq!(found(&[&magic[..], &[0; 20]].concat()), Some(Format::Pcap));
        }
        for (begin, format) in [
            (&b"EB 90 82 F0\n"[..], Format::Hex),
            (b"# a comment\n\neb9082 # another\n0G", Format::Hex),
            (b"\xEF\xBB\xBF0xEB, 0x90\n", Format::Hex),
            (b"00000000  41 42 43  |ABC|\n00000003\n", Format::Hexdump),
            (b"00000000: 4142 43                                  AB\n", Format::Hexdump),
            (b"I\n10:00:01.5\n0000 05\nO 10:00:02\n0000 06 07\n", Format::Hexdump),
            (b"# robot: the end\n11 # 0.001000 s received\n", Format::Trace),
            (b"12:00:01.5 read(3</dev/ttyS0>, \"\\x05\", 64) = 1\n", Format::Strace),
            (b"[pid 7] write(3, \"a\", 1 <unfinished ...>\n", Format::Strace),
            (b"> 2026/11/29 12:45:03.000206370  length=1 from=0 to=0\n 05\n", Format::Socat),
            (b"<TilausAlkaa$4#50$1#>", Format::Raw),
            (b"$POSE,7,16384,0,0*30\r\n", Format::Raw),
            (b"STA\r\nSRVON\r\n", Format::Raw),
            (b"\x05", Format::Raw),
            (b"", Format::Raw),
            (b"\xEB\x90\x82\xF0", Format::Raw),
        ] {
            assert_eq!(found(begin), Some(format), "{:?}", String::from_utf8_lossy(begin));
        }
    }

    #[test]
    fn what_is_something_else_is_refused() {
        for (begin, why) in [
            (
                &b"\x1F\x8B\x08\x00"[..],
                "the input is compressed with gzip: unpack it first, as in `gzip -dc FILE | cellwire …`",
            ),
            (
                b"\x28\xB5\x2F\xFD\x04",
                "the input is compressed with zstd: unpack it first, as in `zstd -dc FILE | cellwire …`",
            ),
            (
                b"snoop\0\0\0\0\0\0\x02",
                "the input is a capture of snoop: convert it with `editcap -F pcapng FILE OUT.pcapng`",
            ),
            (
                b"{\"offset\":0}\n",
                "the input has lines of JSON: cellwire encode makes bytes of message objects",
            ),
        ] {
            assert_eq!(of(begin, true).unwrap_err().to_string(), why);
        }
    }
}
