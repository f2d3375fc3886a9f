//! What strace writes of a program: the bytes that it reads and writes at each of its file descriptors.

use std::collections::HashMap;
use std::io::{BufReader, Read};
use std::time::Duration;

use anyhow::{Result, ensure};

use super::hexdump::{Lines, time};
use super::{Flow, Found, Line, Packet, Summary};

pub(super) fn read(
    input: BufReader<Box<dyn Read>>,
    only: Option<u32>,
    mut take: impl FnMut(Found<'_>) -> Result<()>,
) -> Result<Summary> {
    let (mut lines, mut trace, mut calls) = (Lines::new(input), Trace::default(), 0);
    while let Some(text) = lines.next()? {
        let Some(call) = trace.line(text.trim_end()) else { continue };
        calls += 1;
        let Some((descriptor, by_keeper, data, missing)) = trace.call(&call) else { continue };
        let is_wanted = only.map_or_else(|| trace.is_likely(descriptor), |only| only == descriptor);
        if !is_wanted {
            continue;
        }
        let turn = trace.files.get(&descriptor).map_or(0, |file| file.turn);
        let flow = Flow::Kept(Line::Opened { descriptor, turn }, by_keeper);
        let (number, at) = (lines.number, trace.at);
        take(Found::Packet(Packet { number, at, flow, segment: None, payload: &data, missing }))?;
    }
    ensure!(calls > 0, "the input is not strace output: no line has a call and its result");
    Ok(Summary { packets: calls, ..Summary::default() })
}

#[derive(Default)]
struct Trace {
    at: Option<Duration>,
    /// What a thread has begun: the call up to where another thread was heard.
    begun: HashMap<String, String>,
    files: HashMap<u32, File>,
}

#[derive(Default)]
struct File {
    name: Option<String>,
    /// How many files have had this number before.
    turn: u32,
}

impl Trace {
    /// A call that has returned.
    fn line(&mut self, text: &str) -> Option<String> {
        let mut rest = text.trim_start();
        let mut thread = String::new();
        if let Some((id, after)) = rest.strip_prefix("[pid").and_then(|rest| rest.split_once(']')) {
            (thread, rest) = (id.trim().to_owned(), after.trim_start());
        } else if let Some((id, after)) = rest.split_once(' ')
            && id.bytes().all(|digit| digit.is_ascii_digit())
        {
            (thread, rest) = (id.to_owned(), after.trim_start());
        }
        if let Some((word, after)) = rest.split_once(' ')
            && let Some(at) = time(word)
        {
            // What is no time of this century was counted from the call before.
            const LONG: Duration = Duration::from_secs(100_000_000);
            let is_relative = !word.contains(':') && at < LONG;
            self.at = Some(if is_relative { self.at.unwrap_or_default() + at } else { at });
            rest = after.trim_start();
        }
        if let Some((begun, _)) = rest.rsplit_once("<unfinished ...>") {
            self.begun.insert(thread, begun.trim_end().to_owned());
            return None;
        }
        if rest.starts_with("<... ") {
            let (_, end) = rest.split_once("resumed>")?;
            let begun = self.begun.remove(&thread)?;
            let space = if begun.ends_with(',') { " " } else { "" };
            return Some(format!("{begun}{space}{}", end.trim_start()));
        }
        Some(rest.to_owned())
    }

    /// What a call has read or written: the descriptor, whether the program sends, the bytes, and how many strace has left out.
    fn call(&mut self, call: &str) -> Option<(u32, bool, Vec<u8>, u64)> {
        let (name, arguments) = call.split_once('(')?;
        let Arguments { bytes, after } = strings(arguments)?;
        let returned = after.rsplit_once("= ")?.1;
        let returned: u64 = returned.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()?;
        let by_keeper = match name {
            "open" | "openat" | "openat2" | "socket" | "accept" | "accept4" => {
                let name = match name {
                    "open" | "openat" | "openat2" => String::from_utf8_lossy(&bytes).into_owned(),
                    _ => "socket:".to_owned(),
                };
                self.opened(u32::try_from(returned).ok()?, Some(name));
                return None;
            }
            "read" | "readv" | "recv" | "recvfrom" | "recvmsg" | "pread64" => false,
            "write" | "writev" | "send" | "sendto" | "sendmsg" | "pwrite64" => true,
            "close" => {
                let (descriptor, _) = descriptor(arguments)?;
                self.opened(descriptor, None);
                return None;
            }
            _ => return None,
        };
        let (descriptor, path) = descriptor(arguments)?;
        if let Some(path) = path {
            self.files.entry(descriptor).or_default().name = Some(path.to_owned());
        }
        if returned == 0 {
            return None;
        }
        let mut bytes = bytes;
        bytes.truncate(usize::try_from(returned).ok()?);
        let missing = returned - bytes.len() as u64;
        Some((descriptor, by_keeper, bytes, missing))
    }

    /// Another file has this number now, or none.
    fn opened(&mut self, descriptor: u32, name: Option<String>) {
        match self.files.get_mut(&descriptor) {
            None => drop(self.files.insert(descriptor, File { name, turn: 0 })),
            // It was closed.
            Some(file) if file.name.as_deref() == Some("") => file.name = name.or(Some(String::new())),
            Some(file) => {
                file.turn += 1;
                file.name = name.or(Some(String::new()));
            }
        }
    }

    /// Whether a link may be there: not at standard input and output, nor in a file that is no device.
    fn is_likely(&self, descriptor: u32) -> bool {
        const OTHERS: [&str; 5] = ["/dev/null", "/dev/urandom", "/dev/random", "/dev/tty", "/dev/zero"];
        let name = self.files.get(&descriptor).and_then(|file| file.name.as_deref()).unwrap_or_default();
        descriptor > 2
            && (!name.starts_with('/') || name.starts_with("/dev/") && !OTHERS.contains(&name))
            && !["pipe:", "anon_inode:"].iter().any(|kind| name.starts_with(kind))
    }
}

/// `3</dev/ttyUSB0>, …`
fn descriptor(arguments: &str) -> Option<(u32, Option<&str>)> {
    let end = arguments.find(|c: char| !c.is_ascii_digit())?;
    let (number, rest) = arguments.split_at_checked(end)?;
    let path = rest.strip_prefix('<').and_then(|rest| rest.split_once(['>', '<'])).map(|(path, _)| path);
    Some((number.parse().ok()?, path))
}

struct Arguments<'a> {
    /// Those of the strings, one after the other.
    bytes: Vec<u8>,
    /// What is behind the last string.
    after: &'a str,
}

