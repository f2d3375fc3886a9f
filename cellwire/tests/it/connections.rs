//! The simulators and clients that flood, fall silent, do not read, are too many, or come back.

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use crate::tool::{DEADLINE, Running, cellwire, limited, run};
use socket2::SockRef;

const MB: u64 = 1 << 20;

/// The request of the ball's host.
const ENQ: u8 = 0x05;

/// Reads one holding register, R[1], of a FANUC controller.
fn read_register(transaction: u16) -> [u8; 12] {
    let [high, low] = transaction.to_be_bytes();
    [high, low, 0, 0, 0, 6, 1, 3, 0x40, 0, 0, 1]
}

/// Asks for a register and takes the reply.
fn exchange(client: &mut TcpStream) -> std::io::Result<()> {
    client.write_all(&read_register(7))?;
    let mut reply = [0; 11];
    client.read_exact(&mut reply)?;
    assert_eq!(reply[..9], [0, 7, 0, 0, 0, 5, 1, 3, 2]);
    Ok(())
}

/// Returns whether the device ends the connection: by a normal end, or by a reset.
fn ends(client: &mut TcpStream) -> bool {
    let mut buffer = [0; 4096];
    loop {
        match client.read(&mut buffer) {
            Ok(0) => return true,
            Ok(_) => {}
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                return false;
            }
            Err(_) => return true,
        }
    }
}

