//! The task of each end, whose peer is the test.

use core::future::Future;
use core::pin::pin;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::{Context, Waker};
use core::time::Duration;
use std::io;
use std::sync::Arc;

use kawasaki_msg::robot_session::tokio::{Dial, Link, Reconnect};
use kawasaki_msg::tokio::{
    Error, Journal, JournalEntry, LastOrder, Order, OrderResult, Pc, ProgressStore, RobotError, pc, robot,
};
use kawasaki_msg::{
    CommandOutcome, Dialect, Entry, Field, JobKind, LargePc, Line, PcConfig, Point, RobotConfig, RobotEvent,
    Role, SessionError, Supply, Takeover,
};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream};
use tokio::sync::{Notify, oneshot};
use tokio::task::JoinHandle;
use tokio::time::timeout;

const LONG: Duration = Duration::from_secs(10);
const MS: Duration = Duration::from_millis(1);
const IDLE: &str = "<Tila$6#0$0$$$#>";
const STARTED: &str = "<TilausKuittaus$2#50#><Tila$7#50$2$$$#><TyoPyynto$4#50$1#>";

fn job(x: i32) -> Line {
    Line { kind: JobKind::Draw, start: Point::new(x, 0), end: Point::new(0, 0) }
}

fn jobs(count: i32) -> Vec<Line> {
    (0..count).map(job).collect()
}

struct Peer(DuplexStream);

impl Peer {
    async fn receive(&mut self) -> String {
        let mut packet = [0; 4096];
        let length = timeout(LONG, self.0.read(&mut packet)).await.expect("a packet").unwrap();
        String::from_utf8(packet[..length].to_vec()).unwrap()
    }

    /// Sends a packet, and returns the answer.
    async fn exchange(&mut self, packet: &str) -> String {
        self.0.write_all(packet.as_bytes()).await.unwrap();
        self.receive().await
    }
}

/// Connects once: when it receives its end of the pipe.
type Gate = oneshot::Sender<DuplexStream>;

fn open(gate: Gate) -> Peer {
    let (end, peer) = tokio::io::duplex(1 << 16);
    gate.send(end).unwrap();
    Peer(peer)
}

macro_rules! gated {
    () => {{
        let (gate, end) = oneshot::channel::<DuplexStream>();
        let mut end = Some(end);
        let dial = move || {
            let end = end.take();
            async move {
                let end = end.ok_or_else(|| io::Error::other("once"))?;
                end.await.map_err(|_| io::Error::other("no robot"))
            }
        };
        (gate, Dial(dial))
    }};
}

type Session = Box<LargePc<kawasaki_msg::tokio::TaskSource<Line>>>;

fn a_pc<K: ProgressStore>(config: PcConfig, keep: K) -> (Pc<Line, K>, Gate, JoinHandle<Session>) {
    let (gate, dial) = gated!();
    let (pc, task) = pc(config, keep, dial).unwrap();
    (pc, gate, tokio::spawn(task.run()))
}

async fn kill<T>(task: JoinHandle<T>) {
    task.abort();
    assert!(task.await.is_err());
}

async fn outcome(order: Order) -> Result<OrderResult, Error> {
    timeout(LONG, order).await.expect("an outcome")
}

/// If jobs overtake one another, the journal has each executed job.
#[tokio::test]
async fn a_program_that_was_killed_finds_in_its_journal_how_far_its_order_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    let config = PcConfig { cumulative_acks: false, ..PcConfig::tcp() };
    let (journal, last) = Journal::open(&path).unwrap();
    assert_eq!(last, LastOrder::None);
    let (pc, gate, task) = a_pc(config, journal);
    let mut robot = open(gate);
    let limit = Arc::new(AtomicU32::new(3));
    let known = Arc::clone(&limit);
    let supply = move |index: u32| {
        let is_known = index < known.load(Ordering::SeqCst);
        if is_known { Supply::Job(job(index.try_into().unwrap())) } else { Supply::Later }
    };
    let order = pc.start_from(50, supply).await.unwrap();
    assert!(robot.exchange(IDLE).await.contains("<TilausAlkaa$4#50$1#>"));
    assert_eq!(robot.exchange(STARTED).await.matches("<Tyo$").count(), 3);
    limit.store(4, Ordering::SeqCst);
    let packet = robot.exchange("<TyoKuittaus$4#50$2#><TyoPyynto$4#50$4#>").await;
    assert_eq!(packet.matches("<Tyo$").count(), 1);
    kill(task).await;
    drop(order);
    let (journal, last) = Journal::open(&path).unwrap();
    let kept = JournalEntry { order: 50, first: 0, executed: 0, sent: 4, ahead: vec![1] };
    assert_eq!(last, LastOrder::Active(kept.clone()));

    let (pc, gate, task) = a_pc(config, journal);
    let mut robot = open(gate);
    let order = pc.resume(kept, jobs(5)).await.unwrap();
    assert!(!robot.exchange("<Tila$8#50$2$4$$#>").await.contains("<Tyo$"), "nothing is sent twice");
    let acks = [1, 3, 4].map(|number| format!("<TyoKuittaus$4#50${number}#>")).concat();
    let packet = robot.exchange(&(acks + "<TyoPyynto$4#50$5#>")).await;
    assert!(packet.contains("<Tyo$14#50$5$1$4$0$0$0#>"), "{packet}");
    robot.exchange("<TyoKuittaus$4#50$5#><LoppuKuittaus$6#50$0$5#>").await;
    assert_eq!(outcome(order).await.unwrap(), OrderResult { executed: 5, complete: true, unfit: None });
    kill(task).await;
    let kept = JournalEntry { order: 50, first: 0, executed: 5, sent: 5, ahead: vec![] };
    assert_eq!(Journal::open(&path).unwrap().1, LastOrder::Complete(kept), "what is over is not resumed");
}

