//! The state that outlives the process: records in their sequence until they are removed, in a [`Ring`]; numbers and texts by
//! their names, in a database, which also has the state of the ring.
//!
//! The content of a [`Batch`] with names is on the disk as a whole once [`Store::write`] returns, or not at all: its records are
//! bound to the names. Records alone outlive the process from then on, and a loss of power once [`SYNC`](crate::ring::SYNC) has
//! passed.

use std::cell::Cell;
use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind};
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::Once;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use redb::{Database, TableDefinition, TransactionError, WriteTransaction};

use crate::ring::{Ring, RingState};

const NAMES: TableDefinition<&str, &str> = TableDefinition::new("names");

/// The name of the file's format, and the format of this bridge.
const FORMAT_NAME: &str = "format";
const FORMAT: &str = "3";
/// The name of the ring's state.
const RING: &str = "ring";
/// The name of the length of the ring's file.
const LENGTH: &str = "length";
/// The name of the bridge that the store belongs to.
const OWNER: &str = "owner";

/// The size of the cache of the database, in bytes.
const CACHE: usize = 16 << 20;
/// The size by which the ring's file grows, in bytes.
const EXTENT: u64 = 256 << 10;
/// The number of unused bytes of the ring that may remain before they are overwritten.
const WASTE: u64 = 1 << 20;

const ADVICE: &str = "move it and its .records file away to start with an empty store: the waiting records are lost, and a command that is sent again is executed again";

/// Names and values.
pub type Names = Vec<(String, Option<String>)>;

/// Records and names.
#[allow(missing_debug_implementations, reason = "redb's tables have none")]
pub struct Store {
    path: PathBuf,
    /// Both are missing only while they are opened again.
    open: Option<(Database, Ring)>,
    /// The key of the next record, and the number of the ring's next frame, after what was written last.
    next: u64,
    number: u64,
    most: u64,
}

/// The file is open in another process.
#[derive(Debug)]
pub struct Busy(String);

/// The changes that are written at once.
#[derive(Debug, Default)]
pub struct Batch {
    /// The records to append, in their sequence.
    pub append: Vec<Vec<u8>>,
    /// The keys of records to remove.
    pub remove: Vec<u64>,
    /// Names and their new values; without one the name is removed.
    pub names: Names,
}

/// The result of a write.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct WriteResult {
    /// The number of old records that were dropped for new ones.
    pub dropped: u64,
    /// The names that were kept with the write, if any: those of before the batch, or those with it.
    pub kept: Option<KeptNames>,
}

/// The names that are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeptNames {
    /// The names of before the batch.
    Before,
    /// The names with the batch.
    Now,
}

impl Store {
    /// Opens the files or makes them. The records have up to `most` bytes: the oldest make room for more.
    ///
    /// # Errors
    /// If another process has the files open, or they are not files of a store.
    pub fn open(path: &Path, most: u64) -> Result<Self> {
        Self::open_until(path, most, None)
    }

