//! The loops over real TCP, and a transport that reports when the last byte has left.

use core::net::{Ipv4Addr, SocketAddr};
use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{self, BufRead, BufReader, ErrorKind, Read as _, Write};
use std::net::{TcpListener, TcpStream};
use std::thread;

use crate::common::echo::{Echo, EchoEvent};
use crate::common::{Asker, Event};
use robot_session::{
    Driver, EndReason, ReceiveOutcome, SendOutcome, Session as _, Transport, Wait, drive, now,
};
#[cfg(target_os = "linux")]
use socket2::SockRef;

/// Answers each line with itself, in pieces; closes the connection at `bye`; is silent at `hush`.
fn peer() -> SocketAddr {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap();
    thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            stream.set_nodelay(true).unwrap();
            let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
            while let Some(Ok(line)) = lines.next() {
                match &line[..] {
                    "bye" => break,
                    "hush" => {}
                    _ => {
                        for byte in format!("{line}\n").bytes() {
                            stream.write_all(&[byte]).unwrap();
                            thread::sleep(Duration::from_millis(2));
                        }
                    }
                }
            }
        }
    });
    address
}

fn until(
    last: &'static str,
    seen: &mut Vec<Event>,
) -> impl FnMut(&mut Asker, Event) -> ControlFlow<&'static str> {
    move |_, event| {
        seen.push(event.clone());
        if event == Event::Answer(last.into()) { ControlFlow::Break(last) } else { ControlFlow::Continue(()) }
    }
}

fn answer(text: &str) -> Event {
    Event::Answer(text.into())
}

#[test]
fn a_session_runs_until_its_handler_breaks() {
    let (mut session, mut seen) = (Asker::new(&["one", "two"]), Vec::new());
    let ended = drive(&mut session, TcpStream::connect(peer()).unwrap(), until("two", &mut seen)).unwrap();
    assert_eq!(ended, EndReason::ByHandler("two"));
    assert_eq!(seen, [Event::Connected, answer("one"), answer("two"), Event::Disconnected]);
    assert_eq!(session.statistics(), 0, "a TCP connection does not say when a byte has left");
}

#[test]
fn what_a_handler_says_of_the_end_does_not_replace_what_ended_the_loop() {
    let mut seen = 0;
    let handler = |_: &mut Asker, event| match event {
        Event::Connected => ControlFlow::Continue(()),
        event => {
            seen += 1;
            ControlFlow::Break(event)
        }
    };
    let mut session = Asker::new(&["one", "two"]);
    let ended = drive(&mut session, TcpStream::connect(peer()).unwrap(), handler).unwrap();
    assert_eq!(ended, EndReason::ByHandler(answer("one")));
    assert!(seen >= 2, "it sees the events of the end all the same");
}

#[test]
fn a_handler_may_call_the_session() {
    let mut session = Asker::new(&["1"]);
    let handler = |session: &mut Asker, event| match event {
        Event::Answer(text) if text.len() == 4 => ControlFlow::Break(()),
        Event::Answer(text) => {
            session.requests.push_back(text + "1");
            ControlFlow::Continue(())
        }
        _ => ControlFlow::Continue(()),
    };
    let ended = drive(&mut session, TcpStream::connect(peer()).unwrap(), handler).unwrap();
    assert_eq!(ended, EndReason::ByHandler(()));
}

#[test]
fn a_closed_connection_ends_the_loop_and_the_request_has_an_outcome() {
    let (mut session, mut seen) = (Asker::new(&["one", "bye"]), Vec::new());
    let address = peer();
    let ended = drive(&mut session, TcpStream::connect(address).unwrap(), until("more", &mut seen)).unwrap();
    assert_eq!(ended, EndReason::ByPeer);
    session.requests.push_back("more".into());
    drive(&mut session, TcpStream::connect(address).unwrap(), until("more", &mut seen)).unwrap();
    let first = [Event::Connected, answer("one"), Event::NoAnswer("bye".into()), Event::Disconnected];
    let second = [Event::Connected, answer("more"), Event::Disconnected];
    assert_eq!(seen, [&first[..], &second].concat());
}

