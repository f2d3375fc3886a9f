//! `cellwire fanuc write`.

use core::str::FromStr;
use std::time::{Duration, Instant};

use anyhow::{Context, Error, Result, bail, ensure};
use fanuc_hmi_modbus::typed::{Kind, Multiply};
use fanuc_hmi_modbus::{PositionRegister, Request, Words, text};
use serde_json::{Value, json};

use super::variable::{BROADCAST, KindArg, Outcome, PlaceArgs, Variable, refused};
use crate::command::modbus::Unknown;
use crate::devices::fanuc_hmi_modbus::client::Client;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::interrupt::{self, Policy};
use cellwire_io::output::{log, remark};

/// The longest time to open another connection when the controller closes the first after its reply to the write.
const READ_BACK_WITHIN: Duration = Duration::from_secs(5);

/// Writes a variable into holding registers, and reads it back.
///
/// The value is JSON: a number, a "string", or a position such as {"cartesian": {"xyzwpr": [500,0,300,180,0,0]}, "user_frame": 1}
/// or {"joints": [0,0,0,0,-90,0,0,0,0]}. It is written in one request, never in part. An integer that the registers cannot hold
/// exactly is refused; a real is rounded to 24 bits. A string is written to all of its --size registers: those after its text are
/// cleared. The output names the first and the last written register. R[1] to R[19], PDU addresses 0 to 36, are the
/// telemetry block where a controller has one: its background task overwrites them.
///
/// The exit status is 6 when the controller refuses the write, 1 when it holds a different value afterwards, and 8 when the write
/// may have been executed, but the controller did not reply or the value could not be read back.
#[derive(Debug, clap::Args)]
pub(super) struct WriteArgs {
    #[command(flatten)]
    place: PlaceArgs,
    /// The value
    #[arg(allow_hyphen_values = true)]
    value: String,
}

pub(super) fn write(args: &WriteArgs) -> Result<bool> {
    let (variable, port) = args.place.variable()?;
    let value = Value::from_str(&args.value)
        .with_context(|| format!("{} is not JSON: a string needs quotes, '\"text\"'", args.value))?;
    let registers = variable.registers_of(&value)?;
    let address = variable.address;
    let last = u16::try_from(usize::from(address) + registers.len().saturating_sub(1));
    let last = last.ok().context("the registers end at 65535")?;
    let mut client = Client::open(&port)?;
    let request = Request::WriteRegisters { address, values: Words::from(registers.as_slice()) };
    interrupt::on_interrupt(Policy::EndAfterReply)?;
    interrupt::account("the controller may hold the new value".into());
    match variable.ask(&mut client, &request) {
        Ok(Outcome::Registers(_)) => {}
        Ok(Outcome::Refused(exception)) => return Err(refused(exception)),
        Ok(Outcome::Failed(failure, why)) if failure.is_unknown() => return Err(unknown(&why)),
        Ok(Outcome::Failed(_, why)) => bail!(ConnectionLost(why)),
        Ok(Outcome::Announced) => return Err(unknown(BROADCAST)),
        Err(error) if error.is::<ConnectionLost>() && client.lost().is_unknown() => {
            return Err(unknown(&format!("{error:#}")));
        }
        Err(error) => return Err(error),
    }
    let held = variable.read_back(&mut client)?;
    let (meant, found) = (variable.value(&registers), variable.value(&held));
    let is_same = meant == found;
    log(&json!({"address": address, "registers": [address, last], "value": found, "written": is_same}))?;
    if !is_same {
        remark(&format!("error: {meant} was written, the controller holds {found}"));
    }
    Ok(is_same)
}

/// Returns the error of a write without a reply, with its exit status.
fn unknown(why: &str) -> Error {
    Unknown(format!("the write may have been executed: {why}")).into()
}

