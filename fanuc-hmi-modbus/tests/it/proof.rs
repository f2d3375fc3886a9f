//! A reply that equals its request counts on a line on which another reply has come.

use core::time::Duration;

use crate::common::{MS, connected, read, rtu};
use crate::echo::{PROBE, WRITE, events, exchanges, reply};
use fanuc_hmi_modbus::robot_session::Session as _;
use fanuc_hmi_modbus::{
    Bits, Client, ClientConfig, ClientEvent, Exception, Failure, Reply, Request, Ticket, Words,
};

/// The bytes that a line gives for the frame with this number.
type Line<'a> = &'a dyn Fn(usize, &[u8]) -> Vec<u8>;

/// Runs until the request has its outcome; the line returns any bytes at once.
fn outcome(client: &mut Client, now: &mut Duration, ticket: Ticket, line: Line<'_>) -> ClientEvent {
    let mut out = [0; 260];
    for number in 0.. {
        while let Some(length) = client.poll_transmit(*now, &mut out) {
            let bytes = line(number, &out[..length]);
            *now += MS;
            client.handle_input(*now, &bytes);
        }
        *now = client.poll_timeout().map_or(*now, |at| at.max(*now));
        client.handle_timeout(*now);
        let outcome = events(client).into_iter().find(|event| event.outcome_of() == Some(ticket));
        if let Some(outcome) = outcome {
            return outcome;
        }
        assert!(number < 20, "no outcome");
    }
    unreachable!()
}

fn configs() -> [ClientConfig; 4] {
    let each = [rtu(), ClientConfig::rtu_over_tcp()];
    [each[0], each[1], ClientConfig { echo: true, ..each[0] }, ClientConfig { echo: true, ..each[1] }]
}

/// Returns every request that can equal its reply.
fn mirrored() -> Vec<Request<'static>> {
    let equal = exchanges().into_iter().map(|(request, _)| request);
    let is_mirrored = |request: &Request<'_>| !matches!(request.function(), 3 | 16);
    // The reply to this read of coils can be its request, and so can that to this read and write of registers.
    let reads = [
        Request::ReadCoils { address: 0x0300, quantity: 24 },
        Request::ReadDiscreteInputs { address: 0x0310, quantity: 24 },
        Request::Other { function: 65, data: &[1, 2, 3] },
    ];
    equal.filter(is_mirrored).chain(reads).collect()
}

