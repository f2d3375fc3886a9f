//! A client that writes and reads registers, one request after the other.

use fanuc_hmi_modbus::{Client, ClientConfig, Request, Words};
use static_cell::StaticCell;

use super::{Caller, Peer};

type Session = Client<1>;
static PEER: StaticCell<Caller<Session>> = StaticCell::new();

pub(crate) fn start() -> &'static mut dyn Peer {
    let Ok(client) = Session::new(ClientConfig::rtu(9_600)) else { panic!("it works") };
    PEER.init(Caller::new(client, |client, now| {
        let values = [now.subsec_micros() as u16; 40];
        let quantity = now.subsec_micros() as u16 % 40 + 1;
        let request = match quantity % 4 {
            0 => Request::WriteRegister { address: quantity, value: quantity },
            1 => {
                Request::WriteRegisters { address: 10, values: Words::from(&values[..usize::from(quantity)]) }
            }
            2 => Request::ReadHoldingRegisters { address: 40, quantity }, // most are beyond the table
            _ => Request::ReadHoldingRegisters { address: 10, quantity },
        };
        // Refused while the previous request has no outcome.
        let _ = client.request(1, &request);
        None
    }))
}
