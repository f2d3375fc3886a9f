//! The telemetry of a FANUC controller, and writes to its registers.

use std::time::Duration;

use anyhow::Result;
use fanuc_hmi_modbus::tokio::{Client, Error, Event, Requests};
use fanuc_hmi_modbus::{ClientConfig, ClientEvent, Failure, TelemetryBlock, WordOrder};
use robot_session::now;
use serde::Deserialize;
use serde_json::json;

use super::client::{self, Listener, PollSettings, Silence, Worker};
use super::order;
use super::port::Port;
use super::telemetry::{ReadResult, Telemetry};
use crate::end::End;
use crate::metric::{Definition, define, whole};
use crate::payload::{Kind, Value};
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_links::fanuc_hmi_modbus::ClientSettings;
use cellwire_links::settings::{Configure, FieldVisitor};

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

/// The settings of a cell.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    poll: Duration,
    silence: Duration,
    unit: u8,
    address: u16,
    /// The word order; without one it is detected.
    word_order: Option<WordOrder>,
    session: ClientConfig,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            poll: Duration::from_millis(500),
            silence: Duration::from_secs(3),
            unit: 1,
            address: TelemetryBlock::ADDRESS,
            word_order: None,
            session: ClientConfig::tcp(),
        }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { poll, silence, unit, address, word_order, session } = self;
        let range = Duration::from_millis(10)..=Duration::from_secs(3600);
        fields.time("poll", range, "the polling period of the telemetry", poll);
        Silence::configure(fields, silence);
        fields.whole("unit", 0..=u8::MAX, "", "the Modbus unit", unit);
        fields.whole("address", 0..=16_000, "", "the PDU address of the telemetry's first register", address);
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

/// The content of a command: a write.
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

/// Reports notices.
struct NoticeReporter;

/// Reads the telemetry, and writes.
struct Modbus {
    robot: Client,
    settings: Settings,
    telemetry: Telemetry,
}

pub(super) fn client(cell: &Cell, settings: Settings) -> Result<super::Client> {
    let (robot, task) = fanuc_hmi_modbus::tokio::client(settings.session, Port::of(cell, None)?)?;
    let silence = Silence::of_asked(settings.silence, settings.poll.max(settings.session.timeout));
    let terms = PollSettings { silence, every: Some(settings.poll), deadline: None };
    let telemetry = Telemetry::new(settings.word_order, PERIOD, settings.poll);
    let handle = robot.handle().clone();
    let worker = Modbus { robot: robot.unit(settings.unit), settings, telemetry };
    Ok(client::of(cell, &METRICS, terms, (handle, task), NoticeReporter, worker))
}

impl Listener for NoticeReporter {
    type Service = Requests;

    fn event(&mut self, event: Event, end: &End) -> Result<(), String> {
        let Event::Notice(event) = event else { return Ok(()) };
        match event {
            ClientEvent::Stray { unit, function, .. } => {
                let why = event.to_string();
                end.event(&json!({"event": "stray", "unit": unit, "function": function, "why": why}));
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
}

impl Worker for Modbus {
    fn reconnected(&mut self) {
        self.telemetry.reconnected();
    }

    async fn poll(&mut self, end: &End) {
        let address = self.settings.address;
        let registers = address..address.saturating_add(TelemetryBlock::QUANTITY);
        match self.robot.read_holding_registers(registers).await {
            Ok(words) => {
                end.answered();
                if let Some(registers) = words.first_chunk() {
                    self.report(registers, end);
                }
            }
            Err(Error::Exception(exception)) => {
                end.answered();
                end.event(&json!({"event": "refused", "why": exception.to_string()}));
            }
            // The end of the connection has been reported.
            Err(Error::NotConnected(_) | Error::Closed(_))
            | Err(Error::Failed(Failure::Disconnected | Failure::NotSent)) => {}
            Err(error) => end.event(&json!({"event": "failed", "why": error.to_string()})),
        }
    }

    async fn command(&mut self, command: &Command, end: &End) -> (Outcome, String) {
        let order: Order = match order(&command.order) {
            Ok(order) => order,
            Err(why) => return (Outcome::Refused, why),
        };
        let written = match &order {
            Order::Coil { address, value } => self.robot.write_coil(*address, *value).await,
            Order::Register { address, value } => self.robot.write_register(*address, *value).await,
            Order::Registers { address, values } => self.robot.write_registers(*address, values).await,
        };
        match written {
            Ok(()) if self.settings.session.is_broadcast(self.settings.unit) => {
                (Outcome::Unknown, "sent as a broadcast, which has no reply".into())
            }
            Ok(()) => {
                end.answered();
                (Outcome::Done, String::new())
            }
            Err(error) => {
                if matches!(error, Error::Exception(_)) {
                    end.answered();
                }
                let outcome = if error.is_unknown() { Outcome::Unknown } else { Outcome::Refused };
                (outcome, why(&error))
            }
        }
    }
}

/// Returns the reason of an error; for an exception, the controller's own word.
fn why(error: &Error) -> String {
    match error {
        Error::Exception(exception) => exception.to_string(),
        error => error.to_string(),
    }
}

impl Modbus {
    fn report(&mut self, registers: &[u16; 37], end: &End) {
        let block = match self.telemetry.read(registers, now()) {
            ReadResult::Values(block) => block,
            ReadResult::Cannot(fault, value, 1) => {
                return end.bad(&json!({"event": "implausible", "fault": fault, "value": value}));
            }
            ReadResult::Cannot(fault, value, blocks) => {
                let event = json!({"event": "implausible", "fault": fault, "value": value, "blocks": blocks});
                return end.bad(&event);
            }
            ReadResult::Still => return,
        };
        let floats =
            [&block.position[..], &block.wpr, &block.quaternion, &block.velocity, &block.quaternion_rate];
        let floats = floats.into_iter().flatten().map(|value| Value::Float(*value));
        let wholes = [whole(block.life_counter), whole(block.override_percent)];
        let names = METRICS.iter().map(|definition| definition.name);
        end.values(names.zip(wholes.into_iter().chain(floats)).collect());
    }
}