    /// Opens a store; the frames of the ring from `cut` on do not count.
    #[allow(clippy::result_large_err, reason = "it is returned once")]
    fn open_until(path: &Path, most: u64, cut: Option<u64>) -> Result<Self> {
        let what = format!("the store {}", path.display());
        let records = beside(path);
        if records.exists() && !path.exists() {
            bail!("{what} is missing, but {} is not: restore the store, or {ADVICE}", records.display());
        }
        let database = match catch(|| open(path)) {
            Some(Ok(database)) => database,
            Some(Err(redb::Error::DatabaseAlreadyOpen)) => return Err(Busy(what).into()),
            Some(Err(redb::Error::Io(error))) if !is_damage(&error) => return Err(error).context(what),
            Some(Err(error)) => bail!("{what} is damaged, or of another version: {error}: {ADVICE}"),
            None => bail!("{what} is damaged: {ADVICE}"),
        };
        let format = get(&database, FORMAT_NAME)?;
        if let Some(format) = format.as_deref().filter(|format| *format != FORMAT) {
            bail!(
                "{what} has format {format}, and this bridge reads format {FORMAT}: use the bridge that wrote it, or {ADVICE}"
            );
        }
        // The names were removed, and the outcomes of commands with them.
        let has_records = std::fs::metadata(&records).is_ok_and(|records| records.len() > 0);
        let known = match get(&database, RING)? {
            Some(text) => {
                let known = format.and_then(|_| known_of(&text));
                Some(known.with_context(|| format!("{what} is damaged: {ADVICE}"))?)
            }
            None if has_records => {
                bail!("{what} is empty, but {} is not: restore the store, or {ADVICE}", records.display())
            }
            None => None,
        };
        let length = get(&database, LENGTH)?.map_or(Ok(0), |text| text.parse());
        let length: u64 = length.with_context(|| format!("{what} is damaged: {ADVICE}"))?;
        let found = std::fs::metadata(&records).map_or(0, |records| records.len());
        if found < length || known.is_some() && !records.exists() {
            bail!("{what} is damaged: {} has {found} bytes of {length}: {ADVICE}", records.display());
        }
        let new = RingState { seed: fastrand::u64(..), ..RingState::default() };
        let ring = private(&records).and_then(|file| Ring::open(file, known.unwrap_or(new), most, cut));
        let mut ring = match ring {
            Err(error) if is_damage(&error) => {
                bail!("{what} is damaged: {}: {error}: {ADVICE}", records.display())
            }
            ring => ring.with_context(|| format!("the store {}", records.display()))?,
        };
        if known.is_none() {
            let format = (FORMAT_NAME.into(), Some(FORMAT.into()));
            commit(&database, &mut ring, vec![format]).with_context(|| what)?;
        }
        let (next, number) = (ring.next(), ring.number());
        Ok(Self { path: path.to_owned(), open: Some((database, ring)), next, number, most })
    }

