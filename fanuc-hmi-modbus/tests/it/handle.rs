//! The client in a task of its own, over real sockets.

#![allow(clippy::cast_possible_truncation)]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::future::{Future, poll_fn};
use core::net::SocketAddr;
use core::pin::pin;
use core::task::Poll;
use core::time::Duration;
use std::io;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use crate::common::Bank;
use fanuc_hmi_modbus::robot_session::Session as _;
use fanuc_hmi_modbus::robot_session::tokio::{Dial, GIVE_UP_AFTER, Link, Reconnect, Tcp, serve};
use fanuc_hmi_modbus::tokio::{Client, Error, Event, client};
use fanuc_hmi_modbus::{
    ClientConfig, DecodeError, Exception, Failure, PositionRegister, Registers, Request, Server,
    ServerConfig, SessionError, TelemetryBlock, WordOrder, Words,
};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

const LONG: Duration = Duration::from_secs(20);
const ANY: SocketAddr = SocketAddr::new(core::net::IpAddr::V4(core::net::Ipv4Addr::LOCALHOST), 0);
const MS: Duration = Duration::from_millis(1);

/// Serves every connection with its own registers.
async fn server(address: SocketAddr) -> (SocketAddr, impl Future<Output = io::Result<()>>) {
    let listener = TcpListener::bind(address).await.unwrap();
    let address = listener.local_addr().unwrap();
    let session = |_| Server::<_>::new(ServerConfig::tcp(), Bank::new()).unwrap();
    (address, serve(listener, 8, session, |_, _, _| {}))
}

fn to(address: SocketAddr, config: ClientConfig) -> Client {
    let (client, task) = client(config, Tcp::new(address.to_string())).unwrap();
    let reconnect = Reconnect { first: 5 * MS, longest: 50 * MS };
    tokio::spawn(task.reconnect(reconnect).run());
    client
}

#[tokio::test]
async fn every_call_has_its_reply() {
    let (address, serving) = server(ANY).await;
    tokio::spawn(serving);
    let robot = to(address, ClientConfig::tcp());
    robot.write_registers(10, &[1, 2, 3]).await.unwrap();
    robot.write_register(13, 4).await.unwrap();
    robot.mask_write_register(13, 0xFFF0, 5).await.unwrap();
    assert_eq!(robot.read_holding_registers(10..14).await.unwrap(), [1, 2, 3, 5]);
    assert_eq!(robot.read_input_registers(10..12).await.unwrap(), [!1, !2]);
    robot.write_coils(0, &[true, false, true]).await.unwrap();
    robot.write_coil(3, false).await.unwrap();
    assert_eq!(robot.read_coils(0..4).await.unwrap(), [true, false, true, false]);
    assert_eq!(robot.read_discrete_inputs(0..2).await.unwrap(), [false, true]);
    assert_eq!(robot.read_write_registers(20..22, 20, &[8, 9]).await.unwrap(), [8, 9]);
    let block = TelemetryBlock { life_counter: 70_000, override_percent: 30, ..TelemetryBlock::default() };
    robot.write_registers(0, &block.to_registers(WordOrder::LowFirst)).await.unwrap();
    assert_eq!(robot.read_telemetry(0, WordOrder::LowFirst).await.unwrap(), block);
    let position = PositionRegister { user_frame: 3, user_tool: 4, ..PositionRegister::default() };
    robot.write_position(50, &position, WordOrder::HighFirst).await.unwrap();
    assert_eq!(robot.read_position(50, WordOrder::HighFirst).await.unwrap(), position);

    robot.write_registers(40, &[1, 2, 3, 4]).await.unwrap();
    let many = robot.read_many(&[40..42, 43..44, 60..62], 1).await.unwrap();
    assert_eq!((&many[0].registers[..], &many[1].registers[..]), (&[1, 2][..], &[4][..]));
    assert_eq!((many[0].at, many[2].registers.len()), (many[1].at, 2));
    assert!(many[2].at > many[0].at);
    assert!(robot.read_many(&[40..42, 98..102], 0).await.is_err());

    let refused = robot.read_holding_registers(99..101).await;
    assert!(matches!(refused, Err(Error::Exception(Exception::IllegalDataAddress))), "{refused:?}");
    let wrong = robot.read_holding_registers(0..126).await;
    assert!(matches!(wrong, Err(Error::Request(SessionError::Encode(_)))), "{wrong:?}");
    let last = robot.read_holding_registers(65_530..=u16::MAX).await;
    assert!(matches!(last, Err(Error::Exception(Exception::IllegalDataAddress))), "{last:?}");
    let two = robot.read_input_registers(10..12).await.unwrap();
    assert_eq!(robot.read_input_registers(10..=11).await.unwrap(), two);
    let all = robot.read_coils(..).await;
    assert!(matches!(all, Err(Error::Request(SessionError::Encode(_)))), "{all:?}");
    let backwards = robot.read_holding_registers(core::ops::Range { start: 2, end: 1 }).await;
    assert!(matches!(backwards, Err(Error::Request(SessionError::Encode(_)))), "{backwards:?}");
}

