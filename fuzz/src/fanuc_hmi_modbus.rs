//! Modbus: the stream decoder over both framings and from both sides, and both sessions on any transport at any time.

use core::time::Duration;
use std::collections::BTreeSet;

use arbitrary::Unstructured;
use fanuc_hmi_modbus::assignment::{self, Slots};
use fanuc_hmi_modbus::{
    Bits, BitsMut, Client, ClientConfig, ClientEvent, Decoder, Exception, Frame, Framing, Pdu, PduBuf,
    Registers, Reply, Request, Server, ServerConfig, ServerStatistics, Side, Signal, Table, Ticket, Words,
    WordsMut, limit,
};
use robot_session::{Encode as _, Session};

use crate::{codecs, step, written};

/// Two bytes choose which framing and side, and how long the reads are; the rest is the stream.
pub fn fanuc_hmi_modbus_decoder(data: &[u8]) {
    let [settings, size, stream @ ..] = data else { return };
    codecs::decoder(&Sent::new(*settings), stream, *size);
}

/// What one side sends in one framing.
pub(crate) struct Sent {
    framing: Framing,
    side: Side,
}

impl Sent {
    pub(crate) fn new(settings: u8) -> Self {
        Self {
            framing: if settings & 1 == 0 { Framing::Tcp } else { Framing::RTU_OVER_TCP },
            side: if settings & 2 == 0 { Side::Client } else { Side::Server },
        }
    }
}

impl codecs::Side for Sent {
    type Decoder = Decoder;
    type Frame = Frame<PduBuf>;

    fn decoder(&self) -> Decoder {
        Decoder::new(self.framing, self.side)
    }

    fn keep(&self, frame: Frame<&[u8]>) -> Frame<PduBuf> {
        frame.to_buf().unwrap()
    }

    fn check(&self, kept: &Frame<PduBuf>, _: &[u8], bytes: &[u8]) {
        let frame = match self.framing {
            Framing::Tcp => {
                let (frame, used) = Frame::decode_tcp(bytes).unwrap().unwrap();
                assert_eq!(used, bytes.len());
                frame
            }
            _ => Frame::decode_rtu_whole(bytes).unwrap(),
        };
        assert_eq!(frame.to_buf().unwrap(), *kept);
        assert_eq!(encoded(&frame), bytes, "an accepted frame encodes to its bytes");
        messages(frame.pdu);
    }

    fn good(&self, _: usize) -> (Frame<PduBuf>, Vec<u8>) {
        let transaction = matches!(self.framing, Framing::Tcp).then_some(1);
        let good = Frame { transaction, unit: 1, pdu: &[6, 0, 1, 2, 3][..] };
        (good.to_buf().unwrap(), encoded(&good))
    }
}

/// What a PDU holds encodes to its bytes again, but for the unused bits of a request; a server answers it with a reply that a
/// client takes.
fn messages(pdu: &[u8]) {
    let mut out = [0; limit::PDU];
    if let Ok(reply) = Reply::decode(pdu)
        && let Ok(len) = reply.encode(&mut out)
    {
        assert_eq!(&out[..len], pdu);
        assert_eq!(len, reply.encoded_len());
    }
    let request = Request::decode(pdu);
    if let Ok(request) = request
        && let Ok(len) = request.encode(&mut out)
    {
        assert_eq!((len, Request::decode(&out[..len])), (pdu.len(), Ok(request)));
    }
    let mut out = [0; limit::PDU];
    let len = fanuc_hmi_modbus::serve(pdu, &mut Bank, &mut out);
    if let Ok(request) = request {
        let reply = Reply::decode(&out[..len]).expect("a server's reply is one");
        assert_eq!(reply.answers(&request), Ok(()));
    }
}