#[tokio::test]
async fn a_journal_has_the_last_that_was_kept_and_no_more_than_a_mebibyte() {
    const REWRITE_SIZE: u64 = 1 << 20;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    let length = || std::fs::metadata(&path).unwrap().len();
    // A line of half of it: "50 0 1 20000", jobs of 4 digits, each after a blank, the checksum of ten bytes, and the end of
    // the line.
    let mut kept =
        JournalEntry { order: 50, first: 0, executed: 1, sent: 20_000, ahead: vec![1000; (1 << 19) / 5 - 4] };
    let (mut journal, _) = Journal::open(&path).unwrap();
    journal.keep(&LastOrder::Active(kept.clone())).await.unwrap();
    assert_eq!(length(), REWRITE_SIZE / 2);
    kept.executed = 2;
    journal.keep(&LastOrder::Active(kept.clone())).await.unwrap();
    assert_eq!(length(), REWRITE_SIZE);
    // It would be longer than that: the last line is left.
    kept.executed = 3;
    journal.keep(&LastOrder::Active(kept.clone())).await.unwrap();
    assert_eq!(length(), REWRITE_SIZE / 2);
    drop(journal);
    let (mut journal, last) = Journal::open(&path).unwrap();
    assert_eq!(last, LastOrder::Active(kept.clone()));
    // A journal that was opened again has the length of the file.
    kept.executed = 4;
    journal.keep(&LastOrder::Active(kept.clone())).await.unwrap();
    kept.executed = 5;
    journal.keep(&LastOrder::Active(kept.clone())).await.unwrap();
    assert_eq!(length(), REWRITE_SIZE / 2);
    let last = LastOrder::Active(JournalEntry { order: 51, ..JournalEntry::default() });
    journal.keep(&last).await.unwrap();
    drop(journal);
    assert_eq!(Journal::open(&path).unwrap().1, last);
}

/// A write continues when its future is dropped: the next one waits for it, and does not write the same again.
#[tokio::test]
async fn a_change_whose_future_was_dropped_is_written_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    let (mut journal, _) = Journal::open(&path).unwrap();
    let kept = |sent| LastOrder::Active(JournalEntry { order: 50, sent, ..JournalEntry::default() });
    for sent in 1..=20 {
        let mut context = Context::from_waker(Waker::noop());
        let first = kept(sent);
        assert!(pin!(journal.keep(&first)).poll(&mut context).is_pending());
        if sent % 2 == 0 {
            journal.keep(&first).await.unwrap();
        }
    }
    drop(journal);
    // The last write ends before another journal begins.
    assert_eq!(Journal::open(&path).unwrap().1, kept(20));
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<_> = text.lines().map(|line| line.rsplit_once(" *").unwrap().0).collect();
    assert_eq!(lines, (1..=20).map(|sent| format!("50 0 0 {sent}")).collect::<Vec<_>>());
}

/// Returns a PC in the middle of order 50, after three of its jobs were sent.
async fn running(config: PcConfig, jobs: Vec<Line>) -> (Pc<Line, ()>, Peer, Order) {
    let (pc, gate, _task) = a_pc(config, ());
    let mut robot = open(gate);
    let order = pc.start(50, jobs).await.unwrap();
    robot.exchange(IDLE).await;
    robot.exchange(STARTED).await;
    (pc, robot, order)
}

