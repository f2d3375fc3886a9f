//! The robot of the Kawasaki link, with the queue and the motion program that takes its jobs.

use core::time::Duration;

use anyhow::{Result, bail};
use kawasaki_msg::robot::{Input, Machine, Order, RobotRule};
use kawasaki_msg::{
    Acks, Decoder, Dialect, Field, FromPc, Job, LargeRobot, Message, Numbering, RecoveryLimits, RobotConfig,
    RobotEvent, Role, Value as Wire,
};
use robot_session::{Decoder as _, Session as _};
use robot_work_queue::Reader;
use serde::Deserialize;
use serde_json::{Map, Value};

use super::kawasaki::{AnyWork, Layout, Seen, corrupt, outputs, plain, plant, refused, rejected, see};
use super::{Do, End, Fields, Maker, Omits, Step, event, kind};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| Ok(Box::new(KawasakiRobot::new(config, without)?)),
    rules: || {
        [
            "DestroyRest",
            "EndFillsGap",
            "GapAtConnection",
            "StepsByClock",
            "ClosingIsStep",
            "SlowInRest",
            "SettledTwice",
            "NewStarts",
            "IgnoreStarts",
            "DrainStarts",
        ]
        .map(String::from)
        .to_vec()
    },
};

const RULES: [RobotRule; 10] = [
    RobotRule::DestroyRest,
    RobotRule::EndFillsGap,
    RobotRule::GapAtConnection,
    RobotRule::StepsByClock,
    RobotRule::ClosingIsStep,
    RobotRule::SlowInRest,
    RobotRule::SettledTwice,
    RobotRule::NewStarts,
    RobotRule::IgnoreStarts,
    RobotRule::DrainStarts,
];

/// Slots of the queue where a story does not say how many.
const SLOTS: usize = 256;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Recovery {
    resends: u16,
    pauses: u16,
    clears: u16,
}

fn configuration(fields: &mut Fields, without: Option<usize>) -> Result<RobotConfig<'static>> {
    let mut made = RobotConfig::TCP;
    fields.take("limits", &mut made.limits)?;
    fields.take("datagrams", &mut made.datagrams)?;
    fields.take("max_number", &mut made.max_number)?;
    let mut acks: Option<Value> = None;
    fields.take("acks", &mut acks)?;
    if let Some(acks) = acks {
        made.acks = match acks.as_str() {
            Some("individual") => Acks::Individual,
            _ => Acks::Cumulative { every: serde_json::from_value(acks)? },
        };
    }
    fields.take("low_water", &mut made.low_water)?;
    let mut recovery: Option<Recovery> = None;
    fields.take("recovery", &mut recovery)?;
    if let Some(Recovery { resends, pauses, clears }) = recovery {
        made.recovery = RecoveryLimits { resends, pauses, clears };
    }
    fields.time("patience", &mut made.patience)?;
    fields.time("pause", &mut made.pause)?;
    fields.time("reply_timeout", &mut made.reply_timeout)?;
    fields.time("exchange", &mut made.exchange)?;
    fields.take("silent_cycles", &mut made.silent_cycles)?;
    fields.time("reconnect_delay", &mut made.reconnect_delay)?;
    fields.time("status_period", &mut made.status_period)?;
    fields.take("refuse_repeated_start", &mut made.refuse_repeated_start)?;
    fields.take("end_foreign_order", &mut made.end_foreign_order)?;
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
    Ok(made)
}

struct KawasakiRobot {
    robot: LargeRobot<'static, AnyWork>,
    config: RobotConfig<'static>,
    layout: Layout,
    motion: Option<Motion>,
    /// Reads the same bytes, for the cells.
    decoder: Decoder,
}

/// The motion program. A job that it executes stays in its slot; what is cleared is removed at once, but for that job.
struct Motion {
    reader: Reader<'static, Job<AnyWork>>,
    executes: Option<u16>,
}

impl Motion {
    /// Removes what was cleared. While a job is being executed its slot comes first, and nothing is looked at.
    fn sweep(&mut self) {
        if self.executes.is_none() {
            let _ = self.reader.take();
        }
    }

    /// Begins the oldest job, or the one with this number.
    fn take(&mut self, number: Option<u16>) -> Result<Job<AnyWork>, &'static str> {
        if self.executes.is_some() {
            return Err("busy");
        }
        let job = self.reader.take_where(|_, job| number.is_none_or(|number| number == job.number));
        let job = *job.ok_or("no_job")?;
        self.executes = Some(job.number);
        Ok(job)
    }

    /// Frees the slot of the job; it is gone already if it was cleared meanwhile.
    fn complete(&mut self) -> Result<(), &'static str> {
        let number = self.executes.take().ok_or("no_job")?;
        if let Some(job) = self.reader.take_where(|_, job| job.number == number) {
            job.complete();
        }
        Ok(())
    }

    fn is_full(&self) -> bool {
        let capacity = self.reader.capacity();
        self.reader.len() >= capacity || self.executes.is_some() && capacity == 1
    }
}