    /// Opens the files again, since no other action makes them usable after an error of the disk. The last completed write
    /// is the last one that counts.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn reopen(&mut self) -> Result<()> {
        self.open = None; // it holds a lock
        let mut again = Self::open_until(&self.path, self.most, Some(self.number))?;
        again.both()?.1.skip_to(self.next);
        self.open = again.open;
        Ok(())
    }

    fn both(&mut self) -> Result<(&mut Database, &mut Ring)> {
        self.open.as_mut().map(|(database, ring)| (database, ring)).context("cannot reopen the store")
    }

    fn database(&self) -> Result<&Database> {
        self.open.as_ref().map(|open| &open.0).context("cannot reopen the store")
    }

    /// Returns the key that the next record gets: each is more than the previous one.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Returns the number of records.
    pub fn len(&self) -> u64 {
        self.open.as_ref().map_or(0, |open| open.1.count())
    }

    /// Returns whether there are no records.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the bytes of the records, and their maximum.
    pub fn bytes(&self) -> (u64, u64) {
        (self.open.as_ref().map_or(0, |open| open.1.used()), self.most)
    }

    /// Writes the batch. `more` are names that are kept whenever any are: as of before the batch, or with it.
    ///
    /// # Errors
    /// If the disk does not take the batch: then [`reopen`](Self::reopen) the store; nothing has changed.
    pub fn write(&mut self, batch: &Batch, more: &dyn Fn(KeptNames) -> Names) -> Result<WriteResult> {
        let written =
            self.write_all(batch, more).with_context(|| format!("the store {}", self.path.display()))?;
        if let Some((_, ring)) = &self.open {
            (self.next, self.number) = (ring.next(), ring.number());
        }
        Ok(written)
    }

    fn write_all(&mut self, batch: &Batch, more: &dyn Fn(KeptNames) -> Names) -> Result<WriteResult> {
        let most = self.most;
        let (database, ring) = self.both()?;
        let (mut written, is_bound) = (WriteResult::default(), !batch.names.is_empty());
        let removed: Vec<u64> = batch.remove.iter().copied().filter(|key| ring.remove(*key)).collect();
        if ring.wasted() >= WASTE.min(most / 4) {
            commit(database, ring, more(KeptNames::Before))?;
            written.kept = Some(KeptNames::Before);
        }
        // A batch of more than half of the file does not occur at a site.
        let mut append = batch.append.as_slice();
        let mut frames = ring.frames(append, &removed, is_bound);
        while frames.iter().map(|frame| frame.len() as u64).sum::<u64>() > most / 2 {
            let gone = append.len().div_ceil(2);
            written.dropped += gone as u64;
            append = append.get(gone..).unwrap_or_default();
            frames = ring.frames(append, &removed, is_bound);
        }
        let (dropped, has_to_be_kept) = ring.make_room(frames.iter().map(|frame| frame.len() as u64).sum());
        written.dropped += dropped;
        if has_to_be_kept {
            commit(database, ring, more(KeptNames::Before))?;
            written.kept = Some(KeptNames::Before);
        }
        let bytes = frames.iter().map(|frame| frame.len() as u64).sum();
        if let Some(length) = ring.extend(bytes, EXTENT.min(most))? {
            put(database, vec![(LENGTH.into(), Some(length.to_string()))])?;
        }
        ring.write(&frames, append.len())?;
        if is_bound {
            commit(
                database,
                ring,
                more(KeptNames::Now).into_iter().chain(batch.names.iter().cloned()).collect(),
            )?;
            ring.mark()?;
            written.kept = Some(KeptNames::Now);
        } else if ring.sync_due().is_some_and(|due| due <= Instant::now()) {
            ring.sync()?;
        }
        Ok(written)
    }

    /// Returns the time at which an empty [`write`](Self::write) has something to do.
    pub fn due(&self) -> Option<Instant> {
        self.open.as_ref().and_then(|open| open.1.sync_due())
    }

    /// Returns up to `count` records from this key on, with their keys.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn records(&mut self, from: u64, count: usize) -> Result<Vec<(u64, Vec<u8>)>> {
        let path = self.path.clone();
        let found = self.both()?.1.records(from, count);
        found.with_context(|| format!("the records of the store {}", path.display()))
    }

    /// Passes every record that was written since names were kept to `see`, even removed ones.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn each(&mut self, see: impl FnMut(&[u8])) -> Result<()> {
        let path = self.path.clone();
        let seen = self.both()?.1.each(see);
        seen.with_context(|| format!("the records of the store {}", path.display()))
    }

    /// Makes the store that of a bridge, unless it is another bridge's.
    ///
    /// # Errors
    /// If it is another bridge's, or cannot be read or written.
    pub fn belong_to(&mut self, owner: &str) -> Result<()> {
        let what = format!("the store {}", self.path.display());
        match self.get(OWNER)? {
            Some(found) if found == owner => Ok(()),
            Some(found) => bail!("{what} is that of the bridge {found}, and this is {owner}: {ADVICE}"),
            None => put(self.both()?.0, vec![(OWNER.into(), Some(owner.to_owned()))]).with_context(|| what),
        }
    }

    /// Returns the value of a name.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn get(&self, name: &str) -> Result<Option<String>> {
        get(self.database()?, name).with_context(|| format!("the store {}", self.path.display()))
    }

    /// Returns every name that begins so, with its value, in order.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn names(&self, prefix: &str) -> Result<Vec<(String, String)>> {
        let read = || -> Result<_> {
            let names = self.database()?.begin_read()?.open_table(NAMES)?;
            let mut found = Vec::new();
            for entry in names.range(prefix..)? {
                let (name, value) = entry?;
                if !name.value().starts_with(prefix) {
                    break;
                }
                found.push((name.value().to_owned(), value.value().to_owned()));
            }
            Ok(found)
        };
        read().with_context(|| format!("the store {}", self.path.display()))
    }
}

