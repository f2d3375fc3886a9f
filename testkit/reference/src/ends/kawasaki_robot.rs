//! The robot of the Kawasaki link, with the queue and the motion program that takes its jobs.

use core::time::Duration;

use anyhow::{Result, bail};
use kawasaki_msg::robot::{Order, Rule};
use kawasaki_msg::{ALL_NUMBERS, Acks, Job, LargeRobot, RecoveryLimits, RobotConfig, RobotEvent};
use robot_session::{End as _, Machine as _, Session as _};
use robot_work_queue::Reader;
use serde::Deserialize;
use serde_json::{Map, Value};
use testkit::links::kawasaki_msg::rows;

use super::kawasaki::{AnyWork, Layout, corrupt, outputs, plain, plant, refused, rejected};
use super::{Do, End, Fields, Maker, Omits, Step, cell, event, kind, names, reached, without};

pub(super) const MAKER: Maker =
    Maker { make: |config, rule| Ok(Box::new(KawasakiRobot::new(config, rule)?)), rules: names::<Rule> };

/// Slots of the queue where a story does not say how many.
const SLOTS: usize = 256;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Recovery {
    resends: u16,
    pauses: u16,
    clears: u16,
}

fn configuration(fields: &mut Fields, rule: Option<usize>) -> Result<RobotConfig<'static>> {
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
    made.rules = without(rule);
    Ok(made)
}

struct KawasakiRobot {
    robot: LargeRobot<'static, AnyWork>,
    layout: Layout,
    motion: Option<Motion>,
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
}

impl KawasakiRobot {
    fn new(config: &Map<String, Value>, rule: Option<usize>) -> Result<Self> {
        let mut fields = Fields(config.clone());
        let (dialect, layout) = plant(&mut fields)?;
        let config = RobotConfig { dialect, ..configuration(&mut fields, rule)? };
        let mut slots = SLOTS.min(usize::from(config.max_number) - 1);
        fields.take("queue", &mut slots)?;
        fields.end()?;
        let (writer, reader) = robot_work_queue::boxed(slots, config.max_number)?;
        let mut robot = LargeRobot::sized(config, writer)?.with_ranges(layout.clone())?;
        robot.core_mut().moves = Some(Vec::new());
        Ok(Self { robot, layout, motion: Some(Motion { reader, executes: None }) })
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
}

impl End for KawasakiRobot {
    fn step(&mut self, now: Duration, input: &Do, omits: Omits) -> Result<Step> {
        let mut step = Step::default();
        if let Some((name, argument)) = input.give(&mut self.robot, now) {
            step.refused = self.call(now, name, argument, &mut step.events)?;
        }
        if let Some(motion) = &mut self.motion {
            motion.sweep();
        }
        outputs(&mut self.robot, now, omits, &mut step, shown)?;
        step.cells = reached(&mut self.robot.core_mut().moves, cell::<rows::Robot<ALL_NUMBERS>>);
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