#[test]
fn the_timeout_of_the_session_ends_a_wait() {
    let (mut session, mut seen) = (Asker::new(&["hush", "two"]), Vec::new());
    session.timeout = Duration::from_millis(300);
    drive(&mut session, TcpStream::connect(peer()).unwrap(), until("two", &mut seen)).unwrap();
    assert_eq!(seen[1..3], [Event::NoAnswer("hush".into()), answer("two")]);
}

/// A peer that does not read does not delay any deadline, and its bytes are read.
#[test]
fn a_peer_that_does_not_read_holds_up_nothing_else() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let mut stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let mut peer = listener.accept().unwrap().0;
    // As many bytes as both systems buffer for the peer.
    let mut held = 0;
    stream.set_nonblocking(true).unwrap();
    loop {
        match stream.write(&[b'x'; 4096]) {
            Ok(length) => held += length,
            Err(error) if error.kind() == ErrorKind::WouldBlock => break,
            Err(error) => panic!("{error}"),
        }
    }
    stream.set_nonblocking(false).unwrap();
    let (mut driver, mut session) = (Driver::new(stream), Asker::new(&["1234567"]));
    session.timeout = Duration::from_millis(100);
    let begin = now();
    let mut end = |_: &mut Asker, event| ControlFlow::Break(event);
    let mut turn = |session: &mut Asker| loop {
        if let ControlFlow::Break(EndReason::ByHandler(event)) = driver.turn(session, None, &mut end).unwrap()
        {
            break event;
        }
    };
    assert_eq!(turn(&mut session), Event::NoAnswer("1234567".into()));
    assert!((Duration::from_millis(100)..Duration::from_secs(5)).contains(&(now() - begin)));
    // The peer's bytes are read meanwhile, and answered after the message that was begun.
    let mut session = Echo::new(Duration::ZERO);
    session.handle_connected(now());
    peer.write_all(b"a").unwrap();
    let mut received = vec![0; held];
    let reader = thread::spawn(move || {
        thread::sleep(Duration::from_millis(100));
        peer.read_exact(&mut received).unwrap();
        assert!(received.iter().all(|byte| *byte == b'x'));
        let mut rest = [0; 9];
        peer.read_exact(&mut rest).unwrap();
        (peer, rest)
    });
    let mut answered = false;
    while !(answered && reader.is_finished()) {
        let handler = |_: &mut Echo, event| {
            answered |= event == EchoEvent::Answered(b'a');
            ControlFlow::<()>::Continue(())
        };
        let wait = Some(Duration::from_millis(10));
        assert!(driver.turn(&mut session, wait, handler).unwrap().is_continue());
    }
    assert_eq!(&reader.join().unwrap().1, b"1234567\na");
}

#[test]
fn a_socket_says_how_much_it_took_and_that_its_peer_is_gone() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let mut stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let (peer, _) = listener.accept().unwrap();
    let bytes = [7; 100_000];
    assert!(Wait::limited(LONG).writable(&stream).unwrap());
    let mut sent = 0;
    loop {
        match stream.send(&bytes).unwrap() {
            SendOutcome::Buffered => sent += bytes.len(),
            SendOutcome::Part(0) if !Wait::limited(SHORT).writable(&stream).unwrap() => break,
            SendOutcome::Part(length) => sent += length,
            SendOutcome::Transmitted => panic!("a socket does not know"),
        }
    }
    let begin = now();
    stream.wait_for_room(Wait::limited(SHORT)).unwrap();
    assert!(now() - begin >= SHORT, "there is none");
    let mut received = vec![0; sent];
    (&peer).read_exact(&mut received).unwrap();
    stream.wait_for_room(Wait::default()).unwrap();
    assert_eq!(stream.send(b"end").unwrap(), SendOutcome::Buffered);
    let mut rest = [0; 4];
    assert_eq!((&peer).read(&mut rest).unwrap(), 3, "what was sent, and no more");
    // Bytes that the peer never reads: its close is an error at both ends.
    assert_eq!(stream.send(b"unread").unwrap(), SendOutcome::Buffered);
    Wait::limited(LONG).readable(&peer).unwrap();
    drop(peer);
    assert!(stream.receive(&mut rest, Wait::limited(LONG)).is_err());
    assert!(stream.send(b"x").is_err());
}