/// Requests and replies of any values: what can be written is read back the same, in both framings.
pub fn fanuc_hmi_modbus_message(data: &[u8]) {
    let mut input = Unstructured::new(data);
    let Ok((kind, address, quantity, a, b)) = input.arbitrary::<(u8, u16, u16, u16, u16)>() else { return };
    let Ok((bits, words, data)) = input.arbitrary::<(Vec<bool>, Vec<u16>, Vec<u8>)>() else { return };
    let (bits, words, value) = (Bits::from(&bits[..]), Words::from(&words[..]), a & 1 == 1);
    let request = match kind {
        0 => Request::ReadCoils { address, quantity },
        1 => Request::ReadDiscreteInputs { address, quantity },
        2 => Request::ReadHoldingRegisters { address, quantity },
        3 => Request::ReadInputRegisters { address, quantity },
        4 => Request::WriteCoil { address, value },
        5 => Request::WriteRegister { address, value: a },
        6 => Request::WriteCoils { address, values: bits },
        7 => Request::WriteRegisters { address, values: words },
        8 => Request::MaskWriteRegister { address, and: a, or: b },
        9 => Request::ReadWriteRegisters { address, quantity, write_address: a, values: words },
        function => Request::Other { function, data: &data },
    };
    if let Ok(pdu) = written(request.encoded_len(), |out| request.encode(out)) {
        assert_eq!(Request::decode(&pdu), Ok(request));
        framed(&pdu, Side::Client, a);
    }
    let reply = match kind {
        0 => Reply::Coils(bits),
        1 => Reply::DiscreteInputs(bits),
        2 => Reply::HoldingRegisters(words),
        3 => Reply::InputRegisters(words),
        4 => Reply::WriteCoil { address, value },
        5 => Reply::WriteRegister { address, value: a },
        6 => Reply::WriteCoils { address, quantity },
        7 => Reply::WriteRegisters { address, quantity },
        8 => Reply::MaskWriteRegister { address, and: a, or: b },
        9 => Reply::ReadWriteRegisters(words),
        function @ 0x80.. => {
            Reply::Exception { function: function & 0x7F, exception: Exception::from(data.len() as u8) }
        }
        function => Reply::Other { function, data: &data },
    };
    if let Ok(pdu) = written(reply.encoded_len(), |out| reply.encode(out)) {
        match (Reply::decode(&pdu), reply) {
            // The reply does not show how many of the last byte's bits were asked for: those are 0.
            (Ok(Reply::Coils(read)), Reply::Coils(bits))
            | (Ok(Reply::DiscreteInputs(read)), Reply::DiscreteInputs(bits)) => {
                assert_eq!(read.truncated(bits.len()), bits);
                assert!(read.iter().skip(bits.len()).all(|bit| !bit));
            }
            (read, reply) => assert_eq!(read, Ok(reply)),
        }
        framed(&pdu, Side::Server, a);
    }
}

/// A PDU in its frames: read whole, and of less of it nothing is read.
fn framed(pdu: &[u8], side: Side, transaction: u16) {
    let unit = pdu[0];
    for transaction in [Some(transaction), None] {
        let frame = Frame { transaction, unit, pdu };
        let bytes = encoded(&frame);
        let framing = if transaction.is_some() { Framing::Tcp } else { Framing::RTU_OVER_TCP };
        let kept = frame.to_buf().unwrap();
        assert_eq!(codecs::items(&Sent { framing, side }, &bytes, 5), [(Ok(kept), bytes.len())]);
        for cut in 0..bytes.len() {
            let part = match framing {
                Framing::Tcp => Frame::decode_tcp(&bytes[..cut]),
                _ => Frame::decode_rtu(&bytes[..cut], side),
            };
            assert_eq!(part, Ok(None), "{cut} of {bytes:02X?}");
        }
    }
}

/// A listing of assignments, and the place of every signal: what a slot prints is read back the same.
pub fn fanuc_hmi_modbus_assignment(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let slots = match Slots::parse(&text) {
        Ok(slots) => slots,
        Err(error) => return assert!((1..=text.lines().count()).contains(&error.line)),
    };
    let used: Vec<_> = slots.used().collect();
    for (slot, found) in &used {
        assert!((1..=80).contains(slot));
        if found.check().is_err() {
            continue;
        }
        let mut printed = String::new();
        found.print(*slot, &mut printed).unwrap();
        let again = Slots::parse(&printed).unwrap();
        let (_, read) = again.used().next().unwrap();
        assert_eq!((read.address, read.size, read.var_name), (found.address, found.size, found.var_name));
        let (a, b) = (read.multiply.value(), found.multiply.value());
        assert!((a - b).abs() <= 1e-6 * b.abs(), "six decimals are printed: {a} for {b}");
    }
    let all: Vec<_> = used.iter().map(|(_, found)| **found).collect();
    if assignment::check(&all).is_ok() {
        let taken: usize = all.iter().map(|found| found.pdu_range().len()).sum();
        assert!(taken <= 16_384, "no two overlap");
    }
    for address in data.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])) {
        for table in [Table::Coils, Table::DiscreteInputs, Table::InputRegisters, Table::HoldingRegisters] {
            if let Some(signal) = Signal::at(table, address) {
                assert_eq!(signal.place(), Some((table, address)));
            }
        }
    }
}

