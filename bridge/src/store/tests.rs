use std::os::unix::fs::PermissionsExt as _;

use super::*;

const MAX_BYTES: u64 = 64 << 10;

fn append(records: &[&str]) -> Batch {
    Batch { append: records.iter().map(|text| text.as_bytes().to_vec()).collect(), ..Batch::default() }
}

fn named(name: &str) -> Batch {
    Batch { names: vec![(name.into(), Some("1".into()))], ..Batch::default() }
}

fn write(store: &mut Store, batch: &Batch) -> WriteResult {
    store.write(batch, &|_| Vec::new()).unwrap()
}

fn texts(store: &mut Store) -> Vec<(u64, String)> {
    let text = |(key, bytes)| (key, String::from_utf8(bytes).unwrap());
    store.records(0, 10_000).unwrap().into_iter().map(text).collect()
}

fn keyed(texts: &[(u64, &str)]) -> Vec<(u64, String)> {
    texts.iter().map(|(key, text)| (*key, (*text).to_owned())).collect()
}

fn fault(path: &Path) -> String {
    format!("{:#}", Store::open(path, MAX_BYTES).err().unwrap())
}

#[test]
fn records_are_there_until_they_are_removed_and_keys_are_not_used_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    for file in [&path, &beside(&path)] {
        std::fs::write(file, "").unwrap();
        std::fs::set_permissions(file, std::fs::Permissions::from_mode(0o644)).unwrap();
    }
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    for file in [&path, &beside(&path)] {
        assert_eq!(std::fs::metadata(file).unwrap().permissions().mode() & 0o777, 0o600);
    }
    write(&mut store, &append(&["a", "b"]));
    write(&mut store, &Batch { remove: vec![0, 0, 99], ..append(&["c", "d", "e"]) });
    write(&mut store, &Batch { remove: vec![3, 2], ..Batch::default() });
    assert_eq!((store.len(), texts(&mut store)), (2, keyed(&[(1, "b"), (4, "e")])));
    let busy = Store::open(&path, MAX_BYTES).err().unwrap().to_string();
    assert!(busy.ends_with("is open in another process: each bridge needs its own store"), "{busy}");
    // As after a kill.
    drop(store);
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    assert_eq!((store.len(), texts(&mut store)), (2, keyed(&[(1, "b"), (4, "e")])));
    write(&mut store, &Batch { remove: vec![1, 4], ..named("n") });
    assert!(store.is_empty());
    drop(store);
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    write(&mut store, &append(&["f"]));
    assert_eq!(texts(&mut store), keyed(&[(5, "f")]));
    store.reopen().unwrap();
    write(&mut store, &append(&["g"]));
    assert_eq!(texts(&mut store), keyed(&[(5, "f"), (6, "g")]));
}

#[test]
fn the_oldest_make_room_and_the_file_does_not_grow() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    let (mut dropped, mut made) = (0, 0);
    for turn in 0..3000 {
        let record = "x".repeat(turn % 97 + 1);
        let remove = if turn % 3 == 0 { vec![store.next() - store.next().min(9)] } else { Vec::new() };
        let before = store.len();
        let written = write(&mut store, &Batch { remove, ..append(&[&*record; 3]) });
        (dropped, made) = (dropped + written.dropped, made + 3);
        assert!(store.len() + written.dropped >= before + 2);
    }
    assert!(dropped > 5000 && std::fs::metadata(beside(&path)).unwrap().len() <= MAX_BYTES);
    let left = texts(&mut store);
    let oldest = left[0].0;
    assert!(left.len() as u64 == store.len() && left.len() as u64 > (made - oldest) / 2);
    assert_eq!(left.last().unwrap().0, made - 1);
    assert!(store.bytes().0 <= MAX_BYTES && store.bytes().0 > MAX_BYTES / 2, "{:?}", store.bytes());
    drop(store);
    assert!(texts(&mut Store::open(&path, MAX_BYTES).unwrap()) == left);
}

#[test]
fn a_store_that_is_emptied_again_and_again_stays_short() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, 64 << 20).unwrap();
    let mut kept = 0;
    for turn in 0..200_u64 {
        let remove = turn.checked_sub(1).into_iter().collect();
        let written = write(&mut store, &Batch { remove, ..append(&["x".repeat(50_000).as_str()]) });
        kept += u64::from(written.kept == Some(KeptNames::Before));
    }
    assert!((8..11).contains(&kept), "{kept}");
    assert!(std::fs::metadata(beside(&path)).unwrap().len() < 2 * WASTE);
    drop(store);
    assert_eq!(texts(&mut Store::open(&path, 64 << 20).unwrap())[0].0, 199);
}

