//! The PC in a task of its own, against a robot over TCP.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

#[path = "../../examples/ends/mod.rs"]
mod ends;

use core::future::Future;
use core::net::SocketAddr;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use core::time::Duration;
use std::fs;
use std::io::{self, Write as _};
use std::sync::Arc;
use std::thread;

use kawasaki_msg::robot_session::tokio::Listen;
use kawasaki_msg::tokio::{
    Error, Journal, JournalEntry, LastOrder, OrderResult, Pc, ProgressStore, pc, pc_with_ranges,
};
use kawasaki_msg::{Bounds, Job, JobKind, Line, PcConfig, PcEvent, Point, RobotConfig, SessionError};
use tokio::sync::Semaphore;
use tokio::task::JoinHandle;
use tokio::time::timeout;

const LONG: Duration = Duration::from_secs(60);
const MS: Duration = Duration::from_millis(1);

fn jobs(count: i32) -> Vec<Line> {
    (0..count)
        .map(|n| Line { kind: JobKind::Draw, start: Point::new(n, 0), end: Point::new(n + 1, 0) })
        .collect()
}

/// Returns a PC that listens, and its address.
async fn listening<K: ProgressStore>(at: SocketAddr, keep: K) -> (Pc<Line, K>, SocketAddr, JoinHandle<()>) {
    let listen = Listen::bind(at).await.unwrap();
    let address = listen.address().unwrap();
    let (pc, task) = pc(PcConfig::tcp(), keep, listen).unwrap();
    (pc, address, tokio::spawn(async { drop(task.run().await) }))
}

fn any() -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], 0))
}

#[tokio::test]
async fn a_job_out_of_the_ranges_of_the_plant_is_not_sent() {
    let board = Bounds { min: Point::new(0, 0), max: Point::new(2, 2) };
    let listen = Listen::bind(any()).await.unwrap();
    let address = listen.address().unwrap();
    let (pc, task) = pc_with_ranges(PcConfig::tcp(), board, (), listen).unwrap();
    tokio::spawn(task.run());
    let robot = robot(address);
    let over = pc.run(50, jobs(4)).await.unwrap();
    assert_eq!((over.executed, over.complete, over.unfit.unwrap().0), (2, false, 2));
    assert_eq!(robot.join().unwrap().len(), 2);
}

/// Starts a robot that executes one order.
fn robot(address: SocketAddr) -> thread::JoinHandle<Vec<Job<Line>>> {
    robot_until(address, Arc::new(AtomicBool::new(true)))
}

/// Starts the same robot, which dials its PC until the test reports that the PC has received the end.
fn robot_until(address: SocketAddr, is_over: Arc<AtomicBool>) -> thread::JoinHandle<Vec<Job<Line>>> {
    let address = address.to_string();
    let connect = move || loop {
        match ends::tcp(&address) {
            Err(_) if !is_over.load(Ordering::SeqCst) => thread::sleep(MS),
            connected => return connected,
        }
    };
    thread::spawn(move || ends::robot(RobotConfig::tcp(), connect).unwrap())
}

fn executed(robot: thread::JoinHandle<Vec<Job<Line>>>) -> Vec<Line> {
    robot.join().unwrap().into_iter().map(|job| job.work).collect()
}

#[tokio::test]
async fn an_order_has_progress_and_an_end() {
    let (pc, address, _task) = listening(any(), ()).await;
    let robot = robot(address);
    let mut order = pc.start(50, jobs(300)).await.unwrap();
    let second = pc.run(51, jobs(1)).await;
    assert!(matches!(second, Err(Error::Call(SessionError::OrderActive { active: 50 }))), "{second:?}");
    let mut last = 0;
    while let Some(progress) = order.progress().await {
        assert!(progress.executed >= last);
        last = progress.executed;
    }
    assert_eq!(last, 300);
    let over = timeout(LONG, order).await.unwrap().unwrap();
    assert_eq!(over, OrderResult { executed: 300, complete: true, unfit: None });
    assert_eq!(executed(robot), jobs(300));
}

/// The program is killed at any point, and another one continues with its journal.
#[tokio::test]
async fn every_job_is_executed_once_however_often_the_program_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    let mut address = any();
    let (mut working, mut runs, is_over) = (None, 0, Arc::new(AtomicBool::new(false)));
    let over = loop {
        let (journal, last) = Journal::open(&path).unwrap();
        let (pc, at, task) = listening(address, journal).await;
        address = at;
        working.get_or_insert_with(|| robot_until(at, is_over.clone()));
        let order = match last {
            LastOrder::Active(kept) => pc.resume(kept, jobs(600)).await.unwrap(),
            // Killed before the robot had begun, the last time too.
            LastOrder::None => pc.start(7, jobs(600)).await.unwrap(),
            LastOrder::Stopped(kept) => pc.go_on(7, kept, jobs(600)).await.unwrap(),
            other => panic!("{other:?}"),
        };
        runs += 1;
        match timeout(runs * 17 * MS, order).await {
            Ok(over) => {
                pc.handle().shutdown().await;
                match over.unwrap() {
                    // Killed before the robot had begun: there is nothing to continue.
                    OrderResult { executed: 0, complete: false, .. } => {}
                    over => break over,
                }
            }
            Err(_) => {
                task.abort();
                let _ = task.await;
            }
        }
    };
    is_over.store(true, Ordering::SeqCst);
    assert!(runs > 3, "{runs}");
    assert_eq!(over, OrderResult { executed: 600, complete: true, unfit: None });
    assert_eq!(executed(working.unwrap()), jobs(600));
    let over = JournalEntry { order: 7, first: 0, executed: 600, sent: 600, ahead: vec![] };
    assert_eq!(Journal::open(&path).unwrap().1, LastOrder::Complete(over));
}