/// More callers than requests in flight, more of those than a server has places.
#[tokio::test]
async fn a_hundred_callers_at_once_are_all_answered() {
    let (address, serving) = server(ANY).await;
    tokio::spawn(serving);
    let robot = to(address, ClientConfig { in_flight: 16, ..ClientConfig::tcp() });
    let mut callers = JoinSet::new();
    for caller in 0..100u16 {
        let robot = robot.clone();
        callers.spawn(async move {
            for round in 0..20 {
                robot.write_register(caller % 100, round).await.unwrap();
                assert_eq!(robot.read_holding_registers(caller..caller + 1).await.unwrap(), [round]);
            }
        });
    }
    timeout(LONG, callers.join_all()).await.unwrap();
}

#[tokio::test]
async fn a_server_that_goes_and_comes_is_found_again() {
    let (address, serving) = server(ANY).await;
    let serving = tokio::spawn(serving);
    let robot = to(address, ClientConfig::tcp());
    robot.write_register(0, 1).await.unwrap();
    for _ in 0..5 {
        serving.abort();
        let mut link = robot.handle().link();
        timeout(LONG, link.wait_for(|link| matches!(link, Link::Failed(_)))).await.unwrap().unwrap();
        let error = robot.write_register(0, 2).await.unwrap_err();
        assert!(matches!(error, Error::NotConnected(_)), "{error:?}");
    }
    tokio::spawn(server(address).await.1);
    timeout(LONG, robot.handle().connected()).await.unwrap().unwrap();
    robot.write_register(0, 3).await.unwrap();
    assert_eq!(robot.read_holding_registers(0..1).await.unwrap(), [3]);
}

/// A future that is dropped wherever it waits: the request was not made, or its outcome is an event.
#[tokio::test]
async fn no_outcome_of_a_dropped_call_is_lost() {
    let listener = TcpListener::bind(ANY).await.unwrap();
    let address = listener.local_addr().unwrap();
    let written = Written::default();
    let registers = written.clone();
    let session = move |_| Server::<_>::new(ServerConfig::tcp(), registers.clone()).unwrap();
    tokio::spawn(serve(listener, 8, session, |_, _, _| {}));
    let robot = to(address, ClientConfig::tcp());
    let mut events = robot.handle().events();
    let (mut outcomes, mut dropped) = (Vec::new(), 0);
    for round in 0..3000u16 {
        let outcome = {
            let mut call = pin!(robot.write_register(0, round));
            let mut polls = 0;
            poll_fn(|context| match call.as_mut().poll(context) {
                Poll::Ready(outcome) => Poll::Ready(Some(outcome)),
                Poll::Pending if polls == round % 3 => Poll::Ready(None),
                Poll::Pending => {
                    polls += 1;
                    context.waker().wake_by_ref();
                    Poll::Pending
                }
            })
            .await
        };
        match outcome {
            Some(outcome) => outcomes.push(outcome.map(|()| round).unwrap()),
            None => dropped += 1,
        }
        if round % 5 == 0 {
            sleep(MS / 5).await;
        }
        // After this request nothing is in flight.
        let _ = robot.read_coils(0..1).await;
        while let Ok(event) = events.try_recv() {
            let Event::Abandoned(call) = event else { panic!("{event:?}") };
            call.outcome.unwrap();
            let request = call.request.request();
            let Ok(Request::WriteRegister { value, .. }) = request else { panic!("{request:?}") };
            outcomes.push(value);
        }
    }
    assert!(dropped > 500 && outcomes.len() < 3000, "{dropped}");
    outcomes.sort_unstable();
    assert_eq!(outcomes, *written.0.lock().unwrap());
}

/// The written values of all connections.
#[derive(Clone, Default)]
struct Written(Arc<Mutex<Vec<u16>>>);

