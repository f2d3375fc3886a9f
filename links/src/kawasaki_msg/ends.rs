//! Both ends; the PC with the jobs of its order, the robot with the motion program that takes them from its queue.

use core::borrow;
use core::cell::RefCell;
use std::rc::Rc;

use anyhow::{Context, Result, ensure};
use kawasaki_msg::{
    Dialect, Job, JobSource, LargePc, LargeRobot, PcConfig, RobotConfig, Supply, Takeover, Text, pc, robot,
};
use robot_session::end::Rules;
use robot_work_queue::Reader;
use serde::Deserialize;
use serde_json::{Map, Value};

use super::layout::{AnyValue, AnyWork, FieldType, Layout};
use super::plant::Plant;
use crate::end::{Call, CallResult, EndRow, Owner, called, done};
use crate::given::GivenFields;
use crate::json;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Pc>(), EndRow::of::<Robot>()];

/// The default number of slots in the queue.
const SLOTS: usize = 256;

/// The PC, and the jobs of its order.
struct Pc {
    pc: LargePc<SharedJobs>,
    layout: Layout,
    jobs: Rc<RefCell<Jobs>>,
}

/// The jobs of an order, which may grow.
#[derive(Debug, Default)]
struct Jobs {
    jobs: Vec<AnyWork>,
    is_open: bool,
}

/// The supplier of jobs that the session calls.
#[derive(Debug)]
struct SharedJobs(Rc<RefCell<Jobs>>);

impl Owner for Pc {
    type End = LargePc<SharedJobs>;
    type Rule = pc::Rule;

