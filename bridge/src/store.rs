//! A file that outlives the process: records in their order until they are removed, numbers and texts by their names.
//!
//! What a [`Batch`] holds is in the file as a whole once [`Store::write`] returns, also if the power fails then, or not at all.

use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind};
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use redb::{Database, ReadableTable, ReadableTableMetadata, TableDefinition};

const RECORDS: TableDefinition<u64, &[u8]> = TableDefinition::new("records");
const NAMES: TableDefinition<&str, &str> = TableDefinition::new("names");

/// The name of the file's format, and the format of this bridge. A file without one has the first.
const FORMAT_NAME: &str = "format";
const FORMAT: u32 = 2;

/// What the file is read through, in bytes.
const CACHE: usize = 16 << 20;

const ADVICE: &str = "move the file away, and a new one is made; what waits in it is lost";

/// Records and names in a file.
#[allow(missing_debug_implementations, reason = "redb's tables have none")]
pub struct Store {
    path: PathBuf,
    /// Missing only while it is opened again.
    database: Option<Database>,
    /// The key of the next record.
    next: u64,
    length: u64,
    most: u64,
}

/// The file is open in another process.
#[derive(Debug)]
pub struct Busy(String);

/// What is written at once.
#[derive(Debug, Default)]
pub struct Batch {
    /// Records to append.
    pub append: Vec<Vec<u8>>,
    /// The keys of records to remove.
    pub remove: Vec<u64>,
    /// Names and their new values; without one the name is removed.
    pub names: Vec<(String, Option<String>)>,
}

impl Store {
    /// Opens the file or makes it. It holds up to `most` records: the oldest make room for more.
    ///
    /// # Errors
    /// When another process has it open, or it is no such file.
    #[allow(clippy::result_large_err, reason = "it is returned once")]
    pub fn open(path: &Path, most: u64) -> Result<Self> {
        let what = format!("the store {}", path.display());
        let (database, next, length) = match catch(|| open(path)) {
            Some(Ok(opened)) => opened,
            Some(Err(redb::Error::DatabaseAlreadyOpen)) => return Err(Busy(what).into()),
            Some(Err(redb::Error::Io(error)))
                if !matches!(error.kind(), ErrorKind::InvalidData | ErrorKind::UnexpectedEof) =>
            {
                return Err(error).context(what);
            }
            Some(Err(error)) => bail!("{what} is damaged, or of another version: {error}: {ADVICE}"),
            None => bail!("{what} is damaged: {ADVICE}"),
        };
        let store = Self { path: path.to_owned(), database: Some(database), next, length, most: most.max(1) };
        let format = store.format()?;
        if format > FORMAT {
            bail!(
                "{what} has format {format}, and this bridge knows up to {FORMAT}: run the bridge that has written it, or {ADVICE}"
            );
        }
        Ok(store)
    }

    fn format(&self) -> Result<u32> {
        Ok(self.get(FORMAT_NAME)?.and_then(|text| text.parse().ok()).unwrap_or(1))
    }

