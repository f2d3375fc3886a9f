//! Both ends.

use core::time::Duration;

use anyhow::{Result, bail};
use robot_session::Rules;
use serde::Deserialize as _;
use serde_json::Value;
use val2_alter::{
    Controller, ControllerConfig, Exception, Host, HostConfig, Policy, SegmentStatus, Transform, Unselected,
    controller, host,
};

use crate::end::{Call, EndRow, Owner, called, done};
use crate::fields::Fields;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Controller>("controller"), EndRow::of::<Host>("host")];

impl Owner for Host {
    type End = Self;
    type Rule = host::Rule;

    const CALLS: &'static [Call<Self>] = &[
        ("set_target", |host, now, words| done(host.set_target(now, <[i16; 6]>::deserialize(words)?))),
        ("clear_target", |host, now, _| done(host.clear_target(now))),
        ("stop", |host, now, _| done(host.stop(now))),
        ("set_policy", |host, now, policy| done(host.set_policy(now, Policy::deserialize(policy)?))),
        ("set_subroutine", |host, now, there| done(host.set_subroutine(now, bool::deserialize(there)?))),
        ("exception", |host, now, code| called(host.exception(now, Exception::deserialize(code)?))),
    ];

    fn new(fields: &mut Fields, rules: Rules<host::Rule>) -> Result<Self> {
        let mut made = HostConfig { rules, ..HostConfig::default() };
        fields.take("framing", &mut made.framing)?;
        fields.take("baud", &mut made.baud)?;
        fields.take("mode", &mut made.mode.0)?;
        fields.take("subroutine", &mut made.subroutine)?;
        fields.take("repeats", &mut made.repeats)?;
        fields.take("silence_cycles", &mut made.silence_cycles)?;
        gap(fields, &mut made.gap)?;
        fields.time("target_timeout", &mut made.target_timeout)?;
        fields.time("reserve", &mut made.reserve)?;
        fields.time("max_delay", &mut made.max_delay)?;
        fields.take("policy", &mut made.policy)?;
        if let Some(limits) = fields.0.remove("limits") {
            let Value::Object(limits) = limits else { bail!("limits is an object") };
            let mut limits = Fields(limits);
            limits.take("velocity", &mut made.limits.velocity)?;
            limits.take("acceleration", &mut made.limits.acceleration)?;
            limits.end()?;
        }
        Ok(Self::new(made)?)
    }
}

impl Owner for Controller {
    type End = Self;
    type Rule = controller::Rule;

    const CALLS: &'static [Call<Self>] = &[
        ("start", |controller, now, _| called(controller.start(now))),
        ("finish", |controller, now, _| called(controller.finish(now))),
        ("interrupt", |controller, now, _| called(controller.interrupt(now))),
        ("resume", |controller, now, _| called(controller.resume(now))),
        ("set_segment", |controller, _, argument| {
            let (status, number, percent) = <(u8, u16, u16)>::deserialize(argument)?;
            done(controller.set_segment(SegmentStatus::from(status), number, percent))
        }),
        ("set_transform", |controller, _, words| {
            done(controller.set_transform(Transform::deserialize(words)?))
        }),
    ];

    fn new(fields: &mut Fields, rules: Rules<controller::Rule>) -> Result<Self> {
        let mut made = ControllerConfig { rules, ..ControllerConfig::default() };
        fields.take("framing", &mut made.framing)?;
        fields.take("baud", &mut made.baud)?;
        fields.take("mode", &mut made.mode.0)?;
        fields.take("data", &mut made.data)?;
        fields.take("subroutine", &mut made.subroutine)?;
        fields.take("attempts", &mut made.attempts)?;
        gap(fields, &mut made.gap)?;
        if let Some(unselected) = fields.0.remove("unselected") {
            made.unselected = match unselected.as_str() {
                Some("by_mode") => Unselected::ByMode,
                Some("hold") => Unselected::Hold,
                Some("zero") => Unselected::Zero,
                _ => bail!("unselected: {unselected}"),
            };
        }
        Ok(Self::new(made)?)
    }
}

/// In nanoseconds, of which the most is for ever; `null`: a silence ends no frame.
fn gap(fields: &mut Fields, gap: &mut Option<Duration>) -> Result<()> {
    if let Some(given) = fields.0.remove("gap") {
        let nanoseconds = serde_json::from_value::<Option<u64>>(given)?;
        *gap = nanoseconds.map(|gap| if gap == u64::MAX { Duration::MAX } else { Duration::from_nanos(gap) });
    }
    Ok(())
}
