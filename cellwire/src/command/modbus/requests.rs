//! Requests as JSON lines, replies as JSON lines back.

use std::io::BufRead as _;
use std::path::Path;

use anyhow::{Context, Result, anyhow};
use fanuc_hmi_modbus::{Failure, Frame, PduBuf, Reply, Request, Side};
use serde_json::{Value, json};

use super::{RefusedRequest, Unknown, silent_unit};
use crate::devices::fanuc_hmi_modbus::client::{Client, Port, RequestOutcome, changes_nothing};
use cellwire_io::drive::ConnectionLost;
use cellwire_io::input;
use cellwire_io::interrupt::{self, Policy};
use cellwire_io::output::{log, remark};
use cellwire_links::fanuc_hmi_modbus::unknown_key;
use cellwire_links::json::value as object;

pub(super) fn run(port: &Port, unit: u8, file: Option<&Path>, confirm: bool) -> Result<bool> {
    interrupt::on_interrupt(Policy::EndAfterReply)?;
    let input = input::open(file)?;
    let mut client = super::open(port)?;
    let (mut all, mut refused, mut unknown) = (true, 0u64, 0u64);
    let mut lost = None;
    for (number, text) in (1..).zip(input.lines()) {
        let text = text.context("cannot read the requests")?;
        if text.trim().is_empty() {
            continue;
        }
        let frame = request(&text, unit).with_context(|| format!("line {number} is not a message object"))?;
        if lost.is_some() {
            log(&failed(&frame, Failure::NotSent, &Failure::NotSent.to_string()))?;
            continue;
        }
        interrupt::account(format!("the server may execute the request of line {number}"));
        if interrupt::requested() {
            interrupt::account(format!("line {number} and the following were not sent"));
            interrupt::end_at_once("interrupted");
        }
        // Each request has its line, even when the connection is lost.
        let mut answer = match ask(&mut client, &frame) {
            Err(error) if error.is::<ConnectionLost>() => {
                lost = Some(error.context(format!("line {number}")));
                let failure = client.lost();
                failed(&frame, failure, &failure.to_string())
            }
            answer => answer.with_context(|| format!("line {number}"))?,
        };
        refused += u64::from(answer.get("exception").is_some());
        if confirm && answer.get("exception").is_none() && answer.get("failed").is_none() {
            match self::confirm(&mut client, &frame, &mut answer) {
                Err(error) if error.is::<ConnectionLost>() => {
                    put(&mut answer, json!(client.lost().to_string()));
                    lost = Some(error.context(format!("line {number}")));
                }
                confirmed => all &= confirmed.with_context(|| format!("line {number}"))?,
            }
        }
        all &= answer.get("failed").is_none();
        unknown += u64::from(answer.get("unknown").is_some());
        log(&answer)?;
        interrupt::account(String::new());
    }
    if let Some(unit) = client.silent_unit() {
        remark(&silent_unit(port.server(), unit));
    }
    let requests = |count| if count == 1 { "1 request".into() } else { format!("{count} requests") };
    if unknown > 0 {
        let unknown = Unknown(format!("{} may have been executed: see \"unknown\"", requests(unknown)));
        return Err(match lost {
            Some(lost) => lost.context(unknown),
            None => unknown.into(),
        });
    }
    if let Some(lost) = lost {
        return Err(lost);
    }
    if refused > 0 && all {
        return Err(RefusedRequest(format!("{} refused: see \"exception\"", requests(refused))).into());
    }
    Ok(all)
}

/// Reads a request; one that names no unit is to `unit`.
fn request(text: &str, unit: u8) -> Result<Frame<PduBuf>> {
    let mut request: Value = input::json(text)?;
    if let Some(object) = request.as_object_mut() {
        object.entry("unit").or_insert_with(|| json!(unit));
    }
    let unknown = unknown_key(&request, Side::Client);
    serde_json::from_value(request).map_err(|error| match unknown {
        Some(unknown) => anyhow!(unknown),
        None => error.into(),
    })
}

/// Sends one request; returns the answer as the object to print.
fn ask(client: &mut Client, frame: &Frame<PduBuf>) -> Result<Value> {
    Ok(match client.ask(frame.unit, &frame.pdu.request()?, |reply| object(reply))? {
        RequestOutcome::Replied(reply) => reply,
        RequestOutcome::Announced => json!({"broadcast": true}),
        RequestOutcome::Failed(failure) => failed(frame, failure, &client.explain(failure)),
    })
}

