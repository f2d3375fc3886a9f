//! The host in a task of its own, over TCP.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::future::pending;
use core::net::SocketAddr;
use core::ops::ControlFlow;
use core::pin::Pin;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::{Context, Poll, Waker};
use core::time::Duration;
use std::io::{self, Read as _, Write as _};
use std::sync::{Arc, Mutex};
use std::{net, thread};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf, duplex};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::spawn_blocking;
use tokio::time::{sleep, timeout};
use val2_alter::robot_session::tokio::{Dial, Driver, GIVE_UP_AFTER, Reconnect, Tcp};
use val2_alter::robot_session::{Session as _, now};
use val2_alter::tokio::{Arm, Error, host};
use val2_alter::{
    Controller, ControllerConfig, ControllerEvent, ControllerState, ErrorCode, Exception, ExceptionOutcome,
    Frame, Framing, HostConfig, HostMessage, List, Message as _, Mode, Motion, MotionPhase, Reach, Reply,
    RobotMessage, SessionError, Start, StartCode,
};

const LONG: Duration = Duration::from_secs(30);
/// A line that takes no time: TCP.
const FAST: u32 = u32::MAX;
const MS: Duration = Duration::from_millis(1);

/// The arm's position by the values that its controller has accepted, and its furthest position.
type Path = Arc<Mutex<([i32; 6], [i32; 6])>>;

/// Runs a controller that executes ALTER again each time that it has ended.
async fn controller(stream: TcpStream, path: Path) {
    let mut session =
        Controller::new(ControllerConfig { baud: FAST, ..ControllerConfig::default() }).unwrap();
    let mut driver = Driver::new(stream);
    session.handle_connected(now());
    loop {
        if session.state() == ControllerState::Off {
            session.start(now()).unwrap();
        }
        let turn = driver.turn(&mut session, |_, event| {
            if let ControllerEvent::Reply { values, .. } = event {
                let (at, most) = &mut *path.lock().unwrap();
                for axis in 0..6 {
                    at[axis] += i32::from(values[axis]);
                    most[axis] = most[axis].max(at[axis].abs());
                }
            }
            ControlFlow::<()>::Continue(())
        });
        if !matches!(timeout(100 * MS, turn).await, Ok(Ok(ControlFlow::Continue(()))) | Err(_)) {
            return;
        }
    }
}

/// Starts both ends in threads of their own, because a reply is due within 15 ms.
async fn cell(reach: Option<Reach>) -> (Arm, Path) {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let to = Tcp::new(listener.local_addr().unwrap().to_string());
    let (arm, task) = host(HostConfig { baud: FAST, ..HostConfig::default() }, reach, to).unwrap();
    drop(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).thread().unwrap());
    let path = Path::default();
    let stream = listener.accept().await.unwrap().0.into_std().unwrap();
    let moved = Arc::clone(&path);
    thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async { controller(TcpStream::from_std(stream).unwrap(), moved).await });
    });
    (arm, path)
}

#[tokio::test]
async fn a_target_from_anywhere_stays_within_reach_and_a_stop_is_waited_for() {
    let reach = Reach { low: [-150, 0, 0, 0, 0, 0], high: [200, 0, 0, 0, 0, 0] };
    let (arm, path) = cell(Some(reach)).await;
    for (speed, end) in [(60, 200), (-60, -150)] {
        let moving = {
            let arm = arm.clone();
            thread::spawn(move || {
                for _ in 0..600 {
                    arm.set_target([speed, 60, 0, 0, 0, 0]);
                    if arm.commanded()[0] == end {
                        return;
                    }
                    thread::sleep(20 * MS);
                }
            })
        };
        tokio::task::spawn_blocking(move || moving.join().unwrap()).await.unwrap();
        assert_eq!(arm.commanded(), [end, 0, 0, 0, 0, 0], "{path:?}");
    }
    let most = path.lock().unwrap().1;
    assert!((1..=350).contains(&most[0]) && most[1] == 0, "{most:?}");
    arm.set_target([30, 0, 0, 0, 0, 0]);
    sleep(100 * MS).await;
    timeout(LONG, arm.stop()).await.unwrap().unwrap();
    let stopped = arm.commanded();
    arm.set_target([30, 0, 0, 0, 0, 0]);
    sleep(200 * MS).await;
    assert_eq!(arm.commanded(), stopped);
    arm.accept().await.unwrap();
    let refused = arm.exception(Exception::from(5)).await;
    assert!(matches!(refused, Err(Error::Call(SessionError::NoSubroutine))), "{refused:?}");
    arm.handle().shutdown().await;
    assert!(matches!(arm.stop().await, Err(Error::Closed(_))));
}