impl Variable<'_> {
    /// Reads the registers after an acknowledged write. If the controller closes the connection after each reply, another
    /// connection is used.
    fn read_back(&self, client: &mut Client) -> Result<Vec<u16>> {
        let mut outcome = self.read(client, self.address);
        if outcome.as_ref().is_err_and(Error::is::<ConnectionLost>) {
            let end = Instant::now() + READ_BACK_WITHIN;
            if client.regain(|| Instant::now() < end && !interrupt::requested()) {
                outcome = self.read(client, self.address);
            }
        }
        let why = match outcome {
            Ok(Outcome::Registers(registers)) if registers.len() == usize::from(self.registers()) => {
                return Ok(registers);
            }
            Ok(Outcome::Registers(_)) => "the reply has another number of registers".to_owned(),
            Ok(Outcome::Refused(exception)) => format!("the controller refuses: {exception}"),
            Ok(Outcome::Failed(_, why)) => why,
            Ok(Outcome::Announced) => BROADCAST.to_owned(),
            Err(error) if error.is::<ConnectionLost>() => format!("{error:#}"),
            Err(error) => return Err(error),
        };
        Err(unknown(&format!(
            "the controller has acknowledged it, but the value could not be read back: {why}"
        )))
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
                ensure!(self.holds(number, !value.is_f64()), "{value} does not fit: {}", self.range());
                let words = self.number().write(number)?;
                registers.iter_mut().zip(words).for_each(|(register, word)| *register = word);
            }
        }
        Ok(registers)
    }

    /// Returns whether the registers of a number hold this one: an integer after the multiply, or a real.
    #[expect(clippy::cast_possible_truncation, reason = "a real is rounded to 24 bits")]
    fn holds(&self, number: f64, is_integer: bool) -> bool {
        let (least, most) = match self.number().kind {
            Kind::Int16 => (f64::from(i16::MIN), f64::from(i16::MAX)),
            Kind::Int32 => (f64::from(i32::MIN), f64::from(i32::MAX)),
            Kind::Float32 => {
                // A larger number is infinite, a smaller one 0 or denormal.
                let held = number as f32;
                return held.is_finite()
                    && (held.is_normal() || number == 0.0)
                    && (!is_integer || f64::from(held) == number);
            }
        };
        let scaled = number * self.scale();
        // One multiplication of decimals is off by some units in the last place.
        let is_whole = (scaled - scaled.round()).abs() <= scaled.abs() * 4.0 * f64::EPSILON;
        is_whole && (least..=most).contains(&scaled.round())
    }

    /// Returns the multiply of an integer, as the decimal number that was given.
    fn scale(&self) -> f64 {
        match self.number().multiply {
            Multiply::Scale(scale) => scale.to_string().parse().unwrap_or(f64::from(scale)),
            Multiply::Real | Multiply::Text => 1.0,
        }
    }

    /// Returns the numbers that the registers can contain, for an error.
    fn range(&self) -> String {
        let (name, least, most) = match self.number().kind {
            Kind::Int16 => ("int16", f64::from(i16::MIN), f64::from(i16::MAX)),
            Kind::Int32 => ("int32", f64::from(i32::MIN), f64::from(i32::MAX)),
            Kind::Float32 => {
                let (least, most) = (f32::MIN_POSITIVE, f32::MAX);
                return format!("a real holds 24 bits, and 0 or {least:e} to {most:e} with either sign");
            }
        };
        let scale = self.scale();
        let step = 1.0 / scale;
        let multiply = if scale == 1.0 { String::new() } else { format!(" with --multiply {scale}") };
        format!("{name} holds {} to {} in steps of {step}{multiply}", least / scale, most / scale)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;

    #[derive(clap::Parser)]
    struct Command {
        #[command(flatten)]
        args: WriteArgs,
    }

    /// Returns the registers that a command would write, or its error.
    fn registers(arguments: &str) -> Result<Vec<u16>, String> {
        let words = ["write", "127.0.0.1:1", "--address", "0"].into_iter().chain(arguments.split(' '));
        let args = Command::parse_from(words).args;
        let value = Value::from_str(&args.value).unwrap();
        let (variable, _) = args.place.variable().unwrap();
        variable.registers_of(&value).map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn a_number_that_the_registers_cannot_hold_is_refused_with_range_and_step() {
        let integers = "int16 holds -32768 to 32767 in steps of 1";
        for (arguments, expected) in [
            ("int16 1.5", Err(format!("1.5 does not fit: {integers}"))),
            ("int16 40000", Err(format!("40000 does not fit: {integers}"))),
            ("int16 1.0", Ok(vec![1])),
            ("int16 -32768", Ok(vec![0x8000])),
            ("int16 1.5 --multiply 10", Ok(vec![15])),
            ("int16 1.1 --multiply 100", Ok(vec![110])),
            ("int16 50 --multiply 0.1", Ok(vec![5])),
            (
                "int16 55 --multiply 0.1",
                Err("55 does not fit: int16 holds -327680 to 327670 in steps of 10 with --multiply 0.1"
                    .into()),
            ),
            (
                "int16 0.125 --multiply 100",
                Err("0.125 does not fit: int16 holds -327.68 to 327.67 in steps of 0.01 with --multiply 100"
                    .into()),
            ),
            (
                "int32 2000000000.5",
                Err("2000000000.5 does not fit: int32 holds -2147483648 to 2147483647 in steps of 1".into()),
            ),
            ("real 0.1", Ok(vec![0xCCCD, 0x3DCC])),
            ("real 0", Ok(vec![0, 0])),
        ] {
            assert_eq!(registers(arguments), expected, "{arguments}");
        }
        for value in ["1e39", "1e-50", "16777217"] {
            let error = registers(&format!("real {value}")).unwrap_err();
            assert!(
                error.contains("does not fit: a real holds 24 bits, and 0 or 1.1754944e-38 to "),
                "{error}"
            );
        }
    }
}
