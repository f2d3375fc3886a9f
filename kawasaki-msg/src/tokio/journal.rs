//! The journal of an order, from which a killed program resumes the order when it restarts.

use core::fmt::{self, Write as _};
use core::future::Future;
use core::str::FromStr;
use core::time::Duration;
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::string::String;
use std::thread;
use std::vec::Vec;

use fs4::FileExt;
use robot_session::tokio::{JoinHandle, spawn_blocking};

/// The last order of a program, as it was stored: the program continues from it when it starts again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LastOrder {
    /// No job of an order was sent.
    None,
    /// The program ended before the order: [`Pc::resume`](super::Pc::resume) continues it, and no job is executed twice.
    Active(JournalEntry),
    /// The order has ended before its last job: it was interrupted, or a job did not fit. Its first `executed` jobs are
    /// executed, and no others: [`Pc::go_on`](super::Pc::go_on) begins an order with the rest.
    Stopped(JournalEntry),
    /// All jobs of the order are executed. If the order is started again, they are executed again.
    Complete(JournalEntry),
    /// The outcome of the jobs from `executed` to `sent` is unknown
    /// ([`Error::OutcomeUnknown`](super::Error::OutcomeUnknown)). Check the workpiece, and set
    /// [`executed`](JournalEntry::executed) to the jobs that are done: [`Pc::go_on`](super::Pc::go_on) continues after them.
    Unknown(JournalEntry),
}

/// The progress of an order, or its last progress once it has ended.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct JournalEntry {
    /// The number of the order, from 1.
    pub order: u16,
    /// The index of the order's first job in the list of jobs: 0, unless it continues an order that was stopped. The counts
    /// below begin there.
    pub first: u32,
    /// The number of jobs of the order that are known to be executed, all of them from the first on.
    pub executed: u32,
    /// The first job that was not sent.
    pub sent: u32,
    /// The jobs that are known to be executed ahead of others, counted from 0.
    pub ahead: Vec<u32>,
}

impl JournalEntry {
    /// Returns the number of jobs of the list that are known to be executed, all of them from its first on: by this order and
    /// the stopped ones before it.
    pub const fn done(&self) -> u32 {
        self.first.saturating_add(self.executed)
    }
}

/// Stores the progress of an order, before the robot can receive it.
pub trait ProgressStore: Send + 'static {
    /// Stores the progress durably: even across a loss of power, if the program is to survive that. `last` is never
    /// [`LastOrder::None`].
    ///
    /// # Errors
    /// The progress could not be stored: the packet is not sent, and the connection ends.
    fn keep(&mut self, last: &LastOrder) -> impl Future<Output = io::Result<()>> + Send;
}

/// Stores nothing: an order ends with the program.
impl ProgressStore for () {
    async fn keep(&mut self, _last: &LastOrder) -> io::Result<()> {
        Ok(())
    }
}

/// A file that stores the progress: a line `ORDER FIRST EXECUTED SENT [AHEAD …] [stopped|complete|unknown] *CHECKSUM` before
/// jobs are sent, for every 64 executed jobs and for the end; the last line counts. The checksum is the CRC-32 of the line
/// before it, in hex.
///
/// A change is written and synchronised to the disk in a thread for blocking work: a slow disk does not delay other tasks of
/// the runtime.
#[derive(Debug)]
pub struct Journal {
    /// `None` while a change is being written.
    writer: Option<Writer>,
    /// The change that is being written. The write continues if its future is dropped.
    writing: Option<(Writing, LastOrder)>,
}

type Writing = JoinHandle<(Writer, io::Result<()>)>;

#[derive(Debug)]
struct Writer {
    file: File,
    line: String,
    length: u64,
}

/// The longest time for the last write of a journal that was dropped.
const LAST_WRITE: Duration = Duration::from_secs(1);
/// The interval at which the lock of a journal is tried again.
const RETRY: Duration = Duration::from_millis(10);
/// The size at which the file is rewritten with its last line.
const REWRITE_SIZE: u64 = 1 << 20;

impl Journal {
    /// Opens a journal, or creates one; returns it with the last order. One program has it at a time.
    ///
    /// # Errors
    /// The errors of the file system; another program has the journal, even after a second; the file has other contents, or a
    /// damaged line ([`InvalidData`](io::ErrorKind::InvalidData)). Then the jobs that the robot has executed are not known:
    /// check the workpiece, remove the file, and [continue](super::Pc::go_on) after the last executed job.
    #[allow(clippy::disallowed_methods, reason = "the lock of a file can only be tried again")]
    pub fn open(path: impl AsRef<Path>) -> io::Result<(Self, LastOrder)> {
        let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        let mut waited = Duration::ZERO;
        while FileExt::try_lock(&file).is_err() {
            if waited >= LAST_WRITE {
                return Err(io::Error::new(io::ErrorKind::ResourceBusy, "another program has this journal"));
            }
            thread::sleep(RETRY);
            waited += RETRY;
        }
        let mut text = String::new();
        file.read_to_string(&mut text)?;
        // A last line without a line feed was not written completely: drop it.
        let whole = text.rfind('\n').map_or("", |end| text.get(..=end).unwrap_or_default());
        let last = whole.lines().last().map(|line| match line.rsplit_once(" *") {
            Some((text, sum)) if u32::from_str_radix(sum, 16) == Ok(crc32fast::hash(text.as_bytes())) => {
                LastOrder::from_str(text)
            }
            _ => Err(damaged(line)),
        });
        let last = last.unwrap_or(Ok(LastOrder::None))?;
        let length = whole.len() as u64;
        file.set_len(length)?;
        file.seek(SeekFrom::Start(length))?;
        let writer = Writer { file, line: String::new(), length };
        Ok((Self { writer: Some(writer), writing: None }, last))
    }

