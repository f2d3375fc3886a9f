//! `cellwire fanuc read` and `write`: variables in holding registers, by their types.

use core::str::FromStr;

use anyhow::{Context, Result, ensure};
use clap::ValueEnum;
use fanuc_hmi_modbus::typed::{Kind, Multiply, Number};
use fanuc_hmi_modbus::{Failure, PositionRegister, Reply, Request, WordOrder, Words, text};
use serde_json::{Value, json};

use super::OrderArg;
use crate::command::settings::SetArgs;
use crate::io::interrupt;
use crate::io::output::{log, remark};
use crate::io::tcp::ConnectArgs;
use crate::links::fanuc_hmi_modbus::client::{Answer, Client, Port, PortKind};
use cellwire_links::fanuc_hmi_modbus::{ClientSettings, Frames};
use cellwire_links::settings;

/// Reads variables from holding registers, one JSON line each.
///
/// TYPE is the type in `$SNPX_ASG`: `int16` (`R[n]@1.1`), `int32` (`R[n]`), `real` (`$MULTIPLY` 0), `string`
/// (`$MULTIPLY` -1) or `position` (`PR[n]`, `$MULTIPLY` 0, 50 registers). --address is $ADDRESS - 1.
#[derive(Debug, clap::Args)]
pub(super) struct ReadArgs {
    #[command(flatten)]
    place: PlaceArgs,
    /// The number of consecutive variables
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=16_384))]
    count: u16,
}

/// Writes a variable into holding registers, and reads it back.
///
/// The value is JSON: a number, a "string", or a position such as {"cartesian": {"xyzwpr": [500,0,300,180,0,0]}, "user_frame": 1}
/// or {"joints": [0,0,0,0,-90,0,0,0,0]}. It is written in one request, never in part. The exit
/// status is 1 when the controller refuses it, or holds a different value afterwards.
#[derive(Debug, clap::Args)]
pub(super) struct WriteArgs {
    #[command(flatten)]
    place: PlaceArgs,
    /// The value
    #[arg(allow_hyphen_values = true)]
    value: String,
}

#[derive(Debug, clap::Args)]
struct PlaceArgs {
    /// The controller: HOST:PORT, where the port is usually 502
    server: String,
    /// The variable's type
    #[arg(value_enum, value_name = "TYPE")]
    kind: KindArg,
    /// The PDU address of its first register, from 0 [default: the setting `address`]
    #[arg(long, value_name = "N")]
    address: Option<u16>,
    /// The registers of a string, two characters each: $SIZE
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u16).range(1..=120))]
    size: u16,
    /// $MULTIPLY of an integer
    #[arg(long, value_name = "X", default_value = "1", value_parser = scale)]
    multiply: Multiply,
    /// The Modbus unit [default: the setting `unit` of a file, or 1]
    #[arg(long, value_name = "N")]
    unit: Option<u8>,
    /// Word order of 32-bit values [default: the setting `word_order` of a file, or low-first]
    #[arg(long, value_enum)]
    word_order: Option<OrderArg>,
    #[command(flatten)]
    connect: ConnectArgs,
    #[command(flatten)]
    set: SetArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum KindArg {
    Int16,
    Int32,
    Real,
    String,
    Position,
}

pub(super) fn read(args: &ReadArgs) -> Result<bool> {
    let (variable, port) = args.place.variable()?;
    let (mut client, each) = (Client::open(&port)?, variable.registers());
    for index in 0..args.count {
        let address = u32::from(variable.address) + u32::from(index) * u32::from(each);
        let address = u16::try_from(address).ok().context("the registers end at 65535")?;
        let Some(registers) = variable.read(&mut client, address)? else { return Ok(false) };
        log(&json!({"address": address, "value": variable.value(&registers)}))?;
        if variable.is_denormal(&registers) {
            remark(
                "warning: denormal numbers: another variable is mapped here, or the word order is the other one",
            );
        }
    }
    Ok(true)
}

pub(super) fn write(args: &WriteArgs) -> Result<bool> {
    let (variable, port) = args.place.variable()?;
    let value = Value::from_str(&args.value)
        .with_context(|| format!("{} is not JSON: a string needs quotes, '\"text\"'", args.value))?;
    let registers = variable.registers_of(&value)?;
    let mut client = Client::open(&port)?;
    let address = variable.address;
    let request = Request::WriteRegisters { address, values: Words::from(registers.as_slice()) };
    interrupt::handle_after_reply()?;
    interrupt::account("the controller may hold the new value".into());
    if variable.ask(&mut client, &request)?.is_none() {
        return Ok(false);
    }
    let Some(held) = variable.read(&mut client, address)? else { return Ok(false) };
    let (meant, found) = (variable.value(&registers), variable.value(&held));
    let is_same = meant == found;
    log(&json!({"address": address, "value": found, "written": is_same}))?;
    if !is_same {
        remark(&format!("error: {meant} was written, the controller holds {found}"));
    }
    Ok(is_same)
}

/// A variable, and the order of its words.
struct Variable<'a> {
    place: &'a PlaceArgs,
    order: WordOrder,
    unit: u8,
    address: u16,
}

