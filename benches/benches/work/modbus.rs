//! One piece of work for fanuc-hmi-modbus and for three other crates: a request for 38 holding registers, and its reply.

use std::hint::black_box;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, Exception, Frame, Registers, Reply, Request, Server, ServerConfig,
    Words, WordsMut,
};
use modbus_core::tcp as core_tcp;
use rmodbus::client::ModbusRequest;
use rmodbus::server::ModbusFrame;
use rmodbus::server::context::ModbusContext;
use rmodbus::server::storage::ModbusStorageSmall;
use robot_session::{Encode as _, Session as _};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_modbus::client::Reader;

pub(crate) const N: usize = 38;

fn words() -> [u16; N] {
    core::array::from_fn(|i| i as u16 * 257)
}

pub(crate) fn request_bytes() -> Vec<u8> {
    let pdu = Request::ReadHoldingRegisters { address: 0, quantity: N as u16 };
    let mut out = Vec::new();
    Frame { transaction: Some(1), unit: 1, pdu }.append_to(&mut out).expect("a request");
    out
}

pub(crate) fn reply_bytes() -> Vec<u8> {
    let mut out = Vec::new();
    let words = words();
    let pdu = Reply::HoldingRegisters(Words::from(&words));
    Frame { transaction: Some(1), unit: 1, pdu }.append_to(&mut out).expect("a reply");
    out
}

pub(crate) fn decode(rounds: u64) {
    let bytes = reply_bytes();
    let mut out = [0u16; N];
    for _ in 0..rounds {
        let (frame, _) = Frame::decode_tcp(black_box(&bytes)).expect("good").expect("whole");
        let Reply::HoldingRegisters(words) = frame.reply().expect("good").pdu else { panic!("other") };
        assert_eq!(words.copy_to(&mut out), N);
        black_box(&out);
    }
}

pub(crate) fn decode_modbus_core(rounds: u64) {
    let bytes = reply_bytes();
    let mut out = [0u16; N];
    for _ in 0..rounds {
        let adu = core_tcp::client::decode_response(black_box(&bytes)).expect("good").expect("whole");
        let Ok(modbus_core::Response::ReadHoldingRegisters(data)) = adu.pdu.0 else { panic!("other") };
        for (to, from) in out.iter_mut().zip(data) {
            *to = from;
        }
        black_box(&out);
    }
}

pub(crate) fn decode_rmodbus(rounds: u64) {
    let bytes = reply_bytes();
    let mut request = ModbusRequest::new_tcp_udp(1, 1);
    request.generate_get_holdings(0, N as u16, &mut Vec::new()).expect("a request");
    let mut out = Vec::with_capacity(N);
    for _ in 0..rounds {
        out.clear();
        request.parse_u16(black_box(&bytes), &mut out).expect("good");
        black_box(&out);
    }
}

pub(crate) struct Bank(pub(crate) [u16; 100]);

impl Registers for Bank {
    #[inline]
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let first = usize::from(address);
        out.copy_from(self.0.get(first..first + out.len()).ok_or(Exception::IllegalDataAddress)?);
        Ok(())
    }
}

pub(crate) fn serve(rounds: u64) {
    let (request, mut bank) = (request_bytes(), Bank([7; 100]));
    let mut out = [0; Frame::MAX_LEN];
    for _ in 0..rounds {
        let (frame, _) = Frame::decode_tcp(black_box(&request)).expect("good").expect("whole");
        let len = frame.serve(&mut bank, black_box(&mut out));
        assert_eq!(len, Some(9 + 2 * N));
        black_box(&out);
    }
}

pub(crate) fn serve_modbus_core(rounds: u64) {
    let (request, bank) = (request_bytes(), black_box([7u16; 100]));
    let (mut data, mut out) = ([0; 250], [0; 260]);
    for _ in 0..rounds {
        let adu = core_tcp::server::decode_request(black_box(&request)).expect("good").expect("whole");
        let modbus_core::Request::ReadHoldingRegisters(address, quantity) = adu.pdu.0 else {
            panic!("other")
        };
        let words = bank.get(address.into()..usize::from(address + quantity)).expect("in range");
        let data = modbus_core::Data::from_words(words, &mut data).expect("it fits");
        let pdu = modbus_core::ResponsePdu(Ok(modbus_core::Response::ReadHoldingRegisters(data)));
        let len = core_tcp::server::encode_response(core_tcp::ResponseAdu { hdr: adu.hdr, pdu }, &mut out);
        assert_eq!(len.expect("it fits"), 9 + 2 * N);
        black_box(&out);
    }
}

pub(crate) fn serve_rmodbus(rounds: u64) {
    let (request, mut bank) = (request_bytes(), ModbusStorageSmall::default());
    bank.set_holdings_bulk(0, &words()).expect("in range");
    let mut out = Vec::with_capacity(260);
    for _ in 0..rounds {
        let mut frame = ModbusFrame::new(1, black_box(&request), rmodbus::ModbusProto::TcpUdp, &mut out);
        frame.parse().expect("good");
        frame.process_read(&bank).expect("in range");
        frame.finalize_response().expect("it fits");
        assert_eq!(out.len(), 9 + 2 * N);
        black_box(&out);
    }
}