    /// Waits for the change that is being written. Returns the change and the result.
    async fn written(&mut self) -> Option<(LastOrder, io::Result<()>)> {
        let (writing, _) = self.writing.as_mut()?;
        let joined = writing.await;
        let (_, last) = self.writing.take()?;
        let result = joined.map_err(io::Error::other).and_then(|(writer, result)| {
            self.writer = Some(writer);
            result
        });
        Some((last, result))
    }
}

impl Writer {
    fn store(&mut self, last: &LastOrder) -> io::Result<()> {
        let written = self.write(last);
        if written.is_err() {
            // Overwrite a line that was not written completely.
            self.file.set_len(self.length)?;
            self.file.seek(SeekFrom::Start(self.length))?;
        }
        written
    }

    fn write(&mut self, last: &LastOrder) -> io::Result<()> {
        self.line.clear();
        write!(self.line, "{last}").map_err(io::Error::other)?;
        let sum = crc32fast::hash(self.line.as_bytes());
        writeln!(self.line, " *{sum:08x}").map_err(io::Error::other)?;
        self.file.write_all(self.line.as_bytes())?;
        self.file.sync_data()?;
        self.length += self.line.len() as u64;
        if self.length > REWRITE_SIZE {
            self.begin_anew()?;
        }
        Ok(())
    }

    /// Writes the last line at the beginning of the file, then truncates the file after it: at any moment the last whole line
    /// is this one.
    fn begin_anew(&mut self) -> io::Result<()> {
        let length = self.line.len() as u64;
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(self.line.as_bytes())?;
        self.file.sync_data()?;
        self.file.set_len(length)?;
        self.file.sync_data()?;
        self.length = length;
        Ok(())
    }
}

impl ProgressStore for Journal {
    async fn keep(&mut self, last: &LastOrder) -> io::Result<()> {
        if let Some((written, result)) = self.written().await
            && written == *last
        {
            return result;
        }
        let Some(mut writer) = self.writer.take() else {
            return Err(io::Error::other("the journal has stopped in the middle of a line"));
        };
        let change = last.clone();
        let writing = spawn_blocking(move || {
            let result = writer.store(&change);
            (writer, result)
        });
        self.writing = Some((writing, last.clone()));
        self.written().await.map_or(Ok(()), |(_, result)| result)
    }
}

/// Writes the words of a line of the journal.
impl fmt::Display for LastOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (JournalEntry { order, first, executed, sent, ahead }, end) = match self {
            Self::None => return Ok(()),
            Self::Active(kept) => (kept, ""),
            Self::Stopped(kept) => (kept, " stopped"),
            Self::Complete(kept) => (kept, " complete"),
            Self::Unknown(kept) => (kept, " unknown"),
        };
        write!(f, "{order} {first} {executed} {sent}")?;
        ahead.iter().try_for_each(|index| write!(f, " {index}"))?;
        f.write_str(end)
    }
}

impl FromStr for LastOrder {
    type Err = io::Error;

    fn from_str(line: &str) -> io::Result<Self> {
        let wrong = || damaged(line);
        let (numbers, last): (_, fn(JournalEntry) -> Self) = match line.rsplit_once(' ') {
            Some((numbers, "stopped")) => (numbers, Self::Stopped),
            Some((numbers, "complete")) => (numbers, Self::Complete),
            Some((numbers, "unknown")) => (numbers, Self::Unknown),
            _ => (line, Self::Active),
        };
        let mut words = numbers.split(' ');
        let mut word = || words.next().ok_or_else(wrong);
        let (order, first) = (word()?.parse(), word()?.parse());
        let (executed, sent) = (word()?.parse(), word()?.parse());
        let ahead = words.map(str::parse).collect();
        match (order, first, executed, sent, ahead) {
            (Ok(order), Ok(first), Ok(executed), Ok(sent), Ok(ahead)) => {
                let kept = JournalEntry { order, first, executed, sent, ahead };
                let fits = executed <= sent && kept.ahead.iter().all(|index| *index < sent);
                match last(kept) {
                    _ if !fits => Err(wrong()),
                    // The robot has none of its jobs.
                    Self::Stopped(JournalEntry { first: 0, sent: 0, .. }) => Ok(Self::None),
                    last => Ok(last),
                }
            }
            _ => Err(wrong()),
        }
    }
}

fn damaged(line: &str) -> io::Error {
    let message = std::format!(
        "this is not the journal of an order, or it is damaged: {line:?} is not ORDER FIRST EXECUTED SENT [AHEAD …] [stopped|complete|unknown] *CHECKSUM"
    );
    io::Error::new(io::ErrorKind::InvalidData, message)
}