/// A target expires after its timeout, even if its caller does not clear it.
#[tokio::test]
async fn a_target_that_nobody_renews_ends() {
    let (arm, _path) = cell(None).await;
    while arm.commanded()[0] == 0 {
        arm.set_target([9, 0, 0, 0, 0, 0]);
        sleep(10 * MS).await;
    }
    sleep(HostConfig::default().target_timeout + 150 * MS).await;
    let at = arm.commanded();
    sleep(300 * MS).await;
    assert_eq!(arm.commanded(), at);
}

/// A controller by hand, which may take its time.
struct Line(Arc<net::TcpStream>);

impl Line {
    async fn to_arm(mode: Mode) -> (Arm, Self) {
        let (arm, line, _) = Self::to_arm_behind_gate(mode).await;
        (arm, line)
    }

    /// Starts an arm whose task is in a thread of its own, and stops there while it reads bytes and the gate is locked.
    async fn to_arm_behind_gate(mode: Mode) -> (Arm, Self, Arc<Gate>) {
        let listener = net::TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).unwrap();
        let address = listener.local_addr().unwrap();
        let gate = Arc::new(Gate::default());
        let passed = Arc::clone(&gate);
        let to = Dial(move || {
            let gate = Arc::clone(&passed);
            async move { Ok(Gated(TcpStream::connect(address).await?, gate)) }
        });
        let config = HostConfig {
            baud: FAST,
            mode,
            subroutine: true,
            silence_cycles: 10_000,
            target_timeout: LONG,
            gap: None,
            ..HostConfig::default()
        };
        let (arm, task) = host(config, None, to).unwrap();
        drop(task.thread().unwrap());
        let stream = spawn_blocking(move || listener.accept()).await.unwrap().unwrap().0;
        stream.set_read_timeout(Some(LONG)).unwrap();
        (arm, Self(Arc::new(stream)), gate)
    }

    fn send(&self, message: RobotMessage) {
        let mut out = [0; Frame::MAX_LEN];
        let length = message.encode(Framing::DEFAULT, &mut out).unwrap();
        (&*self.0).write_all(&out[..length]).unwrap();
    }

    async fn receive(&self) -> HostMessage {
        let stream = Arc::clone(&self.0);
        let receiving = move || {
            let mut read = Vec::new();
            loop {
                let mut byte = [0];
                (&*stream).read_exact(&mut byte).unwrap();
                read.extend(byte);
                if let Some((answer, _)) = HostMessage::decode_frame(&read, Framing::DEFAULT).unwrap() {
                    return answer;
                }
            }
        };
        spawn_blocking(receiving).await.unwrap()
    }

    /// Sends a message, and reads its answer.
    async fn answer(&self, message: RobotMessage) -> HostMessage {
        self.send(message);
        self.receive().await
    }

    async fn start(&self, mode: Mode) -> HostMessage {
        self.answer(RobotMessage::Start(Start::new(mode, List::EMPTY))).await
    }

    async fn reply(&self, phase: MotionPhase, error: ErrorCode) -> Reply {
        match self.answer(motion(phase, error)).await {
            HostMessage::Reply(reply) => reply,
            HostMessage::StartReply(_) => panic!("no start was sent"),
        }
    }
}

