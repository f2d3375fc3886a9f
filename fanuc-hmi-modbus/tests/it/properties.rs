//! Properties of every message and every stream.

#![allow(clippy::cast_possible_truncation)]

use core::time::Duration;

use arbitrary::Unstructured;
use fanuc_hmi_modbus::robot_session::{Decoder as _, Encode as _};
use fanuc_hmi_modbus::{
    Bits, BitsMut, CommEvents, DecodeError, Decoder, DeviceIdentification, DeviceObjects, EncodeError,
    Exception, FileRange, FileRecord, Frame, Framing, Pdu, PduBuf, Records, Registers, Reply, Request, Side,
    WordOrder, Words, WordsMut, function, limit, serve,
};
use proptest::collection::vec;
use proptest::prelude::*;

const RTU: Framing = Framing::Rtu { silence: Duration::from_millis(2) };

/// A request without its borrows.
#[derive(Debug, Clone)]
struct Asked {
    code: u8,
    address: u16,
    other: u16,
    quantity: u16,
    bits: Vec<bool>,
    words: Vec<u16>,
    data: Vec<u8>,
}

impl Asked {
    fn request(&self) -> Request<'_> {
        let Self { code, address, other, quantity, .. } = *self;
        match code {
            1 => Request::ReadCoils { address, quantity },
            2 => Request::ReadDiscreteInputs { address, quantity },
            3 => Request::ReadHoldingRegisters { address, quantity },
            4 => Request::ReadInputRegisters { address, quantity },
            5 => Request::WriteCoil { address, value: other % 2 == 1 },
            6 => Request::WriteRegister { address, value: other },
            8 => Request::Diagnostics { subfunction: other, data: self.words.as_slice().into() },
            7 => Request::ReadExceptionStatus,
            11 => Request::GetCommEventCounter,
            12 => Request::GetCommEventLog,
            17 => Request::ReportServerId,
            20 => Request::ReadFileRecord(Records::from_wire(&self.data)),
            21 => Request::WriteFileRecord(Records::from_wire(&self.data)),
            24 => Request::ReadFifoQueue { address },
            43 => Request::ReadDeviceIdentification { category: address as u8, object: other as u8 },
            15 => Request::WriteCoils { address, values: self.bits.as_slice().into() },
            16 => Request::WriteRegisters { address, values: self.words.as_slice().into() },
            22 => Request::MaskWriteRegister { address, and: quantity, or: other },
            23 => Request::ReadWriteRegisters {
                address,
                quantity,
                write_address: other,
                values: self.words.as_slice().into(),
            },
            function => Request::Other { function, data: &self.data },
        }
    }

    fn reply(&self) -> Reply<'_> {
        let Self { code, address, other, quantity, .. } = *self;
        match code {
            1 => Reply::Coils(self.bits.as_slice().into()),
            2 => Reply::DiscreteInputs(self.bits.as_slice().into()),
            3 => Reply::HoldingRegisters(self.words.as_slice().into()),
            4 => Reply::InputRegisters(self.words.as_slice().into()),
            5 => Reply::WriteCoil { address, value: other % 2 == 1 },
            6 => Reply::WriteRegister { address, value: other },
            8 => Reply::Diagnostics { subfunction: other, data: self.words.as_slice().into() },
            7 => Reply::ExceptionStatus(other as u8),
            11 => Reply::CommEventCounter { status: address, events: other },
            12 => Reply::CommEventLog { status: address, events: other, messages: quantity, log: &self.data },
            17 => Reply::ServerId(&self.data),
            20 => Reply::FileRecords(Records::from_wire(&self.data)),
            21 => Reply::WriteFileRecord(Records::from_wire(&self.data)),
            24 => Reply::FifoQueue(self.words.as_slice().into()),
            43 => Reply::DeviceIdentification(DeviceIdentification {
                category: address as u8,
                conformity: other as u8,
                more: quantity % 2 == 1,
                next: quantity as u8,
                objects: DeviceObjects::from_wire(&self.data),
            }),
            15 => Reply::WriteCoils { address, quantity },
            16 => Reply::WriteRegisters { address, quantity },
            22 => Reply::MaskWriteRegister { address, and: quantity, or: other },
            23 => Reply::ReadWriteRegisters(self.words.as_slice().into()),
            code @ 100.. => {
                Reply::Exception { function: code - 99, exception: Exception::from(self.data.len() as u8) }
            }
            function => Reply::Other { function, data: &self.data },
        }
    }
}