fn failed(frame: &Frame<PduBuf>, failure: Failure, explained: &str) -> Value {
    let mut answer = json!({"failed": explained});
    let changes = frame.pdu.request().is_ok_and(|request| !changes_nothing(&request));
    if let (Some(answer), true, true) = (answer.as_object_mut(), failure.is_unknown(), changes) {
        answer.insert("unknown".into(), json!(true));
    }
    answer
}

/// Reads back the values of a write, and adds to its reply whether they are there. Returns true for a request that is not a
/// write, and for a broadcast, which has no reply.
fn confirm(client: &mut Client, frame: &Frame<PduBuf>, answer: &mut Value) -> Result<bool> {
    let request = frame.pdu.request()?;
    let Some(read) = read_back(&request) else { return Ok(true) };
    if answer.get("broadcast").is_some() {
        return Ok(true);
    }
    let found = match client.ask(frame.unit, &read, |reply| differs(&request, &reply.pdu))? {
        RequestOutcome::Replied(None) => json!(true),
        RequestOutcome::Replied(Some(found)) => found,
        RequestOutcome::Announced => json!(false),
        RequestOutcome::Failed(failure) => json!(client.explain(failure)),
    };
    Ok(put(answer, found))
}

/// Adds the values that were read back, or the reason that they were not; returns true if they equal the written ones.
fn put(answer: &mut Value, found: Value) -> bool {
    let confirmed = found == json!(true);
    if let Some(answer) = answer.as_object_mut() {
        answer.insert("confirmed".into(), json!(confirmed));
        if !confirmed {
            answer.insert("holds".into(), found);
        }
    }
    confirmed
}

/// Returns the request that reads the values that a request writes.
fn read_back(request: &Request<'_>) -> Option<Request<'static>> {
    let count = |len: usize| u16::try_from(len).ok();
    Some(match *request {
        Request::WriteCoil { address, .. } => Request::ReadCoils { address, quantity: 1 },
        Request::WriteCoils { address, values } => {
            Request::ReadCoils { address, quantity: count(values.len())? }
        }
        Request::WriteRegister { address, .. } => Request::ReadHoldingRegisters { address, quantity: 1 },
        Request::WriteRegisters { address, values } => {
            Request::ReadHoldingRegisters { address, quantity: count(values.len())? }
        }
        Request::ReadWriteRegisters { write_address, values, .. } => {
            Request::ReadHoldingRegisters { address: write_address, quantity: count(values.len())? }
        }
        Request::MaskWriteRegister { address, .. } => Request::ReadHoldingRegisters { address, quantity: 1 },
        _ => return None,
    })
}

/// Returns the server's values if they differ from the written ones. Of a mask only the bits that it sets or clears are known.
fn differs(written: &Request<'_>, reply: &Reply<'_>) -> Option<Value> {
    let bits: Vec<bool>;
    let words: Vec<u16>;
    (bits, words) = match reply {
        Reply::Coils(bits) => (bits.iter().collect(), Vec::new()),
        Reply::HoldingRegisters(words) => (Vec::new(), words.iter().collect()),
        Reply::Exception { exception, .. } => return Some(json!(exception.to_string())),
        _ => return Some(Value::Null),
    };
    let is_same = match *written {
        Request::WriteCoil { value, .. } => bits == [value],
        Request::WriteCoils { values, .. } => values.iter().eq(bits.iter().copied()),
        Request::WriteRegister { value, .. } => words == [value],
        Request::WriteRegisters { values, .. } | Request::ReadWriteRegisters { values, .. } => {
            values.iter().eq(words.iter().copied())
        }
        Request::MaskWriteRegister { and, or, .. } => {
            words.first().is_some_and(|word| word & !and == or & !and)
        }
        _ => true,
    };
    if is_same {
        return None;
    }
    Some(if bits.is_empty() { json!(words) } else { json!(bits) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_without_a_unit_is_to_the_unit_of_the_settings() {
        let unit = |text: &str| request(text, 7).unwrap().unit;
        assert_eq!(unit(r#"{"function":3,"address":0,"quantity":1}"#), 7);
        assert_eq!(unit(r#"{"unit":2,"function":3,"address":0,"quantity":1}"#), 2);
        assert!(request("7", 7).is_err());
    }
}