impl KawasakiRobot {
    fn new(config: &Map<String, Value>, without: Option<usize>) -> Result<Self> {
        let mut fields = Fields(config.clone());
        let (dialect, layout) = plant(&mut fields)?;
        let config = RobotConfig { dialect, ..configuration(&mut fields, without)? };
        let mut slots = SLOTS.min(usize::from(config.max_number) - 1);
        fields.take("queue", &mut slots)?;
        fields.end()?;
        let (writer, reader) = robot_work_queue::boxed(slots, config.max_number)?;
        Ok(Self {
            robot: LargeRobot::sized(config, writer)?.with_ranges(layout.clone())?,
            config,
            layout,
            motion: Some(Motion { reader, executes: None }),
            decoder: Decoder::new(dialect.charset()),
        })
    }

    /// The object of the refusal, if it is one.
    fn call(
        &mut self,
        now: Duration,
        name: &str,
        argument: &Value,
        events: &mut Vec<String>,
    ) -> Result<Option<String>> {
        let number = argument.as_u64().map(u16::try_from).transpose()?;
        let result = match (name, &mut self.motion) {
            ("report", _) => self.robot.job_done(now, number.unwrap_or_default()).map_err(refused),
            ("clear_queue", _) => self.robot.clear_queue().map_err(refused),
            ("reset_order", _) => self.robot.reset_order().map_err(refused),
            ("abandon", motion) => {
                *motion = None;
                Ok(())
            }
            (_, None) => bail!("the motion program is gone"),
            ("take", Some(motion)) => match motion.take(number) {
                Ok(job) => {
                    events.push(self.taken(&job)?);
                    Ok(())
                }
                Err(why) => Err(kind(why)),
            },
            ("complete", Some(motion)) => motion.complete().map_err(kind),
            ("execute", Some(motion)) => match motion.take(None) {
                Ok(job) => {
                    events.push(self.taken(&job)?);
                    let result = self.robot.job_done(now, job.number).map_err(refused);
                    if let Some(motion) = &mut self.motion {
                        motion.complete().map_err(|why| anyhow::anyhow!(why))?;
                    }
                    result
                }
                Err(why) => Err(kind(why)),
            },
            _ => bail!("a robot has no call {name}"),
        };
        Ok(result.err())
    }

    fn taken(&self, job: &Job<AnyWork>) -> Result<String> {
        let object = event("taken").raw("order", job.order).raw("number", job.number);
        Ok(object.raw("job", self.layout.show(&job.work)?).end())
    }

    /// The cells that an input has reached.
    fn cells(
        &mut self,
        before: &Machine,
        now: Duration,
        input: &Do,
        was_full: bool,
        is_refused: bool,
    ) -> Vec<String> {
        let state = before.name();
        let one = |input: &str| vec![format!("{state}: {input}")];
        match input {
            Do::Connected => one("Connected"),
            Do::Disconnected => one("Disconnected"),
            Do::Timeout => self.cells_of_time(before, now),
            Do::Input(bytes) if before.is_connected() => {
                let config = &self.config;
                let Seen { first, is_whole } = see(&mut self.decoder, bytes, config.datagrams, |message| {
                    meaning(config, message, before, !was_full)
                });
                let mut cells = Vec::new();
                if is_whole {
                    cells.push(format!("{}: ReadEnd", self.robot.machine().name()));
                }
                match first {
                    Some(Ok(cell)) => cells.extend(cell.map(|cell| format!("{state}: {cell}"))),
                    Some(Err(_)) => cells.push(format!("{state}: Corrupt")),
                    None => {}
                }
                cells
            }
            Do::Call { name, .. } if !is_refused => match name.as_str() {
                "report" | "execute" => one("Executed { number: 2 }"),
                "clear_queue" => one("ClearQueue"),
                "reset_order" => one("ResetOrder"),
                _ => Vec::new(),
            },
            _ => Vec::new(),
        }
    }

    /// Time passes first, then the queue is looked at.
    fn cells_of_time(&self, before: &Machine, now: Duration) -> Vec<String> {
        let mut cells = vec![format!("{}: Timeout", before.name())];
        let mut machine = before.clone();
        let mut on = |input| {
            // No state refuses these.
            let _ = machine.on(now, input, &self.config);
            machine.name()
        };
        on(Input::Timeout);
        let state = on(Input::Timeout);
        let Some(motion) = &self.motion else {
            cells.push(format!("{state}: Settled"));
            return cells;
        };
        let state = match motion.executes {
            None => {
                cells.push(format!("{state}: Settled"));
                on(Input::Settled)
            }
            Some(_) => state,
        };
        let low_water = self.config.low_water.unwrap_or(motion.reader.capacity() / 2);
        if motion.reader.len() <= low_water {
            cells.push(format!("{state}: Drained"));
        }
        cells
    }
}

