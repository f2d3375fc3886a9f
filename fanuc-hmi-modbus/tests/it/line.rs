//! A server on a line with other units: the requests that it executes begin after a silence, or after a whole frame.
#![allow(clippy::cast_possible_truncation)]

use core::time::Duration;

use crate::common::{Line, MS, bytes, transmitted, write};
use fanuc_hmi_modbus::robot_session::Session as _;
use fanuc_hmi_modbus::robot_session::end::End as _;
use fanuc_hmi_modbus::timing::transmission_time;
use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, DecodeError, Failure, Framing, Reply, Request, ServerConfig,
    ServerEvent, Words,
};

const BAUDS: [u32; 7] = [1200, 2400, 9600, 19_200, 38_400, 57_600, 115_200];

/// Registers that look like a frame where the data of a message begins.
fn words(frame: &[u8]) -> Vec<u16> {
    frame.chunks(2).map(|pair| u16::from_be_bytes([pair[0], *pair.get(1).unwrap_or(&0)])).collect()
}

#[test]
fn the_data_of_another_units_reply_is_not_carried_out() {
    for baud in BAUDS {
        for looks_like in [write(1), write(0)] {
            for before in 0..4 {
                let words = [vec![7; before], words(&looks_like)].concat();
                let reply = bytes(None, 2, Reply::HoldingRegisters(Words::from(&words[..])));
                let mut line = Line::new(baud);
                line.send(&bytes(None, 2, Request::ReadHoldingRegisters { address: 0, quantity: 4 }));
                assert_eq!(line.silence(), [] as [Vec<u8>; 0]);
                line.send(&reply);
                assert_eq!(line.silence(), [] as [Vec<u8>; 0]);
                assert_eq!(line.written(), [], "{baud} {before}");
                assert_eq!(line.server.statistics().corrupt, 0, "a reply of another unit is a frame");
                line.is_served();
            }
        }
    }
}

#[test]
fn a_damaged_message_is_dropped_whole() {
    for unit in [1, 2] {
        let words = [vec![7, 7], words(&write(1)), words(&write(0)), vec![7]].concat();
        let whole = bytes(None, unit, Request::WriteRegisters { address: 20, values: (&words[..]).into() });
        for at in 0..whole.len() {
            let mut lost = whole.clone();
            lost.remove(at);
            let mut inserted = whole.clone();
            inserted.insert(at, 0x55);
            let mut flipped = whole.clone();
            flipped[at] ^= 0x10;
            for damaged in [&whole[..at], &lost, &inserted, &flipped] {
                let mut line = Line::new(19_200);
                line.send(damaged);
                assert_eq!(line.silence(), [] as [Vec<u8>; 0], "unit {unit}, byte {at}");
                assert_eq!(line.written(), [], "unit {unit}, byte {at}");
                line.is_served();
            }
        }
    }
}

#[test]
fn a_byte_beside_a_good_frame_makes_it_none() {
    for byte in 0..=255 {
        for (damaged, is_behind) in
            [([&[byte], &write(1)[..]].concat(), false), ([&write(1)[..], &[byte]].concat(), true)]
        {
            let mut line = Line::new(19_200);
            line.send(&damaged);
            // The CRC stays right with a zero after it: a write of one byte too many, which is refused.
            let replies = if is_behind && byte == 0 { 1 } else { 0 };
            assert_eq!(line.silence().len(), replies, "{byte} {is_behind}");
            line.give_up();
            assert_eq!(line.written(), [], "{byte} {is_behind}");
            assert_eq!(line.server.statistics().corrupt, 1 - replies as u64);
            line.is_served();
        }
    }
}