#[test]
fn names_are_found_by_how_they_begin() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Store::open(&folder.path().join("store"), MAX_BYTES).unwrap();
    let names = [("a/1", "x"), ("b/1", "y"), ("b/2", "z"), ("c", "w")];
    let names = names.map(|(name, value)| (name.to_owned(), Some(value.to_owned()))).to_vec();
    write(&mut store, &Batch { names, ..Batch::default() });
    write(&mut store, &Batch { names: vec![("b/1".into(), None)], ..Batch::default() });
    assert_eq!(store.names("b/").unwrap(), [("b/2".to_owned(), "z".to_owned())]);
    assert_eq!((store.get("c").unwrap().as_deref(), store.get("d").unwrap()), (Some("w"), None));
}

#[test]
fn a_file_of_another_format_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    let other = Batch { names: vec![("format".into(), Some("4".into()))], ..Batch::default() };
    write(&mut store, &other);
    drop(store);
    let why = "has format 4, and this bridge reads format 3: use the bridge that wrote it, or move it";
    assert!(fault(&path).contains(why), "{}", fault(&path));
}

#[test]
fn records_are_bound_to_the_names_of_their_batch() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    write(&mut store, &Batch { names: named("first").names, ..append(&["a"]) });
    drop(store);
    let before = std::fs::read(&path).unwrap();
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    write(&mut store, &append(&["telemetry"]));
    write(&mut store, &Batch { names: named("second").names, ..append(&["accepted"]) });
    drop(store);
    // A commit that came to its end is missing.
    std::fs::write(&path, &before).unwrap();
    assert!(
        fault(&path).contains("store.records: the store is older than its records: "),
        "{}",
        fault(&path)
    );
    // The power has gone before the names were written, and so before the frame after them.
    let mut records = std::fs::read(beside(&path)).unwrap();
    let last = records.windows(4).rposition(|bytes| bytes == b"cwR1").unwrap();
    records[last] = 0;
    std::fs::write(beside(&path), records).unwrap();
    std::fs::write(&path, before).unwrap();
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    assert_eq!(texts(&mut store), keyed(&[(0, "a"), (1, "telemetry")]));
    write(&mut store, &append(&["next"]));
    drop(store);
    assert_eq!(texts(&mut Store::open(&path, MAX_BYTES).unwrap())[2], (2, "next".into()));
}

#[test]
fn a_loss_of_power_takes_what_was_not_synced_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    write(&mut store, &append(&["a"]));
    write(&mut store, &named("n"));
    for record in ["lost", "lost, too"] {
        write(&mut store, &append(&[record]));
    }
    drop(store);
    let good = std::fs::read(beside(&path)).unwrap();
    let at = |text: &str| good.windows(text.len()).position(|found| found == text.as_bytes()).unwrap();
    let without = |text: &str| {
        let mut bytes = good.clone();
        bytes[at(text)] ^= 1;
        std::fs::write(beside(&path), bytes).unwrap();
    };
    // The later one came to the disk before the other.
    without("lost");
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    assert_eq!(texts(&mut store), keyed(&[(0, "a")]));
    for record in ["b", "c"] {
        write(&mut store, &append(&[record]));
    }
    drop(store);
    assert_eq!(texts(&mut Store::open(&path, MAX_BYTES).unwrap()), keyed(&[(0, "a"), (1, "b"), (2, "c")]));
    // A frame that was on the disk when a later one was written is damaged.
    std::fs::write(beside(&path), &good).unwrap();
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    std::thread::sleep(crate::ring::SYNC);
    write(&mut store, &Batch::default());
    assert_eq!(store.due(), None);
    write(&mut store, &append(&["later"]));
    drop(store);
    let good = std::fs::read(beside(&path)).unwrap();
    let mut bytes = good.clone();
    bytes[at("lost")] ^= 1;
    std::fs::write(beside(&path), bytes).unwrap();
    assert!(fault(&path).contains("store.records: its frame 2 is damaged or missing"), "{}", fault(&path));
    std::fs::remove_file(beside(&path)).unwrap();
    assert!(fault(&path).contains("store.records has 0 bytes of 65536"), "{}", fault(&path));
    std::fs::write(beside(&path), &good).unwrap();
    assert_eq!(texts(&mut Store::open(&path, MAX_BYTES).unwrap()).len(), 4);
}

