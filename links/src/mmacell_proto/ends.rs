//! Both ends of a platform's connection.

use anyhow::Result;
use mmacell_proto::device::machine::DeviceLink;
use mmacell_proto::{
    Central, CentralConfig, Command, Device, DeviceConfig, ErrorCode, Order, PlatformPose, central, device,
};
use robot_session::end::{End as _, Rules};
use serde::Deserialize as _;

use crate::end::{Act, Call, EndRow, Owner, PairedItem, PendingLimit, called, done};
use crate::given::GivenFields;

pub(super) const ENDS: &[EndRow] =
    &[EndRow::of::<Central<PlatformPose>>(), EndRow::of::<Device<PlatformPose>>()];

impl Owner for Central<PlatformPose> {
    type End = Self;
    type Rule = central::Rule;

    const CALLS: &'static [Call<Self>] = &[
        ("request", |central, _, argument| called(central.request(Command::deserialize(argument)?))),
        ("abort", |central, now, _| done(central.abort(now))),
    ];

    const PAIRED: &'static [PairedItem] = &[PairedItem {
        begins: Act::Call("request"),
        ends: &[
            Act::Event("done"),
            Act::Event("status"),
            Act::Event("refused"),
            Act::Event("aborted"),
            Act::All("closed"),
        ],
        room: PendingLimit::Most(1),
    }];

    fn new(given: GivenFields, rules: Rules<central::Rule>) -> Result<Self> {
        let made = given.configure(CentralConfig::DEFAULT.with_rules(rules))?;
        Ok(Self::new(made)?)
    }
}

impl Owner for Device<PlatformPose> {
    type End = Self;
    type Rule = device::Rule;

    const CALLS: &'static [Call<Self>] = &[
        ("accept", |device, _, _| called(device.accept(asked(device)))),
        ("accept_another", |device, _, _| called(device.accept(Order::Acquire { camera: 77 }))),
        ("refuse", |device, _, argument| {
            called(device.refuse(asked(device), ErrorCode::deserialize(argument)?))
        }),
        ("set_pose", |device, _, argument| done(device.set_pose(PlatformPose::deserialize(argument)?))),
        ("arrived", |device, _, _| done(device.arrived())),
        ("fail", |device, _, argument| done(device.fail(ErrorCode::deserialize(argument)?))),
    ];

    const PAIRED: &'static [PairedItem] = &[PairedItem {
        begins: Act::Event("asked"),
        ends: &[
            Act::Call("accept"),
            Act::Call("refuse"),
            Act::All("rejected"),
            Act::All("closed"),
            Act::Connection,
        ],
        room: PendingLimit::Silent,
    }];

    fn new(given: GivenFields, rules: Rules<device::Rule>) -> Result<Self> {
        let made = given.configure(DeviceConfig::DEFAULT.with_rules(rules))?;
        Ok(Self::new(made)?)
    }
}

/// Returns the pending order; without one, an order that is not pending.
fn asked(device: &Device<PlatformPose>) -> Order<PlatformPose> {
    match device.machine().link {
        DeviceLink::Asked { order } => order,
        _ => Order::Stop,
    }
}
