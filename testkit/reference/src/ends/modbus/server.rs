//! The server, with 100 of everything.

use anyhow::{Result, bail};
use fanuc_hmi_modbus::{
    Bits, BitsMut, Exception, Framing, Registers, Server, ServerConfig, ServerEvent, Words, WordsMut,
};
use robot_session::End as _;
use serde_json::{Map, Value};
use testkit::links::fanuc_hmi_modbus::rows;

use super::{Transport, places};
use crate::ends::{About, End, Fields, Maker, Noted, event, names, show, unexpected, without};

pub(in crate::ends) const MAKER: Maker = Maker { make, rules: names::<fanuc_hmi_modbus::server::Rule> };

fn make(config: &Map<String, Value>, rule: Option<usize>) -> Result<Box<dyn End>> {
    let mut fields = Fields(config.clone());
    let transport = Transport::take(&mut fields)?;
    let mut made = match transport.framing()? {
        Framing::Tcp => ServerConfig::tcp(),
        Framing::Rtu { .. } => ServerConfig::rtu(1, transport.baud),
        Framing::RtuOverTcp { .. } => ServerConfig::rtu_over_tcp(1),
    };
    made.framing = transport.framing()?;
    fields.take("unit", &mut made.unit)?;
    fields.take("broadcast", &mut made.broadcast)?;
    let places = places(&mut fields)?;
    fields.end()?;
    made.rules = without(rule);
    match made.framing {
        Framing::Tcp => boxed::<rows::Tcp>(made, places),
        Framing::Rtu { .. } => boxed::<rows::Rtu>(made, places),
        Framing::RtuOverTcp { .. } => boxed::<rows::RtuOverTcp>(made, places),
    }
}

fn boxed<T: rows::Transport + 'static>(config: ServerConfig, places: usize) -> Result<Box<dyn End>> {
    Ok(match places {
        2 => Noted::<ModbusServer<T, 2>>::boxed(Server::new(config, Tables::new())?),
        8 => Noted::<ModbusServer<T, 8>>::boxed(Server::new(config, Tables::new())?),
        _ => bail!("a server of the stories has 2 or 8 places"),
    })
}

struct ModbusServer<T, const N: usize>(core::marker::PhantomData<T>);

impl<T: rows::Transport + 'static, const N: usize> About for ModbusServer<T, N> {
    type End = Server<Tables, N>;
    type Rows = rows::Server<T, N>;

    fn state(server: &Server<Tables, N>) -> String {
        rows::server_state(&server.core().machine)
    }

    fn event(_: &Server<Tables, N>, happened: ServerEvent) -> Result<String> {
        Ok(match happened {
            ServerEvent::Served { transaction, unit, function, exception } => event("served")
                .optional("transaction", transaction.as_ref())?
                .raw("unit", unit)
                .raw("function", function)
                .optional("exception", exception.as_ref())?
                .end(),
            ServerEvent::Refused { unit, function } => {
                event("refused").raw("unit", unit).raw("function", function).end()
            }
            ServerEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            ServerEvent::OutOfStep(error) => event("out_of_step").raw("error", show(&error)).end(),
            ServerEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }
}

/// What reference/README.md says that a server of the stories holds.
#[derive(Clone)]
struct Tables {
    coils: [bool; 100],
    holding: [u16; 100],
}

impl Tables {
    fn new() -> Self {
        Self {
            coils: core::array::from_fn(|address| address % 3 == 0),
            holding: core::array::from_fn(|address| u16::try_from(7 * address).unwrap_or_default()),
        }
    }
}

/// The items of a request, if the table has all of them.
fn items<T>(table: &mut [T], address: u16, count: usize) -> Result<&mut [T], Exception> {
    let first = usize::from(address);
    table.get_mut(first..first + count).ok_or(Exception::IllegalDataAddress)
}

impl Registers for Tables {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        let bits = items(&mut self.coils, address, out.len())?;
        bits.iter().enumerate().for_each(|(index, bit)| out.set(index, *bit));
        Ok(())
    }

    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        let bits = items(&mut self.coils, address, out.len())?;
        bits.iter().enumerate().for_each(|(index, bit)| out.set(index, !*bit));
        Ok(())
    }

    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.copy_from(items(&mut self.holding, address, out.len())?);
        Ok(())
    }

    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        values.copy_to(items(&mut self.coils, address, values.len())?);
        Ok(())
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        values.copy_to(items(&mut self.holding, address, values.len())?);
        Ok(())
    }

    fn other(&mut self, function: u8, data: &[u8], out: &mut [u8]) -> Result<usize, Exception> {
        match function {
            65 => {
                out.iter_mut().zip(data).for_each(|(to, from)| *to = *from);
                Ok(data.len())
            }
            66 => Ok(out.len() + 1),
            67 => Err(Exception::ServerDeviceBusy),
            _ => Err(Exception::IllegalFunction),
        }
    }
}