/// Steps of an action, a pause in milliseconds, a length, and so many bytes from the server.
pub fn fanuc_hmi_modbus_client(data: &[u8]) {
    let Some((settings, mut data)) = data.split_first() else { return };
    let mut config = match settings & 3 {
        0 | 1 => ClientConfig::tcp(),
        2 => ClientConfig::rtu(19_200),
        _ => ClientConfig::rtu_over_tcp(),
    };
    if settings & 2 == 0 {
        config.in_flight = usize::from(settings >> 2 & 3) + 1;
    }
    config.any_unit = settings & 0x20 != 0;
    config.broadcast = settings & 0x40 != 0;
    let mut client = Client::<4>::new(config).expect("a good configuration");
    let (mut now, mut open, mut out) = (Duration::ZERO, BTreeSet::<Ticket>::new(), [0; 260]);
    client.handle_connected(now);
    while let Some(([action, pause, _], bytes)) = step(&mut data) {
        now += Duration::from_millis(pause.into());
        match action & 7 {
            0 | 1 => {
                if let Ok(request) = Request::decode(bytes)
                    && let Ok(ticket) = client.request(action >> 3, &request)
                {
                    assert!(open.insert(ticket), "a ticket is given once");
                    assert!(open.len() <= 4, "there are four places");
                }
            }
            2 => {
                client.handle_disconnected(now);
                client.handle_connected(now);
            }
            3 => client.handle_timeout(now),
            _ => client.handle_input(now, bytes),
        }
        drain(&mut client, &mut open);
        while let Some(len) = client.poll_transmit(now, &mut out) {
            assert!(len <= out.len());
        }
        assert!(client.in_flight() <= config.in_flight);
    }
    // Whatever is still open ends when its time is over.
    for _ in 0..60 {
        while client.poll_transmit(now, &mut out).is_some() {}
        now += Duration::from_secs(2);
        client.handle_timeout(now);
        drain(&mut client, &mut open);
    }
    assert!(open.is_empty(), "{open:?} never ended");
    assert_eq!(client.statistics().unexpected, 0);
}

fn drain(client: &mut Client<4>, open: &mut BTreeSet<Ticket>) {
    while let Some(event) = client.poll_event() {
        if let Some(ticket) = event.outcome_of() {
            assert!(open.remove(&ticket), "{ticket:?} ended twice");
            assert_eq!(client.reply(ticket).is_some(), matches!(event, ClientEvent::Replied { .. }));
        }
    }
}

/// Steps of a pause in milliseconds (after an odd one replies stay), a length, and so many bytes from the client.
pub fn fanuc_hmi_modbus_server(data: &[u8]) {
    let Some((settings, mut data)) = data.split_first() else { return };
    let config = match settings & 3 {
        0 | 1 => ServerConfig::tcp(),
        2 => ServerConfig::rtu(1, 19_200),
        _ => ServerConfig::rtu_over_tcp(1),
    };
    let mut server = Server::<_, 8>::new(config, Bank).expect("a good configuration");
    let (mut now, mut out, mut replies) = (Duration::ZERO, [0; Frame::MAX_LEN], 0);
    server.handle_connected(now);
    while let Some(([pause, _], bytes)) = step(&mut data) {
        now += Duration::from_millis(pause.into());
        server.handle_input(now, bytes);
        while !server.wants_input() || pause % 2 == 0 || data.len() < 2 {
            while let Some(len) = server.poll_transmit(now, &mut out) {
                replies += 1;
                let frame = match config.framing {
                    Framing::Tcp => {
                        let (frame, used) = Frame::decode_tcp(&out[..len]).unwrap().unwrap();
                        assert_eq!(used, len);
                        frame
                    }
                    _ => Frame::decode_rtu_whole(&out[..len]).unwrap(),
                };
                assert!(config.unit.is_none_or(|unit| unit == frame.unit), "it answers for another unit");
            }
            assert!(core::iter::from_fn(|| server.poll_event()).count() <= 8, "the queue is bounded");
            let Some(at) = server.poll_timeout() else { break };
            server.handle_timeout(at);
            now = now.max(at);
        }
    }
    let ServerStatistics { served, refused, unexpected, .. } = server.statistics();
    assert_eq!(unexpected, 0);
    match config.framing {
        Framing::Tcp => assert_eq!((served, refused), (replies, 0), "every request is answered"),
        Framing::RtuOverTcp { .. } => assert!(served >= replies && refused == 0),
        Framing::Rtu { .. } => assert!(served >= replies),
    }
}