/// Returns whether groups of this many registers are allowed: in addition to the registers a group has some bytes in the
/// message that has them, and some in the request.
fn groups(quantities: impl Iterator<Item = usize>, around: usize, head: usize, most: usize) -> bool {
    let quantities: Vec<usize> = quantities.collect();
    let bytes: usize = quantities.iter().map(|quantity| around + 2 * quantity).sum();
    let is_within = !quantities.is_empty() && !quantities.contains(&0) && bytes <= most;
    is_within && (around == head || head * quantities.len() <= 251)
}

/// Generates any request, even beyond the limits.
fn asked() -> impl Strategy<Value = Asked> {
    let code = prop_oneof![
        Just(1),
        Just(2),
        Just(3),
        Just(4),
        5u8..=8,
        11u8..=12,
        15u8..=17,
        20u8..=24,
        Just(43),
        1u8..=127
    ];
    let quantity = prop_oneof![1u16..=125, 0u16..=2100];
    (
        code,
        any::<u16>(),
        any::<u16>(),
        quantity,
        vec(any::<bool>(), 0..2050),
        vec(any::<u16>(), 0..130),
        vec(any::<u8>(), 0..255),
    )
        .prop_map(|(code, address, other, quantity, bits, words, data)| Asked {
            code,
            address,
            other,
            quantity,
            bits,
            words,
            data,
        })
}

/// Returns the RTU frame of a small request whose function shows its length.
fn small() -> impl Strategy<Value = Vec<u8>> {
    vec(any::<u8>(), 6..24).prop_filter_map("no such request", |bytes| {
        let request = Unstructured::new(&bytes).arbitrary::<Request<'_>>().ok()?;
        let shows_length = function::is_typed(request.function()) && ![8, 43].contains(&request.function());
        shows_length.then(|| encoded(None, 1, &request).unwrap())
    })
}

fn encoded<P: Pdu + Copy>(transaction: Option<u16>, unit: u8, pdu: &P) -> Result<Vec<u8>, EncodeError> {
    let frame = Frame { transaction, unit, pdu: *pdu };
    let mut out = [0xAA; 300];
    let len = frame.encode(&mut out)?;
    assert_eq!(len, frame.encoded_len());
    assert!(out[len..].iter().all(|byte| *byte == 0xAA), "wrote beyond its length");
    let mut exact = vec![0; len];
    assert_eq!(frame.encode(&mut exact), Ok(len));
    let space = EncodeError::Space { needed: len, available: len - 1 };
    assert_eq!(frame.encode(&mut exact[..len - 1]), Err(space));
    let mut grown = Vec::new();
    assert_eq!(frame.append_to(&mut grown), Ok(()));
    assert_eq!(grown, exact);
    Ok(out[..len].to_vec())
}

type Items = Vec<(Result<Vec<u8>, DecodeError>, u64)>;

fn decode<'a>(framing: Framing, side: Side, chunks: impl IntoIterator<Item = &'a [u8]>) -> Items {
    let (mut decoder, mut items) = (Decoder::new(framing, side), Vec::new());
    let drain = |decoder: &mut Decoder, items: &mut Items| {
        while let Some(item) = decoder.next_frame() {
            let item = item.map(|frame| frame.pdu.to_vec());
            items.push((item, decoder.position()));
        }
    };
    for mut chunk in chunks {
        while !chunk.is_empty() {
            let taken = decoder.push(chunk);
            chunk = &chunk[taken..];
            drain(&mut decoder, &mut items);
        }
    }
    decoder.finish();
    drain(&mut decoder, &mut items);
    items
}