impl PlaceArgs {
    /// The variable and the port of its controller, by the command line and the settings.
    fn variable(&self) -> Result<(Variable<'_>, Port)> {
        let (view, given) = self.set.read_client()?;
        let order = self.word_order.map_or(view.word_order, WordOrder::from);
        let (server, rtu) = (self.server.clone(), view.frames == Frames::Rtu);
        let dialing = self.set.dialing(None, self.connect)?;
        let mut port = Port::new(PortKind::Tcp { server, rtu }, dialing);
        settings::read("fanuc", ClientSettings(&mut port.config), &given)
            .map_err(|error| self.set.located(error.into()))?;
        let unit = self.unit.or(view.unit).unwrap_or(1);
        let address = self.address.or(view.address).context("give --address, or the setting `address`")?;
        Ok((Variable { place: self, order, unit, address }, port))
    }
}

impl Variable<'_> {
    /// The registers of a variable.
    fn registers(&self) -> u16 {
        match self.place.kind {
            KindArg::Int16 => 1,
            KindArg::Int32 | KindArg::Real => 2,
            KindArg::String => self.place.size,
            KindArg::Position => PositionRegister::QUANTITY,
        }
    }

    fn number(&self) -> Number {
        let kind = match self.place.kind {
            KindArg::Int16 => Kind::Int16,
            KindArg::Int32 => Kind::Int32,
            _ => Kind::Float32,
        };
        let multiply = if kind == Kind::Float32 { Multiply::Real } else { self.place.multiply };
        Number { kind, multiply, order: self.order }
    }

    /// None when the controller refuses, which has been said.
    fn read(&self, client: &mut Client, address: u16) -> Result<Option<Vec<u16>>> {
        let quantity = self.registers();
        self.ask(client, &Request::ReadHoldingRegisters { address, quantity })
    }

    /// The registers in the reply. None when the controller refuses, which has been said.
    fn ask(&self, client: &mut Client, request: &Request<'_>) -> Result<Option<Vec<u16>>> {
        let answer = client.ask(self.unit, request, |reply| match reply.pdu {
            Reply::Exception { exception, .. } => Err(exception),
            Reply::HoldingRegisters(words) => Ok(words.iter().collect()),
            _ => Ok(Vec::new()),
        })?;
        match answer {
            Answer::Replied(Ok(registers)) => return Ok(Some(registers)),
            Answer::Replied(Err(exception)) => remark(&format!("error: the controller refuses: {exception}")),
            Answer::Failed(failure @ Failure::TimedOut) => remark(&format!(
                "error: {}\n`cellwire modbus scan {}` shows which units answer; {} was asked",
                client.explain(failure),
                self.place.server,
                self.unit
            )),
            Answer::Failed(failure) => remark(&format!("error: {failure}")),
            Answer::Announced => remark("error: unit 0 is a broadcast, without a reply"),
        }
        Ok(None)
    }

    /// What registers hold.
    fn value(&self, registers: &[u16]) -> Value {
        match self.place.kind {
            KindArg::String => {
                let mut bytes = vec![0; 2 * registers.len()];
                let length = text::read(registers, &mut bytes);
                bytes.truncate(length);
                // A byte a character, as a controller has it.
                String::from_utf8(bytes)
                    .unwrap_or_else(|error| error.as_bytes().iter().copied().map(char::from).collect())
                    .into()
            }
            KindArg::Position => registers.first_chunk().map_or(Value::Null, |registers| {
                json!(PositionRegister::from_registers(registers, self.order))
            }),
            KindArg::Int16 | KindArg::Int32 | KindArg::Real => {
                let word = |index| registers.get(index).copied().unwrap_or(0);
                let value = self.number().read([word(0), word(1)]);
                // JSON has neither NaN nor infinities.
                if value.is_finite() { json!(value) } else { json!(value.to_string()) }
            }
        }
    }

    /// Whether a value is one that no robot computes: below 2^-126, and not 0.
    fn is_denormal(&self, registers: &[u16]) -> bool {
        match (self.place.kind, registers.first_chunk()) {
            (KindArg::Position, Some(registers)) => {
                let position = PositionRegister::from_registers(registers, self.order);
                let cartesian = position.cartesian.iter().flat_map(|it| it.xyzwpr);
                cartesian.chain(position.joints.into_iter().flatten()).any(f32::is_subnormal)
            }
            (KindArg::Real, _) => match *registers {
                [first, second] => self.order.f32([first, second]).is_subnormal(),
                _ => false,
            },
            _ => false,
        }
    }

    fn registers_of(&self, value: &Value) -> Result<Vec<u16>> {
        let mut registers = vec![0; self.registers().into()];
        match self.place.kind {
            KindArg::String => {
                let string = value.as_str().context("a string is JSON in quotes: '\"text\"'")?;
                text::write(string.as_bytes(), &mut registers)?;
            }
            KindArg::Position => {
                let position: PositionRegister = serde_json::from_value(value.clone())
                    .with_context(|| format!("{value} is not a position: see --help"))?;
                ensure!(
                    position.cartesian.is_some() != position.joints.is_some(),
                    "a position has either cartesian or joints"
                );
                registers = position.to_registers(self.order).to_vec();
            }
            KindArg::Int16 | KindArg::Int32 | KindArg::Real => {
                let number = value.as_f64().context("a number is needed")?;
                let words = self.number().write(number)?;
                registers.iter_mut().zip(words).for_each(|(register, word)| *register = word);
            }
        }
        Ok(registers)
    }
}

fn scale(text: &str) -> Result<Multiply, String> {
    let value: f32 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    match Multiply::new(value) {
        Ok(multiply @ Multiply::Scale(_)) => Ok(multiply),
        Ok(_) => Err("give 0.0001 to 10000; for reals and strings use their types".into()),
        Err(error) => Err(error.to_string()),
    }
}