#[test]
fn frames_in_one_read_are_told_apart_and_the_last_is_answered() {
    let ask = bytes(None, 2, Request::ReadHoldingRegisters { address: 0x0800, quantity: 8 });
    let data = [vec![7], words(&write(1)), vec![7; 3]].concat();
    let reply = bytes(None, 2, Reply::HoldingRegisters((&data[..]).into()));
    let refusal = bytes(None, 3, Reply::Exception { function: 16, exception: 2.into() });
    for before in [
        vec![],
        vec![&ask, &reply],
        vec![&reply, &ask],
        vec![&ask, &refusal, &ask, &reply],
        vec![&refusal, &reply, &reply],
    ] {
        let before: Vec<u8> = before.into_iter().flatten().copied().collect();
        let mut line = Line::new(19_200);
        line.lump(&[&before[..], &write(1)].concat());
        assert_eq!(line.silence(), [write(1)]);
        assert_eq!(line.written(), [(10, 0x0BAD)]);
        // A frame after the request was sent by a client that does not wait for its reply any more.
        line.lump(&[&write(1)[..], &before, &ask].concat());
        assert_eq!(line.silence(), [] as [Vec<u8>; 0]);
        assert_eq!(line.written(), []);
        assert_eq!(line.server.statistics().refused, 1);
        // Garbage, and a request that begins after it.
        line.lump(&[&before[..], &ask[..5], &write(1)].concat());
        assert_eq!(line.silence(), [] as [Vec<u8>; 0]);
        assert_eq!(line.written(), []);
        assert_eq!(line.server.statistics().corrupt, 1);
    }
    // A broadcast is executed at any position.
    let mut line = Line::new(19_200);
    line.lump(&[write(0), ask, write(1)].concat());
    assert_eq!(line.silence(), [write(1)]);
    assert_eq!(line.written(), [(10, 0x0BAD); 2]);
}

/// A busy line may deliver more bytes without a silence that the driver observes than the server's buffer holds.
#[test]
fn a_line_without_a_silence_is_followed() {
    let ask = bytes(None, 2, Request::ReadHoldingRegisters { address: 0, quantity: 8 });
    let data = [vec![7], words(&write(1)), vec![7; 3]].concat();
    let reply = bytes(None, 2, Reply::HoldingRegisters((&data[..]).into()));
    for piece in [7, 60, 500] {
        for times in 0..80 {
            let mut line = Line::new(19_200);
            let stream = [[&ask[..], &reply].concat().repeat(times), write(1)].concat();
            stream.chunks(piece).for_each(|piece| line.lump(piece));
            assert_eq!(line.silence(), [write(1)], "{piece} {times}");
            assert_eq!(line.written(), [(10, 0x0BAD)]);
            // The same with a byte lost somewhere at the beginning.
            stream[1..].chunks(piece).for_each(|piece| line.lump(piece));
            assert_eq!(line.silence(), [] as [Vec<u8>; 0], "{piece} {times}");
            assert_eq!(line.written(), []);
            line.is_served();
        }
    }
}

/// A pause that the driver did not observe proves nothing: the bytes may have come late.
#[test]
fn only_a_silence_that_was_seen_ends_a_frame() {
    let silence = Framing::Rtu { silence: 20 * MS };
    for split in 1..8 {
        let (head, tail) = (&write(1)[..split], &write(1)[split..]);
        // A USB adapter delivers after 16 ms; its driver checks in between.
        let mut line = Line::with(ServerConfig { framing: silence, ..ServerConfig::rtu(1, 19_200) }, 19_200);
        line.lump(head);
        line.pause(16 * MS);
        line.lump(tail);
        assert_eq!(line.silence(), [write(1)], "{split}");
        // A driver that is very late, and has not checked in between.
        let mut line = Line::new(19_200);
        line.lump(head);
        line.now += 500 * MS;
        line.lump(tail);
        assert_eq!(line.silence(), [write(1)], "{split}");
        // A silence in the middle, after which the rest does not come in time.
        line.written();
        line.lump(head);
        assert_eq!(line.silence(), [] as [Vec<u8>; 0], "{split}");
        line.give_up();
        line.lump(tail);
        assert_eq!(line.silence(), [] as [Vec<u8>; 0], "{split}");
        assert_eq!(line.written(), []);
        line.is_served();
    }
    // The rest of a reply that a late driver reads is the rest of a reply.
    let reply = bytes(None, 2, Reply::HoldingRegisters((&words(&write(1))[..]).into()));
    let mut line = Line::new(19_200);
    line.lump(&reply[..3]);
    line.now += 500 * MS;
    line.lump(&reply[3..]);
    line.is_served();
}