    /// Whether the file is of an earlier format: then the batch, with what else changes, makes it one of this format.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn upgrade(&self, batch: &mut Batch) -> Result<bool> {
        let is_older = self.format()? < FORMAT;
        if is_older {
            batch.names.push((FORMAT_NAME.into(), Some(FORMAT.to_string())));
        }
        Ok(is_older)
    }

    /// Opens the file again: after an error of the disk nothing else makes it usable.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn reopen(&mut self) -> Result<()> {
        self.database = None; // it holds a lock
        let Self { database, next, length, .. } = Self::open(&self.path, self.most)?;
        (self.database, self.next, self.length) = (database, next.max(self.next), length);
        Ok(())
    }

    fn database(&self) -> Result<&Database> {
        self.database.as_ref().context("it could not be opened again")
    }

    /// The key that the next record gets: each is one more than the one before.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// How many records there are.
    pub fn len(&self) -> u64 {
        self.length
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Writes all of it. Returns how many old records had to make room.
    ///
    /// # Errors
    /// When the disk does not take it: then nothing has changed.
    pub fn write(&mut self, batch: &Batch) -> Result<u64> {
        let (next, length, dropped) =
            self.write_all(batch).with_context(|| format!("the store {}", self.path.display()))?;
        (self.next, self.length) = (next, length);
        Ok(dropped)
    }

    fn write_all(&self, batch: &Batch) -> Result<(u64, u64, u64)> {
        let (mut next, mut length, mut dropped) = (self.next, self.length, 0);
        let transaction = self.database()?.begin_write()?;
        {
            let mut records = transaction.open_table(RECORDS)?;
            for key in &batch.remove {
                length -= u64::from(records.remove(key)?.is_some());
            }
            for record in &batch.append {
                records.insert(next, record.as_slice())?;
                (next, length) = (next + 1, length + 1);
            }
            while length > self.most && records.pop_first()?.is_some() {
                (length, dropped) = (length - 1, dropped + 1);
            }
            let mut names = transaction.open_table(NAMES)?;
            for (name, value) in &batch.names {
                match value {
                    Some(value) => names.insert(name.as_str(), value.as_str())?,
                    None => names.remove(name.as_str())?,
                };
            }
        }
        transaction.commit()?;
        Ok((next, length, dropped))
    }

    /// Up to `count` records from this key on, with their keys.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn records(&self, from: u64, count: usize) -> Result<Vec<(u64, Vec<u8>)>> {
        let read = || -> Result<_> {
            let records = self.database()?.begin_read()?.open_table(RECORDS)?;
            let range = records.range(from..)?.take(count);
            range
                .map(|record| record.map(|(key, value)| (key.value(), value.value().to_vec())))
                .collect::<Result<_, _>>()
                .map_err(Into::into)
        };
        read().with_context(|| format!("the store {}", self.path.display()))
    }

    /// The value of a name.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn get(&self, name: &str) -> Result<Option<String>> {
        let read = || -> Result<_> {
            let names = self.database()?.begin_read()?.open_table(NAMES)?;
            Ok(names.get(name)?.map(|value| value.value().to_owned()))
        };
        read().with_context(|| format!("the store {}", self.path.display()))
    }

    /// Every name that begins so, with its value, in order.
    ///
    /// # Errors
    /// When the file cannot be read.
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
        write!(f, "{} is open in another process: one bridge, one store", self.0)
    }
}

impl std::error::Error for Busy {}

/// The database, the key of the next record, and how many records there are.
#[allow(clippy::result_large_err, reason = "it is returned once")]
fn open(path: &Path) -> Result<(Database, u64, u64), redb::Error> {
    let file = private(path)?;
    let mut database = Database::builder().set_cache_size(CACHE).create_file(file)?;
    database.check_integrity()?;
    let transaction = database.begin_write()?;
    let (next, length) = {
        let records = transaction.open_table(RECORDS)?;
        transaction.open_table(NAMES)?;
        let last = records.last()?.map(|(key, _)| key.value());
        (last.map_or(0, |last| last + 1), records.len()?)
    };
    transaction.commit()?;
    Ok((database, next, length))
}

/// The file, which nobody else can read, also where an earlier version has made it.
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

