//! Both ends.

use anyhow::Result;
use robot_session::end::Rules;
use serde::Deserialize as _;
use toy_link::{Device, DeviceConfig, Host, HostConfig, device, host};

use crate::end::{By, Call, EndRow, Once, Owner, Room, called};
use crate::given::Given;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Host>(), EndRow::of::<Device>()];

impl Owner for Host {
    type End = Self;
    type Rule = host::Rule;

    const CALLS: &'static [Call<Self>] =
        &[("get", |host, now, register| called(host.get(now, u8::deserialize(register)?)))];

    const ONCE: &'static [Once] = &[Once {
        begins: By::Call("get"),
        ends: &[By::Event("value"), By::Event("timed_out")],
        room: Room::Most(1),
    }];

    fn new(given: Given, rules: Rules<host::Rule>) -> Result<Self> {
        let made = given.configure(HostConfig { rules, ..HostConfig::default() })?;
        Ok(Self::new(made)?)
    }
}

impl Owner for Device {
    type End = Self;
    type Rule = device::Rule;

    const CALLS: &'static [Call<Self>] =
        &[("answer", |device, _, value| called(device.answer(i32::deserialize(value)?)))];

    const ONCE: &'static [Once] = &[Once {
        begins: By::Event("asked"),
        ends: &[By::Call("answer"), By::Connection],
        room: Room::Most(1),
    }];

    fn new(given: Given, rules: Rules<device::Rule>) -> Result<Self> {
        let made = given.configure(DeviceConfig { rules })?;
        Ok(Self::new(made))
    }
}
