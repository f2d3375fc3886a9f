//! The host in a task of its own, over TCP.

#![allow(clippy::cast_possible_truncation)]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::net::SocketAddr;
use core::ops::ControlFlow;
use core::time::Duration;
use std::sync::{Arc, Mutex};
use std::thread;

use laser_eb90::robot_session::tokio::{Driver, Reconnect, Tcp};
use laser_eb90::robot_session::{Session as _, now};
use laser_eb90::tokio::{Command, Error, Laser, host};
use laser_eb90::{
    Controller, ControllerConfig, ControllerEvent, EncodeError, HostConfig, Instruction, Item, Refusal,
    SessionError,
};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;

const LONG: Duration = Duration::from_secs(60);
const MS: Duration = Duration::from_millis(1);
const LINE: u16 = 0x0101;
const OFF: u16 = 0x0201;
const STATE: u16 = 0x0301;

/// The number in an instruction; below zero it is invalid.
struct Cut(f32);

impl TryFrom<Instruction<'_>> for Cut {
    type Error = Refusal;

    fn try_from(instruction: Instruction<'_>) -> Result<Self, Refusal> {
        match instruction.parameters.clone().next() {
            Some(Ok(Item::F32(values))) => {
                let value = values.iter().next().unwrap_or(-1.0);
                if value < 0.0 { Err(Refusal::BadParameters) } else { Ok(Self(value)) }
            }
            _ => Err(Refusal::BadParameters),
        }
    }
}

/// The numbers that a controller has executed.
type Done = Arc<Mutex<Vec<f32>>>;

async fn controller(stream: TcpStream, done: Done) {
    let (writer, mut queue) = robot_work_queue::boxed::<Cut>(32, 9999).unwrap();
    let mut session = Controller::new(ControllerConfig::default(), writer).unwrap();
    let mut driver = Driver::new(stream);
    session.handle_connected(now());
    loop {
        while let Some(cut) = queue.take() {
            done.lock().unwrap().push(cut.0);
            cut.complete();
        }
        let turn = driver.turn(&mut session, |controller, event| {
            if let ControllerEvent::Execute { word, .. } = event {
                if word == OFF {
                    controller.answer(now(), |_| Ok(())).unwrap();
                } else {
                    controller.answer(now(), |values| values.f32(&[1.5, 2.5]).map(drop)).unwrap();
                }
            }
            ControlFlow::<()>::Continue(())
        });
        if !matches!(timeout(2 * MS, turn).await, Ok(Ok(ControlFlow::Continue(()))) | Err(_)) {
            return;
        }
    }
}

async fn cell() -> (Laser, Done, TcpListener) {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let to = Tcp::new(listener.local_addr().unwrap().to_string());
    let (laser, task) = host(HostConfig::default(), to).unwrap();
    drop(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).thread().unwrap());
    let done = Done::default();
    serve(listener.accept().await.unwrap().0, &done);
    (laser, done, listener)
}

fn serve(stream: TcpStream, done: &Done) {
    let (stream, done) = (stream.into_std().unwrap(), Arc::clone(done));
    thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async { controller(TcpStream::from_std(stream).unwrap(), done).await });
    });
}

fn cut(value: f32) -> Command {
    Command::new(LINE, move |parameters| parameters.f32(&[value]).map(drop))
}

fn numbers(done: &Done) -> Vec<u32> {
    done.lock().unwrap().iter().map(|value| *value as u32).collect()
}

#[tokio::test]
async fn a_run_is_taken_once_and_queries_go_between_its_frames() {
    let (laser, done, _listener) = cell().await;
    let running = tokio::spawn({
        let laser = laser.clone();
        async move { laser.run((0..60).map(|n| cut(n as f32))).await }
    });
    let mut between = 0;
    while !running.is_finished() {
        let answer = timeout(LONG, laser.query(Command::bare(STATE))).await.unwrap().unwrap();
        assert!(matches!(answer.items().next(), Some(Ok(Item::F32(_)))));
        timeout(LONG, laser.now(Command::bare(OFF))).await.unwrap().unwrap();
        between += u32::from(numbers(&done).len() < 60);
    }
    running.await.unwrap().unwrap();
    assert!(between > 1, "{between}");
    // A second run after it, and an empty run.
    laser.run([cut(60.0), cut(61.0)]).await.unwrap();
    laser.run([]).await.unwrap();
    timeout(LONG, async {
        while numbers(&done).len() < 62 {
            tokio::time::sleep(5 * MS).await;
        }
    })
    .await
    .unwrap();
    assert_eq!(numbers(&done), (0..62).collect::<Vec<_>>());
}

