//! Records in a file of a bounded size, written one after the other; at its end the writing begins at its start again.
//!
//! ```text
//!  │ frame │ frame │ frame │ …      frame: "cwR1", length, CRC-32, then a message of up to 64 records and of keys that were removed
//! ```
//!
//! Frames have consecutive numbers. The caller that opens the ring states the range that is needed, which begins with the first
//! frame whose records were not all removed; the other frames in the file are of an earlier lap. A frame that is missing is
//! damage, unless a loss of power may have taken it: it was written after the last [`sync`](Ring::sync).

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::time::{Duration, Instant};

use prost::Message;

const MAGIC: [u8; 4] = *b"cwR1";
/// The bytes of a frame before its message: the magic word, the length of the message, its checksum.
const HEAD: usize = 12;
/// Frames begin at multiples of this.
const ALIGN: u64 = 8;
/// The most records of a frame: the bits of [`Extent::alive`].
const CAPACITY: usize = 64;
/// The file is read in pieces of this size when it is opened.
const PIECE: usize = 1 << 20;
/// The time after which a written frame is on the disk.
pub const SYNC: Duration = Duration::from_millis(200);

/// Records in a file.
#[derive(Debug)]
pub struct Ring {
    file: File,
    known: RingState,
    /// The most bytes of the file.
    most: u64,
    /// The offset of the next frame in the file.
    at: u64,
    /// The number of the next frame.
    number: u64,
    /// Frames below this one are on the disk.
    synced: u64,
    unsynced_since: Option<Instant>,
    /// The frames from the first that is needed on; a frame without remaining records is listed only if a [`RingState`]
    /// still names it.
    places: VecDeque<Extent>,
    /// The key of the next record.
    next: u64,
    length: u64,
}

/// The state of a ring, as it is kept elsewhere.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RingState {
    /// A number of this ring alone.
    pub seed: u64,
    /// The number of the first frame that is needed.
    pub first: u64,
    /// Frames below this number are complete; a frame from this number on that is bound to the contents of another file was
    /// not finished.
    pub end: u64,
    /// The key of the next record is this or higher.
    pub next: u64,
    /// The number of times that the state was kept.
    pub commits: u64,
}

/// The position of a frame in the file.
#[derive(Debug, Clone, Copy)]
struct Extent {
    number: u64,
    /// The key of the frame's first record.
    first: u64,
    offset: u64,
    length: u64,
    /// A bit for each record that is there.
    alive: u64,
}

/// The records and removals that are written at once.
#[derive(Clone, PartialEq, Message)]
struct Frame {
    #[prost(uint64, tag = "1")]
    number: u64,
    #[prost(uint64, tag = "2")]
    first: u64,
    /// Frames below this number were on the disk when this one was written.
    #[prost(uint64, tag = "3")]
    synced: u64,
    /// The frame counts only if the frames up to it are known elsewhere.
    #[prost(bool, tag = "4")]
    is_bound: bool,
    /// Keys that were removed: the first of some that follow one another, and how many.
    #[prost(uint64, repeated, tag = "5")]
    removed: Vec<u64>,
    #[prost(bytes = "vec", repeated, tag = "6")]
    records: Vec<Vec<u8>>,
    /// The number of times that the state of the ring had been kept when this frame was written.
    #[prost(uint64, tag = "7")]
    commits: u64,
}