impl End for KawasakiRobot {
    fn step(&mut self, now: Duration, input: &Do, omits: Omits) -> Result<Step> {
        let before = self.robot.machine().clone();
        let was_full = self.motion.as_ref().is_some_and(Motion::is_full);
        let mut step = Step::default();
        match input {
            Do::Connected => {
                self.robot.handle_connected(now);
                self.decoder.clear();
            }
            Do::Disconnected => self.robot.handle_disconnected(now),
            Do::Input(bytes) => self.robot.handle_input(now, bytes),
            Do::Timeout => self.robot.handle_timeout(now),
            Do::Transmitted => self.robot.handle_transmitted(now),
            Do::Nothing => {}
            Do::Call { name, argument } => step.refused = self.call(now, name, argument, &mut step.events)?,
        }
        step.cells = self.cells(&before, now, input, was_full, step.refused.is_some());
        if let Some(motion) = &mut self.motion {
            motion.sweep();
        }
        outputs(&mut self.robot, now, omits, &mut step, shown)?;
        Ok(step)
    }

    fn deadline(&self) -> Option<Duration> {
        self.robot.poll_timeout()
    }

    fn state(&self) -> String {
        let machine = self.robot.machine();
        let is_alone = !machine.is_connected() && machine.order != Order::Idle;
        format!("{}{}", machine.name(), if is_alone { ", not connected" } else { "" })
    }
}

fn shown(happened: &RobotEvent) -> Result<String> {
    Ok(match happened {
        RobotEvent::Corrupt(error) => corrupt(error),
        RobotEvent::Rejected(error) => rejected(error),
        RobotEvent::PeerStatus { order, phase, sent, executed } => event("peer_status")
            .raw("order", order)
            .raw("phase", u8::from(*phase))
            .value("sent", sent)?
            .value("executed", executed)?
            .end(),
        other => plain(other)?,
    })
}

/// What a message is in the matrix, where the active order is 50 and its next job 3; `None` for a message that is not in it.
fn meaning(config: &RobotConfig<'_>, message: &Message<'_>, machine: &Machine, room: bool) -> Option<String> {
    let dialect = &config.dialect;
    let of = |message: &str| format!("Message {{ message: {message}, room: true }}");
    let Ok((role, params)) = dialect.read(message) else { return Some(of("Unusable")) };
    let active = machine.order.number();
    let is_ours = |order: u16| if active == 0 { order != 51 } else { order == active };
    let next = Numbering::new(config.max_number).next(machine.queued);
    Some(match FromPc::read(role, &params) {
        FromPc::Status { .. } => of("Status { order: 51 }"),
        FromPc::Start { order, .. } if is_ours(order) => of("Start { order: 50, first: 1 }"),
        FromPc::Start { .. } => of("Start { order: 51, first: 1 }"),
        FromPc::End { order } if is_ours(order) => of("End { order: 50 }"),
        FromPc::Interrupt { order } if is_ours(order) => of("Interrupt { order: 50 }"),
        FromPc::End { .. } | FromPc::Interrupt { .. } => return None,
        FromPc::Job { order, number, .. } if is_ours(order) && number == next => {
            match machine.fast_path(config) {
                Some(_) if room && is_plain(dialect, message, order, number) => "Queued { count: 1 }".into(),
                _ => {
                    format!("Message {{ message: Job {{ order: 50, number: 3, good: true }}, room: {room} }}")
                }
            }
        }
        FromPc::Job { order, .. } if is_ours(order) => of("Job { order: 50, number: 5, good: true }"),
        FromPc::Job { .. } => return None,
        FromPc::Filler => of("Filler"),
        FromPc::WrongSide => of("WrongSide"),
        FromPc::Unusable => of("Unusable"),
    })
}

/// Whether a job is written as we would: any other is read by itself.
fn is_plain(dialect: &Dialect<'_>, message: &Message<'_>, order: u16, number: u16) -> bool {
    let fields = dialect.entry(Role::Job).map_or(&[][..], |entry| entry.fields);
    let is = |field: &Field<'_>, value: Wire<'_>| match field {
        Field::Order => value == *order.to_string().as_str(),
        Field::Number => value == *number.to_string().as_str(),
        _ => true,
    };
    let before_work = fields.iter().take_while(|field| **field != Field::Work);
    before_work.zip(message.fields.iter()).all(|(field, value)| is(field, value))
}
