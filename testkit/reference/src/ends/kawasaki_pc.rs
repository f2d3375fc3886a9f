//! The PC of the Kawasaki link.

use core::cell::RefCell;
use core::time::Duration;
use std::rc::Rc;

use anyhow::{Context, Result, bail};
use kawasaki_msg::pc::{Machine, Order, PcRule};
use kawasaki_msg::{
    Decoder, FromRobot, JobSource, LargePc, Message, PcConfig, PcEvent, Status, Supply, Takeover,
};
use robot_session::{Decoder as _, Session as _};
use serde_json::{Map, Value};

use super::kawasaki::{AnyWork, Layout, Seen, corrupt, outputs, plain, plant, refused, rejected, see};
use super::{Do, End, Fields, Maker, Omits, Step, event};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| Ok(Box::new(KawasakiPc::new(config, without)?)),
    rules: || {
        ["LearnIdentity", "CancelWaits", "StartOnce", "DoubtCorrupt", "Window", "LateReports"]
            .map(String::from)
            .to_vec()
    },
};

const RULES: [PcRule; 6] = [
    PcRule::LearnIdentity,
    PcRule::CancelWaits,
    PcRule::StartOnce,
    PcRule::DoubtCorrupt,
    PcRule::Window,
    PcRule::LateReports,
];

fn configuration(fields: &mut Fields, without: Option<usize>) -> Result<PcConfig<'static>> {
    let mut made = PcConfig::TCP;
    fields.take("limits", &mut made.limits)?;
    fields.take("datagrams", &mut made.datagrams)?;
    fields.take("max_number", &mut made.max_number)?;
    fields.take("cumulative_acks", &mut made.cumulative_acks)?;
    fields.time("reply_delay", &mut made.reply_delay)?;
    fields.time("silence", &mut made.silence)?;
    let mut takeover = "interrupt".to_owned();
    fields.take("takeover", &mut takeover)?;
    made.takeover = match takeover.as_str() {
        "never" => Takeover::Never,
        "end" => Takeover::End,
        "interrupt" => Takeover::Interrupt,
        _ => bail!("takeover is never, end or interrupt"),
    };
    fields.take("start_retries", &mut made.start_retries)?;
    fields.take("end_when_done", &mut made.end_when_done)?;
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
    Ok(made)
}

/// The jobs of an order, which may grow.
#[derive(Debug)]
struct Jobs {
    jobs: Vec<AnyWork>,
    is_open: bool,
}

/// What the session asks for jobs.
#[derive(Debug)]
struct Source(Rc<RefCell<Jobs>>);

impl JobSource for Source {
    type Work = AnyWork;

    fn job(&mut self, index: u32) -> Supply<AnyWork> {
        let jobs = self.0.borrow();
        match usize::try_from(index).ok().and_then(|index| jobs.jobs.get(index)) {
            Some(work) => Supply::Job(*work),
            None if jobs.is_open => Supply::Later,
            None => Supply::End,
        }
    }
}

struct KawasakiPc {
    pc: LargePc<'static, Source>,
    config: PcConfig<'static>,
    layout: Layout,
    jobs: Rc<RefCell<Jobs>>,
    /// Reads the same bytes, for the cells.
    decoder: Decoder,
}

impl KawasakiPc {
    fn new(config: &Map<String, Value>, without: Option<usize>) -> Result<Self> {
        let mut fields = Fields(config.clone());
        let (dialect, layout) = plant(&mut fields)?;
        let config = PcConfig { dialect, ..configuration(&mut fields, without)? };
        fields.end()?;
        Ok(Self {
            pc: LargePc::sized(config)?.with_ranges(layout.clone())?,
            config,
            layout,
            jobs: Rc::new(RefCell::new(Jobs { jobs: Vec::new(), is_open: false })),
            decoder: Decoder::new(dialect.charset()),
        })
    }

    fn call(&mut self, name: &str, argument: &Value) -> Result<Option<String>> {
        let number = |key: &str| argument.get(key).and_then(Value::as_u64).unwrap_or_default();
        let pc = &mut self.pc;
        let result = match name {
            "start" | "resume" => {
                let jobs = self.layout.read(argument.get("jobs").context("an order has jobs")?)?;
                let is_open = argument.get("open").and_then(Value::as_bool).unwrap_or_default();
                let jobs = Rc::new(RefCell::new(Jobs { jobs, is_open }));
                let (order, source) = (u16::try_from(number("order"))?, Source(Rc::clone(&jobs)));
                let result = if name == "start" {
                    pc.start(order, source)
                } else {
                    let (executed, sent) =
                        (u32::try_from(number("executed"))?, u32::try_from(number("sent"))?);
                    let ahead: Vec<u32> = match argument.get("ahead") {
                        Some(ahead) => serde_json::from_value(ahead.clone())?,
                        None => Vec::new(),
                    };
                    pc.resume(order, source, executed, sent, ahead)
                };
                if result.is_ok() {
                    self.jobs = jobs;
                }
                result
            }
            "add" => {
                self.jobs.borrow_mut().jobs.extend(self.layout.read(argument)?);
                Ok(())
            }
            "close" => {
                self.jobs.borrow_mut().is_open = false;
                Ok(())
            }
            "end" => pc.end(),
            "interrupt" => pc.interrupt(),
            "command" => {
                let value = argument.get("value").and_then(Value::as_i64).unwrap_or_default();
                pc.command(u8::try_from(number("id"))?, i32::try_from(value)?)
            }
            _ => bail!("a PC has no call {name}"),
        };
        Ok(result.err().map(refused))
    }