impl Registers for Written {
    fn write_registers(&mut self, _: u16, values: Words<'_>) -> Result<(), Exception> {
        self.0.lock().unwrap().extend(values.iter());
        Ok(())
    }
}

#[tokio::test]
async fn a_shutdown_ends_what_is_in_flight_and_what_waits() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let robot = to(address, ClientConfig::tcp());
    let (silent, _) = listener.accept().await.unwrap();
    let mut calls = JoinSet::new();
    for _ in 0..3 {
        let robot = robot.clone();
        calls.spawn(async move { robot.read_coils(0..1).await.unwrap_err() });
    }
    sleep(50 * MS).await;
    timeout(LONG, robot.handle().shutdown()).await.unwrap();
    let mut ends = [0; 2];
    while let Some(Ok(error)) = calls.join_next().await {
        assert_eq!(error.is_unknown(), !matches!(error, Error::NotConnected(_)), "{error:?}");
        match error {
            Error::Failed(Failure::Disconnected) => ends[0] += 1,
            Error::NotConnected(_) | Error::Closed(_) => ends[1] += 1,
            error => panic!("{error:?}"),
        }
    }
    assert_eq!(ends, [1, 2]);
    assert!(matches!(robot.read_coils(0..1).await, Err(Error::Closed(_))));
    drop(silent);
}

/// A server that is out of step is unusable on this connection; on the next one it is usable.
#[tokio::test]
async fn a_server_out_of_step_is_connected_again() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let server = tokio::spawn(async move {
        let (mut first, _) = listener.accept().await.unwrap();
        first.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n").await.unwrap();
        let session = |_| Server::<_>::new(ServerConfig::tcp(), Bank::new()).unwrap();
        serve(listener, 8, session, |_, _, _| {}).await.unwrap();
    });
    let robot = to(address, ClientConfig { timeout: 100 * MS, ..ClientConfig::tcp() });
    let begun = Instant::now();
    while robot.read_coils(0..1).await.is_err() {
        assert!(begun.elapsed() < LONG);
    }
    server.abort();
}

/// After a part of a reply the meaning of the next bytes is unknown. A server that is only late is not affected.
#[tokio::test]
async fn a_server_that_cuts_a_reply_off_is_connected_again_and_a_silent_one_is_not() {
    async fn reply(stream: &mut TcpStream) -> [u8; 10] {
        let mut request = [0; 12];
        stream.read_exact(&mut request).await.unwrap();
        [request[0], request[1], 0, 0, 0, 4, 1, 1, 1, 1]
    }
    let listener = TcpListener::bind(ANY).await.unwrap();
    let robot = to(listener.local_addr().unwrap(), ClientConfig { timeout: 100 * MS, ..ClientConfig::tcp() });
    let server = async {
        let mut first = listener.accept().await.unwrap().0;
        reply(&mut first).await;
        let whole = reply(&mut first).await;
        first.write_all(&whole).await.unwrap();
        let whole = reply(&mut first).await;
        first.write_all(&whole[..9]).await.unwrap();
        let mut second = listener.accept().await.unwrap().0;
        let whole = reply(&mut second).await;
        second.write_all(&whole).await.unwrap();
        (first, second)
    };
    let ask = async {
        for is_answered in [false, true, false, true] {
            match robot.read_coils(0..1).await {
                Ok(bits) => assert!(is_answered && bits == [true]),
                Err(Error::Failed(Failure::TimedOut)) => assert!(!is_answered),
                Err(error) => panic!("{error:?}"),
            }
        }
    };
    timeout(LONG, async { tokio::join!(server, ask) }).await.unwrap();
}

/// On a serial line the silence ends it.
#[tokio::test]
async fn a_serial_line_goes_on_behind_a_reply_that_was_cut_off() {
    const REPLY: [u8; 6] = [1, 1, 1, 1, 0x90, 0x48];
    let listener = TcpListener::bind(ANY).await.unwrap();
    let config = ClientConfig { timeout: 100 * MS, ..ClientConfig::rtu_over_tcp() };
    let robot = to(listener.local_addr().unwrap(), config);
    let server = async {
        let mut only = listener.accept().await.unwrap().0;
        for reply in [&REPLY[..3], &REPLY] {
            only.read_exact(&mut [0; 8]).await.unwrap();
            only.write_all(reply).await.unwrap();
        }
        only
    };
    let ask = async {
        let cut = robot.read_coils(0..1).await;
        assert!(matches!(cut, Err(Error::Failed(Failure::TimedOut))), "{cut:?}");
        assert_eq!(robot.read_coils(0..1).await.unwrap(), [true]);
    };
    timeout(LONG, async { tokio::join!(server, ask) }).await.unwrap();
}