fn motion(phase: MotionPhase, error: ErrorCode) -> RobotMessage {
    let (segment_status, segment, percent, transform) = (1.into(), 1, 0, None);
    RobotMessage::Motion(Motion { phase, error, segment_status, segment, percent, transform })
}

/// While it is locked, a task waits here for the lock.
#[derive(Default)]
struct Gate {
    lock: Mutex<()>,
    waiting: AtomicBool,
}

struct Gated(TcpStream, Arc<Gate>);

impl AsyncRead for Gated {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let read = Pin::new(&mut self.0).poll_read(context, buffer);
        if read.is_ready() {
            self.1.waiting.store(true, Ordering::SeqCst);
            drop(self.1.lock.lock().unwrap());
            self.1.waiting.store(false, Ordering::SeqCst);
        }
        read
    }
}

impl AsyncWrite for Gated {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.0).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_shutdown(context)
    }
}

#[tokio::test]
async fn a_reply_that_the_controller_could_not_read_is_no_way() {
    let (arm, line) = Line::to_arm(Mode::CUMULATIVE_23).await;
    line.start(Mode::CUMULATIVE_23).await;
    arm.set_target([5, 0, 0, 0, 0, 0]);
    let mut ways = Vec::new();
    for error in [ErrorCode::None, ErrorCode::None, ErrorCode::Checksum, ErrorCode::None] {
        let reply = line.reply(MotionPhase::Running, error).await;
        assert_eq!(reply.values[0], Some(5));
        ways.push(arm.commanded());
    }
    assert_eq!(ways, [0, 5, 5, 10].map(|way| [way, 0, 0, 0, 0, 0]));
    arm.clear_target();
    assert_eq!(line.reply(MotionPhase::Running, ErrorCode::None).await, Reply::all([0; 6]));
    assert_eq!(arm.commanded(), [15, 0, 0, 0, 0, 0]);
}

#[tokio::test]
async fn an_offset_that_the_controller_could_not_read_is_not_where_the_arm_is() {
    let (arm, line) = Line::to_arm(Mode(22)).await;
    line.start(Mode(22)).await;
    let mut places = Vec::new();
    for (offset, error) in
        [(5, ErrorCode::None), (6, ErrorCode::None), (7, ErrorCode::Checksum), (8, ErrorCode::None)]
    {
        arm.set_target([offset, 0, 0, 0, 0, 0]);
        line.reply(MotionPhase::Running, error).await;
        places.push(arm.commanded()[0]);
    }
    assert_eq!(places, [0, 5, 5, 7]);
}

#[tokio::test]
async fn an_exception_is_sent_once_unless_its_caller_is_gone() {
    let (arm, line, gate) = Line::to_arm_behind_gate(Mode::CUMULATIVE_23).await;
    line.start(Mode::CUMULATIVE_23).await;
    line.reply(MotionPhase::Running, ErrorCode::None).await;
    // Both are called while the task works.
    let locked = gate.lock.lock().unwrap();
    line.send(motion(MotionPhase::Running, ErrorCode::None));
    while !gate.waiting.load(Ordering::SeqCst) {
        thread::sleep(MS);
    }
    let mut context = Context::from_waker(Waker::noop());
    let mut gone = Box::pin(arm.exception(Exception::from(5)));
    let mut called = Box::pin(arm.exception(Exception::CloseGripper));
    assert!(gone.as_mut().poll(&mut context).is_pending() && called.as_mut().poll(&mut context).is_pending());
    drop(gone);
    drop(locked);
    // One of the next two replies: the task may answer the first message before it makes the calls.
    let HostMessage::Reply(first) = line.receive().await else { panic!("no start was sent") };
    let second = line.reply(MotionPhase::Running, ErrorCode::None).await;
    assert!([first.exception, second.exception].contains(&Exception::CloseGripper), "{first:?} {second:?}");
    assert!(![first.exception, second.exception].contains(&Exception::from(5)), "{first:?} {second:?}");
    let reply = line.reply(MotionPhase::Interrupted, ErrorCode::None).await;
    assert_eq!(reply.exception, Exception::None);
    let outcome = timeout(LONG, called).await.unwrap();
    assert!(matches!(outcome, Ok(ExceptionOutcome::Done)), "{outcome:?}");
}

