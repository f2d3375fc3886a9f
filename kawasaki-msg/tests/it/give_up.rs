//! Orders and commands end, whatever the robot and the disk do.

use core::future::{Future, pending};
use core::pin::Pin;
use core::time::Duration;
use std::io;
use std::sync::{Arc, Mutex};

use kawasaki_msg::robot_session::tokio::{Dial, GIVE_UP_AFTER, Reconnect};
use kawasaki_msg::tokio::{Error, Journal, JournalEntry, LastOrder, OrderResult, Pc, ProgressStore, pc};
use kawasaki_msg::{JobKind, Line, PcConfig, PcEvent, Point, SessionError};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream, duplex};
use tokio::time::{Instant, sleep, timeout};

use super::tasks::with_command;

const LONG: Duration = Duration::from_secs(3600);
const S: Duration = Duration::from_secs(1);
const MS: Duration = Duration::from_millis(1);
const IDLE: &str = "<Tila$6#0$0$$$#>";
const STARTED: &str = "<TilausKuittaus$2#50#><Tila$7#50$2$$$#><TyoPyynto$4#50$1#>";

fn jobs(count: i32) -> Vec<Line> {
    (0..count).map(|x| Line { kind: JobKind::Draw, start: Point::new(x, 0), end: Point::new(0, 0) }).collect()
}

type Connecting = Pin<Box<dyn Future<Output = io::Result<DuplexStream>> + Send>>;

/// Returns a PC whose connections lead to the ends that `robot` returns.
fn a_pc<K: ProgressStore>(
    keep: K,
    mut robot: impl FnMut(DuplexStream) -> Option<()> + Send + 'static,
) -> Pc<Line, K> {
    let dial = Dial(move || {
        let (near, far) = duplex(1 << 16);
        let is_there = robot(far).is_some();
        Box::pin(async move { if is_there { Ok(near) } else { Err(io::Error::other("no robot")) } })
            as Connecting
    });
    let (pc, task) = pc(with_command(), keep, dial).unwrap();
    tokio::spawn(task.reconnect(Reconnect { first: MS, longest: 50 * MS }).run());
    pc
}

async fn timed<T>(future: impl Future<Output = T>) -> (T, Duration) {
    let begun = Instant::now();
    let value = timeout(LONG, future).await.expect("it ends");
    (value, begun.elapsed())
}

async fn receive(robot: &mut DuplexStream) -> String {
    let mut packet = [0; 4096];
    let length = timeout(LONG, robot.read(&mut packet)).await.unwrap().unwrap();
    String::from_utf8(packet[..length].to_vec()).unwrap()
}

async fn exchange(robot: &mut DuplexStream, packet: &str) -> String {
    robot.write_all(packet.as_bytes()).await.unwrap();
    receive(robot).await
}

/// Nothing is sent before the robot has sent something.
#[tokio::test(start_paused = true)]
async fn a_robot_that_closes_every_connection_costs_what_waits_for_it() {
    let pc = a_pc((), |robot| {
        drop(robot);
        Some(())
    });
    let calls = async { tokio::join!(pc.run(50, jobs(3)), pc.command(7, 1)) };
    let ((run, command), time) = timed(calls).await;
    assert!((GIVE_UP_AFTER..GIVE_UP_AFTER + S).contains(&time), "{time:?}");
    for error in [run.unwrap_err(), command.unwrap_err()] {
        assert_eq!(error.to_string(), "not connected: the peer has closed the connection");
    }
    assert!(
        matches!(pc.end().await, Err(Error::Call(SessionError::NoOrder))),
        "the session has forgotten it"
    );
}

