//! The telemetry of a FANUC controller, and writes to its registers.

use std::time::Duration;

use anyhow::Result;
use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, Reply, Request, TelemetryBlock, Ticket, WordOrder, Words,
};
use robot_session::now;
use serde::Deserialize;
use serde_json::json;

use super::client::{self, Adapter, Silence};
use super::order;
use super::telemetry::{Read, Telemetry};
use crate::end::{ENDS, End};
use crate::metric::{Definition, define, whole};
use crate::payload::{Kind, Value};
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_links::fanuc_hmi_modbus::ClientSettings;
use cellwire_links::settings::{Configure, Fields};

/// The period of the controller's background task, which counts the life counter.
const PERIOD: Duration = Duration::from_millis(8);

const METRICS: [Definition; 19] = [
    define("Telemetry/Life Counter", Kind::Int64),
    define("Telemetry/Override", Kind::Int64),
    define("Telemetry/Position/X", Kind::Float),
    define("Telemetry/Position/Y", Kind::Float),
    define("Telemetry/Position/Z", Kind::Float),
    define("Telemetry/Position/W", Kind::Float),
    define("Telemetry/Position/P", Kind::Float),
    define("Telemetry/Position/R", Kind::Float),
    define("Telemetry/Quaternion/W", Kind::Float),
    define("Telemetry/Quaternion/X", Kind::Float),
    define("Telemetry/Quaternion/Y", Kind::Float),
    define("Telemetry/Quaternion/Z", Kind::Float),
    define("Telemetry/Velocity/X", Kind::Float),
    define("Telemetry/Velocity/Y", Kind::Float),
    define("Telemetry/Velocity/Z", Kind::Float),
    define("Telemetry/Quaternion Rate/W", Kind::Float),
    define("Telemetry/Quaternion Rate/X", Kind::Float),
    define("Telemetry/Quaternion Rate/Y", Kind::Float),
    define("Telemetry/Quaternion Rate/Z", Kind::Float),
];

/// What can be set.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    poll: Duration,
    silence: Duration,
    unit: u8,
    register: u16,
    /// Without one it is found.
    word_order: Option<WordOrder>,
    session: ClientConfig,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            poll: Duration::from_millis(500),
            silence: Duration::from_secs(3),
            unit: 1,
            register: TelemetryBlock::ADDRESS,
            word_order: None,
            session: ClientConfig::tcp(),
        }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { poll, silence, unit, register, word_order, session } = self;
        let range = Duration::from_millis(10)..=Duration::from_secs(3600);
        fields.time("poll", range, "the polling period of the telemetry", poll);
        Silence::configure(fields, silence);
        fields.whole("unit", 0..=u8::MAX, "", "the Modbus unit", unit);
        fields.whole(
            "register",
            0..=16_000,
            "",
            "the PDU address of the telemetry's first register",
            register,
        );
        let orders = [
            ("auto", None),
            ("low_first", Some(WordOrder::LowFirst)),
            ("high_first", Some(WordOrder::HighFirst)),
        ];
        let about = "word order of 32-bit values; auto: detected from the life counter and from plausibility";
        fields.choice("word_order", &orders, about, word_order);
        ClientSettings(session).configure(fields);
    }
}

/// What a command may order.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
enum Order {
    #[serde(rename = "write_coil")]
    Coil { address: u16, value: bool },
    #[serde(rename = "write_register")]
    Register { address: u16, value: u16 },
    #[serde(rename = "write_registers")]
    Registers { address: u16, values: Vec<u16> },
}

struct Modbus {
    settings: Settings,
    next: Duration,
    /// The request for the telemetry that is in flight.
    asked: Option<Ticket>,
    telemetry: Telemetry,
    /// What is to be written as soon as nothing is in flight, and then its request.
    order: Option<Order>,
    writing: Option<Ticket>,
}

pub(super) fn client(cell: &Cell, settings: Settings) -> Result<super::Client> {
    let session = Client::<1>::new(settings.session)?;
    let (asked, order, writing) = (None, None, None);
    let silence = Silence::of_asked(settings.silence, settings.poll.max(settings.session.timeout));
    let telemetry = Telemetry::new(settings.word_order, PERIOD, settings.poll);
    let adapter = Modbus { settings, next: Duration::ZERO, asked, telemetry, order, writing };
    client::of(cell, &METRICS, None, silence, session, adapter)
}

impl Adapter for Modbus {
    type Session = Client<1>;

    fn is_answer(event: &ClientEvent) -> bool {
        matches!(event, ClientEvent::Replied { .. })
    }