/// No device answers, and the line returns the bytes sent, but not always, and not always unchanged.
#[test]
fn what_a_line_returns_is_not_done() {
    let first = |change: &'static dyn Fn(&[u8]) -> Vec<u8>| {
        move |number: usize, sent: &[u8]| if number == 0 { change(sent) } else { sent.to_vec() }
    };
    let lost = first(&|_| Vec::new());
    let without_first = first(&|sent| sent[1..].to_vec());
    let without_last = first(&|sent| sent[..sent.len() - 1].to_vec());
    let noisy = |_: usize, sent: &[u8]| [&[0xFF; 3], sent].concat();
    let noisier = |_: usize, sent: &[u8]| [&[0xFF; 8], sent].concat();
    let twice = |_: usize, sent: &[u8]| sent.repeat(2);
    let thrice = |_: usize, sent: &[u8]| sent.repeat(3);
    let damaged: Vec<_> = (0..8)
        .map(|at| {
            move |number: usize, sent: &[u8]| {
                let mut sent = sent.to_vec();
                let at = at % sent.len();
                sent[at] ^= u8::from(number == 0);
                sent
            }
        })
        .collect();
    let mut lines: Vec<Line<'_>> =
        vec![&lost, &without_first, &without_last, &noisy, &noisier, &twice, &thrice];
    lines.extend(damaged.iter().map(|line| -> Line<'_> { line }));
    for config in configs() {
        for request in mirrored() {
            for (index, line) in lines.iter().enumerate() {
                let mut client: Client = connected(config);
                let mut now = config.timeout + config.settle;
                // The same again, and on the next connection.
                for round in 0..3 {
                    if round == 2 {
                        client.handle_disconnected(now);
                        client.handle_connected(now);
                    }
                    let ticket = client.request(1, &request).unwrap();
                    let outcome = outcome(&mut client, &mut now, ticket, line);
                    let is_failed = matches!(
                        outcome,
                        ClientEvent::Failed { failure: Failure::Returned | Failure::TimedOut, .. }
                    );
                    assert!(is_failed, "{request:?}, line {index}, round {round}: {outcome:?}, {config:?}");
                }
            }
        }
    }
}

/// The outcome names the setting that the line may need.
#[test]
fn the_reason_names_the_setting() {
    let mut client: Client = connected(rtu());
    let mut now = rtu().timeout + rtu().settle;
    let ticket = client.request(1, &WRITE).unwrap();
    let line = |number: usize, sent: &[u8]| if number == 0 { Vec::new() } else { sent.to_vec() };
    let failure = Failure::Returned;
    assert_eq!(outcome(&mut client, &mut now, ticket, &line), ClientEvent::Failed { ticket, failure });
    assert!(failure.is_unknown());
    let text = "only the request itself came back, and no other reply shows that a device answers: if the line returns what is sent, set \
                echo=true; if the request writes, it may have been executed";
    assert_eq!(failure.to_string(), text);
}

/// Any reply that the line cannot have returned shows that a device answers, on this connection.
#[test]
fn after_another_reply_an_equal_one_is_done() {
    let written = reply(Reply::WriteRegisters { address: 1, quantity: 1 });
    let values = [7];
    let others = [
        (read(0, 1), reply(Reply::HoldingRegisters(Words::from(&[9])))),
        (read(0, 1), reply(Reply::Exception { function: 3, exception: Exception::IllegalFunction })),
        (WRITE, reply(Reply::Exception { function: 6, exception: Exception::IllegalDataAddress })),
        (Request::WriteRegisters { address: 1, values: (&values).into() }, written),
        (Request::ReadCoils { address: 0x0100, quantity: 1 }, reply(Reply::Coils(Bits::from(&[true])))),
    ];
    for config in [rtu(), ClientConfig::rtu_over_tcp()] {
        for (request, answer) in &others {
            let mut client: Client = connected(config);
            let mut now = config.timeout + config.settle;
            // A device that does not answer the read of register 0.
            let device = |_: usize, sent: &[u8]| match sent {
                sent if sent == PROBE && request.function() != 3 => Vec::new(),
                sent if sent[..3] == [1, 6, 0] && request.function() != 6 => sent.to_vec(),
                _ => answer.clone(),
            };
            let ticket = client.request(1, request).unwrap();
            let done = ClientEvent::Replied { ticket, unit: 1 };
            assert_eq!(outcome(&mut client, &mut now, ticket, &device), done);
            let ticket = client.request(1, &WRITE).unwrap();
            let equal = |_: usize, sent: &[u8]| if sent == PROBE { Vec::new() } else { sent.to_vec() };
            let done = ClientEvent::Replied { ticket, unit: 1 };
            assert_eq!(outcome(&mut client, &mut now, ticket, &equal), done, "{request:?}");
            // The next connection may use another line.
            client.handle_disconnected(now);
            client.handle_connected(now);
            let ticket = client.request(1, &WRITE).unwrap();
            let failed = ClientEvent::Failed { ticket, failure: Failure::Returned };
            assert_eq!(outcome(&mut client, &mut now, ticket, &equal), failed, "{request:?}");
        }
    }
}

/// After the bytes that the line has returned, the device still answers.
#[test]
fn an_exception_after_an_equal_frame_counts() {
    let refused = reply(Reply::Exception { function: 6, exception: Exception::IllegalDataAddress });
    let line = |_: usize, sent: &[u8]| if sent == PROBE { Vec::new() } else { [sent, &refused[..]].concat() };
    let mut client: Client = connected(rtu());
    let mut now = rtu().timeout + rtu().settle;
    let ticket = client.request(1, &WRITE).unwrap();
    assert_eq!(outcome(&mut client, &mut now, ticket, &line), ClientEvent::Replied { ticket, unit: 1 });
    assert!(matches!(client.reply(ticket), Some(Reply::Exception { .. })));
}
