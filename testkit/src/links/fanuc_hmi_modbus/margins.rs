//! The tolerance of the ends for wrong assumptions about each other and the line: their sessions on a virtual clock,
//! with the default settings.

use core::time::Duration;

use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, Frame, Framing, Registers, Reply, Request, Server, ServerConfig, Words,
};
use robot_session::{Encode as _, Session as _};

use crate::model::Margin;

const START: Duration = Duration::from_secs(60);
const BAUD: u32 = 19_200;
const CLIENT: &str = "fanuc-hmi-modbus client";
const SERVER: &str = "fanuc-hmi-modbus server";
const READ: Request<'static> = Request::ReadHoldingRegisters { address: 0, quantity: 1 };

/// Returns the assumptions of the ends about time.
pub fn margins() -> Vec<Margin> {
    let rtu = ClientConfig::rtu(BAUD);
    let silence = ServerConfig::rtu(1, BAUD).framing.silence().unwrap_or_default();
    let stall = through().framing.silence().unwrap_or_default();
    vec![
        Margin::around(
            [CLIENT, "timeout (TCP)", "a reply takes so long"],
            ClientConfig::tcp().timeout,
            is_answered,
        ),
        Margin::around(
            [
                CLIENT,
                "timeout + settle (serial line)",
                "a reply takes so long, and the next request is alike",
            ],
            rtu.timeout + rtu.settle,
            is_its_own,
        ),
        Margin::around(
            [CLIENT, "turnaround", "a unit does not listen for so long after a broadcast"],
            rtu.turnaround,
            is_heard,
        ),
        Margin::around([CLIENT, "stall (RTU over TCP)", "a reply pauses for so long"], stall, goes_on),
        Margin::around([SERVER, "silence", "a request pauses for so long"], silence, is_whole),
        Margin::around(
            [SERVER, "stall (RTU over TCP)", "a request pauses for so long"],
            stall,
            goes_on_through,
        ),
    ]
}

/// Returns the configuration of a client of RTU over TCP, with long enough timeouts.
fn through() -> ClientConfig {
    ClientConfig {
        framing: Framing::RTU_OVER_TCP,
        timeout: Duration::from_secs(10),
        ..ClientConfig::rtu(BAUD)
    }
}

/// Returns the time at which a client sends, from `from` on.
fn sends<const N: usize>(client: &mut Client<N>, from: Duration) -> Duration {
    let mut now = from;
    loop {
        client.handle_timeout(now);
        if client.poll_transmit(now, &mut [0; Frame::MAX_LEN]).is_some() {
            return now;
        }
        now = client.poll_timeout().expect("a request waits").max(now);
    }
}

fn reply(transaction: Option<u16>, value: u16) -> ([u8; Frame::MAX_LEN], usize) {
    let (mut out, words) = ([0; Frame::MAX_LEN], [value]);
    let pdu = Reply::HoldingRegisters(Words::from(&words));
    let length = Frame { transaction, unit: 1, pdu }.encode(&mut out).expect("a buffer of a frame");
    (out, length)
}

fn is_answered(after: Duration) -> Option<&'static str> {
    let mut client = Client::<1>::new(ClientConfig::tcp()).expect("the default can work");
    client.handle_connected(START);
    client.request(1, &READ).expect("there is a place");
    let mut out = [0; Frame::MAX_LEN];
    client.poll_transmit(START, &mut out).expect("it is sent at once");
    let (reply, length) = reply(Some(u16::from_be_bytes([out[0], out[1]])), 7);
    client.handle_timeout(START + after);
    client.handle_input(START + after, &reply[..length]);
    let failed =
        core::iter::from_fn(|| client.poll_event()).any(|it| matches!(it, ClientEvent::Failed { .. }));
    failed.then_some("the outcome of a request is known")
}

fn is_its_own(after: Duration) -> Option<&'static str> {
    let mut client = Client::<2>::new(ClientConfig::rtu(BAUD)).expect("the default can work");
    client.handle_connected(START);
    client.request(1, &READ).expect("there is a place");
    let asked = sends(&mut client, START);
    let second = client.request(1, &READ).expect("there is a place");
    // The reply to the first request comes, and the client may send the second before that.
    let (late, length) = reply(None, 7);
    let comes = asked + after;
    let mut now = asked;
    while let Some(next) = client.poll_timeout().map(|at| at.max(now)).filter(|at| *at < comes) {
        now = next;
        client.handle_timeout(now);
        client.poll_transmit(now, &mut [0; Frame::MAX_LEN]);
    }
    client.handle_input(comes, &late[..length]);
    for _ in 0..4 {
        now = client.poll_timeout().map_or(comes, |at| at.clamp(comes, comes + Duration::from_millis(5)));
        client.handle_timeout(now);
        client.poll_transmit(now, &mut [0; Frame::MAX_LEN]);
    }
    let is_taken = |it| matches!(it, ClientEvent::Replied { ticket, .. } if ticket == second);
    core::iter::from_fn(|| client.poll_event()).any(is_taken).then_some("a reply is that of its request")
}

fn is_heard(deaf: Duration) -> Option<&'static str> {
    let mut client = Client::<2>::new(ClientConfig::rtu(BAUD)).expect("the default can work");
    client.handle_connected(START);
    client.request(0, &Request::WriteRegister { address: 0, value: 1 }).expect("there is a place");
    let announced = sends(&mut client, START);
    client.request(1, &READ).expect("there is a place");
    (sends(&mut client, announced) < announced + deaf).then_some("the request after a broadcast is heard")
}

fn goes_on(pause: Duration) -> Option<&'static str> {
    let mut client = Client::<1>::new(through()).expect("it can work");
    client.handle_connected(START);
    client.request(1, &READ).expect("there is a place");
    let asked = sends(&mut client, START);
    let (reply, length) = reply(None, 7);
    client.handle_input(asked, &reply[..3]);
    client.handle_timeout(asked + pause);
    client.handle_input(asked + pause, &reply[3..length]);
    let is_replied = |it| matches!(it, ClientEvent::Replied { .. });
    let is_read = core::iter::from_fn(|| client.poll_event()).any(is_replied);
    (!is_read).then_some("a reply is read")
}

struct Nothing;

impl Registers for Nothing {}

fn is_whole(pause: Duration) -> Option<&'static str> {
    is_read(ServerConfig::rtu(1, BAUD), pause)
}

fn goes_on_through(pause: Duration) -> Option<&'static str> {
    is_read(ServerConfig { framing: Framing::RTU_OVER_TCP, ..ServerConfig::rtu(1, BAUD) }, pause)
}

fn is_read(config: ServerConfig, pause: Duration) -> Option<&'static str> {
    let mut server: Server<_> = Server::new(config, Nothing).expect("it can work");
    server.handle_connected(START);
    let mut out = [0; Frame::MAX_LEN];
    let length =
        Frame { transaction: None, unit: 1, pdu: READ }.encode(&mut out).expect("a buffer of a frame");
    let (head, rest) = out[..length].split_at(3);
    server.handle_input(START, head);
    server.handle_timeout(START + pause);
    server.handle_input(START + pause, rest);
    let judged = START + pause + Duration::from_millis(50);
    server.handle_timeout(judged);
    server.poll_transmit(judged, &mut [0; Frame::MAX_LEN]).is_none().then_some("a request is answered")
}
