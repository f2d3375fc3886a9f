//! How much later a byte arrives for passing through a tap: measured on a quiet machine, `-- --ignored --nocapture`.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use crate::tool::{DEADLINE, Running, cellwire};
use cellwire_io::serial;
use serialport::SerialPort;

const ROUNDS: usize = 10_000;

/// Returns the median and the 99th percentile of half the round-trip time of a byte.
fn exchange(client: &mut (impl Read + Write), rounds: usize, end: impl FnOnce()) -> [Duration; 2] {
    let times = (0..rounds).map(|_| {
        let begin = Instant::now();
        client.write_all(&[7]).unwrap();
        client.read_exact(&mut [0]).unwrap();
        begin.elapsed() / 2
    });
    let mut times: Vec<Duration> = times.collect();
    end();
    times.sort_unstable();
    [rounds / 2, rounds * 99 / 100].map(|at| times[at])
}

fn echo(mut end: impl Read + Write + Send + 'static) -> thread::JoinHandle<()> {
    thread::spawn(move || {
        let mut byte = [0];
        while end.read_exact(&mut byte).is_ok() && end.write_all(&byte).is_ok() {}
    })
}

fn added(through: [Duration; 2], direct: [Duration; 2]) -> [Duration; 2] {
    let added = [0, 1].map(|at| through[at].saturating_sub(direct[at]));
    println!("each way, median and 99 %: {added:?} more than {direct:?}");
    added
}

#[test]
#[ignore = "measures a delay, which a busy machine makes longer"]
fn the_delay_is_small() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap();
    let tap = Running::start(cellwire(&format!(
        "tap laser-eb90 --listen 127.0.0.1:0 --connect {address} --no-capture"
    )));
    let [direct, through] = [TcpStream::connect(address).unwrap(), tap.connect()].map(|mut client| {
        let end = server.accept().unwrap().0;
        client.set_nodelay(true).unwrap();
        end.set_nodelay(true).unwrap();
        let (echoing, stream) = (echo(end), client.try_clone().unwrap());
        let times = exchange(&mut client, ROUNDS, || stream.shutdown(Shutdown::Both).unwrap());
        echoing.join().unwrap();
        times
    });
    assert!(added(through, direct)[1] < Duration::from_micros(200));
}

/// Within the time of one byte at the fastest rate of a source that is tapped on a serial line, 115200 baud.
#[test]
#[ignore = "measures a delay, which a busy machine makes longer"]
fn the_delay_of_a_serial_line_is_below_a_byte() {
    let line = || -> (Box<dyn SerialPort>, String) {
        let (mut end, name) = serial::pair().unwrap();
        end.set_timeout(DEADLINE).unwrap();
        (end, name)
    };
    let open = |name: &str| serialport::new(name, 115_200).timeout(DEADLINE).open().unwrap();
    let (near, name) = line();
    drop(echo(near));
    let direct = exchange(&mut open(&name), ROUNDS, || ());
    let ((mut host, a), (device, b)) = (line(), line());
    let _tap =
        Running::start(cellwire(&format!("tap laser-eb90 --a {a} --b {b} --baud 115200 --no-capture")));
    drop(echo(device));
    let through = exchange(&mut host, ROUNDS, || ());
    assert!(added(through, direct)[1] < Duration::from_micros(87));
}
