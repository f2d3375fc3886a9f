//! Both ends.

use anyhow::Result;
use robot_session::end::Rules;
use serde::Deserialize as _;
use toy_link::{Device, DeviceConfig, Host, HostConfig, device, host};

use crate::end::{Act, Call, EndRow, Owner, PairedItem, PendingLimit, called};
use crate::given::GivenFields;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Host>(), EndRow::of::<Device>()];

impl Owner for Host {
    type End = Self;
    type Rule = host::Rule;

    const CALLS: &'static [Call<Self>] =
        &[("get", |host, now, register| called(host.get(now, u8::deserialize(register)?)))];

    const PAIRED: &'static [PairedItem] = &[PairedItem {
        begins: Act::Call("get"),
        ends: &[Act::Event("value"), Act::Event("timed_out")],
        room: PendingLimit::Most(1),
    }];

    fn new(given: GivenFields, rules: Rules<host::Rule>) -> Result<Self> {
        let made = given.configure(HostConfig::default().with_rules(rules))?;
        Ok(Self::new(made)?)
    }
}

impl Owner for Device {
    type End = Self;
    type Rule = device::Rule;

    const CALLS: &'static [Call<Self>] =
        &[("answer", |device, _, value| called(device.answer(i32::deserialize(value)?)))];

    const PAIRED: &'static [PairedItem] = &[PairedItem {
        begins: Act::Event("asked"),
        ends: &[Act::Call("answer"), Act::Connection],
        room: PendingLimit::Most(1),
    }];

    fn new(given: GivenFields, rules: Rules<device::Rule>) -> Result<Self> {
        let made = given.configure(DeviceConfig::default().with_rules(rules))?;
        Ok(Self::new(made))
    }
}