#[tokio::test]
async fn a_broadcast_has_no_reply_and_goes_to_every_unit() {
    let listener = TcpListener::bind(ANY).await.unwrap();
    let written = Written::default();
    let config = ClientConfig { settle: Duration::ZERO, turnaround: MS, ..ClientConfig::rtu_over_tcp() };
    let robot = to(listener.local_addr().unwrap(), config);
    let registers = written.clone();
    let session = move |_| Server::<_>::new(ServerConfig::rtu_over_tcp(7), registers.clone()).unwrap();
    tokio::spawn(serve(listener, 8, session, |_, _, _| {}));
    for (unit, value) in [(0, 5), (7, 6)] {
        timeout(LONG, robot.unit(unit).write_register(0, value)).await.unwrap().unwrap();
    }
    assert_eq!(*written.0.lock().unwrap(), [5, 6]);
}

/// Without a runtime of the caller, and with a connection that is not one of this crate's sockets.
#[test]
fn a_thread_serves_callers_that_have_no_runtime() {
    let (reachable, arrived) = std::sync::mpsc::channel();
    let serving = std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let (address, serving) = server(ANY).await;
            reachable.send(address).unwrap();
            let _ = timeout(LONG, serving).await;
        });
    });
    let address = arrived.recv().unwrap();
    let dial = Dial(move || TcpStream::connect(address));
    let (robot, task) = client(ClientConfig::tcp(), dial).unwrap();
    let thread = task.thread().unwrap();
    let block_on = tokio::runtime::Builder::new_current_thread().build().unwrap();
    block_on.block_on(async {
        robot.write_register(0, 7).await.unwrap();
        let reply = robot.request(&Request::ReadHoldingRegisters { address: 0, quantity: 1 }).await.unwrap();
        assert_eq!(reply.as_bytes(), [3, 2, 0, 7]);
    });
    drop(robot);
    assert_eq!(thread.join().unwrap().statistics().requests, 2);
    drop(serving);
}

/// The behaviour of a peer on a connection.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Peer {
    Closes,
    Silent,
    /// No attempt to connect ends.
    Absent,
}

/// More callers than requests in flight, and than calls that wait in the channel.
#[tokio::test(start_paused = true)]
async fn every_request_ends_whatever_the_server_does() {
    const HOUR: Duration = Duration::from_secs(3600);
    for peer in [Peer::Closes, Peer::Silent, Peer::Absent] {
        for config in [ClientConfig::tcp(), ClientConfig::rtu_over_tcp()] {
            let mut open = Vec::new();
            let dial = Dial(move || {
                let (near, far) = tokio::io::duplex(4096);
                if peer != Peer::Closes {
                    open.push(far);
                }
                async move {
                    if peer == Peer::Absent {
                        core::future::pending::<()>().await;
                    }
                    Ok(near)
                }
            });
            let (robot, task) = client(config, dial).unwrap();
            tokio::spawn(task.run());
            let mut callers = JoinSet::new();
            for _ in 0..40 {
                let robot = robot.clone();
                callers.spawn(async move { robot.read_coils(0..1).await.unwrap_err() });
            }
            let begun = tokio::time::Instant::now();
            let errors = timeout(HOUR, callers.join_all()).await.expect("outcomes");
            let not_connected = errors.iter().filter(|error| matches!(error, Error::NotConnected(_))).count();
            match peer {
                Peer::Absent => assert_eq!(not_connected, 40),
                Peer::Silent => assert_eq!(not_connected, 0),
                Peer::Closes => {}
            }
            // A silent server costs each request its time, one after the other.
            let each = config.timeout + config.settle;
            let most = if peer == Peer::Silent { 40 * each + LONG } else { GIVE_UP_AFTER + LONG };
            assert!(begun.elapsed() < most, "{peer:?}: {:?}", begun.elapsed());
            let begun = tokio::time::Instant::now();
            timeout(HOUR, robot.handle().shutdown_after(HOUR)).await.unwrap();
            assert!(begun.elapsed() < MS);
        }
    }
}

/// Answers the requests of one connection after the other.
async fn answering(answer: impl Fn(&[u8]) -> Vec<u8> + Send + 'static) -> SocketAddr {
    let listener = TcpListener::bind(ANY).await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move {
        while let Ok((mut stream, _)) = listener.accept().await {
            let mut request = [0; 12];
            while stream.read_exact(&mut request).await.is_ok() {
                stream.write_all(&answer(&request)).await.unwrap();
            }
        }
    });
    address
}