/// Returns the stream in pieces of these lengths, repeated.
fn pieces<'a>(mut stream: &'a [u8], lengths: &[usize]) -> Vec<&'a [u8]> {
    let mut pieces = Vec::new();
    for length in lengths.iter().cycle() {
        let (piece, rest) = stream.split_at((*length).min(stream.len()));
        pieces.push(piece);
        stream = rest;
        if stream.is_empty() {
            break;
        }
    }
    pieces
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
    fn exception_status(&mut self) -> Result<u8, Exception> {
        Ok(0x6D)
    }
    fn comm_events(&mut self, log: &mut [u8]) -> Result<CommEvents, Exception> {
        Ok(CommEvents { status: 0, events: 1, messages: 2, logged: log.len() })
    }
    fn read_file(&mut self, _: u16, record: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.read_holding_registers(record, out)
    }
    fn write_file(&mut self, _: u16, record: u16, values: Words<'_>) -> Result<(), Exception> {
        self.write_registers(record, values)
    }
    fn read_fifo(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<usize, Exception> {
        assert_eq!(out.len(), 31);
        Ok(usize::from(address % 33))
    }
    fn other(&mut self, _: u8, data: &[u8], out: &mut [u8]) -> Result<usize, Exception> {
        out.get_mut(..data.len()).ok_or(Exception::ServerDeviceFailure)?.copy_from_slice(data);
        Ok(data.len())
    }
}