fn strings(mut rest: &str) -> Option<Arguments<'_>> {
    let mut bytes = Vec::new();
    while let Some((_, text)) = rest.split_once('"') {
        let mut letters = text.char_indices();
        loop {
            let (at, letter) = letters.next()?;
            match letter {
                '"' => {
                    rest = text.get(at + 1..)?;
                    break;
                }
                '\\' => {
                    let (byte, length) = escaped(text.get(at + 1..)?)?;
                    bytes.push(byte);
                    for _ in 0..length {
                        letters.next();
                    }
                }
                letter => bytes.push(u8::try_from(letter).ok()?),
            }
        }
    }
    Some(Arguments { bytes, after: rest })
}

/// What is behind a backslash: a byte, and how many characters it takes.
fn escaped(text: &str) -> Option<(u8, usize)> {
    let first = text.chars().next()?;
    let byte = match first {
        'n' => b'\n',
        't' => b'\t',
        'r' => b'\r',
        'v' => 0x0B,
        'f' => 0x0C,
        'x' => return Some((u8::from_str_radix(text.get(1..3)?, 16).ok()?, 3)),
        '0'..='7' => {
            let digits = text.bytes().take(3).take_while(|digit| (b'0'..=b'7').contains(digit)).count();
            return Some((u8::from_str_radix(text.get(..digits)?, 8).ok()?, digits));
        }
        other => u8::try_from(other).ok()?,
    };
    Some((byte, 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace(text: &str, only: Option<u32>) -> Vec<String> {
        let mut found = Vec::new();
        let input: Box<dyn Read> = Box::new(std::io::Cursor::new(text.as_bytes().to_vec()));
        read(BufReader::new(input), only, |it| {
            let Found::Packet(Packet { at, flow: Flow::Kept(line, by_keeper), payload, missing, .. }) = it
            else {
                panic!("{it:?}")
            };
            let at = at.map_or_else(String::new, |at| format!("{:.3} ", at.as_secs_f64()));
            let way = if by_keeper { ">" } else { "<" };
            found.push(format!("{at}{line} {way} {payload:02x?} {missing}"));
            Ok(())
        })
        .unwrap();
        found
    }

    #[test]
    fn calls_are_read_in_every_notation() {
        let text = r#"openat(AT_FDCWD, "/etc/ld.so.cache", O_RDONLY|O_CLOEXEC) = 3
read(3, "\177ELF", 832) = 4
close(3) = 0
openat(AT_FDCWD, "/dev/ttyUSB0", O_RDWR) = 3
write(3, "\x05", 1) = 1
read(3, "a\"\\\r\n\08\377", 256) = 8
read(3, "ab"..., 256) = 5
read(3, "", 256) = 0
read(3, 0x7ffe, 256) = -1 EAGAIN (Resource temporarily unavailable)
write(1, "text", 4) = 4
"#;
        let expected = [
            "descriptor 3 file 2 > [05] 0",
            "descriptor 3 file 2 < [61, 22, 5c, 0d, 0a, 00, 38, ff] 0",
            "descriptor 3 file 2 < [61, 62] 3",
        ];
        assert_eq!(trace(text, None), expected);
        assert_eq!(trace(text, Some(1)), ["descriptor 1 > [74, 65, 78, 74] 0"]);
    }

    #[test]
    fn threads_and_times_are_read() {
        let text = r#"[pid 7] 12:00:00.500000 read(3</dev/ttyS0>,  <unfinished ...>
[pid 8] 12:00:01.250000 writev(3</dev/ttyS0>, [{iov_base="\x01", iov_len=1}, {iov_base="\x02", iov_len=1}], 2) = 2
[pid 7] 12:00:02.000000 <... read resumed>"\x03\x04", 16) = 2
[pid 7] 12:00:02.000000 read(4</home/me/settings>, "x", 16) = 1
8 1700000000.125 sendto(5<TCP:[1.2.3.4:5->6.7.8.9:10]>, "\x09", 1, 0, NULL, 0) = 1
"#;
        let expected = [
            "43201.250 descriptor 3 > [01, 02] 0",
            "43202.000 descriptor 3 < [03, 04] 0",
            "1700000000.125 descriptor 5 > [09] 0",
        ];
        assert_eq!(trace(text, None), expected);
    }
}