/// The program was killed after it had stored an order, and before the robot could begin it: the second program ends the
/// order, and the third one begins it.
#[tokio::test]
async fn an_order_that_the_robot_has_not_begun_ends_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    fs::write(&path, line("7 0 0 0")).unwrap();
    let (journal, last) = Journal::open(&path).unwrap();
    let LastOrder::Active(kept) = last else { panic!("{last:?}") };
    let (pc, address, _task) = listening(any(), journal).await;
    let robot = robot(address);
    let over = timeout(LONG, pc.resume(kept, jobs(20)).await.unwrap()).await.unwrap().unwrap();
    assert_eq!(over, OrderResult { executed: 0, complete: false, unfit: None });
    pc.handle().shutdown().await;
    let (journal, last) = Journal::open(&path).unwrap();
    assert_eq!(last, LastOrder::None);
    let (pc, _, _task) = listening(address, journal).await;
    let over = timeout(LONG, pc.run(7, jobs(20))).await.unwrap().unwrap();
    assert_eq!(over, OrderResult { executed: 20, complete: true, unfit: None });
    assert_eq!(executed(robot), jobs(20));
}

/// An order that ends before its start is stored leaves no order that is active.
#[tokio::test]
async fn the_end_of_an_order_is_stored_though_nothing_was_sent() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    fs::write(&path, line("7 0 0 0")).unwrap();
    let (journal, _) = Journal::open(&path).unwrap();
    let (pc, address, _task) = listening(any(), journal).await;
    let robot = robot(address);
    let order = pc.start(8, jobs(20)).await.unwrap();
    pc.interrupt().await.unwrap();
    let over = timeout(LONG, order).await.unwrap().unwrap();
    assert_eq!(over, OrderResult { executed: 0, complete: false, unfit: None });
    pc.handle().shutdown().await;
    drop(robot);
    assert_eq!(Journal::open(&path).unwrap().1, LastOrder::None);
}

/// State that is not stored, because the disk is full or does not answer, does not reach the robot.
#[tokio::test]
async fn nothing_is_sent_that_was_not_kept() {
    #[derive(Debug, Clone)]
    struct Disk(Arc<Semaphore>, Arc<AtomicUsize>);
    impl ProgressStore for Disk {
        fn keep(&mut self, last: &LastOrder) -> impl Future<Output = io::Result<()>> + Send {
            let Self(works, full) = self.clone();
            let has_jobs = matches!(last, LastOrder::Active(kept) if kept.sent > 0);
            async move {
                if !has_jobs {
                    return Ok(());
                }
                let _works = works.acquire().await.unwrap();
                let is_full = full.fetch_add(1, Ordering::SeqCst) < 3;
                if is_full { Err(io::ErrorKind::StorageFull.into()) } else { Ok(()) }
            }
        }
    }
    let disk = Disk(Arc::new(Semaphore::new(0)), Arc::default());
    let (pc, address, _task) = listening(any(), disk.clone()).await;
    let robot = robot(address);
    let mut order = pc.start(50, jobs(20)).await.unwrap();
    let early =
        timeout(500 * MS, async { while order.progress().await.is_some_and(|now| now.queued == 0) {} });
    assert!(early.await.is_err(), "the robot has jobs that were not kept");
    disk.0.add_permits(1);
    let over = timeout(LONG, order).await.unwrap().unwrap();
    assert_eq!(over, OrderResult { executed: 20, complete: true, unfit: None });
    assert!(disk.1.load(Ordering::SeqCst) > 3);
    assert_eq!(executed(robot), jobs(20));
}

#[tokio::test]
async fn an_interrupt_passes_the_queue() {
    let (pc, address, _task) = listening(any(), ()).await;
    let mut events = pc.handle().events();
    assert!(timeout(50 * MS, pc.interrupt()).await.is_err(), "there is no robot yet");
    let robot = robot(address);
    let mut order = pc.start(50, jobs(5000)).await.unwrap();
    assert!(order.progress().await.is_some());
    pc.interrupt().await.unwrap();
    let over = timeout(LONG, order).await.unwrap().unwrap();
    assert!(!over.complete && over.executed < 5000, "{over:?}");
    let all = executed(robot);
    assert_eq!(all.len(), over.executed as usize);
    let mut is_over = false;
    while let Ok(event) = events.try_recv() {
        is_over |= matches!(event, PcEvent::OrderOver { order: 50, .. });
    }
    assert!(is_over);
    pc.handle().shutdown().await;
    assert!(matches!(pc.run(51, jobs(1)).await, Err(Error::Closed(_))));
}