#[tokio::test]
async fn an_order_has_the_outcome_that_the_robot_reports() {
    let (_pc, mut robot, order) = running(PcConfig::tcp(), jobs(3)).await;
    robot.exchange(IDLE).await;
    let unknown = outcome(order).await.unwrap_err();
    assert!(matches!(unknown, Error::OutcomeUnknown { executed: 0, sent: 3 }), "{unknown:?}");

    let (_pc, mut robot, order) = running(PcConfig::tcp(), vec![job(1), job(10_000_000)]).await;
    robot.exchange("<TyoKuittaus$4#50$1#><LoppuKuittaus$6#50$0$1#>").await;
    let over = outcome(order).await.unwrap();
    assert_eq!((over.executed, over.complete), (1, false));
    let (index, error) = over.unfit.expect("a job does not fit");
    assert_eq!(
        (index, error.to_string().as_str()),
        (1, "field 'x1' is 10000000, not from -9999999 to 9999999")
    );

    let (pc, mut robot, order) = running(PcConfig::tcp(), jobs(2)).await;
    pc.end().await.unwrap();
    assert!(robot.exchange("<Huuhaa$0##>").await.contains("<TilausLoppuu$2#50#>"));
    robot.exchange("<LoppuKuittaus$6#50$0$2#>").await;
    assert_eq!(outcome(order).await.unwrap(), OrderResult { executed: 2, complete: true, unfit: None });
    let error = pc.end().await.unwrap_err();
    assert!(matches!(error, Error::Call(SessionError::NoOrder)), "{error:?}");

    let (pc, gate, _task) = a_pc(PcConfig { takeover: Takeover::Never, ..PcConfig::tcp() }, ());
    let mut robot = open(gate);
    let order = pc.start(50, jobs(3)).await.unwrap();
    robot.exchange("<Tila$6#9$2$$$#>").await;
    robot.exchange("<TilausKuittaus$1#9#>").await;
    let refused = outcome(order).await.unwrap_err();
    assert!(matches!(refused, Error::Refused { active: 9 }), "{refused:?}");
}

/// The robot forgets the order, refuses it, or ends it early.
#[tokio::test]
async fn a_journal_has_the_outcome_of_its_last_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    let kept = |executed, sent| JournalEntry { order: 50, first: 0, executed, sent, ahead: vec![] };
    let ends: [(&[&str], LastOrder); 3] = [
        (&[IDLE, STARTED, "<TyoKuittaus$4#50$1#>", IDLE], LastOrder::Unknown(kept(1, 3))),
        (&["<Tila$6#9$2$$$#>", "<TilausKuittaus$1#9#>"], LastOrder::Active(kept(0, 0))),
        (&[IDLE, STARTED, "<TyoKuittaus$4#50$3#><LoppuKuittaus$6#50$0$3#>"], LastOrder::Complete(kept(3, 3))),
    ];
    for (packets, expected) in ends {
        std::fs::remove_file(&path).unwrap_or_default();
        let (journal, _) = Journal::open(&path).unwrap();
        let (pc, gate, task) = a_pc(PcConfig { takeover: Takeover::Never, ..PcConfig::tcp() }, journal);
        let mut robot = open(gate);
        let order = pc.start(50, jobs(3)).await.unwrap();
        for packet in packets {
            robot.exchange(packet).await;
        }
        drop(outcome(order).await);
        kill(task).await;
        assert_eq!(Journal::open(&path).unwrap().1, expected);
    }
}

/// Stores the end of an order after a notification.
struct SlowStore(Arc<Notify>);

impl ProgressStore for SlowStore {
    async fn keep(&mut self, last: &LastOrder) -> io::Result<()> {
        if !matches!(last, LastOrder::Active(_)) {
            self.0.notified().await;
        }
        Ok(())
    }
}

/// A caller that ends the program at the outcome has it in the journal.
#[tokio::test]
async fn an_outcome_is_stored_before_the_caller_receives_it() {
    let store = Arc::new(Notify::new());
    let (pc, gate, _task) = a_pc(PcConfig::tcp(), SlowStore(Arc::clone(&store)));
    let mut robot = open(gate);
    let mut order = pin!(pc.start(50, jobs(3)).await.unwrap());
    robot.exchange(IDLE).await;
    robot.exchange(STARTED).await;
    robot.0.write_all(b"<TyoKuittaus$4#50$3#><LoppuKuittaus$6#50$0$3#>").await.unwrap();
    assert!(timeout(50 * MS, order.as_mut()).await.is_err(), "not stored yet");
    store.notify_one();
    let over = timeout(LONG, order).await.expect("an outcome").unwrap();
    assert_eq!(over, OrderResult { executed: 3, complete: true, unfit: None });
}

