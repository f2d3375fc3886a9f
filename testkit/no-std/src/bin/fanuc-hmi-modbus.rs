//! The telemetry block through both ends, and an RTU frame through its decoder.
#![no_std]
#![no_main]

use core::time::Duration;

use fanuc_hmi_modbus::robot_session::{Decoder as _, Session as _};
use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, Decoder, Exception, Framing, Registers, Reply, Server, ServerConfig,
    Side, Signal, Table, TelemetryBlock, WordOrder, WordsMut,
};
use no_std as _;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(exchange() != Some(100_000) || rtu() != Some(1) || signal() != Some(Signal::Ri(3)))
}

struct Robot;

impl Registers for Robot {
    fn read_holding_registers(&mut self, _: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let block = TelemetryBlock { life_counter: 100_000, ..TelemetryBlock::default() };
        out.copy_from(&block.to_registers(WordOrder::LowFirst));
        Ok(())
    }
}

fn exchange() -> Option<u32> {
    let mut client = Client::<1>::new(ClientConfig::tcp()).ok()?;
    let mut server = Server::<_, 1>::new(ServerConfig::tcp(), Robot).ok()?;
    let (now, mut buf) = (Duration::ZERO, [0; 260]);
    client.handle_connected(now);
    server.handle_connected(now);
    client.request(1, &TelemetryBlock::request()).ok()?;
    let n = client.poll_transmit(now, &mut buf)?;
    server.handle_input(now, buf.get(..n)?);
    let n = server.poll_transmit(now, &mut buf)?;
    client.handle_input(now, buf.get(..n)?);
    let ClientEvent::Replied { ticket, .. } = client.poll_event()? else { return None };
    match client.reply(ticket)? {
        Reply::HoldingRegisters(words) => {
            Some(TelemetryBlock::from_words(&words, WordOrder::LowFirst)?.life_counter)
        }
        _ => None,
    }
}

fn rtu() -> Option<u8> {
    let mut decoder = Decoder::new(Framing::RTU_OVER_TCP, Side::Client);
    let bytes = [0x55, 1, 3, 0, 0, 0, 37, 0x84, 0x11];
    if decoder.push(&bytes) != bytes.len() {
        return None;
    }
    decoder.finish();
    decoder.next_frame()?.err()?;
    Some(decoder.next_frame()?.ok()?.unit)
}

fn signal() -> Option<Signal> {
    let (table, address) = Signal::Ri(3).place()?;
    Signal::at(table, address).filter(|_| table == Table::DiscreteInputs)
}