/// Returns a line of a journal.
fn line(text: &str) -> String {
    format!("{text} *{:08x}\n", crc32fast::hash(text.as_bytes()))
}

#[test]
fn a_journal_counts_to_its_last_whole_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    fs::write(&path, line("7 0 0 5") + &line("7 0 3 12 5 6") + "7 0 9").unwrap();
    let (journal, last) = Journal::open(&path).unwrap();
    assert_eq!(
        last,
        LastOrder::Active(JournalEntry { order: 7, first: 0, executed: 3, sent: 12, ahead: vec![5, 6] })
    );
    assert!(Journal::open(&path).is_err(), "one program has it");
    drop(journal);
    let block_on = tokio::runtime::Builder::new_current_thread().build().unwrap();
    for sent in 0..200_000 {
        let (mut journal, last) = Journal::open(&path).unwrap();
        assert!(matches!(last, LastOrder::Active(_)));
        let mut kept = JournalEntry { order: 7, first: 0, executed: 3, sent: sent + 3, ahead: Vec::new() };
        let until = if sent == 0 { 3 } else { 1 };
        for _ in 0..until {
            block_on.block_on(journal.keep(&LastOrder::Active(kept.clone()))).unwrap();
            kept.sent += 1;
        }
        if sent > 20 {
            break;
        }
    }
    fs::OpenOptions::new().append(true).open(&path).unwrap().write_all(b"# notes\n").unwrap();
    let error = Journal::open(&path).unwrap_err();
    assert!(error.to_string().contains("this is not the journal of an order"), "{error}");
    assert!(fs::metadata(&path).unwrap().len() > 0, "it is left as it is");
}

/// After a finished order, and after one whose outcome is unknown, a program that starts again must not do the same.
#[test]
fn a_journal_says_how_its_last_order_has_ended() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    let block_on = tokio::runtime::Builder::new_current_thread().build().unwrap();
    assert_eq!(Journal::open(&path).unwrap().1, LastOrder::None);
    let kept = || JournalEntry { order: 7, first: 2, executed: 3, sent: 6, ahead: vec![4] };
    for (text, last) in [
        ("7 2 3 6 4", LastOrder::Active(kept())),
        ("7 2 3 6 4 stopped", LastOrder::Stopped(kept())),
        ("7 2 3 6 4 complete", LastOrder::Complete(kept())),
        ("7 2 3 6 4 unknown", LastOrder::Unknown(kept())),
    ] {
        let (mut journal, _) = Journal::open(&path).unwrap();
        block_on.block_on(journal.keep(&last)).unwrap();
        drop(journal);
        assert!(fs::read_to_string(&path).unwrap().ends_with(&line(text)));
        assert_eq!(Journal::open(&path).unwrap().1, last);
    }
    fs::write(&path, line("7 0 0 0 stopped")).unwrap();
    assert_eq!(Journal::open(&path).unwrap().1, LastOrder::None, "none of its jobs was sent");
    fs::write(&path, line("8 3 0 0 stopped")).unwrap();
    let rest = JournalEntry { order: 8, first: 3, ..JournalEntry::default() };
    assert_eq!(
        Journal::open(&path).unwrap().1,
        LastOrder::Stopped(rest),
        "the order before it has executed three"
    );
}

/// A wrong digit in the last line must be detected: otherwise jobs would be lost or repeated.
#[test]
fn a_changed_digit_in_a_journal_is_damage() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    let block_on = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let (mut journal, _) = Journal::open(&path).unwrap();
    for sent in [5, 17] {
        let last = LastOrder::Active(JournalEntry { order: 7, first: 0, executed: 3, sent, ahead: vec![4] });
        block_on.block_on(journal.keep(&last)).unwrap();
    }
    drop(journal);
    let text = fs::read(&path).unwrap();
    let last = text.len() - "7 0 3 17 4 *12345678\n".len();
    for at in last..text.len() - 1 {
        let mut changed = text.clone();
        changed[at] ^= 1;
        fs::write(&path, &changed).unwrap();
        let error = Journal::open(&path).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData, "byte {at}");
    }
    // Nor is a line without its checksum.
    for line in ["7 0 3 18 4\n", "7 0 3 2 *00000000\n"] {
        fs::write(&path, [&text, line.as_bytes()].concat()).unwrap();
        assert!(Journal::open(&path).is_err(), "{line}");
    }
    for impossible in ["7 0 3 2", "7 0 1 5 9"] {
        fs::write(&path, line(impossible)).unwrap();
        assert!(Journal::open(&path).is_err(), "{impossible}");
    }
    fs::write(&path, &text).unwrap();
    assert_eq!(
        Journal::open(&path).unwrap().1,
        LastOrder::Active(JournalEntry { order: 7, first: 0, executed: 3, sent: 17, ahead: vec![4] })
    );
}