#[tokio::test]
async fn what_is_refused_ends_its_run_and_those_behind_it() {
    let (laser, done, _listener) = cell().await;
    let behind = {
        let laser = laser.clone();
        async move { laser.run([cut(99.0)]).await }
    };
    let refused = laser.run((0..20).map(|n| cut(if n == 9 { -1.0 } else { n as f32 })));
    let (refused, behind) = timeout(LONG, async { tokio::join!(refused, behind) }).await.unwrap();
    assert!(
        matches!(refused, Err(Error::Refused { taken: 1..=9, refusal: Refusal::BadParameters })),
        "{refused:?}"
    );
    assert!(matches!(behind, Err(Error::NotSent)), "{behind:?}");
    let unfit = laser.run([cut(50.0), Command::new(0x0999, |_| Ok(())), cut(51.0)]).await;
    assert!(
        matches!(unfit, Err(Error::Unfit { index: 1, error: SessionError::UnknownWord { word: 0x0999 } })),
        "{unfit:?}"
    );
    let long =
        |_: &mut laser_eb90::Payload<'_>| Err(EncodeError::BufferTooSmall { needed: 999, available: 1 });
    assert!(matches!(laser.query(Command::new(STATE, long)).await, Err(Error::Unfit { .. })));
    assert!(matches!(laser.now(Command::new(OFF, long)).await, Err(Error::Unfit { .. })));
    // The line works on.
    timeout(LONG, laser.query(Command::bare(STATE))).await.unwrap().unwrap();
    let done = numbers(&done);
    assert!(
        done.contains(&50) && !done.contains(&51) && !done.contains(&99) && !done.contains(&10),
        "{done:?}"
    );
}

#[tokio::test]
async fn without_a_connection_nothing_is_sent() {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let to = Tcp::new(listener.local_addr().unwrap().to_string());
    drop(listener);
    let (laser, task) = host(HostConfig::default(), to).unwrap();
    drop(task.thread().unwrap());
    let run = timeout(LONG, laser.run([cut(1.0)])).await.unwrap();
    assert!(matches!(run, Err(Error::NotConnected(_))), "{run:?}");
    let state = timeout(LONG, laser.query(Command::bare(STATE))).await.unwrap();
    assert!(matches!(state, Err(Error::NotConnected(_))), "{state:?}");
}

#[test]
fn a_command_prints_its_word() {
    assert_eq!(format!("{:?}", Command::bare(OFF)), "Command { word: 0201h, .. }");
}

#[tokio::test]
async fn what_was_in_flight_when_the_controller_went_is_unknown() {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let to = Tcp::new(listener.local_addr().unwrap().to_string());
    let (laser, task) = host(HostConfig::default(), to).unwrap();
    drop(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).thread().unwrap());
    let silent = listener.accept().await.unwrap().0;
    let going = async {
        silent.peek(&mut [0]).await.unwrap();
        drop(silent);
    };
    let (unknown, ()) =
        timeout(LONG, async { tokio::join!(laser.run((0..20).map(|n| cut(n as f32))), going) })
            .await
            .unwrap();
    assert!(matches!(unknown, Err(Error::Unknown { taken: 0, count: 1..=7, .. })), "{unknown:?}");
    let text = unknown.unwrap_err().to_string();
    assert!(text.ends_with(" of the run were taken is unknown: the connection was lost"), "{text}");
    let done = Done::default();
    serve(listener.accept().await.unwrap().0, &done);
    timeout(LONG, laser.run([cut(30.0)])).await.unwrap().unwrap();
    laser.handle().shutdown().await;
    assert_eq!(numbers(&done), [30]);
    assert!(matches!(laser.run([cut(31.0)]).await, Err(Error::Closed(_))));
}