#[tokio::test(start_paused = true)]
async fn an_order_whose_robot_is_gone_is_given_up_and_can_be_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    let (journal, _) = Journal::open(&path).unwrap();
    let robots = Arc::new(Mutex::new(Vec::new()));
    let is_there = Arc::new(Mutex::new(true));
    let (plugged, there) = (Arc::clone(&robots), Arc::clone(&is_there));
    let pc = a_pc(journal, move |robot| there.lock().unwrap().then(|| plugged.lock().unwrap().push(robot)));
    let mut events = pc.handle().events();
    pc.handle().connected().await.unwrap();
    let order = pc.start(50, jobs(5)).await.unwrap();
    let mut robot = robots.lock().unwrap().pop().unwrap();
    assert!(exchange(&mut robot, IDLE).await.contains("<TilausAlkaa$4#50$1#>"));
    assert_eq!(exchange(&mut robot, STARTED).await.matches("<Tyo$").count(), 5);
    exchange(&mut robot, "<TyoKuittaus$4#50$1#>").await;
    *is_there.lock().unwrap() = false;
    drop(robot);
    let (outcome, time) = timed(order).await;
    let Err(Error::GivenUp { kept, .. }) = outcome else { panic!("{outcome:?}") };
    assert_eq!(kept, JournalEntry { order: 50, first: 0, executed: 1, sent: 5, ahead: vec![] });
    assert!((GIVE_UP_AFTER..GIVE_UP_AFTER + S).contains(&time), "{time:?}");
    let mut unknown = false;
    while let Ok(event) = events.try_recv() {
        unknown |= event == PcEvent::OutcomeUnknown { order: 50, executed: 1, sent: 5 };
    }
    assert!(unknown, "an order that is not awaited has an event");
    let stored = std::fs::read_to_string(&path).unwrap();
    assert!(stored.lines().last().unwrap().starts_with("50 "), "{stored}");

    // The robot has executed two more meanwhile, and is in an order that the PC does not know.
    *is_there.lock().unwrap() = true;
    pc.handle().connected().await.unwrap();
    let mut robot = robots.lock().unwrap().pop().unwrap();
    exchange(&mut robot, "<Tila$9#50$2$5$3$#>").await;
    let unchanged = std::fs::read_to_string(&path).unwrap();
    assert_eq!(unchanged, stored, "a program that is restarted can resume it too");
    let order = pc.resume(kept, jobs(5)).await.unwrap();
    let packet = exchange(&mut robot, "<Tila$9#50$2$5$3$#>").await;
    assert!(!packet.contains("<Tyo$") && !packet.contains("<TilausAlkaa$"), "{packet}");
    exchange(&mut robot, "<TyoKuittaus$4#50$5#><LoppuKuittaus$6#50$0$5#>").await;
    assert_eq!(timed(order).await.0.unwrap(), OrderResult { executed: 5, complete: true, unfit: None });
}

/// On the same handle, as soon as the order is given up: the session has discarded it.
#[tokio::test(start_paused = true)]
async fn after_an_order_that_was_given_up_another_one_may_begin() {
    let pc = a_pc((), |robot| {
        drop(robot);
        Some(())
    });
    for order in [50, 51] {
        let outcome = timed(pc.run(order, jobs(1))).await.0;
        assert!(matches!(outcome, Err(Error::NotConnected(_))), "{outcome:?}");
    }
}

/// The robot requests the order on each connection, gets it, and is then silent.
#[tokio::test(start_paused = true)]
async fn a_robot_that_takes_no_order_costs_it() {
    let pc = a_pc((), |mut robot| {
        tokio::spawn(async move {
            assert!(exchange(&mut robot, IDLE).await.contains("<TilausAlkaa$4#50$1#>"));
            sleep(LONG).await;
        });
        Some(())
    });
    let order = pc.start(50, jobs(1)).await.unwrap();
    let (outcome, time) = timed(order).await;
    let Err(Error::GivenUp { kept, why }) = outcome else { panic!("{outcome:?}") };
    assert_eq!(
        (kept, why.to_string()),
        (JournalEntry { order: 50, ..JournalEntry::default() }, "the robot is silent".into())
    );
    assert!(time < GIVE_UP_AFTER + 2 * PcConfig::tcp().silence, "{time:?}");
}

/// The behaviour of a disk when the state is stored.
#[derive(Debug, Clone, Copy)]
enum Disk {
    Fails,
    Hangs,
}

impl ProgressStore for Disk {
    async fn keep(&mut self, _: &LastOrder) -> io::Result<()> {
        match self {
            Self::Fails => Err(io::Error::other("the disk is full")),
            Self::Hangs => pending().await,
        }
    }
}

#[tokio::test(start_paused = true)]
async fn an_order_that_cannot_be_stored_ends_and_so_does_its_task() {
    for (disk, why) in [(Disk::Fails, "the disk is full"), (Disk::Hangs, "the state was not stored in time")]
    {
        let pc = a_pc(disk, |mut robot| {
            tokio::spawn(async move {
                let _ = robot.write_all(IDLE.as_bytes()).await;
                let mut bytes = [0];
                assert!(!matches!(robot.read(&mut bytes).await, Ok(1..)), "it was not stored");
            });
            Some(())
        });
        let (outcome, time) = timed(pc.run(50, jobs(1))).await;
        let error = outcome.unwrap_err();
        assert!(error.to_string().contains(why), "{error}");
        assert!((GIVE_UP_AFTER..GIVE_UP_AFTER + 11 * S).contains(&time), "{time:?}");
        let order = pc.start(51, jobs(1)).await.unwrap();
        sleep(200 * MS).await;
        let (_, time) = timed(pc.handle().shutdown()).await;
        assert!(time <= S + 10 * MS, "{time:?}");
        assert!(matches!(timed(order).await.0, Err(Error::Closed(_))));
    }
}