/// Writes without reading until nothing was taken for two seconds; how many bytes were taken.
fn flood(client: &mut TcpStream, bytes: &[u8], most: u64) -> u64 {
    client.set_nonblocking(true).unwrap();
    let (mut taken, mut last) = (0, Instant::now());
    while last.elapsed() < Duration::from_secs(2) && taken < most {
        // A piece that was cut is gone on with, so that requests stay requests.
        let done = usize::try_from(taken % bytes.len() as u64).unwrap();
        match client.write(&bytes[done..]) {
            Ok(length) => (taken, last) = (taken + length as u64, Instant::now()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(Duration::from_millis(10)),
            Err(error) => panic!("after {taken} bytes: {error}"),
        }
    }
    client.set_nonblocking(false).unwrap();
    taken
}

#[test]
fn requests_without_end_are_all_answered_and_stop_nobody() {
    let fanuc = Running::listening("fanuc");
    let mut greedy = fanuc.connect();
    let requests: Vec<u8> = (0..1000).flat_map(read_register).collect();
    let taken = flood(&mut greedy, &requests, 256 * MB);
    assert!(taken < 64 * MB, "it took {taken} bytes and nobody took its replies");
    for _ in 0..100 {
        exchange(&mut fanuc.connect()).unwrap();
    }
    assert!(fanuc.resident() < 64 * MB, "{} bytes", fanuc.resident());
    // A client that reads at last receives the reply to each request, in sequence.
    let whole = taken / 12;
    greedy.shutdown(Shutdown::Write).unwrap();
    let mut replies = BufReader::new(greedy);
    for number in 0..whole {
        let mut reply = [0; 11];
        replies.read_exact(&mut reply).unwrap_or_else(|error| panic!("reply {number} of {whole}: {error}"));
        let transaction = u16::try_from(number % 1000).unwrap().to_be_bytes();
        assert_eq!((&reply[..2], reply[7]), (&transaction[..], 3), "reply {number} of {whole}");
    }
}

#[test]
fn a_client_that_floods_a_serial_device_waits_and_takes_no_memory() {
    for device in ["ball", "puma", "laser", "viewer"] {
        // A poll of the ball, a reply to the robot's start, the head of a frame that never ends, a line that never ends.
        let bytes: &[u8] = match device {
            "ball" => &[ENQ; 256],
            "puma" => &[0x10, 0x10, 0x02, 0x20, 0x10, 0x03, 0x20],
            "laser" => &[0xEB, 0x90, 0x82, 0xF0, 0xF1],
            _ => b"$POSE,7,",
        };
        let simulator = Running::listening(device);
        let taken = flood(&mut simulator.connect(), bytes, 256 * MB);
        assert!(taken < 64 * MB, "{device} took {taken} bytes");
        assert!(simulator.resident() < 64 * MB, "{device} needs {} bytes", simulator.resident());
    }
}

/// Discards bytes for the previous client, as at a serial port.
fn open(client: &mut TcpStream) {
    client.set_nonblocking(true).unwrap();
    let mut buffer = [0; 256];
    for _ in 0..50 {
        thread::sleep(Duration::from_millis(10));
        let _discarded = client.read(&mut buffer);
    }
    client.set_nonblocking(false).unwrap();
}

/// At 9600 baud 200 kB take four minutes, and what the system holds may take an hour.
#[test]
fn what_a_client_has_sent_that_has_left_is_dropped_and_the_next_one_is_served() {
    thread::scope(|scope| {
        for (device, noise, request, reply) in [
            ("ball", &[ENQ][..], &[ENQ][..], &[0x08, 0xF8, 0x5D][..]),
            ("puma", b"noise", b"", &[0x10, 0x10]),
            (
                "laser",
                b"noise",
                &[0xEB, 0x90, 0x82, 0xF0, 0xF1, 1, 1, 3, 0x90, 0x82, 0xF6],
                &[0xEB, 0x90, 0x82, 0xF0],
            ),
        ] {
            scope.spawn(move || {
                let mut simulator = Running::listening(device);
                for (most, resets) in [(3 * MB, true), (50_000, false)] {
                    let mut client = simulator.connect();
                    let taken = flood(&mut client, noise, most);
                    assert!(taken >= 50_000, "{device} took {taken} bytes");
                    SockRef::from(&client).set_linger(resets.then_some(Duration::ZERO)).unwrap();
                    drop(client);
                    let left = Instant::now();
                    simulator.line("it has left, and its data takes longer than 5 s");
                    let mut next = simulator.connect();
                    open(&mut next);
                    next.write_all(request).unwrap();
                    let mut found = vec![0; reply.len()];
                    next.read_exact(&mut found).unwrap();
                    assert_eq!(found, reply, "{device}");
                    assert!(left.elapsed() < Duration::from_secs(20), "{device}: {:?}", left.elapsed());
                }
            });
        }
    });
}

/// The system's buffers hide that a client has closed the connection: at 115200 baud for minutes.
#[test]
fn a_flood_and_a_normal_close_do_not_keep_the_next_client_out() {
    thread::scope(|scope| {
        for (device, request) in
            [("ball", &[ENQ][..]), ("laser", &[0xEB, 0x90, 0x82, 0xF0, 0xF1, 1, 1, 3, 0x90, 0x82, 0xF6])]
        {
            scope.spawn(move || {
                let simulator = Running::listening(&format!("{device} --set baud=115200"));
                let mut client = simulator.connect();
                let taken = flood(&mut client, &[b'0'; 65536], 16 * MB);
                assert!(taken > MB, "{device} took {taken} bytes");
                drop(client);
                let left = Instant::now();
                let is_served = || {
                    let mut next = simulator.connect();
                    next.set_read_timeout(Some(Duration::from_secs(1))).unwrap();
                    next.write_all(request).is_ok() && next.read(&mut [0; 64]).is_ok_and(|length| length > 0)
                };
                while !is_served() {
                    assert!(left.elapsed() < Duration::from_secs(20), "{device} serves nobody");
                }
            });
        }
    });
}

/// A robot that listens has one PC: the newest, whatever the earlier ones do.
#[test]
fn a_robot_that_listens_serves_the_newest_pc_at_once() {
    let mut robot = Running::listening("kawasaki-robot");
    let is_served = |robot: &mut Running, pc: &TcpStream| {
        let begin = Instant::now();
        robot.line(&format!("\"peer\":\"{}\"", pc.local_addr().unwrap()));
        assert!(begin.elapsed() < Duration::from_secs(3), "after {:?}", begin.elapsed());
    };
    let first = robot.connect();
    is_served(&mut robot, &first);
    // One that is silent, and several that are gone already.
    let second = robot.connect();
    is_served(&mut robot, &second);
    for _ in 0..20 {
        SockRef::from(&robot.connect()).set_linger(Some(Duration::ZERO)).unwrap();
    }
    let last = robot.connect();
    is_served(&mut robot, &last);
}

/// A client that leaves at once has sent what it has sent, and one that comes at once is not refused.
#[test]
fn a_frame_of_a_client_that_has_left_is_executed() {
    let mut laser = Running::listening("laser");
    for reset in [false, true] {
        let mut client = laser.connect();
        client.write_all(&[0xEB, 0x90, 0x82, 0xF0, 0xF1, 1, 1, 1, 0x90, 0x82, 0xF4]).unwrap();
        if reset {
            SockRef::from(&client).set_linger(Some(Duration::ZERO)).unwrap();
        }
        drop(client);
        let mut next = laser.connect();
        laser.line(r#""event":"queued""#);
        open(&mut next);
        next.write_all(&[0xEB, 0x90, 0x82, 0xF0, 0xF1, 1, 1, 3, 0x90, 0x82, 0xF6]).unwrap();
        let mut reply = [0; 8];
        next.read_exact(&mut reply).unwrap();
        assert_eq!(reply, [0xEB, 0x90, 0x82, 0xF0, 0xF1, 1, 1, 3], "the status");
    }
}

#[test]
fn a_second_client_of_a_serial_device_is_refused_and_the_first_is_served() {
    let mut ball = Running::listening("ball --set baud=115200");
    let mut first = ball.connect();
    let poll = |first: &mut TcpStream| {
        first.write_all(&[ENQ]).unwrap();
        let mut reply = [0; 12];
        first.read_exact(&mut reply).unwrap();
        assert_eq!(reply[..3], [0x08, 0xF8, 0x5D]);
    };
    poll(&mut first);
    for _ in 0..3 {
        assert!(ends(&mut ball.connect()), "the second client waits");
        ball.line("refused the client");
        poll(&mut first);
    }
    // One that comes in the moment in which the first one leaves is served.
    let mut next = ball.connect();
    thread::sleep(Duration::from_millis(20));
    drop(first);
    poll(&mut next);
    drop(next);
    ball.line("disconnected");
    poll(&mut ball.connect());
}

#[test]
fn a_silent_client_is_disconnected_after_the_set_time_and_others_stay() {
    let fanuc = Running::listening("fanuc --idle-timeout 5s");
    let (mut silent, mut busy) = (fanuc.connect(), fanuc.connect());
    exchange(&mut silent).unwrap();
    let waiting = thread::spawn(move || ends(&mut silent));
    let begin = Instant::now();
    while !waiting.is_finished() {
        exchange(&mut busy).expect("a client that asks ten times a second is not silent");
        thread::sleep(Duration::from_millis(100));
    }
    assert!(waiting.join().unwrap(), "the silent client stays");
    assert!(begin.elapsed() > Duration::from_secs(3), "{:?}", begin.elapsed());

    let never = Running::listening("fanuc --idle-timeout never");
    let mut silent = never.connect();
    for device in ["ball", "mma-robot"] {
        let mut simulator = Running::listening(&format!("{device} --idle-timeout 500ms"));
        assert!(ends(&mut simulator.connect()), "{device} keeps a silent client");
        simulator.line("--idle-timeout");
    }
    exchange(&mut silent).unwrap();
}

#[test]
fn a_client_that_does_not_read_is_stuck_and_disconnected() {
    let mut fanuc = Running::listening("fanuc --idle-timeout 1s");
    let mut stuck = fanuc.connect();
    let requests: Vec<u8> = (0..1000).flat_map(read_register).collect();
    stuck.set_write_timeout(Some(Duration::from_secs(1))).unwrap();
    while stuck.write_all(&requests).is_ok() {}
    fanuc.line("takes nothing for 1 s");
}

#[test]
fn without_a_descriptor_new_clients_are_refused_and_old_ones_stay() {
    for device in ["fanuc", "mma-robot", "ball", "kawasaki-pc"] {
        let arguments = format!("simulate {device} --listen 127.0.0.1:0 --idle-timeout never");
        let mut simulator = Running::start(limited("-n 24", &arguments));
        let mut first = simulator.connect();
        if device == "fanuc" {
            exchange(&mut first).unwrap();
        }
        let mut others: Vec<TcpStream> = (0..40).map(|_| simulator.connect()).collect();
        if device == "fanuc" {
            simulator.line("too many open files");
            exchange(&mut first).unwrap();
            let refused = others.last_mut().unwrap();
            assert!(ends(refused), "the last client waits");
        }
        drop((first, others));
        // The simulator is there, and serves the next one that there is room for.
        let end = Instant::now() + DEADLINE;
        loop {
            let mut next = simulator.connect();
            next.set_read_timeout(Some(Duration::from_secs(1))).unwrap();
            let served = match device {
                "fanuc" => exchange(&mut next).is_ok(),
                "mma-robot" => next.write_all(b"STP\r\n").and_then(|()| next.read_exact(&mut [0; 4])).is_ok(),
                "ball" => next.write_all(&[ENQ]).and_then(|()| next.read_exact(&mut [0; 12])).is_ok(),
                _ => greet(&mut next).is_ok(),
            };
            if served {
                break;
            }
            assert!(Instant::now() < end, "{device} serves nobody any more");
        }
    }
}

#[test]
fn a_robot_that_does_not_read_does_not_stop_the_pc() {
    let mut pc = Running::listening("kawasaki-pc");
    let mut deaf = pc.connect();
    greet(&mut deaf).unwrap();
    // It accepts the order, requests its first jobs again and again, and has no free slots for them.
    SockRef::from(&deaf).set_recv_buffer_size(4096).unwrap();
    deaf.write_all(b"<TilausKuittaus$2#50#><Tila$7#50$2$$$#>").unwrap();
    let end = Instant::now() + DEADLINE;
    while Instant::now() < end && deaf.write_all(b"<TyoPyynto$4#50$1#>").is_ok() {
        thread::sleep(Duration::from_millis(5));
    }
    greet(&mut pc.connect()).expect("the PC hangs");
    pc.line("does not read");
    assert!(pc.resident() < 64 * MB, "{} bytes", pc.resident());
}

/// Plays a robot that reports that it has no order; the PC begins one.
fn greet(robot: &mut TcpStream) -> std::io::Result<()> {
    robot.write_all(b"<Tila$6#0$0$$$#>")?;
    let mut answer = [0; 5];
    robot.read_exact(&mut answer)?;
    assert_eq!(answer, *b"<Tila");
    Ok(())
}

#[test]
fn a_robot_finds_its_pc_again() {
    let free = || TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let address = free();
    let mut robot = Running::start(cellwire(&format!("simulate kawasaki-robot --connect {address}")));
    robot.line("\"disconnected\"");
    for _ in 0..2 {
        let mut pc = Running::start(cellwire(&format!("simulate kawasaki-pc --listen {address}")));
        robot.line("\"connected\"");
        robot.line("order_started");
        pc.signal("-KILL");
        robot.line("\"disconnected\"");
    }
}

#[test]
fn a_device_listens_on_loopback_unless_told() {
    let mut alone = Running::start(cellwire("simulate fanuc --listen 0"));
    assert!(alone.address().starts_with("127.0.0.1:"), "{}", alone.address());
    exchange(&mut alone.connect()).unwrap();
    assert_eq!(alone.signal("-TERM"), Some(130));
    let mut open = Running::start(cellwire("simulate fanuc --listen 0.0.0.0:0"));
    assert!(open.address().starts_with("0.0.0.0:"), "{}", open.address());
    open.line("is open to the network without authentication");
    let (code, _, said) = run(cellwire("simulate fanuc --listen 127.0.0.1"));
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("give an address and a port from 0 to 65535, such as 127.0.0.1:9105"), "{said}");
}

#[test]
fn a_new_central_controller_takes_the_place_of_one_that_does_not_read() {
    let robot = Running::listening("mma-robot");
    let mut deaf = robot.connect();
    deaf.set_write_timeout(Some(Duration::from_secs(2))).unwrap();
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(20) && deaf.write_all(&b"STP\r\n".repeat(1000)).is_ok() {}
    assert!(robot.resident() < 64 * MB, "{} bytes", robot.resident());
    let mut next = robot.connect();
    next.write_all(b"STP\r\n").unwrap();
    let mut reply = String::new();
    BufReader::new(next).read_line(&mut reply).unwrap();
    assert_eq!(reply, "OK\r\n");
}

#[test]
fn simulators_print_what_their_clients_do_and_nothing_of_it_with_quiet() {
    for (arguments, is_quiet) in [("fanuc", false), ("fanuc --quiet", true)] {
        let mut fanuc = Running::listening(arguments);
        let mut client = fanuc.connect();
        let peer = client.local_addr().unwrap();
        for (request, reply) in [
            (&[0, 1, 0, 0, 0, 6, 1, 3, 0, 10, 0, 2][..], 13),
            (&[0, 2, 0, 0, 0, 11, 1, 16, 0, 200, 0, 2, 4, 0, 7, 0, 8], 12),
            (&[0, 3, 0, 0, 0, 6, 1, 5, 0, 7, 0xFF, 0], 12),
            (&[0, 4, 0, 0, 0, 6, 1, 3, 0xFF, 0, 0, 1], 9),
            (&[0, 5, 0, 0, 0, 2, 1, 7], 9),
        ] {
            client.write_all(request).unwrap();
            client.read_exact(&mut vec![0; reply]).unwrap();
        }
        assert_eq!(fanuc.signal("-TERM"), Some(130));
        let expected = [
            format!(r#"{{"event":"connected","peer":"{peer}"}}"#),
            format!(
                r#"{{"event":"read","peer":"{peer}","table":"holding_registers","address":10,"count":2}}"#
            ),
            format!(
                r#"{{"event":"write","peer":"{peer}","table":"holding_registers","address":200,"values":[7,8]}}"#
            ),
            format!(r#"{{"event":"write","peer":"{peer}","table":"coils","address":7,"values":[true]}}"#),
            format!(
                r#"{{"event":"refused","peer":"{peer}","unit":1,"function":3,"table":"holding_registers","address":65280,"count":1,"exception":2,"why":"exception 2 (illegal data address): the table ends at 16447"}}"#
            ),
            format!(
                r#"{{"event":"refused","peer":"{peer}","unit":1,"function":7,"exception":1,"why":"exception 1 (illegal function)"}}"#
            ),
        ];
        assert_eq!(fanuc.rest(), if is_quiet { &[][..] } else { &expected });
    }
    let mut ball = Running::listening("ball");
    let mut client = ball.connect();
    client.write_all(&[ENQ]).unwrap();
    client.read_exact(&mut [0; 12]).unwrap();
    assert!(ball.line(r#""event":"reply""#).contains(r#""force":["#));
}