#[tokio::test]
async fn no_start_is_answered_from_a_stop_until_it_is_accepted_again() {
    let (arm, line) = Line::to_arm(Mode::CUMULATIVE_23).await;
    arm.handle().connected().await.unwrap();
    timeout(LONG, arm.stop()).await.unwrap().unwrap();
    arm.accept().await.unwrap();
    assert_eq!(line.start(Mode::CUMULATIVE_23).await, HostMessage::StartReply(StartCode::Accept));
}

#[tokio::test]
async fn without_a_connection_a_call_says_why() {
    let dial = Dial(async || Err::<TcpStream, _>(io::Error::from(io::ErrorKind::ConnectionRefused)));
    let (arm, task) = host(HostConfig::default(), None, dial).unwrap();
    tokio::spawn(task.run());
    let outcomes = [
        arm.stop().await.unwrap_err(),
        arm.accept().await.unwrap_err(),
        arm.exception(Exception::CloseGripper).await.unwrap_err(),
    ];
    for error in outcomes {
        assert!(
            matches!(&error, Error::NotConnected(why) if why.kind() == io::ErrorKind::ConnectionRefused),
            "{error}"
        );
    }
}

/// A peer, by its treatment of a connection.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Peer {
    Closes,
    Silent,
    /// No attempt to connect ends.
    Absent,
}

#[tokio::test(start_paused = true)]
async fn every_call_ends_whatever_the_controller_does() {
    const HOUR: Duration = Duration::from_secs(3600);
    for peer in [Peer::Closes, Peer::Silent, Peer::Absent] {
        let mut open = Vec::new();
        let dial = Dial(move || {
            let (near, far) = duplex(4096);
            if peer != Peer::Closes {
                open.push(far);
            }
            async move {
                if peer == Peer::Absent {
                    pending::<()>().await;
                }
                Ok(near)
            }
        });
        let config = HostConfig { subroutine: true, ..HostConfig::default() };
        let (arm, task) = host(config, None, dial).unwrap();
        tokio::spawn(task.run());
        let begun = tokio::time::Instant::now();
        let calls = async { tokio::join!(arm.stop(), arm.accept(), arm.exception(Exception::CloseGripper)) };
        let (stop, accept, exception) = timeout(HOUR, calls).await.expect("outcomes");
        let is_absent = |error: Error| matches!(error, Error::NotConnected(_));
        assert!(stop.map_or_else(is_absent, |()| peer != Peer::Absent));
        assert!(accept.map_or_else(is_absent, |()| peer != Peer::Absent));
        assert_eq!(exception.map_err(is_absent), Err(peer == Peer::Absent));
        assert!(begun.elapsed() <= GIVE_UP_AFTER + 10 * MS, "{peer:?}: {:?}", begun.elapsed());
        timeout(MS, arm.handle().shutdown_after(HOUR)).await.unwrap();
    }
}

/// In the middle of ALTER: the stop ends with the connection, and an exception has an outcome.
#[tokio::test]
async fn a_controller_that_goes_in_the_middle_costs_its_calls() {
    let (arm, line) = Line::to_arm(Mode::CUMULATIVE_23).await;
    line.start(Mode::CUMULATIVE_23).await;
    arm.set_target([30, 0, 0, 0, 0, 0]);
    line.reply(MotionPhase::Running, ErrorCode::None).await;
    line.reply(MotionPhase::Running, ErrorCode::None).await;
    let calls = async { tokio::join!(arm.exception(Exception::CloseGripper), arm.stop()) };
    let going = async {
        sleep(50 * MS).await;
        drop(line);
    };
    let ((exception, stop), ()) = timeout(LONG, async { tokio::join!(calls, going) }).await.unwrap();
    assert!(exception.is_ok(), "{exception:?}");
    assert!(stop.is_ok(), "{stop:?}");
}
