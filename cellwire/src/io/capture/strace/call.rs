//! A call as strace writes it: its name, its arguments and its result.

/// A call that has returned, without the time and the thread before it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Call<'a> {
    pub(super) name: &'a str,
    /// The text after the opening parenthesis.
    pub(super) arguments: &'a str,
}

/// The result of a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CallResult {
    /// A number: of bytes, or of a file descriptor.
    Number(u64),
    /// An error, or a result that is not known.
    Failed,
    /// The line ends before the result.
    Missing,
}

/// The bytes that a call has read or written.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Payload {
    pub(super) bytes: Vec<u8>,
    /// A string was shortened, or a buffer is shown as an address: nothing after it has a known position.
    is_cut: bool,
}

impl<'a> Call<'a> {
    pub(super) fn new(text: &'a str) -> Option<Self> {
        let (before, arguments) = text.split_once('(')?;
        // Options of strace write other columns before the name.
        let name = before.rsplit(' ').next()?;
        let is_name =
            !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        is_name.then_some(Self { name, arguments })
    }

    pub(super) fn returned(&self) -> CallResult {
        match self.arguments.rsplit_once("= ") {
            Some((call, result)) if call.trim_end().ends_with(')') => {
                let digits = result.split(|c: char| !c.is_ascii_digit()).next().unwrap_or_default();
                digits.parse().map_or(CallResult::Failed, CallResult::Number)
            }
            _ => CallResult::Missing,
        }
    }

    /// Returns the descriptor at the beginning of the call, and the file that `-y` writes after it.
    pub(super) fn descriptor(&self) -> Option<(u32, Option<String>)> {
        descriptor(self.arguments).map(|(number, path, _)| (number, path))
    }

    /// Returns the descriptors between brackets, as of a pipe.
    pub(super) fn pair(&self) -> Vec<u32> {
        let list = self.arguments.rsplit_once('[').and_then(|(_, list)| list.split_once(']'));
        list.into_iter()
            .flat_map(|(list, _)| list.split(", "))
            .filter_map(|it| Some(descriptor(it)?.0))
            .collect()
    }

    /// Returns the path that the call names.
    pub(super) fn path(&self) -> Option<String> {
        let (_, text) = self.arguments.split_once('"')?;
        let (path, _) = string(text)?;
        Some(String::from_utf8_lossy(&path).into_owned())
    }

    /// Returns the bytes in the buffer of the call, or in its buffers; without addresses and control data. `None` if the
    /// arguments cannot be read.
    pub(super) fn payload(&self) -> Option<Payload> {
        let (_, _, rest) = descriptor(self.arguments)?;
        let rest = rest.strip_prefix(", ")?;
        let buffers = match self.name {
            "readv" | "preadv" | "preadv2" | "writev" | "pwritev" | "pwritev2" => rest,
            "recvmsg" | "sendmsg" => after(rest, "msg_iov")?.split_once('=')?.1,
            _ => {
                let mut payload = Payload::default();
                payload.add(rest)?;
                return Some(payload);
            }
        };
        let mut payload = Payload::default();
        let Some(mut rest) = buffers.strip_prefix('[') else {
            payload.is_cut = true;
            return Some(payload);
        };
        loop {
            rest = rest.trim_start_matches([',', ' ']);
            if rest.starts_with(']') || payload.is_cut {
                return Some(payload);
            }
            let Some(buffer) = rest.strip_prefix('{') else {
                // Strace writes 32 buffers at most, then `...`.
                payload.is_cut = true;
                return rest.starts_with("...").then_some(payload);
            };
            let buffer = buffer.strip_prefix("iov_base=").unwrap_or(buffer);
            rest = payload.add(buffer)?.split_once('}')?.1;
        }
    }
}

impl Payload {
    /// Adds the buffer that a text begins with; returns the text after it.
    fn add<'a>(&mut self, text: &'a str) -> Option<&'a str> {
        let Some(text) = text.strip_prefix('"') else {
            self.is_cut = true;
            return Some(text);
        };
        let (bytes, rest) = string(text)?;
        self.bytes.extend(bytes);
        self.is_cut = rest.starts_with("...");
        Some(rest)
    }
}

/// Parses `3</dev/ttyUSB0>, …`: the number, the path, and the text after both.
fn descriptor(text: &str) -> Option<(u32, Option<String>, &str)> {
    let (number, rest) =
        text.split_at_checked(text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len()))?;
    let number = number.parse().ok()?;
    let Some(named) = rest.strip_prefix('<') else { return Some((number, None, rest)) };
    // An address has `->` in it, a device `<char 188:0>`.
    let end = [">,", ">)", ">(deleted)"].iter().filter_map(|end| named.find(end)).min();
    let (path, rest) = named.split_at_checked(end.unwrap_or_else(|| named.trim_end_matches('>').len()))?;
    let rest = rest.strip_prefix('>').unwrap_or(rest);
    let rest = rest.strip_prefix("(deleted)").unwrap_or(rest);
    let path = path.split_once('<').map_or(path, |(path, _)| path);
    let (path, _) = string(&format!("{path}\""))?;
    Some((number, Some(String::from_utf8_lossy(&path).into_owned()), rest))
}

/// Returns the text after a word that is outside strings.
fn after<'a>(mut text: &'a str, word: &str) -> Option<&'a str> {
    loop {
        let at = text.find(word)?;
        match text.find('"') {
            Some(quote) if quote < at => text = string(text.get(quote + 1..)?)?.1,
            _ => return text.get(at + word.len()..),
        }
    }
}

/// Returns the bytes of a string without its first quote, and the text after its last one.
fn string(text: &str) -> Option<(Vec<u8>, &str)> {
    let mut bytes = Vec::new();
    let mut letters = text.char_indices();
    loop {
        let (at, letter) = letters.next()?;
        match letter {
            '"' => return Some((bytes, text.get(at + 1..)?)),
            '\\' => {
                let (byte, length) = escaped(text.get(at + 1..)?)?;
                bytes.push(byte);
                for _ in 0..length {
                    letters.next();
                }
            }
            letter => bytes.extend_from_slice(letter.encode_utf8(&mut [0; 4]).as_bytes()),
        }
    }
}

/// Returns the byte of an escape without its backslash, and the number of characters of the escape.
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
