//! Both ends; the server with 100 of everything.

use anyhow::{Result, bail};
use fanuc_hmi_modbus::{
    Bits, BitsMut, Client, ClientConfig, ClientEvent, CommEvents, Exception, Frame, PduBuf, Registers,
    Server, ServerConfig, Words, WordsMut, client, server,
};
use robot_session::end::Rules;
use serde::Deserialize as _;
use serde_json::{Map, Value};

use crate::end::{Act, Call, End, EndRow, Owner, PairedItem, PendingLimit, called};
use crate::given::GivenFields;
use crate::json;

pub(super) const ENDS: &[EndRow] = &[
    EndRow { make: by_places::<Client<2>, Client<8>>, ..EndRow::of::<Client<8>>() },
    EndRow { make: by_places::<Server<Tables, 2>, Server<Tables, 8>>, ..EndRow::of::<Server<Tables, 8>>() },
];

/// Creates the end with as many slots as the key `places` of its configuration gives.
fn by_places<Two: Owner, Eight: Owner>(
    config: &Map<String, Value>,
    left_out: Option<usize>,
) -> Result<Box<dyn End>> {
    let mut config = config.clone();
    match config.remove("places").map_or(Some(8), |places| places.as_u64()) {
        Some(2) => (EndRow::of::<Two>().make)(&config, left_out),
        Some(8) => (EndRow::of::<Eight>().make)(&config, left_out),
        _ => bail!("an end of the table has 2 or 8 places"),
    }
}

impl<const N: usize> Owner for Client<N> {
    type End = Self;
    type Rule = client::Rule;

    const CALLS: &'static [Call<Self>] = &[("request", |client, _, argument| {
        let Ok(frame) = Frame::<PduBuf>::deserialize(argument) else {
            return Ok(Err(r#"{"kind":"message"}"#.into()));
        };
        called(client.request(frame.unit, &frame.pdu.request()?))
    })];

    const PAIRED: &'static [PairedItem] = &[PairedItem {
        begins: Act::Call("request"),
        ends: &[Act::Event("replied"), Act::Event("failed"), Act::Event("announced")],
        room: PendingLimit::Most(N as u64),
    }];

    fn new(given: GivenFields, rules: Rules<client::Rule>) -> Result<Self> {
        Ok(Self::new(client_config(given)?.with_rules(rules))?)
    }

    fn shows(&self, event: &ClientEvent) -> Option<(&'static str, String)> {
        let ClientEvent::Replied { ticket, unit } = *event else { return None };
        // Without the rule that checks the reply, it may be missing.
        let message = self.reply(ticket).map(|pdu| Frame { transaction: None, unit, pdu });
        Some(("message", json::text(&message)))
    }
}

impl<const N: usize> Owner for Server<Tables, N> {
    type End = Self;
    type Rule = server::Rule;

    fn new(mut given: GivenFields, rules: Rules<server::Rule>) -> Result<Self> {
        let (framing, baud) = transport(&mut given)?;
        let made = match framing.as_str() {
            "tcp" => ServerConfig::tcp(),
            "rtu" => ServerConfig::rtu(1, baud),
            _ => ServerConfig::rtu_over_tcp(1),
        };
        let made = given.configure(made.with_rules(rules))?;
        Ok(Self::new(made, Tables::new())?)
    }
}

/// Returns the configuration of a client.
pub(super) fn client_config(mut given: GivenFields) -> Result<ClientConfig> {
    let (framing, baud) = transport(&mut given)?;
    given.configure(match framing.as_str() {
        "tcp" => ClientConfig::tcp(),
        "rtu" => ClientConfig::rtu(baud),
        _ => ClientConfig::rtu_over_tcp(),
    })
}

/// Returns the framing and the rate of a serial line, on which the other defaults depend: `framing` and `baud`.
fn transport(given: &mut GivenFields) -> Result<(String, u32)> {
    let framing = given.0.get("framing").map(String::deserialize).transpose()?;
    Ok((framing.unwrap_or_else(|| "tcp".into()), given.take("baud")?.unwrap_or(19_200)))
}

/// The tables of a server in the stories: reference/fanuc-hmi-modbus.md.
#[derive(Debug, Clone)]
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

/// Returns the items of a request, if the table has all of them.
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

    fn exception_status(&mut self) -> Result<u8, Exception> {
        Ok(0x6D)
    }

    fn comm_events(&mut self, log: &mut [u8]) -> Result<CommEvents, Exception> {
        let logged = log.iter_mut().zip([0x20, 0]).map(|(to, from)| *to = from).count();
        Ok(CommEvents { status: 0, events: 264, messages: 289, logged })
    }

    fn read_file(&mut self, file: u16, record: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        if file == 4 { self.read_holding_registers(record, out) } else { Err(Exception::IllegalDataAddress) }
    }

    fn write_file(&mut self, file: u16, record: u16, values: Words<'_>) -> Result<(), Exception> {
        if file == 4 { self.write_registers(record, values) } else { Err(Exception::IllegalDataAddress) }
    }

    fn read_fifo(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<usize, Exception> {
        match address {
            1246 => out.copy_from(&[440, 4740]),
            1247 => return Ok(0),
            1248 => return Ok(out.len() + 1),
            _ => return Err(Exception::IllegalDataAddress),
        }
        Ok(2)
    }

    fn diagnose(&mut self, subfunction: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        match subfunction {
            0 => {}
            11 => out.set(0, 7),
            _ => return Err(Exception::IllegalFunction),
        }
        Ok(())
    }

    fn server_id(&mut self, out: &mut [u8]) -> Result<usize, Exception> {
        Ok(out.iter_mut().zip([0x11, 0xFF]).map(|(to, from)| *to = from).count())
    }

    fn device_object(&mut self, id: u8, out: &mut [u8]) -> Option<usize> {
        let value: &[u8] = match id {
            0 => b"cellwire",
            1 => b"FM",
            2 => b"1.0",
            3 => &[],
            128 => &[b'x'; 230],
            129 => &[0xFC],
            130 => &[b'y'; 244],
            _ => return None,
        };
        out.get_mut(..value.len())?.copy_from_slice(value);
        Some(value.len())
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