impl Ring {
    /// Opens the ring of a file, or begins one. Frames from `cut` on do not count.
    ///
    /// # Errors
    /// If the file cannot be read, or differs from `known` ([`io::ErrorKind::InvalidData`]).
    pub fn open(file: File, known: RingState, most: u64, cut: Option<u64>) -> io::Result<Self> {
        let mut ring = Self {
            file,
            known,
            most,
            at: 0,
            number: known.first,
            synced: known.end,
            unsynced_since: Some(Instant::now()), // a process that was killed has left that to the system
            places: VecDeque::new(),
            next: known.next,
            length: 0,
        };
        let mut found = ring.scan()?;
        found.sort_unstable_by_key(|(frame, ..)| frame.number);
        let synced = found.iter().map(|(frame, ..)| frame.synced).max().unwrap_or_default();
        if cut.is_none() && found.iter().any(|(frame, ..)| frame.commits > known.commits) {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "the store is older than its records"));
        }
        let mut found = found.into_iter().peekable();
        let counts = |ring: &Self, frame: &Frame| {
            frame.number == ring.number
                && !(frame.is_bound && frame.number >= known.end)
                && cut.is_none_or(|cut| frame.number < cut)
        };
        while let Some((frame, offset, length)) = found.next_if(|(frame, ..)| counts(&ring, frame)) {
            ring.take(&frame, offset, length);
        }
        let number = ring.number;
        if cut.is_none() && found.peek().is_some_and(|(frame, ..)| frame.number > number) && synced > number {
            return Err(missing(number));
        }
        // These frames would be in the way of those that get their numbers now.
        for (_, offset, _) in found {
            ring.erase(offset)?;
        }
        match ring.number < known.end && cut.is_none() {
            true => Err(missing(ring.number)),
            false => Ok(ring),
        }
    }

    /// Finds every frame from the first that is needed on, without its records; returns each with its offset and length.
    fn scan(&mut self) -> io::Result<Vec<(Frame, u64, u64)>> {
        let length = self.file.metadata()?.len();
        let (mut found, mut at, mut piece, mut start) = (Vec::new(), 0, Vec::new(), 0);
        while at + HEAD as u64 <= length {
            let mut wanted = HEAD;
            let frame = loop {
                if at < start || at + wanted as u64 > start + piece.len() as u64 {
                    (start, piece) = (at, self.read(at, PIECE.max(wanted).min(to_usize(length - at)))?);
                }
                let bytes = piece.get(to_usize(at - start)..).unwrap_or_default();
                match (parse(self.known.seed, bytes), at + wanted as u64 <= length) {
                    (ScanResult::More(more), true) if more > wanted && at + more as u64 <= length => {
                        wanted = more
                    }
                    (ScanResult::Frame(frame, length), _) => break Some((frame, length)),
                    _ => break None,
                }
            };
            at += match frame {
                Some((frame, length)) => {
                    if frame.number >= self.known.first {
                        found.push((frame, at, length));
                    }
                    length
                }
                None => ALIGN,
            };
        }
        Ok(found)
    }

    fn take(&mut self, frame: &Frame, offset: u64, length: u64) {
        for run in frame.removed.chunks_exact(2) {
            if let [first, count] = *run {
                for key in first..first.saturating_add(count) {
                    self.remove(key);
                }
            }
        }
        let count = frame.records.len();
        let alive = bits(count);
        self.places.push_back(Extent { number: frame.number, first: frame.first, offset, length, alive });
        self.number = frame.number + 1;
        self.next = self.next.max(frame.first + count as u64);
        self.length += count as u64;
        self.at = offset + length;
    }

    /// Returns the state to keep elsewhere. Once it is kept, frames before the first needed one may be overwritten.
    pub fn known(&self) -> RingState {
        let first =
            self.places.iter().find(|place| place.alive != 0).map_or(self.number, |place| place.number);
        RingState { first, end: self.number, next: self.next, commits: self.known.commits + 1, ..self.known }
    }

    /// Writes, if there is free space, a frame that has only the number of times that the state was kept, so that an earlier
    /// state does not take its place unnoticed.
    ///
    /// # Errors
    /// If the disk does not take the frame.
    pub fn mark(&mut self) -> io::Result<()> {
        let frame = self.pack(Frame { number: self.number, first: self.next, ..Frame::default() });
        let end = self.at + frame.len() as u64;
        let is_free = !self.places.front().is_some_and(|place| (self.at..end).contains(&place.offset));
        if is_free && end <= self.file.metadata()?.len() { self.write(&[frame], 0) } else { Ok(()) }
    }

    /// Notes that this state is kept.
    pub fn set_known(&mut self, known: RingState) {
        self.known = known;
        while self.places.front().is_some_and(|place| place.number < known.first) {
            self.places.pop_front();
        }
        if self.places.is_empty() {
            self.at = 0;
        }
    }

    /// Returns the key of the next record.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Sets the lowest key of the next record.
    pub fn skip_to(&mut self, next: u64) {
        self.next = self.next.max(next);
    }

    /// Returns the number of the next frame.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Returns the number of records.
    pub fn count(&self) -> u64 {
        self.length
    }

    /// Returns the bytes of the file from the first record that is there to the last.
    pub fn used(&self) -> u64 {
        let first = self.places.iter().find(|place| place.alive != 0).map_or(self.at, |place| place.offset);
        if first <= self.at { self.at - first } else { self.most - (first - self.at) }
    }

    /// Returns the bytes before the first record that is there which may not be overwritten, because the kept state names them.
    pub fn wasted(&self) -> u64 {
        let Some(front) = self.places.front() else { return 0 };
        let first = self.places.iter().find(|place| place.alive != 0).map_or(self.at, |place| place.offset);
        if front.offset <= first { first - front.offset } else { self.most }
    }

    fn of(&self, key: u64) -> usize {
        self.places.partition_point(|place| place.first <= key).saturating_sub(1)
    }

    /// Removes a record, if it is there; it is written by the next [`write`](Self::write).
    pub fn remove(&mut self, key: u64) -> bool {
        let at = self.of(key);
        let Some(place) = self.places.get_mut(at) else { return false };
        let bit = key.checked_sub(place.first).filter(|bit| *bit < CAPACITY as u64).map_or(0, |bit| 1 << bit);
        let is_there = place.alive & bit != 0;
        place.alive &= !bit;
        self.length -= u64::from(is_there);
        is_there
    }

    /// Returns the bytes of the frames of these records.
    pub fn frames(&self, records: &[Vec<u8>], removed: &[u64], is_bound: bool) -> Vec<Vec<u8>> {
        let mut runs: Vec<u64> = Vec::new();
        for key in removed {
            match runs.as_mut_slice() {
                [.., first, count] if *first + *count == *key => *count += 1,
                _ => runs.extend([*key, 1]),
            }
        }
        let (mut frames, mut first) = (Vec::new(), self.next);
        let mut chunks = records.chunks(CAPACITY);
        let mut next = chunks.next();
        while next.is_some() || !runs.is_empty() {
            let records = next.unwrap_or_default().to_vec();
            let count = records.len() as u64;
            frames.push(self.pack(Frame {
                number: self.number + frames.len() as u64,
                first,
                is_bound,
                removed: core::mem::take(&mut runs),
                records,
                ..Frame::default()
            }));
            first += count;
            next = chunks.next();
        }
        frames
    }

    /// Makes space for this many bytes: the oldest records are dropped. Returns their number, and whether the
    /// [`known`](Self::known) state must be kept before anything is written.
    pub fn make_room(&mut self, bytes: u64) -> (u64, bool) {
        let (mut dropped, mut has_to_be_kept) = (0, false);
        let mut forget = |ring: &mut Self| {
            let gone = ring.places.pop_front().map_or(0, |place| u64::from(place.alive.count_ones()));
            (ring.length, dropped, has_to_be_kept) = (ring.length - gone, dropped + gone, true);
        };
        if self.at + bytes > self.most {
            while self.places.front().is_some_and(|place| place.offset >= self.at) {
                forget(self);
            }
            self.at = 0;
        }
        // More than is needed, so that not each write has to.
        let end = self.at + bytes + self.most / 64;
        while self.places.front().is_some_and(|place| (self.at..end).contains(&place.offset)) {
            forget(self);
        }
        (dropped, has_to_be_kept)
    }

    /// Makes the file long enough for this many bytes, by multiples of `extent`. Returns its length if it has changed.
    ///
    /// # Errors
    /// If the disk does not take the bytes.
    pub fn extend(&self, bytes: u64, extent: u64) -> io::Result<Option<u64>> {
        if self.at + bytes <= self.file.metadata()?.len() {
            return Ok(None);
        }
        let length = (self.at + bytes).next_multiple_of(extent).min(self.most.max(self.at + bytes));
        self.file.set_len(length)?;
        Ok(Some(length))
    }

    /// Writes frames of [`frames`](Self::frames), for which there must be free space: another process can read them from now
    /// on, and they are on the disk after [`sync`](Self::sync).
    ///
    /// # Errors
    /// If the disk does not take the frames.
    pub fn write(&mut self, frames: &[Vec<u8>], records: usize) -> io::Result<()> {
        if frames.is_empty() {
            return Ok(());
        }
        self.file.seek(SeekFrom::Start(self.at))?;
        self.file.write_all(&frames.concat())?;
        self.unsynced_since.get_or_insert_with(Instant::now);
        let mut left = records;
        for frame in frames {
            let count = left.min(CAPACITY);
            left -= count;
            let (length, offset) = (frame.len() as u64, self.at);
            let alive = bits(count);
            self.places.push_back(Extent { number: self.number, first: self.next, offset, length, alive });
            self.number += 1;
            self.next += count as u64;
            self.length += count as u64;
            self.at += length;
        }
        Ok(())
    }

    /// Returns the time at which [`sync`](Self::sync) is due.
    pub fn sync_due(&self) -> Option<Instant> {
        self.unsynced_since.map(|since| since + SYNC)
    }

    /// Syncs the file: everything that was written is on the disk once this returns.
    ///
    /// # Errors
    /// If the disk does not take the data.
    pub fn sync(&mut self) -> io::Result<()> {
        if self.unsynced_since.is_some() {
            self.file.sync_data()?;
            (self.unsynced_since, self.synced) = (None, self.number);
        }
        Ok(())
    }

    /// Returns up to `count` records from this key on, with their keys.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn records(&mut self, from: u64, count: usize) -> io::Result<Vec<(u64, Vec<u8>)>> {
        let mut found = Vec::new();
        for at in self.of(from)..self.places.len() {
            let has_some =
                |place: &Extent| place.first + u64::from(u64::BITS - place.alive.leading_zeros()) > from;
            let is_read = |place: &Extent| place.alive != 0 && has_some(place);
            let Some(place) = self.places.get(at).copied().filter(is_read) else { continue };
            let keyed = (place.first..).zip(self.frame(place)?.records);
            found.extend(
                keyed.filter(|(key, _)| *key >= from && place.alive & (1 << (key - place.first)) != 0),
            );
            if found.len() >= count {
                found.truncate(count);
                break;
            }
        }
        Ok(found)
    }

    /// Passes every record that is in the file from the first needed frame on to `see`, even removed ones.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn each(&mut self, mut see: impl FnMut(&[u8])) -> io::Result<()> {
        for at in 0..self.places.len() {
            let Some(place) = self.places.get(at).copied() else { break };
            self.frame(place)?.records.iter().for_each(|record| see(record));
        }
        Ok(())
    }

    /// Returns the bytes of a frame, with the fields that each frame has about those before it.
    fn pack(&self, frame: Frame) -> Vec<u8> {
        let frame = Frame { synced: self.synced, commits: self.known.commits, ..frame };
        pack(self.known.seed, &frame)
    }

    fn frame(&mut self, place: Extent) -> io::Result<Frame> {
        let bytes = self.read(place.offset, to_usize(place.length))?;
        match parse(self.known.seed, &bytes) {
            ScanResult::Frame(frame, _) if frame.number == place.number => Ok(frame),
            _ => Err(missing(place.number)),
        }
    }

    fn read(&mut self, at: u64, length: usize) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; length];
        self.file.seek(SeekFrom::Start(at))?;
        self.file.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    fn erase(&mut self, at: u64) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(at))?;
        self.file.write_all(&[0; HEAD])?;
        self.unsynced_since.get_or_insert_with(Instant::now);
        Ok(())
    }
}