    /// The cells that an input has reached.
    fn cells(&mut self, before: &Machine, input: &Do, is_refused: bool) -> Vec<String> {
        let state = before.name();
        let after = self.pc.machine().name();
        let one = |input: &str| vec![format!("{state}: {input}")];
        match input {
            Do::Connected => one("Connected"),
            Do::Disconnected => one("Disconnected"),
            Do::Timeout => one("Timeout"),
            Do::Input(bytes) if before.is_connected() => {
                let (dialect, order) = (self.config.dialect, before.order);
                let Seen { first, is_whole } =
                    see(&mut self.decoder, bytes, self.config.datagrams, |message| {
                        meaning(&dialect, message, order)
                    });
                let mut cells = vec![format!("{after}: ReadEnd {{ whole: {is_whole} }}")];
                match first {
                    Some(Ok(cell)) => {
                        cells.push(format!("{state}: Received"));
                        cells.extend(cell.map(|cell| format!("{state}: Message({cell})")));
                    }
                    Some(Err(_)) => cells.push(format!("{state}: Corrupt")),
                    None => {}
                }
                cells
            }
            Do::Call { name, .. } if !is_refused => match name.as_str() {
                "start" => one("Start { order: 50 }"),
                "resume" => one("Resume { order: 50, executed: 2, sent: 4 }"),
                "end" => one("End"),
                "interrupt" => one("Interrupt"),
                "command" => one("Command"),
                _ => Vec::new(),
            },
            _ => Vec::new(),
        }
    }
}

impl End for KawasakiPc {
    fn step(&mut self, now: Duration, input: &Do, omits: Omits) -> Result<Step> {
        let before = self.pc.machine().clone();
        let mut step = Step::default();
        match input {
            Do::Connected => {
                self.pc.handle_connected(now);
                self.decoder.clear();
            }
            Do::Disconnected => self.pc.handle_disconnected(now),
            Do::Input(bytes) => self.pc.handle_input(now, bytes),
            Do::Timeout => self.pc.handle_timeout(now),
            Do::Transmitted => self.pc.handle_transmitted(now),
            Do::Nothing => {}
            Do::Call { name, argument } => step.refused = self.call(name, argument)?,
        }
        step.cells = self.cells(&before, input, step.refused.is_some());
        outputs(&mut self.pc, now, omits, &mut step, shown)?;
        Ok(step)
    }

    fn deadline(&self) -> Option<Duration> {
        self.pc.poll_timeout()
    }

    fn state(&self) -> String {
        let machine = self.pc.machine();
        let is_alone = !machine.is_connected() && machine.order != Order::Idle;
        format!("{}{}", machine.name(), if is_alone { ", not connected" } else { "" })
    }
}

fn shown(happened: &PcEvent) -> Result<String> {
    Ok(match happened {
        PcEvent::Corrupt(error) => corrupt(error),
        PcEvent::Rejected(error) => rejected(error),
        PcEvent::PeerStatus { order, phase, queued, executed } => event("peer_status")
            .raw("order", order)
            .raw("phase", u8::from(*phase))
            .value("queued", queued)?
            .value("executed", executed)?
            .end(),
        other => plain(other)?,
    })
}

/// What a message is in the matrix, where ours is order 50; `None` for a message that is not in it.
fn meaning(dialect: &kawasaki_msg::Dialect<'_>, message: &Message<'_>, ours: Order) -> Option<&'static str> {
    let Ok((role, params)) = dialect.read(message) else { return Some("Unusable") };
    let is_ours = |order: u16| order != 0 && (ours == Order::Idle || order == ours.number());
    Some(match FromRobot::read(role, &params) {
        FromRobot::JobAck { .. } => "JobAck { order: 50, number: 2 }",
        FromRobot::OrderAck { active: 0 } => "OrderAck { active: 0 }",
        FromRobot::OrderAck { active } if ours != Order::Idle && is_ours(active) => "OrderAck { active: 50 }",
        FromRobot::OrderAck { active: 50 } => "OrderAck { active: 50 }",
        FromRobot::OrderAck { .. } => "OrderAck { active: 51 }",
        FromRobot::EndAck { ended, .. } if is_ours(ended) => {
            "EndAck { ended: 50, active: 0, executed: Some(4) }"
        }
        FromRobot::EndAck { .. } => return None,
        FromRobot::Status(Status { order: 0, .. }) => {
            "Status(Status { order: 0, phase: Idle, queued: None, executed: None, ended: 0 })"
        }
        FromRobot::Status(Status { order, queued: Some(_), .. }) if is_ours(order) => {
            "Status(Status { order: 50, phase: Active, queued: Some(3), executed: Some(1), ended: 0 })"
        }
        FromRobot::Status(Status { order, queued: None, .. }) if ours == Order::Idle || !is_ours(order) => {
            "Status(Status { order: 51, phase: Active, queued: None, executed: None, ended: 0 })"
        }
        FromRobot::Status(_) => return None,
        FromRobot::Pause { .. } => "Pause { order: 50, queued: Some(3) }",
        FromRobot::Request { .. } => "Request { order: 50, number: 1 }",
        FromRobot::Filler => "Filler",
        FromRobot::WrongSide => "WrongSide",
        FromRobot::Unusable => "Unusable",
    })
}