impl fmt::Display for Busy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is open in another process: each bridge needs its own store", self.0)
    }
}

impl std::error::Error for Busy {}

/// Keeps names and the state of the ring: everything that was written to the ring before is then on the disk.
fn commit(database: &Database, ring: &mut Ring, mut changed: Names) -> Result<()> {
    ring.sync()?;
    let known = ring.known();
    let RingState { seed, first, end, next, commits } = known;
    changed.push((RING.into(), Some(format!("{seed} {first} {end} {next} {commits}"))));
    put(database, changed)?;
    ring.set_known(known);
    Ok(())
}

/// Keeps names.
fn put(database: &Database, changed: Names) -> Result<()> {
    let transaction = begin(database)?;
    {
        let mut names = transaction.open_table(NAMES)?;
        for (name, value) in &changed {
            match value {
                Some(value) => names.insert(name.as_str(), value.as_str())?,
                None => names.remove(name.as_str())?,
            };
        }
    }
    transaction.commit()?;
    Ok(())
}

/// Begins a commit with two phases. With one phase, a commit whose pages are damaged later would count as one that a power
/// failure has cut: an outcome would be missing without an error, and its command might be executed again.
#[allow(clippy::result_large_err, reason = "it is returned once")]
fn begin(database: &Database) -> Result<WriteTransaction, TransactionError> {
    let mut transaction = database.begin_write()?;
    transaction.set_two_phase_commit(true);
    Ok(transaction)
}

fn known_of(text: &str) -> Option<RingState> {
    let mut numbers = text.split(' ').map(str::parse::<u64>);
    let mut number = || numbers.next()?.ok();
    // A store of an earlier version has four numbers.
    let (seed, first, end, next) = (number()?, number()?, number()?, number()?);
    Some(RingState { seed, first, end, next, commits: number().unwrap_or_default() })
}

fn get(database: &Database, name: &str) -> Result<Option<String>> {
    let names = database.begin_read()?.open_table(NAMES)?;
    Ok(names.get(name)?.map(|value| value.value().to_owned()))
}

/// Returns the file of the records of a store.
pub fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".records");
    name.into()
}

fn is_damage(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::InvalidData | ErrorKind::UnexpectedEof)
}

#[allow(clippy::result_large_err, reason = "it is returned once")]
fn open(path: &Path) -> Result<Database, redb::Error> {
    let file = private(path)?;
    let mut database = Database::builder().set_cache_size(CACHE).create_file(file)?;
    database.check_integrity()?;
    let transaction = begin(&database)?;
    transaction.open_table(NAMES)?;
    transaction.commit()?;
    Ok(database)
}

/// Opens the file, readable for its owner alone, even if an earlier version has made it.
fn private(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false);
    #[cfg(unix)]
    {
        use std::os::unix::fs::{OpenOptionsExt as _, PermissionsExt as _};
        let file = options.mode(0o600).open(path)?;
        file.set_permissions(std::fs::Permissions::from_mode(0o600))?;
        Ok(file)
    }
    #[cfg(not(unix))]
    options.open(path)
}

thread_local! {
    /// This thread's panics are not printed.
    static IS_QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Wraps the process's panic hook, once: panics of other threads are printed as before.
static QUIET: Once = Once::new();

/// Opens a file; a panic of redb, which asserts its expectations of the file, becomes `None` without a printed trace.
fn catch<T>(open: impl FnOnce() -> T) -> Option<T> {
    QUIET.call_once(|| {
        let hook = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !IS_QUIET.get() {
                hook(info);
            }
        }));
    });
    IS_QUIET.set(true);
    let outcome = panic::catch_unwind(AssertUnwindSafe(open));
    IS_QUIET.set(false);
    outcome.ok()
}

#[cfg(test)]
mod tests;
