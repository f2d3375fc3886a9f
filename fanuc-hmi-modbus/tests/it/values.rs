//! Values wider than a register over the handle.
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::net::Ipv4Addr;

use crate::common::Bank;
use fanuc_hmi_modbus::robot_session::tokio::{Tcp, serve};
use fanuc_hmi_modbus::tokio::{Client, Error, client};
use fanuc_hmi_modbus::typed::{Kind, Multiply, Number};
use fanuc_hmi_modbus::{ClientConfig, Server, ServerConfig, TelemetryBlock, WordOrder, text};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpListener;

/// Creates a client of the server with this listener.
fn to(listener: &TcpListener) -> Client {
    let address = listener.local_addr().unwrap();
    let (client, task) = client(ClientConfig::tcp(), Tcp::new(address.to_string())).unwrap();
    tokio::spawn(task.run());
    client
}

/// The bytes are those of pymodbus 3.16's answers with the registers of its own FLOAT32, INT32, INT16 and STRING, low word
/// first.
#[tokio::test]
async fn numbers_and_texts_are_read_by_their_assignment() {
    let exchanges: [(&[u8], &[u8]); 6] = [
        (b"\x00\x00\x00\x02", b"\x00\x07\x01\x03\x04\x00\x00\xC1\x48"),
        (b"\x00\x02\x00\x02", b"\x00\x07\x01\x03\x04\xFB\x2E\xFF\xFF"),
        (b"\x00\x04\x00\x01", b"\x00\x05\x01\x03\x02\xFF\x06"),
        (b"\x00\x05\x00\x08", b"\x00\x13\x01\x03\x10PART 7/A\0\0\0\0\0\0\0\0"),
        (b"\x00\x05\x00\x03", b"\x00\x09\x01\x03\x06PART 7"),
        (b"\x00\x05\x00\x02", b"\x00\x07\x01\x03\x04M\xDCL\0"),
    ];
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
    let robot = to(&listener);
    tokio::spawn(async move {
        let (mut socket, _) = listener.accept().await.unwrap();
        for (asked, answer) in exchanges {
            let mut request = [0; 12];
            socket.read_exact(&mut request).await.unwrap();
            assert_eq!(request[7], 3);
            assert_eq!(&request[8..], asked);
            socket.write_all(&[&request[..4], answer].concat()).await.unwrap();
        }
    });
    let number = |kind, multiply| Number { kind, multiply, order: WordOrder::LowFirst };
    let hundredths = Multiply::Scale(100.0);
    assert_eq!(robot.read_number(0, number(Kind::Float32, Multiply::Real)).await.unwrap(), -12.5);
    assert_eq!(robot.read_number(2, number(Kind::Int32, hundredths)).await.unwrap(), -12.34);
    assert_eq!(robot.read_number(4, number(Kind::Int16, hundredths)).await.unwrap(), -2.5);
    assert_eq!(robot.read_text(5..13).await.unwrap(), "PART 7/A");
    assert_eq!(robot.read_text(5..8).await.unwrap(), "PART 7", "without a NUL");
    assert_eq!(robot.read_text(5..=6).await.unwrap(), "MÜL", "bytes that are not UTF-8");
}

#[tokio::test]
async fn numbers_and_texts_are_written_as_they_are_read() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
    let robot = to(&listener);
    let session = |_| Server::<_>::new(ServerConfig::tcp(), Bank::new()).unwrap();
    tokio::spawn(serve(listener, 8, session, |_, _, _| {}));
    robot.write_registers(0, &[7; 12]).await.unwrap();
    let number = |kind, multiply| Number { kind, multiply, order: WordOrder::LowFirst };
    let (real, hundredths) = (number(Kind::Float32, Multiply::Real), Multiply::Scale(100.0));
    robot.write_number(0, real, -12.5).await.unwrap();
    robot.write_number(2, number(Kind::Int32, hundredths), -12.34).await.unwrap();
    robot.write_number(4, number(Kind::Int16, hundredths), -2.5).await.unwrap();
    robot.write_text(6..10, "PART 7").await.unwrap();
    let held = robot.read_holding_registers(0..12).await.unwrap();
    assert_eq!(held[..6], [0, 0xC148, 0xFB2E, 0xFFFF, 0xFF06, 7], "a number of one register writes one");
    assert_eq!(held[6..], [0x5041, 0x5254, 0x2037, 0, 7, 7], "the string's other registers are cleared");
    assert_eq!(robot.read_number(2, number(Kind::Int32, hundredths)).await.unwrap(), -12.34);
    assert_eq!(robot.read_text(6..10).await.unwrap(), "PART 7");

    let large = robot.write_number(4, number(Kind::Int16, hundredths), 400.0).await.unwrap_err();
    assert!(matches!(large, Error::Number(_)) && !large.is_unknown());
    assert_eq!(large.to_string(), "400 does not fit: the registers hold -32768 to 32767 after the multiply");
    let long = robot.write_text(6..8, "PART 7").await.unwrap_err();
    assert!(matches!(long, Error::Text(_)) && !long.is_unknown(), "{long}");
    assert_eq!(robot.read_holding_registers(0..12).await.unwrap(), held, "nothing was sent");
}

#[tokio::test]
async fn the_telemetry_block_and_strings_are_read_at_any_address() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
    let robot = to(&listener);
    let session = |_| Server::<_>::new(ServerConfig::tcp(), Bank::new()).unwrap();
    tokio::spawn(serve(listener, 8, session, |_, _, _| {}));
    let block = TelemetryBlock { life_counter: 70_000, override_percent: 30, ..TelemetryBlock::default() };
    robot.write_registers(60, &block.to_registers(WordOrder::LowFirst)).await.unwrap();
    assert_eq!(robot.read_telemetry(60, WordOrder::LowFirst).await.unwrap(), block);
    let mut registers = [0; text::REGISTERS];
    text::write(b"A string register", &mut registers).unwrap();
    robot.write_registers(20, &registers).await.unwrap();
    assert_eq!(robot.read_text(20..20 + text::QUANTITY).await.unwrap(), "A string register");
}