/// redb asserts what it expects of a file: in one that is damaged that is an error, and no reason to print a trace.
fn catch<T>(open: impl FnOnce() -> T) -> Option<T> {
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let outcome = panic::catch_unwind(AssertUnwindSafe(open));
    panic::set_hook(hook);
    outcome.ok()
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    fn append(records: &[&str]) -> Batch {
        Batch { append: records.iter().map(|text| text.as_bytes().to_vec()).collect(), ..Batch::default() }
    }

    fn texts(store: &Store, from: u64) -> Vec<(u64, String)> {
        let text = |(key, bytes)| (key, String::from_utf8(bytes).unwrap());
        store.records(from, 100).unwrap().into_iter().map(text).collect()
    }

    #[test]
    fn the_oldest_make_room_and_keys_are_not_used_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("store");
        std::fs::write(&path, "").unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o644)).unwrap();
        let mut store = Store::open(&path, 3).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(store.write(&append(&["a", "b"])).unwrap(), 0);
        assert_eq!(store.write(&append(&["c", "d", "e"])).unwrap(), 2);
        assert_eq!(texts(&store, 0), [(2, "c".into()), (3, "d".into()), (4, "e".into())]);
        store.write(&Batch { remove: vec![3, 3, 99], ..Batch::default() }).unwrap();
        assert_eq!((store.len(), texts(&store, 3)), (2, vec![(4, "e".into())]));
        let busy = Store::open(&path, 3).err().unwrap().to_string();
        assert!(busy.ends_with("is open in another process: one bridge, one store"), "{busy}");
        drop(store);
        let mut store = Store::open(&path, 3).unwrap();
        store.write(&append(&["f"])).unwrap();
        assert_eq!(texts(&store, 0), [(2, "c".into()), (4, "e".into()), (5, "f".into())]);
    }

    #[test]
    fn names_are_found_by_how_they_begin() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = Store::open(&folder.path().join("store"), 3).unwrap();
        let names = [("a/1", "x"), ("b/1", "y"), ("b/2", "z"), ("c", "w")];
        let names = names.map(|(name, value)| (name.to_owned(), Some(value.to_owned()))).to_vec();
        store.write(&Batch { names, ..Batch::default() }).unwrap();
        store.write(&Batch { names: vec![("b/1".into(), None)], ..Batch::default() }).unwrap();
        assert_eq!(store.names("b/").unwrap(), [("b/2".to_owned(), "z".to_owned())]);
        assert_eq!((store.get("c").unwrap().as_deref(), store.get("d").unwrap()), (Some("w"), None));
    }

    #[test]
    fn a_file_of_an_earlier_format_is_upgraded_and_one_of_a_later_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("store");
        let mut store = Store::open(&path, 3).unwrap();
        let mut batch = append(&["a"]);
        assert!(store.upgrade(&mut batch).unwrap());
        store.write(&batch).unwrap();
        assert!(!store.upgrade(&mut Batch::default()).unwrap());
        let later = Batch { names: vec![("format".into(), Some("3".into()))], ..Batch::default() };
        store.write(&later).unwrap();
        drop(store);
        let error = Store::open(&path, 3).err().unwrap().to_string();
        let why = "has format 3, and this bridge knows up to 2: run the bridge that has written it, or move the file away";
        assert!(error.contains(why), "{error}");
    }

    #[test]
    fn what_is_no_store_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("store");
        std::fs::write(&path, "a file of somebody else, longer than the header of a database is").unwrap();
        let error = format!("{:#}", Store::open(&path, 3).err().unwrap());
        assert!(error.starts_with(&format!("the store {} is damaged", path.display())), "{error}");
        assert!(error.ends_with(ADVICE), "{error}");
    }

    #[test]
    fn a_damaged_file_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("store");
        let mut store = Store::open(&path, 1000).unwrap();
        let text = "a record of some length ".repeat(100);
        store.write(&append(&[text.as_str(); 200])).unwrap();
        drop(store);
        let good = std::fs::read(&path).unwrap();
        let zeros = |from: usize| {
            let mut bytes = good.clone();
            bytes[from..].fill(0);
            bytes
        };
        let mut version = good.clone();
        (version[64], version[192]) = (9, 9);
        for damaged in
            [good[..good.len() / 2].to_vec(), good[..5000].to_vec(), zeros(4096), zeros(64), version]
        {
            std::fs::write(&path, damaged).unwrap();
            let error = format!("{:#}", Store::open(&path, 3).err().unwrap());
            assert!(error.starts_with(&format!("the store {} is damaged", path.display())), "{error}");
        }
        std::fs::write(&path, good).unwrap();
        assert_eq!(Store::open(&path, 1000).unwrap().len(), 200);
    }

    #[test]
    fn a_bit_that_is_flipped_is_an_error_or_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("store");
        let mut store = Store::open(&path, 1000).unwrap();
        let mut batch = append(&["a record of some length".repeat(9).as_str(); 90]);
        batch.names = vec![("number/cell".into(), Some("90".into()))];
        store.write(&batch).unwrap();
        let content = |store: &Store| (store.records(0, 999).unwrap(), store.names("").unwrap(), store.len());
        let whole = content(&store);
        drop(store);
        let good = std::fs::read(&path).unwrap();
        let used: Vec<usize> = (0..good.len()).filter(|at| good[*at] != 0).collect();
        let mut damaged = 0;
        for at in used.iter().step_by(used.len() / 60) {
            let mut bytes = good.clone();
            bytes[*at] ^= 1 << (at % 8);
            std::fs::write(&path, bytes).unwrap();
            match Store::open(&path, 1000) {
                Ok(mut store) => {
                    assert!(content(&store) == whole, "byte {at}");
                    store.write(&append(&["one more"])).unwrap();
                    assert_eq!(store.len(), 91);
                }
                Err(error) => {
                    let error = format!("{error:#}");
                    assert!(
                        error.starts_with(&format!("the store {} is damaged", path.display())),
                        "{at}: {error}"
                    );
                    damaged += 1;
                }
            }
        }
        assert!(damaged > 0);
    }
}
