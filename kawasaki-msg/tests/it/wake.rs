//! A robot under the driver of std whose motion task is a thread: neither polls for changes of the other.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the program has the socket")]

use core::net::Ipv4Addr;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread;

use kawasaki_msg::motion::{self, boxed_with};
use kawasaki_msg::robot_session::{Driver, Session as _, now};
use kawasaki_msg::{JobKind, Line, Pc, PcConfig, PcEvent, Point, Robot, RobotConfig, RobotEvent, timing};

const HOUR: Duration = Duration::from_secs(3600);
/// The time after which an event that has not come is assumed not to come.
const NEVER: Duration = Duration::from_secs(20);

/// Gives the robot an order of one job; while `holds` is set, the next answer waits for the channel. Returns the number of
/// executed jobs at the end.
fn pc(mut stream: TcpStream, holds: &AtomicBool, answer: &Receiver<()>) -> u32 {
    let jobs = [Line { kind: JobKind::Draw, start: Point::new(0, 0), end: Point::new(1, 0) }];
    let mut pc = Pc::new(PcConfig::tcp()).unwrap();
    pc.start(50, &jobs[..]).unwrap();
    pc.handle_connected(now());
    let mut buffer = [0; 4096];
    loop {
        let length = stream.read(&mut buffer).unwrap();
        assert!(length > 0, "the robot has left before its order was over");
        if holds.swap(false, Ordering::SeqCst) {
            answer.recv().unwrap();
        }
        pc.handle_input(now(), &buffer[..length]);
        while let Some(event) = pc.poll_event() {
            if let PcEvent::OrderOver { executed, .. } = event {
                return executed;
            }
        }
        thread::sleep(timing::MIN_REPLY_DELAY);
        while let Some(length) = pc.poll_transmit(now(), &mut buffer) {
            stream.write_all(&buffer[..length]).unwrap();
        }
    }
}

#[test]
fn a_robot_learns_of_executed_jobs_from_the_wake_of_its_queue_alone() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let (watched, peer) = (stream.try_clone().unwrap(), listener.accept().unwrap().0);
    let mut driver = Driver::new(stream);
    let waker = driver.waker().unwrap();

    let (execute, order_to_execute) = channel::<()>();
    let (begins, has_begun) = channel();
    let (motion, end) = channel();
    let motion_task = thread::spawn(move || {
        let mut queue: motion::Motion<'_, Line, _> = end.recv().unwrap();
        loop {
            while let Some(job) = queue.take() {
                begins.send(()).unwrap();
                order_to_execute.recv().unwrap();
                job.complete();
            }
            if queue.is_abandoned() {
                return;
            }
            thread::park();
        }
    });
    let motion_thread = motion_task.thread().clone();
    let (jobs, queue) =
        boxed_with(4, RobotConfig::tcp().max_number, move || motion_thread.unpark(), move || waker.wake())
            .unwrap();
    motion.send(queue).unwrap();

    let (holds, (answer, answers)) = (Arc::new(AtomicBool::new(false)), channel());
    let held = Arc::clone(&holds);
    let pc = thread::spawn(move || pc(peer, &held, &answers));
    let (over, is_over) = channel::<()>();
    let watch = thread::spawn(move || {
        if is_over.recv_timeout(NEVER).is_err() {
            watched.shutdown(Shutdown::Both).unwrap();
        }
    });

    let config = RobotConfig { reply_timeout: HOUR, patience: HOUR, ..RobotConfig::tcp() };
    let mut robot = Robot::new(config, jobs).unwrap();
    robot.handle_timeout(now());
    assert_eq!(robot.poll_event(), Some(RobotEvent::Connect));
    robot.handle_connected(now());
    let mut ended = None;
    let mut turn = |robot: &mut Robot<'_, Line, 256, _>| {
        let turn = driver.turn(robot, None, |_, event| {
            if let RobotEvent::OrderOver { executed, .. } = event {
                ended = Some(executed);
            }
            ControlFlow::<()>::Continue(())
        });
        (ended, turn.unwrap())
    };
    let go_on = ControlFlow::Continue(());
    while robot.queued() == 0 {
        assert_eq!(turn(&mut robot), (None, go_on));
    }
    // A job that is not taken would be discarded.
    has_begun.recv().unwrap();
    // The order is over when the job is executed. The packet that reports it has no answer: there is no other work for an
    // hour.
    robot.reset_order().unwrap();
    holds.store(true, Ordering::SeqCst);
    let executes = thread::spawn(move || {
        thread::sleep(Duration::from_millis(50));
        execute.send(()).unwrap();
    });
    let (begin, mut turns) = (now(), 0);
    let mut executed = None;
    while executed.is_none() {
        let (over, how) = turn(&mut robot);
        assert_eq!(how, go_on, "nothing has woken it");
        (executed, turns) = (over, turns + 1);
    }
    assert_eq!(executed, Some(1), "reported before the queue has settled");
    assert!(turns <= 5, "{turns}: it was woken once");
    assert!(now() - begin < NEVER && robot.poll_timeout().is_some_and(|at| at > now() + HOUR / 2));
    answer.send(()).unwrap();
    while turn(&mut robot).1 == go_on {}
    assert_eq!((pc.join().unwrap(), executes.join().unwrap()), (1, ()));
    over.send(()).unwrap();
    watch.join().unwrap();
    drop(robot);
    motion_task.join().unwrap();
}