#[cfg(target_os = "linux")]
#[test]
fn bytes_that_a_peer_has_not_taken_in_time_are_discarded() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let (_peer, _) = listener.accept().unwrap();
    let mut driver = Driver::new(stream);
    let mut session = Asker::new(&["hush"]);
    session.timeout = SHORT;
    session.handle_connected(now());
    let wait = Some(Duration::ZERO);
    assert!(driver.turn(&mut session, wait, |_, _| ControlFlow::<()>::Continue(())).unwrap().is_continue());
    let stream = driver.transport_mut();
    // The peer does not read: its window is full.
    while stream.send(&[7; 100_000]).unwrap() != SendOutcome::Part(0)
        || Wait::limited(SHORT / 2).writable(&*stream).unwrap()
    {}
    let begin = now();
    let error = loop {
        match stream.receive(&mut [0; 4], Wait::limited(LONG)) {
            Ok(received) => assert_eq!(received, ReceiveOutcome::Nothing),
            Err(error) => break error,
        }
        assert!(now() - begin < LONG, "the connection has not ended");
    };
    assert_eq!(error.kind(), ErrorKind::TimedOut);
}

/// The bytes that a connection did not take are not the beginning of the next one.
#[test]
fn a_connection_that_fails_leaves_nothing_for_the_next() {
    struct Deaf(Vec<u8>, usize);

    impl Transport for Deaf {
        fn receive(&mut self, _: &mut [u8], _: Wait<'_>) -> io::Result<ReceiveOutcome> {
            Ok(ReceiveOutcome::Nothing)
        }

        fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
            let length = bytes.len().min(self.1);
            self.1 -= length;
            self.0.extend(&bytes[..length]);
            if length == 0 { Err(ErrorKind::TimedOut.into()) } else { Ok(SendOutcome::Part(length)) }
        }
    }

    let (mut driver, mut session) = (Driver::new(Deaf(Vec::new(), 3)), Asker::new(&["1234567", "two"]));
    let go_on = |_: &mut Asker, _| ControlFlow::<()>::Continue(());
    assert!(driver.turn(&mut session, Some(Duration::ZERO), go_on).unwrap().is_continue());
    assert!(driver.turn(&mut session, Some(Duration::ZERO), go_on).is_err());
    session.handle_disconnected(now());
    *driver.transport_mut() = Deaf(Vec::new(), 64);
    assert!(driver.turn(&mut session, Some(Duration::ZERO), go_on).unwrap().is_continue());
    assert_eq!(driver.transport_mut().0, b"two\n");
}

#[test]
fn a_turn_waits_no_longer_than_it_is_told() {
    let mut driver = Driver::new(TcpStream::connect(peer()).unwrap());
    let mut session = Asker::new(&["hush"]);
    let handler = |_: &mut Asker, _| ControlFlow::<()>::Continue(());
    let begin = robot_session::now();
    for _ in 0..3 {
        let turn = driver.turn(&mut session, Some(Duration::from_millis(10)), handler).unwrap();
        assert!(turn.is_continue());
    }
    let took = robot_session::now() - begin;
    assert!(took >= Duration::from_millis(29) && took < Duration::from_secs(10), "{took:?}");
}

#[test]
fn what_a_session_does_not_want_yet_stays_in_the_transport() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let mut peer = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let stream = listener.accept().unwrap().0;
    let requests: Vec<u8> = (0..=250).cycle().take(1000).collect();
    peer.write_all(&requests).unwrap();
    let mut answered = 0;
    let handler = |_: &mut Echo, event| match event {
        EchoEvent::Answered(_) if answered == 999 => ControlFlow::Break(()),
        EchoEvent::Answered(_) => {
            answered += 1;
            ControlFlow::Continue(())
        }
        other => panic!("{other:?}"),
    };
    let ended = drive(&mut Echo::new(Duration::from_micros(10)), stream, handler).unwrap();
    assert_eq!(ended, EndReason::ByHandler(()));
    let mut answers = vec![0; 1000];
    peer.read_exact(&mut answers).unwrap();
    assert_eq!(answers, requests);
}

