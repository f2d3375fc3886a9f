//! The PC of the Kawasaki link.

use core::cell::RefCell;
use core::time::Duration;
use std::rc::Rc;

use anyhow::{Context, Result, bail};
use kawasaki_msg::pc::{Order, Rule};
use kawasaki_msg::{ALL_NUMBERS, JobSource, LargePc, PcConfig, PcEvent, Supply, Takeover};
use robot_session::{End as _, Machine as _, Session as _};
use serde_json::{Map, Value};
use testkit::links::kawasaki_msg::rows;

use super::kawasaki::{AnyWork, Layout, corrupt, outputs, plain, plant, refused, rejected};
use super::{Do, End, Fields, Maker, Omits, Step, cell, event, names, reached, without};

pub(super) const MAKER: Maker =
    Maker { make: |config, rule| Ok(Box::new(KawasakiPc::new(config, rule)?)), rules: names::<Rule> };

fn configuration(fields: &mut Fields, rule: Option<usize>) -> Result<PcConfig<'static>> {
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
    made.rules = without(rule);
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
    layout: Layout,
    jobs: Rc<RefCell<Jobs>>,
}

impl KawasakiPc {
    fn new(config: &Map<String, Value>, rule: Option<usize>) -> Result<Self> {
        let mut fields = Fields(config.clone());
        let (dialect, layout) = plant(&mut fields)?;
        let config = PcConfig { dialect, ..configuration(&mut fields, rule)? };
        fields.end()?;
        let mut pc = LargePc::sized(config)?.with_ranges(layout.clone())?;
        pc.core_mut().moves = Some(Vec::new());
        Ok(Self { pc, layout, jobs: Rc::new(RefCell::new(Jobs { jobs: Vec::new(), is_open: false })) })
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
}

impl End for KawasakiPc {
    fn step(&mut self, now: Duration, input: &Do, omits: Omits) -> Result<Step> {
        let mut step = Step::default();
        if let Some((name, argument)) = input.give(&mut self.pc, now) {
            step.refused = self.call(name, argument)?;
        }
        outputs(&mut self.pc, now, omits, &mut step, shown)?;
        step.cells = reached(&mut self.pc.core_mut().moves, cell::<rows::Pc<ALL_NUMBERS>>);
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
