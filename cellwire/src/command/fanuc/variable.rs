//! `cellwire fanuc read`, and the arguments that name a variable in holding registers.

use anyhow::{Context, Error, Result, bail};
use clap::ValueEnum;
use fanuc_hmi_modbus::typed::{Kind, Multiply, Number};
use fanuc_hmi_modbus::{Exception, Failure, PositionRegister, Reply, Request, WordOrder, text};
use serde_json::{Value, json};

use super::{OrderArg, USES};
use crate::command::modbus::{RefusedRequest, silent_unit};
use crate::command::settings::SetArgs;
use crate::devices::fanuc_hmi_modbus::client::{Client, Port, PortKind, RequestOutcome};
use cellwire_io::output::{log, remark};
use cellwire_io::tcp::TimeoutArgs;
use cellwire_io::tls::TlsArgs;
use cellwire_links::fanuc_hmi_modbus::Frames;

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

#[derive(Debug, clap::Args)]
pub(super) struct PlaceArgs {
    /// The controller: HOST:PORT, where the port is usually 502
    server: String,
    /// The variable's type
    #[arg(value_enum, value_name = "TYPE")]
    pub(super) kind: KindArg,
    /// The PDU address of its first register, from 0 [default: the setting `address`]
    #[arg(long, value_name = "N")]
    address: Option<u16>,
    /// The registers of a string, two characters each [default: 40, a whole SR[n]]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=120))]
    size: Option<u16>,
    /// $MULTIPLY of an integer
    #[arg(long, value_name = "X", default_value = "1", value_parser = scale)]
    pub(super) multiply: Multiply,
    /// The Modbus unit [default: the setting `unit` of a file, or 1]
    #[arg(long, value_name = "N")]
    unit: Option<u8>,
    /// Word order of 32-bit values [default: the setting `word_order` of a file, or low_first]
    #[arg(long, value_enum)]
    word_order: Option<OrderArg>,
    #[command(flatten)]
    connect: TimeoutArgs,
    #[command(flatten)]
    tls: TlsArgs,
    #[command(flatten)]
    set: SetArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum KindArg {
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
        let registers = match variable.read(&mut client, address)? {
            Outcome::Registers(registers) => registers,
            Outcome::Refused(exception) => return Err(refused(exception)),
            Outcome::Failed(_, why) => {
                remark(&format!("error: {why}"));
                return Ok(false);
            }
            Outcome::Announced => bail!("{BROADCAST}"),
        };
        log(&json!({"address": address, "value": variable.value(&registers)}))?;
        if variable.is_denormal(&registers) {
            remark(
                "warning: denormal numbers: another variable is mapped here, or the word order is the other one",
            );
        }
    }
    Ok(true)
}

/// Returns the error of a refused request, with its exit status.
pub(super) fn refused(exception: Exception) -> Error {
    RefusedRequest(format!("the controller refuses: {exception}")).into()
}

/// The reason that unit 0 has no outcome.
pub(super) const BROADCAST: &str = "unit 0 is a broadcast, without a reply";

/// The outcome of a request on a connection that was not lost.
pub(super) enum Outcome {
    /// The registers in the reply; none for a write.
    Registers(Vec<u16>),
    /// The controller has not executed the request.
    Refused(Exception),
    /// There is no usable reply, for the reason in words.
    Failed(Failure, String),
    /// The request was sent to all units.
    Announced,
}

/// A variable, and the order of its words.
pub(super) struct Variable<'a> {
    pub(super) place: &'a PlaceArgs,
    pub(super) order: WordOrder,
    unit: u8,
    /// The PDU address of the first register.
    pub(super) address: u16,
}