/// A UART with a FIFO, a USB adapter or a device server delivers a request in pieces, with silences between them that are not
/// on the line.
#[test]
fn a_request_that_is_delivered_in_pieces_is_served_once() {
    let values: Vec<u16> = (0..40).collect();
    let long = bytes(None, 1, Request::WriteRegisters { address: 0, values: (&values[..]).into() });
    for baud in BAUDS {
        // A UART and a CH340 deliver a piece when it is full, an FTDI adapter its bytes every 16 ms.
        for (piece, gap) in [1, 8, 14, 32]
            .map(|size| (size, transmission_time(size, baud)))
            .into_iter()
            .chain([(62, 16 * MS)])
        {
            for request in [&write(1), &long] {
                let mut line = Line::new(baud);
                let pieces: Vec<_> = request.chunks(piece).collect();
                for (number, piece) in pieces.iter().enumerate() {
                    line.lump(piece);
                    let replies = line.silence();
                    assert_eq!(replies.len(), usize::from(number + 1 == pieces.len()), "{baud} {piece:x?}");
                    line.pause(gap.saturating_sub(line.server.config().framing.silence().unwrap()));
                }
                assert_eq!(line.server.statistics().served, 1);
                assert_eq!(line.server.statistics().corrupt, 0);
            }
        }
    }
}

/// A glitch between two frames is not the beginning of the next one.
#[test]
fn a_request_after_a_byte_and_a_silence_is_served() {
    for byte in 0..=255 {
        let mut line = Line::new(19_200);
        line.send(&[byte]);
        assert_eq!(line.silence(), [] as [Vec<u8>; 0]);
        line.send(&write(1));
        let mut replies = line.silence();
        line.give_up();
        replies.extend(transmitted(&mut line.server, line.now));
        assert_eq!(replies, [write(1)], "{byte:x}");
        assert_eq!(line.written(), [(10, 0x0BAD)]);
        assert_eq!(line.server.statistics().corrupt, 1);
    }
}

/// The data of a request to another unit looks like a request, and is delivered in a piece of its own.
#[test]
fn a_piece_of_another_units_frame_is_not_carried_out() {
    let words = [vec![7; 4], words(&write(1)), vec![7; 9]].concat();
    let other = bytes(None, 2, Request::WriteRegisters { address: 20, values: (&words[..]).into() });
    let at = other.windows(8).position(|bytes| bytes == write(1)).unwrap();
    let pieces = [&other[..at], &other[at..at + 8], &other[at + 8..]];
    let mut line = Line::new(19_200);
    for piece in pieces {
        line.lump(piece);
        assert_eq!(line.silence(), [] as [Vec<u8>; 0]);
    }
    assert_eq!((line.written(), line.server.statistics().corrupt), (vec![], 0));
    line.is_served();
}

/// The CRC is right and the frame is for this unit: it is refused, as over TCP.
#[test]
fn a_byte_count_that_does_not_fit_is_refused() {
    for (pdu, exception, is_cut) in [
        (&[16, 0, 0, 0, 1, 4, 0, 1][..], [0x90, 3], true),
        (&[16, 0, 0, 0, 1, 1, 0, 1], [0x90, 3], false),
        (&[16, 0, 0, 0, 5, 2, 0, 1], [0x90, 3], false),
        (&[16, 0, 0], [0x90, 3], true),
        (&[15, 0, 0, 0, 3, 9, 1], [0x8F, 3], true),
        (&[23, 0, 0, 0, 1, 0, 0, 0, 1, 200, 0, 1], [0x97, 3], true),
        (&[3, 0, 0, 0], [0x83, 3], true),
        (&[6, 0, 0, 0, 1, 0], [0x86, 3], false),
    ] {
        let mut frame = [&[1], pdu].concat();
        frame.extend(fanuc_hmi_modbus::crc::crc16(&frame).to_le_bytes());
        for config in [ServerConfig::rtu(1, 19_200), ServerConfig::rtu_over_tcp(1)] {
            let mut line = Line::with(config, 19_200);
            line.send(&frame);
            let replies = line.silence();
            // Through TCP the rest may come.
            if is_cut && config.framing == Framing::RTU_OVER_TCP {
                assert_eq!(replies, [] as [Vec<u8>; 0]);
                continue;
            }
            assert_eq!(replies.len(), 1, "{pdu:x?}");
            assert_eq!(replies[0][1..3], exception, "{pdu:x?}");
            assert_eq!(line.written(), []);
            assert_eq!(line.server.statistics().corrupt, 0);
        }
    }
}

