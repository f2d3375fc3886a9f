//! Runs and queries end, whatever the controller does.

#![allow(clippy::cast_possible_truncation, clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::future::Future;
use core::ops::ControlFlow;
use core::pin::Pin;
use core::time::Duration;
use std::io;
use std::sync::{Arc, Mutex};

use laser_eb90::robot_session::tokio::{Dial, Driver, GIVE_UP_AFTER, Reconnect};
use laser_eb90::robot_session::{Session as _, now};
use laser_eb90::tokio::{Command, Error, Laser, host};
use laser_eb90::{
    Controller, ControllerConfig, ControllerEvent, HostConfig, Instruction, Item, Refusal, UnknownReason,
};
use tokio::io::{DuplexStream, duplex};
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::time::{Instant, sleep, timeout};

const LONG: Duration = Duration::from_secs(3600);
const S: Duration = Duration::from_secs(1);
const MS: Duration = Duration::from_millis(1);
const LINE: u16 = 0x0101;
const STATE: u16 = 0x0301;

/// The number that an instruction carries.
struct Cut(f32);

impl TryFrom<Instruction<'_>> for Cut {
    type Error = Refusal;

    fn try_from(instruction: Instruction<'_>) -> Result<Self, Refusal> {
        match instruction.parameters.clone().next() {
            Some(Ok(Item::F32(values))) => values.iter().next().map(Self).ok_or(Refusal::BadParameters),
            _ => Err(Refusal::BadParameters),
        }
    }
}

/// The numbers that a controller has executed.
type Done = Arc<Mutex<Vec<u32>>>;

/// Runs a controller that closes the connection when it gets a query.
async fn controller(pipe: DuplexStream, done: &Done) {
    let (writer, mut queue) = robot_work_queue::boxed::<Cut>(32, 9999).unwrap();
    let mut session = Controller::new(ControllerConfig::default(), writer).unwrap();
    let mut driver = Driver::new(pipe);
    session.handle_connected(now());
    loop {
        while let Some(cut) = queue.take() {
            done.lock().unwrap().push(cut.0 as u32);
            cut.complete();
        }
        let turn = driver.turn(&mut session, |_, event| match event {
            ControllerEvent::Execute { .. } => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        });
        if !matches!(timeout(2 * MS, turn).await, Ok(Ok(ControlFlow::Continue(()))) | Err(_)) {
            return;
        }
    }
}

type Connecting = Pin<Box<dyn Future<Output = io::Result<DuplexStream>> + Send>>;

/// The end that a laser finds when it connects.
#[derive(Clone, Copy, PartialEq)]
enum Found {
    Nothing,
    /// An end that closes the connection at once.
    Closing,
    Controller,
}

struct Cell {
    laser: Laser,
    found: Arc<Mutex<Found>>,
    pipes: UnboundedReceiver<DuplexStream>,
    done: Done,
}

impl Cell {
    fn new(found: Found) -> Self {
        let found = Arc::new(Mutex::new(found));
        let (plug, pipes) = unbounded_channel();
        let finds = Arc::clone(&found);
        let dial = Dial(move || {
            let (near, far) = duplex(1 << 12);
            let found = *finds.lock().unwrap();
            if found == Found::Controller {
                plug.send(far).unwrap();
            }
            Box::pin(async move {
                if found == Found::Nothing { Err(io::Error::other("no controller")) } else { Ok(near) }
            }) as Connecting
        });
        let (laser, task) = host(HostConfig::default(), dial).unwrap();
        tokio::spawn(task.reconnect(Reconnect { first: MS, longest: 50 * MS }).run());
        Self { laser, found, pipes, done: Done::default() }
    }

    /// Waits beside the controllers that the laser finds; after the first it finds nothing.
    async fn beside<T>(&mut self, calls: impl Future<Output = T>) -> T {
        let Self { pipes, found, done, .. } = self;
        let serving = async {
            while let Some(pipe) = pipes.recv().await {
                *found.lock().unwrap() = Found::Nothing;
                controller(pipe, done).await;
            }
        };
        tokio::select! {
            value = calls => value,
            () = serving => panic!("the laser has gone"),
        }
    }
}

fn cut(value: u16) -> Command {
    Command::new(LINE, move |parameters| parameters.f32(&[f32::from(value)]).map(drop))
}

async fn timed<T>(future: impl Future<Output = T>) -> (T, Duration) {
    let begun = Instant::now();
    let value = timeout(LONG, future).await.expect("it ends");
    (value, begun.elapsed())
}

/// The first frame of a connection waits until frames of an earlier host have passed: on these connections nothing is sent.
#[tokio::test(start_paused = true)]
async fn a_controller_that_closes_every_connection_costs_what_waits_for_it() {
    let mut cell = Cell::new(Found::Closing);
    let laser = cell.laser.clone();
    let calls = async {
        tokio::join!(
            laser.query(Command::bare(STATE)),
            laser.run((0..20).map(cut)),
            laser.now(Command::bare(0x0201)),
            laser.run([cut(20)]),
        )
    };
    let ((query, first, now, second), time) = timed(calls).await;
    assert!((GIVE_UP_AFTER..GIVE_UP_AFTER + S).contains(&time), "{time:?}");
    for error in [query.map(drop), first, now, second] {
        let error = error.unwrap_err();
        assert!(matches!(error, Error::NotConnected(_)), "{error:?}");
        assert_eq!(error.to_string(), "not connected: the peer has closed the connection");
    }
    // None of them is sent when it is back.
    *cell.found.lock().unwrap() = Found::Controller;
    cell.beside(async {
        timed(laser.run([cut(30), cut(31)])).await.0.unwrap();
        sleep(S).await;
    })
    .await;
    assert_eq!(*cell.done.lock().unwrap(), [30, 31]);
}

#[tokio::test(start_paused = true)]
async fn a_run_that_was_begun_says_how_far_it_came() {
    let mut cell = Cell::new(Found::Controller);
    let laser = cell.laser.clone();
    // The query goes between two frames of the run.
    let calls = async {
        let first = laser.run((0..20).map(cut));
        tokio::join!(first, laser.query(Command::bare(STATE)), laser.run([cut(20)]))
    };
    let ((first, query, second), time) = cell.beside(timed(calls)).await;
    let reason = UnknownReason::Disconnected;
    assert!(
        matches!(first, Err(Error::Unknown { taken: 7, count: 0, reason: found }) if found == reason),
        "{first:?}"
    );
    assert!(matches!(query, Err(Error::Unknown { count: 1, .. })), "{query:?}");
    assert!(matches!(second, Err(Error::NotSent)), "{second:?}");
    assert!((GIVE_UP_AFTER..GIVE_UP_AFTER + 3 * S).contains(&time), "{time:?}");
    assert_eq!(*cell.done.lock().unwrap(), [0, 1, 2, 3, 4, 5, 6]);
}
