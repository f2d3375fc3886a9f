//! Serial ports: a pseudo-terminal, and a driver with prescribed results.

use core::time::Duration;
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};

use robot_session::{ReceiveOutcome, SendOutcome, Serial, Transport as _, Wait};
use serialport::{ClearBuffer, DataBits, FlowControl, Parity, SerialPort, StopBits};

const SHORT: Duration = Duration::from_millis(20);

/// The results of its reads and writes, one after the other.
struct Told(VecDeque<Result<usize, ErrorKind>>);

impl Told {
    fn next(&mut self) -> io::Result<usize> {
        Ok(self.0.pop_front().expect("it was told that much")?)
    }
}

impl Read for Told {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        self.next()
    }
}

impl Write for Told {
    fn write(&mut self, _: &[u8]) -> io::Result<usize> {
        self.next()
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

macro_rules! defaults {
    ($($name:ident($($arguments:tt)*) -> $value:ty;)*) => {
        $(fn $name($($arguments)*) -> serialport::Result<$value> { Ok(Default::default()) })*
    };
}

macro_rules! unused {
    ($($name:ident -> $value:ty;)*) => {
        $(fn $name(&self) -> serialport::Result<$value> { unimplemented!() })*
    };
}

impl SerialPort for Told {
    fn name(&self) -> Option<String> {
        None
    }

    fn timeout(&self) -> Duration {
        SHORT
    }

    defaults! {
        baud_rate(&self) -> u32;
        set_baud_rate(&mut self, _: u32) -> ();
        set_data_bits(&mut self, _: DataBits) -> ();
        set_flow_control(&mut self, _: FlowControl) -> ();
        set_parity(&mut self, _: Parity) -> ();
        set_stop_bits(&mut self, _: StopBits) -> ();
        set_timeout(&mut self, _: Duration) -> ();
        write_request_to_send(&mut self, _: bool) -> ();
        write_data_terminal_ready(&mut self, _: bool) -> ();
        read_clear_to_send(&mut self) -> bool;
        read_data_set_ready(&mut self) -> bool;
        read_ring_indicator(&mut self) -> bool;
        read_carrier_detect(&mut self) -> bool;
        bytes_to_read(&self) -> u32;
        bytes_to_write(&self) -> u32;
        clear(&self, _: ClearBuffer) -> ();
        set_break(&self) -> ();
        clear_break(&self) -> ();
    }

    unused! {
        data_bits -> DataBits;
        flow_control -> FlowControl;
        parity -> Parity;
        stop_bits -> StopBits;
        try_clone -> Box<dyn SerialPort>;
    }
}

const SILENCE: [Result<usize, ErrorKind>; 3] =
    [Err(ErrorKind::TimedOut), Err(ErrorKind::WouldBlock), Err(ErrorKind::Interrupted)];

#[test]
fn a_port_says_how_much_it_took_and_that_it_is_gone() {
    let told = [Ok(5), Ok(4), Ok(1)].into_iter().chain(SILENCE).chain([Ok(0), Err(ErrorKind::BrokenPipe)]);
    let mut port = Serial(Box::new(Told(told.collect())));
    let mut send = || port.send(b"12345").map_err(|error| error.kind());
    assert_eq!(send(), Ok(SendOutcome::Buffered));
    for length in [4, 1, 0, 0, 0] {
        assert_eq!(send(), Ok(SendOutcome::Part(length)));
    }
    assert_eq!([send(), send()], [Err(ErrorKind::WriteZero), Err(ErrorKind::BrokenPipe)]);
}

#[test]
fn a_port_says_what_has_come_and_that_it_is_gone() {
    let told = [Ok(5)].into_iter().chain(SILENCE).chain([Ok(0), Err(ErrorKind::BrokenPipe)]);
    let mut port = Serial(Box::new(Told(told.collect())));
    let mut receive = || port.receive(&mut [0; 8], Wait::limited(SHORT)).map_err(|error| error.kind());
    assert_eq!(receive(), Ok(ReceiveOutcome::Bytes(5)));
    for _ in SILENCE {
        assert_eq!(receive(), Ok(ReceiveOutcome::Nothing));
    }
    assert_eq!([receive(), receive()], [Ok(ReceiveOutcome::Closed), Err(ErrorKind::BrokenPipe)]);
}

/// The other end does not read at first.
#[cfg(unix)]
#[test]
fn a_pseudo_terminal_takes_what_it_has_room_for() {
    let (master, mut slave) = serialport::TTYPort::pair().unwrap();
    slave.set_timeout(Duration::from_secs(20)).unwrap();
    let mut port = Serial(Box::new(master));
    let mut sent = 0;
    let bytes: Vec<u8> = (0..=250).cycle().take(1000).collect();
    loop {
        match port.send(&bytes).unwrap() {
            SendOutcome::Buffered => sent += bytes.len(),
            SendOutcome::Part(length) => {
                sent += length;
                break;
            }
            SendOutcome::Transmitted => panic!("a port does not know"),
        }
    }
    let begin = robot_session::now();
    port.wait_for_room(Wait::default()).unwrap();
    let waited = robot_session::now() - begin;
    assert!((Duration::from_millis(5)..Duration::from_secs(5)).contains(&waited), "{waited:?}");
    let mut received = vec![0; sent];
    slave.read_exact(&mut received).unwrap();
    assert!(received.iter().enumerate().all(|(at, byte)| *byte == bytes[at % bytes.len()]));
    slave.write_all(b"ok").unwrap();
    let mut buffer = [0; 8];
    let mut arrived: Vec<u8> = Vec::new();
    while arrived.len() < 2 {
        if let ReceiveOutcome::Bytes(length) = port.receive(&mut buffer, Wait::limited(SHORT)).unwrap() {
            arrived.extend(&buffer[..length]);
        }
    }
    assert_eq!(arrived, b"ok");
    assert_eq!(port.receive(&mut buffer, Wait::limited(SHORT)).unwrap(), ReceiveOutcome::Nothing);
    drop(slave);
    assert!(port.receive(&mut buffer, Wait::limited(SHORT)).is_err(), "it is gone, and not silent");
    assert!(port.send(b"x").is_err());
}