/// A frame that fits and is shorter than the reply can only be an exception: the registers that function 23 reads may look
/// like its refusal.
#[test]
fn the_data_of_a_damaged_reply_is_no_exception() {
    let refusal = bytes(None, 1, Reply::Exception { function: 23, exception: 2.into() });
    let request =
        Request::ReadWriteRegisters { address: 0, quantity: 5, write_address: 10, values: Words::from(&[7]) };
    for (config, damage) in [ClientConfig::rtu(19_200), ClientConfig::rtu_over_tcp()]
        .into_iter()
        .flat_map(|config| (0..15).map(move |damage| (config, damage)))
    {
        let settle = config.timeout + config.settle;
        let mut client: Client = Client::new(config).unwrap();
        client.handle_connected(Duration::ZERO);
        client.handle_timeout(settle);
        let ticket = client.request(1, &request).unwrap();
        assert_eq!(transmitted(&mut client, settle).len(), 1);
        let data = [words(&refusal), vec![7; 2]].concat();
        let mut reply = bytes(None, 1, Reply::ReadWriteRegisters((&data[..]).into()));
        reply[damage] ^= 0x10;
        // Even if the driver takes a pause for a silence, right before the data.
        let (head, tail) = reply.split_at(3);
        client.handle_input(settle, head);
        client.handle_timeout(settle + 500 * MS);
        client.handle_input(settle + 500 * MS, tail);
        client.handle_timeout(settle + 999 * MS);
        let events: Vec<_> = core::iter::from_fn(|| client.poll_event()).collect();
        assert!(events.iter().all(|event| event.outcome_of().is_none()), "{damage}: {events:?}");
        // A refusal of a request that is sent later counts.
        client.handle_timeout(2 * settle + 30_000 * MS);
        client.handle_timeout(4 * settle + 60_000 * MS);
        let now = 4 * settle + 60_000 * MS;
        let later = client.request(1, &request).unwrap();
        assert_eq!(transmitted(&mut client, now).len(), 1);
        client.handle_input(now, &refusal);
        let outcomes =
            core::iter::from_fn(|| client.poll_event()).filter(|event| event.outcome_of().is_some());
        let failed = ClientEvent::Failed { ticket, failure: Failure::TimedOut };
        assert_eq!(outcomes.collect::<Vec<_>>(), [failed, ClientEvent::Replied { ticket: later, unit: 1 }]);
    }
}

/// An adapter gives some bytes when it turns its transmitter off; the refusal comes at once or after a silence, and a
/// silence follows it.
#[test]
fn an_exception_after_noise_counts_when_the_line_is_silent() {
    let requests = [
        Request::ReadHoldingRegisters { address: 60_000, quantity: 1 },
        Request::WriteRegisters { address: 60_000, values: Words::from(&[7]) },
    ];
    let noises: [&[u8]; 8] =
        [&[0], &[0xFF], &[0, 0], &[0xFF; 2], &[1], &[0x83], &[0, 0xFF, 0], &[1, 0x83, 2, 0xC0]];
    for config in [ClientConfig::rtu(19_200), ClientConfig::rtu_over_tcp()] {
        let silence = config.framing.silence().unwrap();
        for (request, noise, gap) in requests.iter().flat_map(|request| {
            noises.iter().flat_map(move |noise| {
                [Duration::ZERO, silence / 2, silence, 3 * silence].map(|gap| (request, noise, gap))
            })
        }) {
            for size in [1, 5] {
                let settle = config.timeout + config.settle;
                let mut client: Client =
                    Client::new(ClientConfig { timeout: Duration::from_secs(5), ..config }).unwrap();
                client.handle_connected(Duration::ZERO);
                client.handle_timeout(settle + Duration::from_secs(5));
                let mut now = settle + Duration::from_secs(5);
                let ticket = client.request(1, request).unwrap();
                assert_eq!(transmitted(&mut client, now).len(), 1);
                client.handle_input(now, noise);
                now += gap;
                if client.poll_timeout().is_some_and(|at| at <= now) {
                    client.handle_timeout(now);
                }
                let function = request.function();
                let refusal = bytes(None, 1, Reply::Exception { function, exception: 2.into() });
                refusal.chunks(size).for_each(|piece| client.handle_input(now, piece));
                now += silence;
                client.handle_timeout(now);
                let outcomes =
                    core::iter::from_fn(|| client.poll_event()).filter(|event| event.outcome_of().is_some());
                let replied = ClientEvent::Replied { ticket, unit: 1 };
                assert_eq!(
                    outcomes.collect::<Vec<_>>(),
                    [replied],
                    "{request:?}, {noise:x?}, {gap:?}, {size}"
                );
                assert!(matches!(client.reply(ticket), Some(Reply::Exception { .. })));
            }
        }
    }
}