/// No job is sent meanwhile: all are in the robot's queue.
#[tokio::test]
async fn a_journal_follows_the_executed_jobs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    let (pc, gate, task) = a_pc(PcConfig::tcp(), Journal::open(&path).unwrap().0);
    let mut robot = open(gate);
    let order = pc.start(50, jobs(100)).await.unwrap();
    robot.exchange(IDLE).await;
    assert_eq!(robot.exchange(STARTED).await.matches("<Tyo$").count(), 100);
    for executed in [63, 64, 70] {
        robot.exchange(&format!("<TyoKuittaus$5#50${executed}#>")).await;
    }
    kill(task).await;
    drop(order);
    let kept = JournalEntry { order: 50, first: 0, executed: 64, sent: 100, ahead: vec![] };
    assert_eq!(Journal::open(&path).unwrap().1, LastOrder::Active(kept));
}

/// Returns the configuration over TCP, with a command of the plant: number 7.
pub(crate) fn with_command() -> PcConfig {
    let mut table = Dialect::DEFAULT.entries().to_vec();
    let fields = &[Field::Order, Field::Value];
    let role = Role::Command(7);
    table.push(Entry { role, name: "Nopeus", header: &[], fields });
    PcConfig { dialect: Dialect::new(table.leak()).unwrap(), ..PcConfig::tcp() }
}

#[tokio::test]
async fn a_command_has_its_outcome_when_the_robot_has_sent_its_next_packet() {
    let (pc, gate, _task) = a_pc(with_command(), ());
    let mut robot = open(gate);
    let of_robot = async {
        let packet = robot.exchange(IDLE).await;
        assert!(packet.contains("<Nopeus$5#0$-80#>"), "{packet}");
        robot.exchange(IDLE).await;
    };
    let (outcome, ()) = timeout(LONG, async { tokio::join!(pc.command(7, -80), of_robot) }).await.unwrap();
    assert_eq!(outcome.unwrap(), CommandOutcome::Transmitted);
}

/// There was no connection until then, so no part of it was done.
#[tokio::test]
async fn a_call_that_is_awaited_no_longer_is_not_made() {
    let (pc, gate, task) = a_pc(with_command(), ());
    drop(pc.start(50, jobs(3)).await.unwrap());
    assert!(timeout(MS, pc.command(7, 1)).await.is_err());
    let mut robot = open(gate);
    let packet = robot.exchange(IDLE).await;
    assert!(!packet.contains("<TilausAlkaa$") && !packet.contains("<Nopeus$"), "{packet}");
    let order = pc.start(51, jobs(3)).await.unwrap();
    assert!(robot.exchange(IDLE).await.contains("<TilausAlkaa$4#51$1#>"));
    pc.handle().shutdown().await;
    assert!(matches!(outcome(order).await, Err(Error::Closed(_))));
    // The order may be resumed: the session still has it.
    let session = task.await.unwrap();
    assert!(format!("{session:?}").contains("source: Some(Source { .. })"));
}

#[tokio::test]
async fn a_call_fails_with_the_attempt_to_connect() {
    let (pc, gate, _task) = a_pc(with_command(), ());
    let calls = async {
        tokio::join!(pc.run(50, jobs(3)), pc.end(), pc.interrupt(), pc.command(7, 1), async { drop(gate) })
    };
    let (run, end, interrupt, command, ()) = timeout(LONG, calls).await.unwrap();
    for error in [run.err(), end.err(), interrupt.err(), command.err()] {
        assert_eq!(error.expect("no robot").to_string(), "not connected: no robot");
    }
}

async fn failure(mut link: tokio::sync::watch::Receiver<Link>) -> String {
    let failed = timeout(LONG, link.wait_for(|link| matches!(link, Link::Failed(_)))).await.unwrap().unwrap();
    let Link::Failed(error) = &*failed else { panic!("it has failed") };
    error.to_string()
}