    fn step(&mut self, session: &mut Client<1>, end: &mut End) -> Option<Duration> {
        let now = now();
        if session.in_flight() == 0
            && let Some(order) = self.order.take()
        {
            if end.is_stopped() {
                end.finish(Outcome::Refused, ENDS);
                return None;
            }
            match order.request(session, self.settings.unit) {
                Ok(ticket) => self.writing = Some(ticket),
                Err(error) => end.finish(Outcome::Refused, error.to_string()),
            }
        }
        if session.in_flight() == 0 && now >= self.next {
            let quantity = TelemetryBlock::QUANTITY;
            let request = Request::ReadHoldingRegisters { address: self.settings.register, quantity };
            self.asked = session.request(self.settings.unit, &request).ok();
            self.next = (self.next + self.settings.poll).max(now); // a late one skips what it missed
        }
        Some(self.next.saturating_sub(now).max(Duration::from_millis(1)))
    }

    fn event(&mut self, session: &mut Client<1>, event: ClientEvent, end: &mut End) -> Result<(), String> {
        match event {
            ClientEvent::Replied { ticket, .. } => {
                let reply = session.reply(ticket);
                if self.writing.take_if(|writing| *writing == ticket).is_some() {
                    match reply {
                        Some(Reply::Exception { exception, .. }) => {
                            end.finish(Outcome::Refused, exception.to_string());
                        }
                        _ => end.finish(Outcome::Done, ""),
                    }
                } else if self.asked.take_if(|asked| *asked == ticket).is_some() {
                    match reply {
                        Some(Reply::HoldingRegisters(words)) => match words.first_chunk() {
                            Some(registers) => self.report(&registers, end),
                            None => end.event(&json!({"event": "short_reply"})),
                        },
                        Some(Reply::Exception { exception, .. }) => {
                            end.event(&json!({"event": "refused", "why": exception.to_string()}));
                        }
                        _ => {}
                    }
                }
            }
            ClientEvent::Announced { ticket } if self.writing.take_if(|it| *it == ticket).is_some() => {
                end.finish(Outcome::Unknown, "sent as a broadcast, which has no reply");
            }
            ClientEvent::Failed { ticket, failure } => {
                if self.writing.take_if(|writing| *writing == ticket).is_some() {
                    let outcome = if failure.is_unknown() { Outcome::Unknown } else { Outcome::Refused };
                    end.finish(outcome, failure.to_string());
                }
                self.asked.take_if(|asked| *asked == ticket);
                end.event(&json!({"event": "failed", "why": failure.to_string()}));
                // The rest of a reply that was cut would be taken from the next one.
                if session.pending() > 0 {
                    return Err("a reply was truncated".into());
                }
            }
            ClientEvent::Stray { unit, function, .. } => {
                end.event(&json!({"event": "stray", "unit": unit, "function": function}));
            }
            ClientEvent::Corrupt(error) | ClientEvent::OutOfStep(error) => {
                end.event(&json!({"event": "corrupt", "error": error}));
            }
            ClientEvent::Echo(error) => {
                end.event(&json!({"event": "echo", "error": error, "text": error.to_string()}));
            }
            _ => {}
        }
        Ok(())
    }

    fn command(&mut self, _: &mut Client<1>, command: Command) -> Result<(), String> {
        self.order = Some(order(&command.order)?);
        Ok(())
    }

    fn lost(&mut self) {
        (self.asked, self.writing, self.order, self.next) = (None, None, None, now());
        self.telemetry.reconnected();
    }
}

impl Modbus {
    fn report(&mut self, registers: &[u16; 37], end: &mut End) {
        let block = match self.telemetry.read(registers, now()) {
            Read::Values(block) => block,
            Read::Cannot(fault, value) => {
                return end.bad(&json!({"event": "implausible", "fault": fault, "value": value}));
            }
            Read::Still => return,
        };
        let floats =
            [&block.position[..], &block.wpr, &block.quaternion, &block.velocity, &block.quaternion_rate];
        let floats = floats.into_iter().flatten().map(|value| Value::Float(*value));
        let wholes = [whole(block.life_counter), whole(block.override_percent)];
        let names = METRICS.iter().map(|definition| definition.name);
        end.values(names.zip(wholes.into_iter().chain(floats)).collect());
    }
}

impl Order {
    fn request(&self, session: &mut Client<1>, unit: u8) -> Result<Ticket, fanuc_hmi_modbus::SessionError> {
        match self {
            Self::Coil { address, value } => {
                session.request(unit, &Request::WriteCoil { address: *address, value: *value })
            }
            Self::Register { address, value } => {
                session.request(unit, &Request::WriteRegister { address: *address, value: *value })
            }
            Self::Registers { address, values } => {
                let values = Words::from(values.as_slice());
                session.request(unit, &Request::WriteRegisters { address: *address, values })
            }
        }
    }
}