enum ScanResult {
    Frame(Frame, u64),
    /// The number of bytes that are needed.
    More(usize),
    Nothing,
}

fn parse(seed: u64, bytes: &[u8]) -> ScanResult {
    let Some((head, rest)) = bytes.split_first_chunk::<HEAD>() else { return ScanResult::More(HEAD) };
    let [m0, m1, m2, m3, l0, l1, l2, l3, c0, c1, c2, c3] = *head;
    if [m0, m1, m2, m3] != MAGIC {
        return ScanResult::Nothing;
    }
    let length = u32::from_le_bytes([l0, l1, l2, l3]) as usize;
    let Some(message) = rest.get(..length) else { return ScanResult::More(HEAD.saturating_add(length)) };
    if u32::from_le_bytes([c0, c1, c2, c3]) != checksum(seed, message) {
        return ScanResult::Nothing;
    }
    let whole = (HEAD + length) as u64;
    Frame::decode(message)
        .map_or(ScanResult::Nothing, |frame| ScanResult::Frame(frame, whole.next_multiple_of(ALIGN)))
}

fn pack(seed: u64, frame: &Frame) -> Vec<u8> {
    let message = frame.encode_to_vec();
    let mut bytes = MAGIC.to_vec();
    bytes.extend(u32::try_from(message.len()).unwrap_or(u32::MAX).to_le_bytes());
    bytes.extend(checksum(seed, &message).to_le_bytes());
    bytes.extend(message);
    bytes.resize(bytes.len().next_multiple_of(to_usize(ALIGN)), 0);
    bytes
}

fn checksum(seed: u64, message: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&seed.to_le_bytes());
    hasher.update(message);
    hasher.finalize()
}

/// Returns a bit for each of this many records.
fn bits(count: usize) -> u64 {
    (0..count.min(CAPACITY)).fold(0, |bits, bit| bits | 1 << bit)
}

fn missing(number: u64) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("its frame {number} is damaged or missing"))
}

fn to_usize(length: u64) -> usize {
    usize::try_from(length).unwrap_or(usize::MAX)
}
