//! The client.

use core::time::Duration;

use anyhow::{Result, bail, ensure};
use fanuc_hmi_modbus::{Client, ClientConfig, ClientEvent, Failure, Frame, Framing, PduBuf, Ticket};
use robot_session::End as _;
use serde_json::{Map, Value};
use testkit::links::fanuc_hmi_modbus::rows;

use super::{Transport, places};
use crate::ends::{About, End, Fields, Maker, Noted, event, kind, names, show, unexpected, without};

pub(in crate::ends) const MAKER: Maker = Maker { make, rules: names::<fanuc_hmi_modbus::client::Rule> };

fn make(config: &Map<String, Value>, rule: Option<usize>) -> Result<Box<dyn End>> {
    let mut fields = Fields(config.clone());
    let transport = Transport::take(&mut fields)?;
    let mut made = match transport.framing()? {
        Framing::Tcp => ClientConfig::tcp(),
        Framing::Rtu { .. } => ClientConfig::rtu(transport.baud),
        Framing::RtuOverTcp { .. } => ClientConfig::rtu_over_tcp(),
    };
    made.framing = transport.framing()?;
    fields.time("timeout", &mut made.timeout)?;
    fields.take("in_flight", &mut made.in_flight)?;
    fields.take("any_unit", &mut made.any_unit)?;
    fields.take("broadcast", &mut made.broadcast)?;
    fields.time("turnaround", &mut made.turnaround)?;
    fields.time("settle", &mut made.settle)?;
    let places = places(&mut fields)?;
    fields.end()?;
    made.rules = without(rule);
    match made.framing {
        Framing::Tcp => boxed::<rows::Tcp>(made, places),
        Framing::Rtu { .. } => boxed::<rows::Rtu>(made, places),
        Framing::RtuOverTcp { .. } => boxed::<rows::RtuOverTcp>(made, places),
    }
}

fn boxed<T: rows::Transport + 'static>(config: ClientConfig, places: usize) -> Result<Box<dyn End>> {
    Ok(match places {
        2 => Noted::<ModbusClient<T, 2>>::boxed(Client::new(config)?),
        8 => Noted::<ModbusClient<T, 8>>::boxed(Client::new(config)?),
        _ => bail!("a client of the stories has 2 or 8 places"),
    })
}

struct ModbusClient<T, const N: usize>(core::marker::PhantomData<T>);

impl<T: rows::Transport + 'static, const N: usize> About for ModbusClient<T, N> {
    type End = Client<N>;
    type Rows = rows::Client<T, N>;

    fn call(client: &mut Client<N>, _: Duration, name: &str, argument: Value) -> Result<Result<(), String>> {
        ensure!(name == "request", "a client has no call {name}");
        let Ok(frame) = serde_json::from_value::<Frame<PduBuf>>(argument) else {
            return Ok(Err(kind("message")));
        };
        let request = frame.pdu.request()?;
        Ok(client.request(frame.unit, &request).map(drop).map_err(|error| show(&error)))
    }

    fn state(client: &Client<N>) -> String {
        rows::client_state(&client.core().machine)
    }

    fn event(client: &Client<N>, happened: ClientEvent) -> Result<String> {
        Ok(match happened {
            ClientEvent::Replied { ticket, unit } => {
                // Without the rule that checks it, it may be none.
                let message = client.reply(ticket).map(|pdu| Frame { transaction: None, unit, pdu });
                event("replied").raw("ticket", ticket.number()).raw("message", show(&message)).end()
            }
            ClientEvent::Announced { ticket } => event("announced").raw("ticket", ticket.number()).end(),
            ClientEvent::Failed { ticket, failure } => {
                let object = event("failed").raw("ticket", ticket.number());
                match failure {
                    Failure::TimedOut => object.value("reason", "timed_out")?,
                    Failure::Disconnected => object.value("reason", "disconnected")?,
                    Failure::NotSent => object.value("reason", "not_sent")?,
                    Failure::Refused(mismatch) => {
                        object.value("reason", "mismatch")?.raw("mismatch", show(&mismatch))
                    }
                    Failure::Malformed(error) => {
                        object.value("reason", "malformed")?.raw("error", show(&error))
                    }
                    _ => bail!("a reason without a name"),
                }
                .end()
            }
            ClientEvent::Stray { transaction, unit, function, late, mismatch } => event("stray")
                .optional("transaction", transaction.as_ref())?
                .raw("unit", unit)
                .raw("function", function)
                .optional("late", late.map(Ticket::number).as_ref())?
                .optional("mismatch", mismatch.as_ref())?
                .end(),
            ClientEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            ClientEvent::OutOfStep(error) => event("out_of_step").raw("error", show(&error)).end(),
            ClientEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }
}