#[tokio::test]
async fn an_exception_with_a_wrong_length_harms_neither_the_connection_nor_the_next_call() {
    let address = answering(|request| match request[9] {
        1 => vec![request[0], request[1], 0, 0, 0, 5, 1, 3, 2, 0, 7],
        rest => {
            [&[request[0], request[1], 0, 0, 0, 4, 1, 0x83, 2][..], &vec![0; usize::from(rest == 2)]].concat()
        }
    })
    .await;
    let robot = to(address, ClientConfig { timeout: LONG, ..ClientConfig::tcp() });
    timeout(LONG, robot.handle().connected()).await.unwrap().unwrap();
    let (mut link, mut events) = (robot.handle().link(), robot.handle().events());
    link.mark_unchanged();
    for address in [0, 1, 2, 1, 0, 0, 1] {
        let outcome = robot.read_holding_registers(address..=address).await;
        if address == 1 {
            assert_eq!(outcome.unwrap(), [7]);
            continue;
        }
        let Err(error @ Error::Failed(failure)) = outcome else { panic!("{outcome:?}") };
        assert_eq!((failure.exception(), error.is_unknown()), (Some(Exception::IllegalDataAddress), false));
        assert!(error.to_string().contains("length field"), "{error}");
    }
    assert!(!link.has_changed().unwrap(), "one connection");
    assert!(events.try_recv().is_err(), "no notice");
}

#[tokio::test]
async fn a_notice_names_the_transaction_that_was_expected() {
    let address = answering(|_| vec![0, 7, 0, 0, 0, 5, 1, 3, 2, 0, 7]).await;
    let robot = to(address, ClientConfig { timeout: 200 * MS, ..ClientConfig::tcp() });
    let mut events = robot.handle().events();
    let error = robot.read_holding_registers(0..1).await.unwrap_err();
    assert!(matches!(error, Error::Failed(Failure::TimedOut)), "{error:?}");
    let Ok(Event::Notice(notice)) = events.try_recv() else { panic!("no notice") };
    assert_eq!(notice.to_string(), "a reply with transaction 7, expected 1 (unit 1, function 3)");
}

/// A server that loses everything in the first 200 ms of each connection.
#[tokio::test]
async fn the_first_request_is_sent_after_the_pause_of_a_connection() {
    let listener = TcpListener::bind(ANY).await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move {
        while let Ok((mut stream, _)) = listener.accept().await {
            sleep(200 * MS).await;
            let mut request = [0; 12];
            while stream.try_read(&mut request).is_ok_and(|length| length > 0) {}
            tokio::spawn(async move {
                while stream.read_exact(&mut request).await.is_ok() {
                    let reply = [request[0], request[1], 0, 0, 0, 5, 1, 3, 2, 0, 7];
                    stream.write_all(&reply).await.unwrap();
                }
            });
        }
    });
    let config = ClientConfig { timeout: 1000 * MS, ..ClientConfig::tcp() };
    for (pause, is_answered) in [(Duration::ZERO, false), (400 * MS, true)] {
        let (robot, task) = client(config, Tcp::new(address.to_string())).unwrap();
        tokio::spawn(task.connect_pause(pause).run());
        assert_eq!(robot.read_holding_registers(0..1).await.is_ok(), is_answered, "{pause:?}");
    }
}

/// The header of a reply counts fewer bytes than the server sends: the next call has a connection of its own, and its reply.
#[tokio::test]
async fn a_reply_that_is_longer_than_its_header_says_does_not_harm_the_next_call() {
    let address = answering(|request| match request[9] {
        1 => vec![request[0], request[1], 0, 0, 0, 5, 1, 3, 2, 0, 7],
        _ => vec![request[0], request[1], 0, 0, 0, 5, 1, 3, 4, 0, 7, 0, 8],
    })
    .await;
    let robot = to(address, ClientConfig { timeout: LONG, ..ClientConfig::tcp() });
    for _ in 0..3 {
        let error = robot.read_holding_registers(0..2).await.unwrap_err();
        let expected = DecodeError::PduLength { function: 3, expected: 6, found: 4 };
        assert!(matches!(error, Error::Failed(Failure::Malformed(found)) if found == expected), "{error:?}");
        assert_eq!(robot.read_holding_registers(1..2).await.unwrap(), [7]);
    }
}