impl PlaceArgs {
    /// Returns the variable and the port of its controller, by the command line and the settings.
    pub(super) fn variable(&self) -> Result<(Variable<'_>, Port)> {
        if !matches!(self.kind, KindArg::Int16 | KindArg::Int32) && self.multiply.value() != 1.0 {
            bail!("--multiply has no effect on this type: it scales int16 and int32");
        }
        if self.kind != KindArg::String && self.size.is_some() {
            remark("--size has no effect on this type: it is for a string");
        }
        let given = self.set.read_client("fanuc", &USES)?;
        let order = self.word_order.map_or(given.view.word_order, WordOrder::from);
        let (server, rtu) = (self.server.clone(), given.view.frames == Frames::Rtu);
        let dialing = self.set.dialing(None, self.connect)?;
        let mut port = Port::new(PortKind::Tcp { server, rtu, tls: self.tls.client()? }, dialing);
        self.set.configure(&given, &mut port.config)?;
        let view = given.view;
        let unit = self.unit.or(view.unit).unwrap_or(1);
        let address = self.address.or(view.address).context("give --address, or the setting `address`")?;
        Ok((Variable { place: self, order, unit, address }, port))
    }
}

impl Variable<'_> {
    /// Returns the number of registers of a variable.
    pub(super) fn registers(&self) -> u16 {
        match self.place.kind {
            KindArg::Int16 => 1,
            KindArg::Int32 | KindArg::Real => 2,
            KindArg::String => self.place.size.unwrap_or(text::QUANTITY),
            KindArg::Position => PositionRegister::QUANTITY,
        }
    }

    pub(super) fn number(&self) -> Number {
        let kind = match self.place.kind {
            KindArg::Int16 => Kind::Int16,
            KindArg::Int32 => Kind::Int32,
            _ => Kind::Float32,
        };
        let multiply = if kind == Kind::Float32 { Multiply::Real } else { self.place.multiply };
        Number { kind, multiply, order: self.order }
    }

    /// Reads the registers of the variable at this address.
    ///
    /// # Errors
    /// As [`ask`](Self::ask).
    pub(super) fn read(&self, client: &mut Client, address: u16) -> Result<Outcome> {
        let quantity = self.registers();
        self.ask(client, &Request::ReadHoldingRegisters { address, quantity })
    }

    /// Makes one request.
    ///
    /// # Errors
    /// When the connection is lost, or the request is not one of the specification.
    pub(super) fn ask(&self, client: &mut Client, request: &Request<'_>) -> Result<Outcome> {
        let answer = client.ask(self.unit, request, |reply| match reply.pdu {
            Reply::Exception { exception, .. } => Err(exception),
            Reply::HoldingRegisters(words) => Ok(words.iter().collect()),
            _ => Ok(Vec::new()),
        })?;
        Ok(match answer {
            RequestOutcome::Replied(Ok(registers)) => Outcome::Registers(registers),
            RequestOutcome::Replied(Err(exception)) => Outcome::Refused(exception),
            RequestOutcome::Failed(failure) => match failure.exception() {
                Some(exception) => Outcome::Refused(exception),
                None => Outcome::Failed(failure, self.explain(client, failure)),
            },
            RequestOutcome::Announced => Outcome::Announced,
        })
    }

    /// Returns the failure in words, with a hint after a timeout.
    fn explain(&self, client: &Client, failure: Failure) -> String {
        let hint = match failure {
            Failure::TimedOut => format!("\n{}", silent_unit(&self.place.server, self.unit)),
            _ => String::new(),
        };
        format!("{}{hint}", client.explain(failure))
    }

    /// Returns the value that registers hold.
    pub(super) fn value(&self, registers: &[u16]) -> Value {
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
                if self.place.kind != KindArg::Real
                    && let Some(whole) = whole(value)
                {
                    return json!(whole);
                }
                // JSON has neither NaN nor infinities.
                if value.is_finite() { json!(value) } else { json!(value.to_string()) }
            }
        }
    }

    /// Returns whether a value is one that robots do not compute: below 2^-126, and not 0.
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
}

fn scale(text: &str) -> Result<Multiply, String> {
    let value: f32 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    match Multiply::new(value) {
        Ok(multiply @ Multiply::Scale(_)) => Ok(multiply),
        Ok(_) => Err("give 0.0001 to 10000; for reals and strings use their types".into()),
        Err(error) => Err(error.to_string()),
    }
}

/// Returns a number without a fraction.
#[expect(clippy::cast_possible_truncation, reason = "it is a whole number below 2^53")]
fn whole(value: f64) -> Option<i64> {
    (value.fract() == 0.0 && value.abs() < 9_007_199_254_740_992.0).then_some(value as i64)
}
