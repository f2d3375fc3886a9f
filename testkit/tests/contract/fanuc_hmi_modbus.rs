use core::time::Duration;

use fanuc_hmi_modbus::{
    ClientConfig, ClientEvent, Exception, Registers, Request, ServerConfig, ServerEvent, WordsMut,
};
use testkit::contract::End;
use testkit::rng::Rng;

const LINK: &str = "fanuc-hmi-modbus";
const BAUD: u32 = 19_200;

pub struct Client<const RTU: bool>;

impl<const RTU: bool> End for Client<RTU> {
    type Session = fanuc_hmi_modbus::Client<2>;
    const NAME: &'static str = if RTU { "modbus client, RTU" } else { "modbus client, TCP" };

    fn new(endless: bool) -> Self::Session {
        let config =
            if RTU { ClientConfig::rtu(BAUD) } else { ClientConfig { in_flight: 2, ..ClientConfig::tcp() } };
        let long = ClientConfig {
            timeout: Duration::MAX,
            turnaround: Duration::MAX,
            settle: Duration::MAX,
            ..config
        };
        fanuc_hmi_modbus::Client::new(if endless { long } else { config }).unwrap()
    }

    fn request(client: &mut Self::Session, _: Duration, rng: &mut Rng) {
        let request = Request::ReadHoldingRegisters { address: 0, quantity: 1 + rng.below(40) as u16 };
        // Too many in flight: nothing changes then.
        let _ = client.request(rng.below(3) as u8, &request);
    }

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame(LINK, Some("server"), rng)
    }

    fn is_provisional(event: &ClientEvent) -> bool {
        matches!(event, ClientEvent::OutOfStep(_))
    }
}

/// Holds a hundred numbers.
#[derive(Debug)]
pub struct Numbers([u16; 100]);

impl Registers for Numbers {
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let first = usize::from(address);
        out.copy_from(self.0.get(first..first + out.len()).ok_or(Exception::IllegalDataAddress)?);
        Ok(())
    }
}

pub struct Server<const RTU: bool>;

impl<const RTU: bool> End for Server<RTU> {
    type Session = fanuc_hmi_modbus::Server<Numbers>;
    const NAME: &'static str = if RTU { "modbus server, RTU" } else { "modbus server, TCP" };

    fn new(_: bool) -> Self::Session {
        let config = if RTU { ServerConfig::rtu(1, BAUD) } else { ServerConfig::tcp() };
        fanuc_hmi_modbus::Server::new(config, Numbers([7; 100])).unwrap()
    }

    fn request(_: &mut Self::Session, _: Duration, _: &mut Rng) {}

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame(LINK, Some("client"), rng)
    }

    fn is_provisional(event: &ServerEvent) -> bool {
        matches!(event, ServerEvent::OutOfStep(_))
    }
}
