//! The output of strace for a program: the bytes that it reads and writes at each of its file descriptors.

mod call;

use std::collections::{BTreeSet, HashMap};
use std::io::{BufRead, BufReader, Read};
use std::time::Duration;

use anyhow::{Context, Result, ensure};

use self::call::{Call, CallResult};
use super::hexdump::time;
use super::{CaptureItem, Fault, Flow, Line, Packet, Summary};

/// The longest line, in bytes. The option -s 65535 with -xx makes lines of a million for 4 buffers.
const MAX_LINE: u64 = 1 << 24;
/// Calls that read the bytes of a descriptor, and calls that write some.
const READS: [&str; 8] = ["read", "readv", "recv", "recvfrom", "recvmsg", "pread64", "preadv", "preadv2"];
const WRITES: [&str; 8] = ["write", "writev", "send", "sendto", "sendmsg", "pwrite64", "pwritev", "pwritev2"];
/// Calls that read or write bytes that strace shows in another form, or not at all.
const UNREAD: [&str; 11] = [
    "recvmmsg",
    "sendmmsg",
    "recvmmsg_time64",
    "sendfile",
    "sendfile64",
    "splice",
    "tee",
    "vmsplice",
    "copy_file_range",
    "io_submit",
    "io_uring_enter",
];

pub(super) fn read(
    mut input: BufReader<Box<dyn Read>>,
    only: Option<u32>,
    mut take: impl FnMut(CaptureItem<'_>) -> Result<()>,
) -> Result<Summary> {
    let (mut trace, mut calls, mut line, mut unread) = (Trace::default(), 0, Vec::new(), BTreeSet::new());
    for number in 1.. {
        line.clear();
        let length = input.by_ref().take(MAX_LINE).read_until(b'\n', &mut line);
        let length = length.with_context(|| format!("line {number}: cannot read the input"))? as u64;
        if length == 0 {
            break;
        }
        ensure!(length < MAX_LINE, "line {number} is longer than {MAX_LINE} bytes: trace with a smaller -s");
        let text = match trace.line(String::from_utf8_lossy(&line).trim_end()) {
            Ok(None) => continue,
            Ok(Some(text)) => text,
            Err(why) => {
                take(CaptureItem::Fault(number, Fault::Line { why }))?;
                continue;
            }
        };
        let Some(call) = Call::new(&text) else { continue };
        calls += u64::from(call.returned() != CallResult::Missing);
        let wanted = |descriptor, file: &File| {
            only.map_or_else(|| file.is_likely(descriptor), |only| only == descriptor)
        };
        let why = match trace.call(&call) {
            Ok(Some(TransferredBytes { descriptor, turn, by_keeper, bytes, missing })) => {
                if trace.file(descriptor, turn).is_some_and(|file| wanted(descriptor, file)) {
                    let flow = Flow::Kept(Line::Opened { descriptor, turn }, by_keeper);
                    let (at, payload) = (trace.at, bytes.as_slice());
                    take(CaptureItem::Packet(Packet { number, at, flow, segment: None, payload, missing }))?;
                }
                continue;
            }
            Ok(None) if UNREAD.contains(&call.name) => {
                let CallResult::Number(1..) = call.returned() else { continue };
                let is_wanted = call.descriptor().is_none_or(|(descriptor, path)| {
                    let turn = trace.turn(descriptor, path);
                    trace.file(descriptor, turn).is_some_and(|file| wanted(descriptor, file))
                });
                if !is_wanted || !unread.insert(call.name.to_owned()) {
                    continue;
                }
                format!("the bytes of {} are not read, here and in later lines", call.name)
            }
            Ok(None) => continue,
            Err(why) => why,
        };
        take(CaptureItem::Fault(number, Fault::Line { why }))?;
    }
    ensure!(calls > 0, "the input is not strace output: no line has a call and its result");
    Ok(Summary { packets: calls, ..Summary::default() })
}

#[derive(Default)]
struct Trace {
    at: Option<Duration>,
    /// The calls that threads have begun: each up to the line of another thread.
    begun: HashMap<String, String>,
    /// The files that each descriptor has stood for, in order.
    files: HashMap<u32, Vec<File>>,
}

/// A file that a program has opened.
#[derive(Default)]
struct File {
    /// Empty if the trace does not show it.
    name: String,
    is_closed: bool,
}

/// Bytes that a call has read or written.
struct TransferredBytes {
    descriptor: u32,
    turn: u32,
    /// The program sends them.
    by_keeper: bool,
    bytes: Vec<u8>,
    /// The bytes after these that strace has left out.
    missing: u64,
}

impl Trace {
    /// Returns the call of a line, if it has returned there.
    ///
    /// # Errors
    /// If the beginning of a call is not in the trace.
    fn line(&mut self, text: &str) -> Result<Option<String>, String> {
        let mut rest = text.trim_start();
        let mut thread = String::new();
        if let Some((id, after)) = rest.strip_prefix("[pid").and_then(|rest| rest.split_once(']')) {
            (thread, rest) = (id.trim().to_owned(), after.trim_start());
        } else if let Some((id, after)) = rest.split_once(' ')
            && id.starts_with(|c: char| c.is_ascii_digit())
            && id.bytes().all(|digit| digit.is_ascii_digit() || id.ends_with('>'))
        {
            (thread, rest) = (id.to_owned(), after.trim_start());
        }
        if let Some((word, after)) = rest.split_once(' ')
            && let Some(at) = time(word)
        {
            self.pass_time(at, word.contains(':'));
            rest = after.trim_start();
        }
        // The number of the call, or the address of the instruction.
        if let Some((_, after)) = rest.strip_prefix('[').and_then(|rest| rest.split_once("] ")) {
            rest = after;
        }
        let ends = ["<unfinished ...>", "<unfinished ...>) = ?"];
        if let Some(begun) = ends.iter().find_map(|end| rest.strip_suffix(end)) {
            self.begun.insert(thread, begun.trim_end().to_owned());
            return Ok(None);
        }
        if let Some(resumed) = rest.strip_prefix("<... ") {
            let Some((name, end)) = resumed.split_once(" resumed>") else { return Ok(None) };
            let Some(begun) = self.begun.remove(&thread) else {
                let is_read = READS.contains(&name) || WRITES.contains(&name);
                return if is_read {
                    Err(format!("the beginning of this {name} is not in the trace"))
                } else {
                    Ok(None)
                };
            };
            let space = if begun.ends_with(',') { " " } else { "" };
            return Ok(Some(format!("{begun}{space}{}", end.trim_start())));
        }
        Ok(Some(rest.to_owned()))
    }

    /// Sets the time: of the day, since 1970, or since the previous call.
    fn pass_time(&mut self, at: Duration, is_of_day: bool) {
        const DAY: Duration = Duration::from_secs(86_400);
        // A number that is not a time of this century is relative.
        const LONG: Duration = Duration::from_secs(100_000_000);
        let last = self.at.unwrap_or_default();
        self.at = Some(if is_of_day {
            let midnight = DAY * u32::try_from(last.as_secs() / DAY.as_secs()).unwrap_or_default();
            let passed = if midnight + at + DAY / 2 < last { DAY } else { Duration::ZERO };
            midnight + at + passed
        } else if at < LONG {
            last + at
        } else {
            at
        });
    }

    /// Applies a call: it opens or closes a file, or moves bytes.
    ///
    /// # Errors
    /// If it moves bytes and cannot be read.
    fn call(&mut self, call: &Call<'_>) -> Result<Option<TransferredBytes>, String> {
        let by_keeper = WRITES.contains(&call.name);
        let is_moving = by_keeper || READS.contains(&call.name);
        let returned = match call.returned() {
            CallResult::Number(returned) => returned,
            CallResult::Missing if is_moving => {
                return Err(format!("the result of this {} is missing", call.name));
            }
            CallResult::Failed | CallResult::Missing => return Ok(None),
        };
        if !is_moving {
            self.open_or_close(call, returned);
            return Ok(None);
        }
        if returned == 0 {
            return Ok(None);
        }
        let unreadable = || format!("the arguments of this {} cannot be read", call.name);
        let (descriptor, path) = call.descriptor().ok_or_else(unreadable)?;
        let mut bytes = call.payload().ok_or_else(unreadable)?.bytes;
        bytes.truncate(usize::try_from(returned).unwrap_or(usize::MAX));
        let missing = returned - bytes.len() as u64;
        let turn = self.turn(descriptor, path);
        Ok(Some(TransferredBytes { descriptor, turn, by_keeper, bytes, missing }))
    }

    fn open_or_close(&mut self, call: &Call<'_>, returned: u64) {
        let mut open = |descriptor: Option<u32>, name: String| {
            if let Some(descriptor) = descriptor {
                let files = self.files.entry(descriptor).or_default();
                files.iter_mut().for_each(|file| file.is_closed = true);
                files.push(File { name, is_closed: false });
            }
        };
        let new = u32::try_from(returned).ok();
        match call.name {
            "open" | "openat" | "openat2" | "creat" => open(new, call.path().unwrap_or_default()),
            "socket" | "accept" | "accept4" => open(new, "socket:".into()),
            "eventfd" | "eventfd2" | "timerfd_create" | "signalfd" | "signalfd4" | "epoll_create"
            | "epoll_create1" | "inotify_init" | "inotify_init1" | "memfd_create" | "pidfd_open"
            | "perf_event_open" => {
                open(new, "anon_inode:".into());
            }
            "pipe" | "pipe2" => call.pair().into_iter().for_each(|it| open(Some(it), "pipe:".into())),
            "socketpair" => call.pair().into_iter().for_each(|it| open(Some(it), "socket:".into())),
            "dup" | "dup2" | "dup3" | "fcntl"
                if call.name != "fcntl" || call.arguments.contains("F_DUPFD") =>
            {
                let Some((old, path)) = call.descriptor() else { return };
                let turn = self.turn(old, path);
                let name = self.file(old, turn).map(|file| file.name.clone()).unwrap_or_default();
                let files = new.filter(|new| *new != old).map(|new| self.files.entry(new).or_default());
                if let Some(files) = files {
                    files.iter_mut().for_each(|file| file.is_closed = true);
                    files.push(File { name, is_closed: false });
                }
            }
            "close" => {
                let Some((descriptor, path)) = call.descriptor() else { return };
                let files = self.files.entry(descriptor).or_default();
                if files.is_empty() {
                    files.push(File { name: path.clone().unwrap_or_default(), is_closed: false });
                }
                // Another process may have another file at this number.
                let is_it = |file: &&mut File| {
                    path.as_ref().is_none_or(|path| file.name.is_empty() || file.name == *path)
                };
                files.iter_mut().filter(is_it).for_each(|file| file.is_closed = true);
            }
            _ => {}
        }
    }

    /// Returns how many files this descriptor has stood for before the one at `path`.
    fn turn(&mut self, descriptor: u32, path: Option<String>) -> u32 {
        let files = self.files.entry(descriptor).or_default();
        let is_it = |file: &File| {
            !file.is_closed
                && path.as_ref().is_none_or(|path| is_kind_of(&file.name, path) || file.name == *path)
        };
        let turn = files.iter().rposition(is_it).unwrap_or_else(|| {
            files.push(File::default());
            files.len() - 1
        });
        if let (Some(path), Some(file)) = (path, files.get_mut(turn)) {
            file.name = path;
        }
        u32::try_from(turn).unwrap_or(u32::MAX)
    }

    fn file(&self, descriptor: u32, turn: u32) -> Option<&File> {
        self.files.get(&descriptor)?.get(turn as usize)
    }
}

impl File {
    /// Returns whether a link may be there: not at standard input and output, nor in a file that is not a device.
    fn is_likely(&self, descriptor: u32) -> bool {
        const OTHERS: [&str; 5] = ["/dev/null", "/dev/urandom", "/dev/random", "/dev/tty", "/dev/zero"];
        let name = self.name.as_str();
        let is_device =
            name.starts_with("/dev/") && !OTHERS.contains(&name) && !name.starts_with("/dev/shm/");
        descriptor > 2
            && (!name.starts_with('/') || is_device)
            && !["pipe:", "anon_inode:"].iter().any(|kind| name.starts_with(kind))
    }
}

/// Returns whether the name of a file is known less exactly than `path`: a socket by its call, or not at all.
fn is_kind_of(name: &str, path: &str) -> bool {
    // With -yy the address of a socket appears when it is bound or connected.
    let is_address = |kind: &str| name.starts_with(kind) && path.starts_with(kind) && !name.contains("->");
    name.is_empty()
        || name == "socket:" && !path.starts_with('/')
        || ["TCP", "UDP"].into_iter().any(is_address)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace(text: &str, only: Option<u32>) -> Vec<String> {
        let mut found = Vec::new();
        let input: Box<dyn Read> = Box::new(std::io::Cursor::new(text.as_bytes().to_vec()));
        read(BufReader::new(input), only, |it| {
            let CaptureItem::Packet(Packet {
                at, flow: Flow::Kept(line, by_keeper), payload, missing, ..
            }) = it
            else {
                found.push(match it {
                    CaptureItem::Fault(line, Fault::Line { why }) => format!("line {line}: {why}"),
                    other => panic!("{other:?}"),
                });
                return Ok(());
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
    fn only_buffers_are_read() {
        let text = r#"sendmsg(7<socket:[1]>, {msg_name={sa_family=AF_INET, sin_port=htons(5), sin_addr=inet_addr("\x31\x32")}, msg_namelen=16, msg_iov=[{iov_base="\x61\x62", iov_len=2}, {iov_base="c", iov_len=1}], msg_iovlen=2, msg_controllen=0, msg_flags=0}, 0) = 3
recvmsg(7<socket:[1]>, {msg_name={sa_family=AF_UNIX, sun_path="msg_iov=["}, msg_iov=[{iov_base="de", iov_len=9}], msg_iovlen=1, msg_control=[{cmsg_data="xyz"}], msg_flags=0}, 0) = 2
recvmsg(7<socket:[1]>, {msg_name(0)=NULL, msg_iov(1)=[{"f", 9}], msg_controllen=0, msg_flags=0}, 0) = 1
recvfrom(7<socket:[1]>, "gh"..., 9, 0, {sa_family=AF_INET, sin_addr=inet_addr("1.2")}, [16]) = 5
sendto(7<socket:[1]>, NULL, 0, 0, {sin_addr=inet_addr("1.2")}, 16) = 0
writev(7<socket:[1]>, [{iov_base="ij"..., iov_len=4}, {iov_base="kl", iov_len=2}], 2) = 6
readv(7<socket:[1]>, [{iov_base="m", iov_len=1}, {iov_base="n", iov_len=8}], 2) = 2
read(7<socket:[1]>, 0x7ffe, 64) = 4
"#;
        let expected = [
            "descriptor 7 > [61, 62, 63] 0",
            "descriptor 7 < [64, 65] 0",
            "descriptor 7 < [66] 0",
            "descriptor 7 < [67, 68] 3",
            "descriptor 7 > [69, 6a] 4",
            "descriptor 7 < [6d, 6e] 0",
            "descriptor 7 < [] 4",
        ];
        assert_eq!(trace(text, None), expected);
    }

    #[test]
    fn a_file_is_known_by_its_path() {
        let text = r#"read(3<\x2f\x65\x74\x63\x2f\x61>, "x", 1) = 1
read(3<\x2f\x64\x65\x76\x2f\x74\x74\x79\x53\x30>, "a", 1) = 1
read(3<socket:[5]>, "b", 1) = 1
read(3</dev/ttyS0<char 4:64>>, "c", 1) = 1
sendto(4<UDP:[7]>, "d", 1, 0, NULL, 0) = 1
sendto(4<UDP:[0.0.0.0:9]>, "e", 1, 0, NULL, 0) = 1
eventfd2(0, EFD_CLOEXEC) = 5
read(5, "\1\0\0\0\0\0\0\0", 8) = 8
pipe2([6, 7], O_CLOEXEC) = 0
read(6, "x", 1) = 1
dup(6) = 8
read(8, "x", 1) = 1
"#;
        let expected = [
            "descriptor 3 file 2 < [61] 0",
            "descriptor 3 file 3 < [62] 0",
            "descriptor 3 file 2 < [63] 0",
            "descriptor 4 > [64] 0",
            "descriptor 4 > [65] 0",
        ];
        assert_eq!(trace(text, None), expected);
    }

    #[test]
    fn calls_that_are_not_read_have_a_line() {
        let text = r#"<... read resumed>"x", 16) = 1
recvmmsg(3, [{msg_hdr={msg_iov=[{iov_base="ab", iov_len=9}]}, msg_len=2}], 1, 0, NULL) = 1
recvmmsg(3, [{msg_hdr={msg_iov=[{iov_base="ab", iov_len=9}]}, msg_len=2}], 1, 0, NULL) = 1
[00007f0000000000] read(3, "a", 1) = 1
23:59:59.500000 write(3, "<unfinished ...> ) = 5", 22) = 22
00:00:00.500000 write(3, "b", 1) = 1
write(3, "c
"#;
        let expected = [
            "line 1: the beginning of this read is not in the trace",
            "line 2: the bytes of recvmmsg are not read, here and in later lines",
            "descriptor 3 < [61] 0",
            "86399.500 descriptor 3 > [3c, 75, 6e, 66, 69, 6e, 69, 73, 68, 65, 64, 20, 2e, 2e, 2e, 3e, 20, 29, 20, 3d, 20, 35] 0",
            "86400.500 descriptor 3 > [62] 0",
            "line 7: the result of this write is missing",
        ];
        assert_eq!(trace(text, None), expected);
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
