//! Both ends.

use anyhow::Result;
use robot_session::end::Rules;
use serde::Deserialize as _;
use val2_alter::{
    Controller, ControllerConfig, Exception, Host, HostConfig, Policy, SegmentStatus, Transform, controller,
    host,
};

use crate::end::{Call, EndRow, Owner, called, done};
use crate::given::GivenFields;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Controller>(), EndRow::of::<Host>()];

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

    fn new(given: GivenFields, rules: Rules<host::Rule>) -> Result<Self> {
        let made = given.configure(HostConfig::default().with_rules(rules))?;
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

    fn new(given: GivenFields, rules: Rules<controller::Rule>) -> Result<Self> {
        let made = given.configure(ControllerConfig::default().with_rules(rules))?;
        Ok(Self::new(made)?)
    }
}