/// Every table at every address: a register holds its address.
struct Bank;

impl Registers for Bank {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        out.fill_with(|i| (usize::from(address) + i) % 2 == 0);
        Ok(())
    }
    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        self.read_coils(address, out)
    }
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.fill_with(|i| u16::try_from(usize::from(address) + i).expect("within the table"));
        Ok(())
    }
    fn read_input_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.read_holding_registers(address, out)
    }
    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        assert!(usize::from(address) + values.iter().count() <= 65_536);
        Ok(())
    }
    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        assert!(usize::from(address) + values.iter().count() <= 65_536);
        Ok(())
    }
    fn other(&mut self, _: u8, data: &[u8], out: &mut [u8]) -> Result<usize, Exception> {
        out.get_mut(..data.len()).ok_or(Exception::ServerDeviceFailure)?.copy_from_slice(data);
        Ok(data.len())
    }
}

fn encoded(frame: &Frame<&[u8]>) -> Vec<u8> {
    let mut out = [0; Frame::MAX_LEN];
    let len = frame.encode(&mut out).unwrap();
    assert_eq!(len, frame.encoded_len());
    assert_eq!(PduBuf::new(&frame.pdu).unwrap().as_bytes(), frame.pdu);
    out[..len].to_vec()
}

/// Blocks of telemetry, 37 registers each, and speeds for DPM: whatever the registers hold, orientations are unit
/// quaternions that follow one another, and no offset passes a limit.
pub fn fanuc_hmi_modbus_motion(data: &[u8]) {
    use cellwire_motion::dpm::{Axis, Config, Modifier};
    use cellwire_motion::{Observation, Quaternion, Tracker};
    use fanuc_hmi_modbus::{TelemetryBlock, WordOrder};

    let axis = Some(Axis::new(0.001));
    let mut modifier = Modifier::new(Config::new([axis; 6])).unwrap();
    let (mut tracker, mut before, mut now) = (Tracker::new(), None::<Quaternion>, Duration::ZERO);
    let (mut samples, mut path) = (0, [0i64; 6]);
    for bytes in data.chunks_exact(74) {
        let mut registers = [0u16; 37];
        for (register, word) in registers.iter_mut().zip(bytes.chunks_exact(2)) {
            *register = u16::from_be_bytes([word[0], word[1]]);
        }
        let block = TelemetryBlock::from_registers(&registers, WordOrder::LowFirst);
        match tracker.push(&block) {
            Observation::Sample(sample) => {
                samples += 1;
                let [w, x, y, z] = sample.orientation.to_array();
                assert!((w * w + x * x + y * y + z * z - 1.0).abs() < 1e-9);
                if let Some(before) = before.replace(sample.orientation) {
                    assert_eq!(sample.orientation.near(before), sample.orientation, "no jump of the sign");
                }
            }
            Observation::Repeated => {}
            _ => before = None,
        }
        now += Duration::from_millis((block.life_counter % 32).into());
        let [x, y, z] = block.velocity.map(f64::from);
        let [w, p, r] = block.position.map(f64::from);
        let refused = modifier.demand(now, [x, y, z, w, p, r]).is_err();
        assert_eq!(refused, ![x, y, z, w, p, r].iter().all(|speed| speed.is_finite()));
        let offsets = modifier.next_period(now);
        for (path, count) in path.iter_mut().zip(offsets.counts) {
            *path += i64::from(count);
            assert!(count.abs() <= 200 && path.abs() <= 10_000 && !(offsets.lost && count != 0));
        }
    }
    assert_eq!(tracker.counts().samples, samples);
}