proptest! {
    #[test]
    fn what_is_encoded_decodes_to_the_same(asked in asked(), unit: u8, transaction: Option<u16>) {
        let request = asked.request();
        if let Ok(bytes) = encoded(transaction, unit, &request) {
            let frame = read(&bytes, transaction.is_some());
            prop_assert_eq!((frame.transaction, frame.unit), (transaction, unit));
            prop_assert_eq!(frame.request().unwrap().pdu, request);
            let kept = PduBuf::new(&request).unwrap();
            prop_assert_eq!(kept.request().unwrap(), request);
            let most = if transaction.is_some() { Frame::MAX_LEN } else { Frame::MAX_RTU_LEN };
            prop_assert!(bytes.len() <= most);
        }
        let reply = asked.reply();
        if let Ok(bytes) = encoded(transaction, unit, &reply) {
            let read = read(&bytes, transaction.is_some()).reply().unwrap().pdu;
            match (reply, read) {
                // A reply does not show how many bits of its last byte count.
                (Reply::Coils(sent), Reply::Coils(read)) | (Reply::DiscreteInputs(sent), Reply::DiscreteInputs(read)) => {
                    prop_assert_eq!(read.truncated(sent.len()), sent);
                    prop_assert!(read.iter().skip(sent.len()).all(|bit| !bit));
                }
                (sent, read) => prop_assert_eq!(sent, read),
            }
        }
    }

    #[test]
    fn exactly_what_the_specification_allows_is_encoded(asked in asked()) {
        let request = asked.request();
        let run = |quantity: usize, most: u16| {
            (1..=usize::from(most)).contains(&quantity) && usize::from(asked.address) + quantity <= 65_536
        };
        let quantity = usize::from(asked.quantity);
        let allowed = match asked.code {
            1 | 2 => run(quantity, 2000),
            3 | 4 => run(quantity, 125),
            5 | 6 | 7 | 11 | 12 | 17 | 22 | 24 | 43 => true,
            20 => groups(Records::<FileRange>::from_wire(&asked.data).iter().map(|it| it.quantity.into()), 2, 7, 245),
            21 => groups(Records::<FileRecord<'_>>::from_wire(&asked.data).iter().map(|it| it.values.len()), 7, 7, 251),
            8 => (1..=125).contains(&asked.words.len()),
            15 => run(asked.bits.len(), 1968),
            16 => run(asked.words.len(), 123),
            23 => {
                let written = asked.words.len();
                run(quantity, 125) && (1..=121).contains(&written) && usize::from(asked.other) + written <= 65_536
            }
            _ => asked.data.len() <= 252,
        };
        prop_assert_eq!(PduBuf::new(&request).is_ok(), allowed, "{:?}", request);
    }

    #[test]
    fn an_accepted_pdu_encodes_to_its_bytes(pdu in vec(any::<u8>(), 0..limit::PDU), code in prop_oneof![0u8..=30, Just(43)]) {
        let mut pdu = pdu;
        if let Some(first) = pdu.first_mut() {
            *first = code;
        }
        let mut out = [0; limit::PDU];
        if let Ok(reply) = Reply::decode(&pdu) {
            match reply.encode(&mut out) {
                Ok(len) => prop_assert_eq!(&out[..len], &pdu[..]),
                Err(EncodeError::Address { .. }) => {}
                Err(error) => prop_assert!(false, "{}", error),
            }
        }
        if let Ok(request) = Request::decode(&pdu) {
            match request.encode(&mut out) {
                Ok(_) => prop_assert_eq!(Request::decode(&out[..pdu.len()]).unwrap(), request),
                Err(EncodeError::Address { .. }) => {}
                Err(error) => prop_assert!(false, "{}", error),
            }
            let len = serve(&pdu, &mut Bank, &mut out);
            let reply = Reply::decode(&out[..len]).expect("a server's reply is one");
            prop_assert_eq!(reply.answers(&request), Ok(()));
        }
    }

    #[test]
    fn any_chunking_gives_the_same_frames(
        stream in vec(prop_oneof![3 => any::<u8>(), 2 => Just(0), 2 => 0u8..=23], 0..1500),
        lengths in vec(1usize..40, 1..8),
        server: bool,
    ) {
        let side = if server { Side::Server } else { Side::Client };
        for framing in [Framing::Tcp, RTU] {
            let whole = decode(framing, side, [&stream[..]]);
            prop_assert_eq!(&whole, &decode(framing, side, pieces(&stream, &lengths)));
            let mut last = 0;
            for (_, position) in &whole {
                prop_assert!(*position > last, "an item takes no bytes");
                last = *position;
            }
            prop_assert_eq!(last, stream.len() as u64, "the items do not cover the stream");
        }
    }

    #[test]
    fn corruption_on_a_line_costs_only_the_frames_that_it_touches(
        bytes in vec(small(), 3..7),
        at in any::<prop::sample::Index>(),
        corrupt in prop_oneof![Just(None), (1u8..=255).prop_map(Some)],
        insert in vec(any::<u8>(), 0..4),
    ) {
        let mut stream = bytes.concat();
        let at = at.index(stream.len());
        // A byte lost before its like is as well the like lost, which may be the next frame's.
        let like = stream[at..].iter().take_while(|byte| **byte == stream[at]).count();
        let last = if corrupt.is_none() { at + like - 1 } else { at };
        let ends: Vec<usize> = bytes.iter().scan(0, |end, frame| { *end += frame.len(); Some(*end) }).collect();
        let frame_at = |at: usize| ends.iter().position(|end| at < *end).unwrap();
        let (first, last) = (frame_at(at), frame_at(last));
        let whole = stream.len();
        match corrupt {
            Some(bits) => stream[at] ^= bits,
            None => drop(stream.splice(at..at + 1, insert.iter().copied())),
        }
        // One run of bytes in 65536 has by chance the CRC that it should have: nothing distinguishes that from a frame.
        let begins = |start: usize| {
            let before = start < at && (start == 0 || ends.contains(&start));
            let old = (start + whole).checked_sub(stream.len());
            before || start > at && old.is_some_and(|old| ends[..bytes.len() - 1].contains(&old))
        };
        let chance = (0..stream.len()).filter(|start| !begins(*start));
        let chance = chance.filter(|start| matches!(Frame::decode_rtu(&stream[*start..], Side::Client), Ok(Some(_))));
        prop_assume!(chance.count() == 0);

        let found: Vec<_> = decode(RTU, Side::Client, [&stream[..]]).into_iter().filter_map(|(item, _)| item.ok()).collect();
        let pdu = |frame: &Vec<u8>| frame[1..frame.len() - 2].to_vec();
        let before: Vec<_> = bytes[..first].iter().map(pdu).collect();
        let after: Vec<_> = bytes[last + 1..].iter().map(pdu).collect();
        prop_assert!(found.starts_with(&before), "{:?}", found);
        prop_assert!(found.ends_with(&after), "{:?}", found);
    }

    #[test]
    fn words_and_orders_are_inverse(bits: u32) {
        for order in [WordOrder::LowFirst, WordOrder::HighFirst] {
            prop_assert_eq!(order.join(order.split(bits)), bits);
        }
    }
}

fn read(bytes: &[u8], tcp: bool) -> Frame<&[u8]> {
    if tcp {
        let (frame, used) = Frame::decode_tcp(bytes).unwrap().unwrap();
        assert_eq!(used, bytes.len());
        for len in 0..bytes.len() {
            assert_eq!(Frame::decode_tcp(&bytes[..len]), Ok(None));
        }
        frame
    } else {
        Frame::decode_rtu_whole(bytes).unwrap()
    }
}