pub(crate) fn encode(rounds: u64) {
    let mut out = [0; Frame::MAX_LEN];
    for _ in 0..rounds {
        let (address, quantity) = black_box((0, N as u16));
        let pdu = Request::ReadHoldingRegisters { address, quantity };
        let frame = Frame { transaction: Some(black_box(1)), unit: 1, pdu };
        assert_eq!(frame.encode(black_box(&mut out)), Ok(12));
    }
}

pub(crate) fn encode_modbus_core(rounds: u64) {
    let mut out = [0; 260];
    for _ in 0..rounds {
        let (address, quantity) = black_box((0, N as u16));
        let hdr = core_tcp::Header { transaction_id: black_box(1), unit_id: 1 };
        let pdu = modbus_core::RequestPdu(modbus_core::Request::ReadHoldingRegisters(address, quantity));
        let len = core_tcp::client::encode_request(core_tcp::RequestAdu { hdr, pdu }, black_box(&mut out));
        assert_eq!(len.expect("it fits"), 12);
    }
}

pub(crate) fn encode_rmodbus(rounds: u64) {
    let mut out = Vec::with_capacity(260);
    for _ in 0..rounds {
        out.clear();
        let (address, quantity) = black_box((0, N as u16));
        let mut request = ModbusRequest::new_tcp_udp(1, black_box(1));
        request.generate_get_holdings(address, quantity, &mut out).expect("a request");
        assert_eq!(out.len(), 12);
        black_box(&out);
    }
}

pub(crate) fn exchange(rounds: u64) {
    let mut client = Client::<8>::new(ClientConfig::tcp()).expect("a good configuration");
    client.handle_connected(Duration::ZERO);
    let mut reply = reply_bytes();
    let (mut out, mut words) = ([0; 260], [0u16; N]);
    for _ in 0..rounds {
        let now = black_box(Duration::from_millis(1));
        let request = Request::ReadHoldingRegisters { address: 0, quantity: N as u16 };
        client.request(1, black_box(&request)).expect("a free place");
        let len = client.poll_transmit(now, &mut out).expect("a request");
        answer(&mut reply, out.get(..len));
        client.handle_input(now, black_box(&reply));
        let Some(ClientEvent::Replied { ticket, .. }) = client.poll_event() else { panic!("no reply") };
        let Some(Reply::HoldingRegisters(read)) = client.reply(ticket) else { panic!("another reply") };
        assert_eq!(read.copy_to(&mut words), N);
        black_box(&words);
        assert_eq!(client.poll_event(), None);
    }
}

/// Gives the reply the transaction of a request.
pub(crate) fn answer(reply: &mut [u8], request: Option<&[u8]>) {
    let transaction = request.and_then(<[u8]>::first_chunk::<2>);
    if let (Some(to), Some(from)) = (reply.first_chunk_mut(), transaction) {
        *to = *from;
    }
}

/// A transport whose other end replies immediately.
#[derive(Debug)]
struct AnsweringTransport {
    reply: Vec<u8>,
    read: usize,
}

impl AsyncWrite for AnsweringTransport {
    fn poll_write(mut self: Pin<&mut Self>, _: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        answer(&mut self.reply, Some(bytes));
        self.read = 0;
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

impl AsyncRead for AnsweringTransport {
    fn poll_read(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let rest = self.reply.get(self.read..).unwrap_or_default();
        if rest.is_empty() {
            return Poll::Pending;
        }
        let len = rest.len().min(buf.remaining());
        buf.put_slice(rest.get(..len).unwrap_or_default());
        self.read += len;
        Poll::Ready(Ok(()))
    }
}

pub(crate) fn exchange_tokio_modbus(rounds: u64) {
    let transport = AnsweringTransport { reply: reply_bytes(), read: usize::MAX };
    let mut client = tokio_modbus::client::tcp::attach_slave(transport, tokio_modbus::Slave(1));
    let mut words = [0u16; N];
    let mut context = Context::from_waker(Waker::noop());
    for _ in 0..rounds {
        let (address, quantity) = black_box((0, N as u16));
        let mut call = client.read_holding_registers(address, quantity);
        let Poll::Ready(read) = call.as_mut().poll(&mut context) else { panic!("not at once") };
        words.copy_from_slice(&read.expect("good").expect("no exception"));
        black_box(&words);
    }
}

pub(crate) fn server_session(rounds: u64) {
    let server = Server::new(ServerConfig::tcp(), Bank([7; 100]));
    let mut server: Server<_, 8> = server.expect("a good configuration");
    server.handle_connected(Duration::ZERO);
    let (request, mut out) = (request_bytes(), [0; Frame::MAX_LEN]);
    for _ in 0..rounds {
        let now = black_box(Duration::from_millis(1));
        server.handle_input(now, black_box(&request));
        assert!(black_box(server.poll_event()).is_some());
        assert_eq!(server.poll_transmit(now, &mut out), Some(9 + 2 * N));
        black_box(&out);
    }
}