#[tokio::test]
async fn a_silent_peer_costs_the_connection() {
    let (pc, gate, _task) = a_pc(PcConfig { silence: 30 * MS, ..PcConfig::tcp() }, ());
    let _robot = open(gate);
    assert_eq!(failure(pc.handle().link()).await, "the robot is silent");

    let config = RobotConfig { silent_cycles: 1, reply_timeout: 30 * MS, ..RobotConfig::tcp() };
    let (gate, dial) = gated!();
    let (robot, _motion, task) = robot::<Line, _>(config, Default::default(), 8, dial).unwrap();
    let mut events = robot.handle().events();
    tokio::spawn(task.run());
    let _pc = open(gate);
    assert_eq!(failure(robot.handle().link()).await, "the PC is silent");
    let mut seen = Vec::new();
    while let Ok(event) = events.try_recv() {
        seen.push(event);
    }
    assert!(seen.contains(&RobotEvent::NoReply) && seen.contains(&RobotEvent::Disconnect), "{seen:?}");
}

#[tokio::test]
async fn both_resets_of_a_robot_reach_its_order() {
    let (gate, dial) = gated!();
    let (robot, mut motion, task) =
        robot::<Line, _>(RobotConfig::tcp(), Default::default(), 8, dial).unwrap();
    tokio::spawn(task.reconnect(Reconnect { first: MS, longest: MS }).run());
    let no_order = Err(RobotError::Call(SessionError::NoOrder));
    let calls = timeout(LONG, async { (robot.clear_queue().await, robot.reset_order().await) }).await;
    assert_eq!(calls.unwrap(), (no_order, no_order), "without a connection too");
    let mut pc = open(gate);
    pc.receive().await;
    pc.exchange("<TilausAlkaa$4#50$1#><Tyo$14#50$1$1$0$0$0$0#>").await;
    assert!(motion.wait().await);
    robot.clear_queue().await.unwrap();
    assert!(motion.take().is_none(), "it was discarded");
    robot.reset_order().await.unwrap();
    assert_eq!(robot.reset_order().await, no_order);
}

/// The journal has the index in the list, even if the order with the rest is stopped and its program is killed.
#[tokio::test]
async fn an_order_with_the_rest_goes_on_after_one_that_was_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    let end = |acks: &str, executed: u32| format!("{acks}<LoppuKuittaus$6#50$0${executed}#>");
    let (pc, gate, task) = a_pc(PcConfig::tcp(), Journal::open(&path).unwrap().0);
    let mut robot = open(gate);
    let order = pc.start(50, jobs(5)).await.unwrap();
    robot.exchange(IDLE).await;
    robot.exchange(STARTED).await;
    pc.interrupt().await.unwrap();
    robot.exchange(&end("<TyoKuittaus$4#50$2#>", 2)).await;
    assert_eq!(outcome(order).await.unwrap(), OrderResult { executed: 2, complete: false, unfit: None });
    pc.handle().shutdown().await;
    task.await.unwrap();

    let (journal, last) = Journal::open(&path).unwrap();
    let LastOrder::Stopped(kept) = last else { panic!("{last:?}") };
    assert_eq!((kept.first, kept.executed, kept.done()), (0, 2, 2));
    let (pc, gate, task) = a_pc(PcConfig::tcp(), journal);
    let mut robot = open(gate);
    let order = pc.go_on(50, kept, jobs(5)).await.unwrap();
    robot.exchange(IDLE).await;
    let packet = robot.exchange(STARTED).await;
    // Number 1 is the third of the list.
    assert!(packet.contains("<Tyo$14#50$1$1$2$0$0$0#>"), "{packet}");
    assert_eq!(packet.matches("<Tyo$").count(), 3);
    robot.exchange("<TyoKuittaus$4#50$1#><TyoPyynto$4#50$4#>").await;
    kill(task).await;
    drop(order);

    let (journal, last) = Journal::open(&path).unwrap();
    let LastOrder::Active(kept) = last else { panic!("{last:?}") };
    assert_eq!((kept.first, kept.sent), (2, 3));
    let (pc, gate, task) = a_pc(PcConfig::tcp(), journal);
    let mut robot = open(gate);
    let order = pc.resume(kept.clone(), jobs(4)).await.unwrap();
    let short = outcome(order).await.unwrap_err();
    assert!(matches!(short, Error::Call(kawasaki_msg::SessionError::FewerJobs { sent: 3 })), "{short}");
    let order = pc.resume(kept, jobs(5)).await.unwrap();
    robot.exchange("<Tila$9#50$2$1$2$#>").await;
    robot.exchange(&end("<TyoKuittaus$4#50$3#>", 3)).await;
    assert_eq!(outcome(order).await.unwrap(), OrderResult { executed: 3, complete: true, unfit: None });
    pc.handle().shutdown().await;
    task.await.unwrap();
    let last = Journal::open(&path).unwrap().1;
    assert!(matches!(&last, LastOrder::Complete(kept) if kept.done() == 5), "{last:?}");
}
