//! The FANUC controller, whose numbers change.

use fanuc_hmi_modbus::{
    Exception, Registers, Rtu, Server, ServerConfig, TelemetryBlock, WordOrder, WordsMut,
};
use static_cell::StaticCell;

use super::{Caller, Peer};

struct Robot {
    life: i32,
}

impl Registers for Robot {
    fn read_holding_registers(&mut self, _: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.life += 1;
        let block = TelemetryBlock { life_counter: self.life as _, ..TelemetryBlock::default() };
        out.copy_from(&block.to_registers(WordOrder::LowFirst));
        Ok(())
    }
}

type Session = Server<Robot, 1>;
static PEER: StaticCell<Caller<Session>> = StaticCell::new();

pub(crate) fn start() -> &'static mut dyn Peer {
    let Ok(server) = Session::new(ServerConfig::rtu(1, 9_600), Robot { life: 0 }) else { panic!("it works") };
    PEER.init(Caller::new(server, |_, _| None))
}