#[test]
fn bytes_and_an_end_are_there_to_be_read_and_silence_is_not() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap();
    let stream = TcpStream::connect(address).unwrap();
    let mut peer = listener.accept().unwrap().0;
    let wait = Duration::from_micros(2300);
    let start = now();
    assert!(!Wait::limited(wait).readable(&stream).unwrap());
    assert!(now() - start >= wait);
    assert!(!Wait::limited(Duration::ZERO).readable(&stream).unwrap());
    peer.write_all(b"x").unwrap();
    assert!(Wait::limited(Duration::MAX).readable(&stream).unwrap());
    let another = TcpStream::connect(address).unwrap();
    drop(listener.accept().unwrap());
    assert!(Wait::default().readable(&another).unwrap());
}

/// Linux reports an urgent byte as readable if the system's buffer is small, although nothing can be read.
#[cfg(target_os = "linux")]
#[test]
fn a_wait_that_ends_without_a_byte_is_silence() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    SockRef::from(&listener).set_recv_buffer_size(1).unwrap();
    let mut peer = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let mut stream = listener.accept().unwrap().0;
    let mut buffer = [0; 1000];
    peer.write_all(&buffer).unwrap();
    stream.read_exact(&mut buffer).unwrap();
    SockRef::from(&peer).send_out_of_band(b"!").unwrap();
    let begin = now();
    assert_eq!(stream.receive(&mut buffer, Wait::limited(SHORT)).unwrap(), ReceiveOutcome::Nothing);
    assert!(now() - begin < LONG / 2);
    peer.write_all(b"x").unwrap();
    assert_eq!(stream.receive(&mut buffer, Wait::limited(LONG)).unwrap(), ReceiveOutcome::Bytes(1));
    assert_eq!(buffer[0], b'x');
}

const LONG: Duration = Duration::from_secs(20);
const SHORT: Duration = Duration::from_millis(20);

#[test]
fn a_wake_ends_the_wait_and_the_next_turn_does_not_wait() {
    let mut driver = Driver::new(TcpStream::connect(peer()).unwrap());
    let waker = driver.waker().unwrap();
    // The session has no deadline, and nothing to send.
    let mut session = Asker::new(&[]);
    let mut turn = |wait| {
        let begin = now();
        let turn = driver.turn(&mut session, Some(wait), |_, _| ControlFlow::<()>::Continue(())).unwrap();
        assert!(turn.is_continue());
        now() - begin
    };
    for wakes in 1..4 {
        (0..wakes).for_each(|_| waker.wake());
        assert!(turn(LONG) < LONG / 2 && turn(LONG) < LONG / 2);
        assert!(turn(SHORT) >= SHORT, "however often, it is woken once");
    }
    let other = thread::spawn(move || {
        thread::sleep(SHORT);
        waker.wake();
    });
    let took = turn(LONG);
    assert!((SHORT..LONG / 2).contains(&took), "{took:?}");
    other.join().unwrap();
}

#[test]
fn without_a_wish_for_input_a_turn_waits_for_the_deadline_or_a_wake() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let mut peer = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let mut driver = Driver::new(listener.accept().unwrap().0);
    let waker = driver.waker().unwrap();
    let mut turn = |session: &mut Echo| {
        let begin = now();
        let turn = driver.turn(session, Some(LONG), |_, _| ControlFlow::<()>::Continue(())).unwrap();
        assert!(turn.is_continue());
        now() - begin
    };
    let mut session = Echo::new(3 * SHORT);
    session.handle_connected(now());
    peer.write_all(b"ab").unwrap();
    turn(&mut session);
    assert!(!session.wants_input());
    let took = turn(&mut session);
    assert!((2 * SHORT..LONG / 2).contains(&took), "{took:?}");
    let mut session = Echo::new(Duration::MAX);
    session.handle_connected(now());
    peer.write_all(b"cd").unwrap();
    turn(&mut session);
    waker.wake();
    assert!(!session.wants_input() && turn(&mut session) < LONG / 2);
}