/// The CRC of a frame that ends in a zero is right without the zero, too: it may come after any stall.
#[test]
fn through_tcp_a_zero_that_is_late_belongs_to_its_frame() {
    let mut line = Line::with(ServerConfig::rtu_over_tcp(1), 19_200);
    let request = bytes(None, 1, Request::ReadCoils { address: 14, quantity: 28 });
    assert_eq!(request[7], 0);
    line.lump(&request[..7]);
    assert_eq!(line.silence(), [] as [Vec<u8>; 0]);
    line.lump(&request[7..]);
    assert_eq!(transmitted(&mut line.server, line.now)[0][..3], [1, 1, 4]);
}

/// No silence is observed through TCP: requests are executed as they come, and nothing after a byte run that is not a frame
/// until the stall.
#[test]
fn through_tcp_nothing_behind_garbage_is_carried_out() {
    let reply = |data: &[u16]| bytes(None, 2, Reply::HoldingRegisters(data.into()));
    let config = ServerConfig::rtu_over_tcp(1);
    let other = reply(&[vec![7], words(&write(1)), vec![7; 3]].concat());
    for piece in [1, 5, 400] {
        let mut line = Line::with(config, 19_200);
        let stream = [other.clone(), write(2), other.clone(), write(1)].concat();
        stream.chunks(piece).for_each(|piece| line.lump(piece));
        assert_eq!(transmitted(&mut line.server, line.now), [write(1)]);
        assert_eq!(line.written(), [(10, 0x0BAD)]);
        let stream = [&other[1..], &write(1)].concat().repeat(50);
        stream.chunks(piece).for_each(|piece| line.lump(piece));
        assert_eq!(line.silence(), [] as [Vec<u8>; 0]);
        line.is_served();
        // The rest of a frame comes after any stall, and begins with data that looks like a request.
        let values = [vec![7], words(&write(1)), vec![7]].concat();
        let whole = bytes(None, 1, Request::WriteRegisters { address: 20, values: (&values[..]).into() });
        line.lump(&whole[..9]);
        assert_eq!(line.silence(), [] as [Vec<u8>; 0]);
        line.pause(5000 * MS);
        line.lump(&whole[9..]);
        assert_eq!(transmitted(&mut line.server, line.now).len(), 1);
        assert_eq!(line.written().len(), 6);
        let events: Vec<_> = core::iter::from_fn(|| line.server.poll_event()).collect();
        let corrupt = |event: &&ServerEvent| matches!(event, ServerEvent::Corrupt(DecodeError::Crc { .. }));
        assert_eq!(events.iter().filter(corrupt).count(), 1, "{events:?}");
    }
}

#[test]
fn behind_garbage_on_a_line_without_a_silence_nothing_is_a_request() {
    let mut line = Line::new(19_200);
    line.lump(&[&[0xFF; 1024][..], &write(1).repeat(300)].concat());
    assert_eq!(line.silence(), [] as [Vec<u8>; 0]);
    let statistics = line.server.statistics();
    assert_eq!((statistics.served, statistics.refused, statistics.corrupt), (0, 0, 1));
    line.is_served();
}