    const CALLS: &'static [Call<Self>] = &[
        ("start", |owner, _, argument| {
            owner.begin(argument, |pc, StartArgs { order, .. }, source| pc.start(order, source))
        }),
        ("resume", |owner, _, argument| {
            owner.begin(argument, |pc, StartArgs { order, executed, sent, ahead, .. }, source| {
                pc.resume(order, source, executed, sent, ahead)
            })
        }),
        ("add", |owner, _, jobs| {
            let jobs = read(&owner.layout, jobs)?;
            done(owner.jobs.borrow_mut().jobs.extend(jobs))
        }),
        ("close", |owner, _, _| done(owner.jobs.borrow_mut().is_open = false)),
        ("end", |owner, _, _| called(owner.pc.end())),
        ("interrupt", |owner, _, _| called(owner.pc.interrupt())),
        ("command", |owner, _, argument| {
            let CommandArgs { id, value } = CommandArgs::deserialize(argument)?;
            called(owner.pc.command(id, value))
        }),
    ];

    fn new(mut given: GivenFields, rules: Rules<pc::Rule>) -> Result<Self> {
        let (dialect, layout) = plant(&mut given)?;
        let made = PcConfig { dialect, takeover: Takeover::Interrupt, ..PcConfig::tcp() }.with_rules(rules);
        let pc = LargePc::with_ranges(given.configure(made)?, layout.clone())?;
        Ok(Self { pc, layout, jobs: Rc::default() })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StartArgs {
    order: u16,
    jobs: Value,
    /// More may come.
    #[serde(default)]
    open: bool,
    #[serde(default)]
    executed: u32,
    #[serde(default)]
    sent: u32,
    #[serde(default)]
    ahead: Vec<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CommandArgs {
    id: u8,
    #[serde(default)]
    value: i32,
}

type StartCall =
    fn(&mut LargePc<SharedJobs>, StartArgs, SharedJobs) -> Result<(), kawasaki_msg::SessionError>;

impl Pc {
    fn begin(&mut self, argument: &Value, begin: StartCall) -> CallResult {
        let begun = StartArgs::deserialize(argument)?;
        let jobs = Jobs { jobs: read(&self.layout, &begun.jobs)?, is_open: begun.open };
        let jobs = Rc::new(RefCell::new(jobs));
        let result = begin(&mut self.pc, begun, SharedJobs(Rc::clone(&jobs)));
        if result.is_ok() {
            self.jobs = jobs;
        }
        called(result)
    }
}

impl JobSource for SharedJobs {
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

impl borrow::Borrow<LargePc<SharedJobs>> for Pc {
    fn borrow(&self) -> &LargePc<SharedJobs> {
        &self.pc
    }
}

impl borrow::BorrowMut<LargePc<SharedJobs>> for Pc {
    fn borrow_mut(&mut self) -> &mut LargePc<SharedJobs> {
        &mut self.pc
    }
}

/// The robot with its motion program.
struct Robot {
    robot: LargeRobot<'static, AnyWork>,
    layout: Layout,
    motion: Option<Motion>,
    taken: Option<Job<AnyWork>>,
}

/// The motion program. A job that it executes stays in its slot; a clear removes all other jobs at once.
struct Motion {
    reader: Reader<'static, Job<AnyWork>>,
    executes: Option<u16>,
}

impl Owner for Robot {
    type End = LargeRobot<'static, AnyWork>;
    type Rule = robot::Rule;

    const CALLS: &'static [Call<Self>] = &[
        ("take", |owner, _, number| owner.take(Option::deserialize(number)?).map(|taken| taken.map(drop))),
        ("report", |owner, now, number| called(owner.robot.job_done(now, u16::deserialize(number)?))),
        ("complete", |owner, _, _| Ok(owner.motion()?.complete())),
        ("execute", |owner, now, _| match owner.take(None)? {
            Ok(number) => {
                let result = owner.robot.job_done(now, number);
                owner.motion()?.complete().map_err(anyhow::Error::msg)?;
                called(result)
            }
            Err(refused) => Ok(Err(refused)),
        }),
        ("clear_queue", |owner, _, _| called(owner.robot.clear_queue())),
        ("reset_order", |owner, _, _| called(owner.robot.reset_order())),
        ("abandon", |owner, _, _| done(owner.motion = None)),
    ];

    fn new(mut given: GivenFields, rules: Rules<robot::Rule>) -> Result<Self> {
        let (dialect, layout) = plant(&mut given)?;
        let slots: Option<usize> = given.take("queue")?;
        let made = given.configure(RobotConfig { dialect, ..RobotConfig::tcp() }.with_rules(rules))?;
        let slots = slots.unwrap_or(SLOTS.min(usize::from(made.max_number).saturating_sub(1)));
        let (writer, reader) = robot_work_queue::boxed(slots, made.max_number)?;
        let robot = LargeRobot::with_ranges(made, writer, layout.clone())?;
        Ok(Self { robot, layout, motion: Some(Motion { reader, executes: None }), taken: None })
    }

    fn then(&mut self) {
        if let Some(motion) = &mut self.motion {
            motion.sweep();
        }
    }

    fn beside(&mut self) -> Option<String> {
        let Job { order, number, work } = self.taken.take()?;
        let job = json::text(&show(&self.layout, &work));
        Some(format!(r#"{{"event":"taken","order":{order},"number":{number},"job":{job}}}"#))
    }
}

impl Robot {
    fn motion(&mut self) -> Result<&mut Motion> {
        self.motion.as_mut().context("the motion program is gone")
    }

    /// Begins the oldest job, or the one with this number.
    fn take(&mut self, number: Option<u16>) -> Result<Result<u16, String>> {
        let job = match self.motion()?.take(number) {
            Ok(job) => job,
            Err(refused) => return Ok(Err(refused)),
        };
        self.taken = Some(job);
        Ok(Ok(job.number))
    }
}

impl Motion {
    /// Removes cleared jobs. While a job is being executed its slot comes first, and no job is removed.
    fn sweep(&mut self) {
        if self.executes.is_none() {
            let _ = self.reader.take();
        }
    }

    fn take(&mut self, number: Option<u16>) -> Result<Job<AnyWork>, String> {
        if self.executes.is_some() {
            return Err(refusal("busy"));
        }
        let job = self.reader.take_where(|_, job| number.is_none_or(|number| number == job.number));
        let job = *job.ok_or_else(|| refusal("no_job"))?;
        self.executes = Some(job.number);
        Ok(job)
    }

    /// Frees the slot of the job; it is gone already if it was cleared meanwhile.
    fn complete(&mut self) -> Result<(), String> {
        let number = self.executes.take().ok_or_else(|| refusal("no_job"))?;
        if let Some(job) = self.reader.take_where(|_, job| job.number == number) {
            job.complete();
        }
        Ok(())
    }
}

fn refusal(kind: &str) -> String {
    format!(r#"{{"kind":"{kind}"}}"#)
}

impl borrow::Borrow<LargeRobot<'static, AnyWork>> for Robot {
    fn borrow(&self) -> &LargeRobot<'static, AnyWork> {
        &self.robot
    }
}

impl borrow::BorrowMut<LargeRobot<'static, AnyWork>> for Robot {
    fn borrow_mut(&mut self) -> &mut LargeRobot<'static, AnyWork> {
        &mut self.robot
    }
}

/// Reads the agreements of both ends that are not settings: `charset`, `messages` and `job` of a configuration.
pub(super) fn plant(given: &mut GivenFields) -> Result<(Dialect, Layout)> {
    let mut plant = Plant::default();
    plant.charset = given.take("charset")?.unwrap_or(plant.charset);
    plant.job = given.take("job")?;
    plant.replace(given.take("messages")?.unwrap_or_default())?;
    Ok((plant.dialect()?, plant.layout()?))
}

/// Reads the jobs of a list of objects, with numbers as counts of their last decimal.
fn read(layout: &Layout, jobs: &Value) -> Result<Vec<AnyWork>> {
    let one = |job: &Value| -> Result<AnyWork> {
        let mut work = AnyWork::default();
        let given = job.as_object().context("a job is an object")?;
        ensure!(given.len() == layout.fields().len(), "{job} has not the fields of the layout");
        for (place, field) in layout.fields().iter().enumerate() {
            let value = given.get(&field.name).with_context(|| format!("{job} has no {}", field.name))?;
            let value = match field.holds {
                FieldType::Number { .. } => AnyValue::Number(i32::deserialize(value)?),
                FieldType::Text { .. } => {
                    let text = value.as_str().and_then(Text::new);
                    AnyValue::Text(text.with_context(|| format!("{value} cannot be in a job"))?)
                }
            };
            work.set(place, value);
        }
        Ok(work)
    };
    jobs.as_array().context("jobs are a list")?.iter().map(one).collect()
}

/// Returns a job as an object of its fields.
fn show(layout: &Layout, work: &AnyWork) -> Map<String, Value> {
    let value = |place| match work.get(place) {
        AnyValue::Number(units) => Value::from(units),
        AnyValue::Text(text) => text.to_string().into(),
    };
    layout.fields().iter().enumerate().map(|(place, field)| (field.name.clone(), value(place))).collect()
}