/// A serial port whose driver waits until the last byte has left.
struct Port(Vec<u8>);

impl Transport for Port {
    fn receive(&mut self, buffer: &mut [u8], _: Wait<'_>) -> io::Result<ReceiveOutcome> {
        if self.0.is_empty() {
            return Err(io::ErrorKind::NotConnected.into());
        }
        let length = self.0.len();
        buffer[..length].copy_from_slice(&self.0);
        self.0.clear();
        Ok(ReceiveOutcome::Bytes(length))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.0.extend(bytes);
        Ok(SendOutcome::Transmitted)
    }
}

#[test]
fn a_transport_that_knows_reports_that_a_frame_has_left() {
    let (mut session, mut seen) = (Asker::new(&["one", "two"]), Vec::new());
    drive(&mut session, Port(Vec::new()), until("two", &mut seen)).unwrap();
    assert_eq!(session.statistics(), 2);
    let error = drive(&mut session, Port(Vec::new()), until("never", &mut seen)).unwrap_err();
    assert_eq!(error.kind(), io::ErrorKind::NotConnected);
    assert_eq!(seen.last(), Some(&Event::Disconnected), "an error of the transport ends the connection too");
}

/// A simulated line: a byte arrives each second of its own clock.
struct Line(Duration, Vec<u8>);

impl Transport for Line {
    fn now(&self) -> Duration {
        self.0
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        let second = Duration::from_secs(1);
        let until = wait.limit.map_or(Duration::MAX, |wait| self.0.saturating_add(wait));
        if self.1.is_empty() || self.0 + second > until {
            self.0 = until;
            return Ok(ReceiveOutcome::Nothing);
        }
        (self.0, buffer[0]) = (self.0 + second, self.1.remove(0));
        Ok(ReceiveOutcome::Bytes(1))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.1.extend(bytes);
        Ok(SendOutcome::Buffered)
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        if after.is_zero() { Err(ErrorKind::InvalidInput.into()) } else { Ok(()) }
    }

    fn wait_for_room(&mut self, _: Wait<'_>) -> io::Result<()> {
        self.0 += Duration::from_secs(1);
        Err(ErrorKind::Unsupported.into())
    }
}

#[test]
fn a_borrowed_transport_is_the_transport() {
    let mut line = Line(Duration::ZERO, Vec::new());
    let mut borrowed = &mut line;
    assert_eq!(Transport::send(&mut borrowed, b"a").unwrap(), SendOutcome::Buffered);
    let error = Transport::wait_for_room(&mut borrowed, Wait::default()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    let mut byte = [0];
    assert_eq!(
        Transport::receive(&mut borrowed, &mut byte, Wait::default()).unwrap(),
        ReceiveOutcome::Bytes(1)
    );
    assert_eq!((byte, Transport::now(&borrowed)), ([b'a'], Duration::from_secs(2)));
    assert!(Transport::discard_after(&mut borrowed, Duration::ZERO).is_err());
}

#[test]
fn a_transport_may_have_a_clock_of_its_own() {
    let (mut session, mut seen) = (Asker::new(&["abc", "longer"]), Vec::new());
    session.timeout = Duration::from_secs(6);
    let mut driver = Driver::new(Line(Duration::ZERO, Vec::new()));
    session.handle_connected(driver.transport_mut().now());
    let mut times = Vec::new();
    while seen.last() != Some(&Event::NoAnswer("longer".into())) {
        let before = seen.len();
        let turn = driver.turn(&mut session, None, until("longer", &mut seen)).unwrap();
        assert!(turn.is_continue());
        times.extend(seen[before..].iter().map(|_| driver.transport_mut().now().as_secs()));
    }
    // Reported in the turn in which it arrived: three letters and the line feed.
    assert_eq!(seen, [Event::Connected, answer("abc"), Event::NoAnswer("longer".into())]);
    assert_eq!(times, [1, 4, 10]);
}