/// Without its names it would know no commands: executed ones would be executed again.
#[test]
fn records_without_their_store_are_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    write(&mut store, &Batch { names: named("n").names, ..append(&["a"]) });
    drop(store);
    let good = std::fs::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    for state in ["missing", "empty"] {
        let error = fault(&path);
        assert!(error.starts_with(&format!("the store {} is {state}, but ", path.display())), "{error}");
        assert!(error.contains("is executed again"), "{error}");
        std::fs::write(&path, "").unwrap();
    }
    std::fs::write(&path, good).unwrap();
    assert_eq!(texts(&mut Store::open(&path, MAX_BYTES).unwrap()), keyed(&[(0, "a")]));
}

#[test]
fn what_is_no_store_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    std::fs::write(&path, "a file of somebody else, longer than the header of a database is").unwrap();
    let error = fault(&path);
    assert!(error.starts_with(&format!("the store {} is damaged", path.display())), "{error}");
    assert!(error.ends_with(ADVICE), "{error}");
}

#[test]
fn a_damaged_file_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, 1 << 20).unwrap();
    let text = "a record of some length ".repeat(100);
    write(&mut store, &Batch { names: named("n").names, ..append(&[text.as_str(); 200]) });
    drop(store);
    for file in [path.clone(), beside(&path)] {
        let good = std::fs::read(&file).unwrap();
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
            std::fs::write(&file, damaged).unwrap();
            let error = fault(&path);
            assert!(error.starts_with(&format!("the store {} is damaged", path.display())), "{error}");
        }
        std::fs::write(&file, good).unwrap();
    }
    assert_eq!(Store::open(&path, 1 << 20).unwrap().len(), 200);
}

#[test]
fn a_bit_that_is_flipped_is_an_error_or_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, 1 << 20).unwrap();
    let mut batch = append(&["a record of some length".repeat(9).as_str(); 90]);
    batch.names = vec![("number/cell".into(), Some("90".into()))];
    write(&mut store, &batch);
    let content = |store: &mut Store| (texts(store), store.names("").unwrap(), store.len());
    let whole = content(&mut store);
    drop(store);
    let both = [path.clone(), beside(&path)];
    let goods = both.clone().map(|file| std::fs::read(file).unwrap());
    for (file, good) in both.iter().zip(&goods) {
        let used: Vec<usize> = (0..good.len()).filter(|at| good[*at] != 0).collect();
        let mut damaged = 0;
        for at in used.iter().step_by(used.len() / 60) {
            both.iter().zip(&goods).for_each(|(file, good)| std::fs::write(file, good).unwrap());
            let mut bytes = good.clone();
            bytes[*at] ^= 1 << (at % 8);
            std::fs::write(file, bytes).unwrap();
            match Store::open(&path, 1 << 20) {
                Ok(mut store) => {
                    assert!(content(&mut store) == whole, "byte {at}");
                    write(&mut store, &append(&["one more"]));
                    assert_eq!(store.len(), 91);
                }
                Err(error) => {
                    let error = format!("{error:#}");
                    let why = format!("the store {} is damaged", path.display());
                    assert!(error.starts_with(&why), "{at}: {error}");
                    damaged += 1;
                }
            }
        }
        assert!(damaged > 0);
    }
}

/// A bit of the database's header selects the last commit of two: with the earlier one, the contents of the last would be
/// lost.
#[test]
fn a_bit_of_the_header_that_is_flipped_is_an_error_or_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    for name in ["command/cell/first", "command/cell/last"] {
        write(&mut store, &Batch { names: named(name).names, ..append(&[name]) });
    }
    write(&mut store, &named("command/cell/without a record"));
    let content = |store: &mut Store| (texts(store), store.names("").unwrap());
    let whole = content(&mut store);
    let (killed, records) = (std::fs::read(&path).unwrap(), std::fs::read(beside(&path)).unwrap());
    drop(store);
    let mut older = 0;
    for good in [killed, std::fs::read(&path).unwrap()] {
        let mut errors = Vec::new();
        for (at, bit) in (0..20).map(|at| (at * 16 + 3, at % 8)).chain((0..8).map(|bit| (9, bit))) {
            let mut bytes = good.clone();
            bytes[at] ^= 1 << bit;
            std::fs::write(&path, bytes).unwrap();
            std::fs::write(beside(&path), &records).unwrap();
            match Store::open(&path, MAX_BYTES) {
                Ok(mut store) => assert!(content(&mut store) == whole, "bit {bit} of byte {at}"),
                Err(error) => errors.push(format!("{error:#}")),
            }
        }
        let damaged = format!("the store {} is damaged", path.display());
        assert!(errors.iter().all(|error| error.starts_with(&damaged)), "{errors:?}");
        older += errors.iter().filter(|error| error.contains("the store is older than its records")).count();
    }
    // The commit that ends a process changes no name.
    assert_eq!(older, 1);
}

/// Outcomes of commands, one per commit; the last one without a record. Flips each byte of each of them in the file,
/// including the copies of an earlier commit in another page.
#[test]
fn a_changed_outcome_is_an_error_or_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, 1 << 20).unwrap();
    for number in 0..6 {
        for outcome in ["accepted", "done"] {
            let record = format!("{outcome} {number}");
            let mut batch = if number < 5 { append(&[record.as_str()]) } else { Batch::default() };
            let value = format!("{{\"at\":{number},\"outcome\":\"{outcome}\"}}");
            batch.names = vec![(format!("command/cell/id-{number}"), Some(value))];
            write(&mut store, &batch);
        }
    }
    let content = |store: &mut Store| (texts(store), store.names("").unwrap(), store.len());
    let whole = content(&mut store);
    // As after a kill: nothing more is written.
    core::mem::forget(store);
    let both = [path.clone(), beside(&path)];
    let goods = both.clone().map(|file| std::fs::read(file).unwrap());
    let copy = tempfile::tempdir().unwrap();
    let copied = copy.path().join("store");
    let texts = ["command/cell/id-", "\"outcome\":\""];
    let (mut places, mut damaged) = (0, 0);
    for text in texts {
        let found = goods[0].windows(text.len()).enumerate().filter(|(_, bytes)| *bytes == text.as_bytes());
        for (at, _) in found {
            places += 1;
            for at in [at, at + text.len()] {
                let mut bytes = goods[0].clone();
                bytes[at] ^= 1;
                std::fs::write(&copied, bytes).unwrap();
                std::fs::write(beside(&copied), &goods[1]).unwrap();
                match Store::open(&copied, 1 << 20) {
                    Ok(mut store) => assert!(content(&mut store) == whole, "byte {at}"),
                    Err(error) => {
                        let error = format!("{error:#}");
                        let why = format!("the store {} is damaged", copied.display());
                        assert!(error.starts_with(&why), "{at}: {error}");
                        damaged += 1;
                    }
                }
            }
        }
    }
    assert!(places > 20 && damaged > 10, "{damaged} of {places}");
}

#[test]
fn a_file_without_the_other_or_cut_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    write(&mut store, &append(&["a", "b"]));
    drop(store);
    let (database, records) = (std::fs::read(&path).unwrap(), std::fs::read(beside(&path)).unwrap());
    std::fs::remove_file(&path).unwrap();
    let why = fault(&path);
    assert!(why.contains("is missing, but ") && why.contains("store.records is not"), "{why}");
    assert!(!path.exists(), "nothing is made");
    std::fs::write(&path, &database).unwrap();
    std::fs::remove_file(beside(&path)).unwrap();
    let why = fault(&path);
    assert!(why.contains("is damaged: ") && why.contains("store.records has 0 bytes of 65536: "), "{why}");
    // A truncated file is an error, even if nothing was kept in the missing part: record numbers would be used again.
    for length in [0, 40, records.len() - 1] {
        std::fs::write(&path, &database).unwrap();
        std::fs::write(beside(&path), &records[..length]).unwrap();
        let why = fault(&path);
        assert!(why.contains(&format!("store.records has {length} bytes of 65536: ")), "{why}");
    }
    std::fs::write(beside(&path), &records).unwrap();
    assert_eq!(texts(&mut Store::open(&path, MAX_BYTES).unwrap()), keyed(&[(0, "a"), (1, "b")]));
}

#[test]
fn a_store_is_that_of_one_bridge() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let mut store = Store::open(&path, MAX_BYTES).unwrap();
    store.belong_to("g/b1").unwrap();
    store.belong_to("g/b1").unwrap();
    drop(store);
    let why = format!("{:#}", Store::open(&path, MAX_BYTES).unwrap().belong_to("g/b2").err().unwrap());
    assert!(why.contains("is that of the bridge g/b1, and this is g/b2: move it and its .records"), "{why}");
}
