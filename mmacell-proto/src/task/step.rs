/// Where the task is. The number in brackets is the step of §6.
///
/// Each step gives orders when it begins and then waits for a [`Trigger`]. [`transitions`](Self::transitions) is the whole
/// table; `docs/task.md` is drawn from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Step {
    /// \[1\] Waits until robot, platform and conditioning system are ready.
    AwaitDevices,
    /// \[2\] They are.
    DevicesReady,
    /// \[3\] Servo motors of robot and platform on.
    ServosOn,
    /// \[4\] Override of robot and platform.
    SetOverride,
    /// \[5\] Robot and platform home.
    GoHome,
    /// \[6\] Asks both until they stand.
    AwaitHome,
    /// \[7\] Robot to where camera 1 sees the parts.
    GoCamera1,
    /// \[8\] Asks the robot until it stands.
    AwaitCamera1,
    /// \[9\] Camera 1: which part, and where.
    FindPart,
    /// \[10\] Platform to the pose that this part needs.
    TurnPlatform,
    /// \[11\] Robot to where camera 2 sees the place.
    GoCamera2,
    /// \[12\] Asks both until they stand.
    AwaitCamera2,
    /// \[13\] Camera 2: where the part goes.
    FindSlot,
    /// \[14\] Robot to the part.
    GoPick,
    /// \[15\] Vacuum on.
    VacuumOn,
    /// \[16\] Asks the robot until it stands, or until the switch closes.
    AwaitPick,
    /// \[17\] The switch closed on the way: robot stop.
    StopAtPart,
    /// \[18\] The robot stands: is the part on the gripper? The switch is looked at before the robot is sent off.
    CheckGrip,
    /// \[18\] Robot to the place.
    GoPlace,
    /// \[19\] Asks the robot until it stands.
    AwaitPlace,
    /// \[20\] The part was missed or lost: robot stop, vacuum off, and again from step 7.
    GiveUp,
    /// \[21\] Vacuum off, blow on.
    Release,
    /// \[21\] For a few milliseconds.
    Blow,
    /// \[21\] Blow off.
    BlowOff,
    /// The part is placed. Goes on with step 7 when told.
    Placed,
    /// A camera saw nothing; what then is not said. Goes on with step 7 when told.
    NothingFound,
    /// A device refused, failed or was lost; what then is not said: everything is stopped, and the valves are closed.
    Faulted,
    /// Told to recover: reset of robot and platform, valves closed, then on from step 3.
    Resetting,
    /// Told to finish: the connections are closed (§3).
    Closing,
    /// They are.
    Finished,
}

/// What leads from one step to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Trigger {
    /// A device refused, failed or was lost.
    Failed,
    /// The caller wants the end.
    Finish,
    /// The caller wants to go on after a failure, and all devices are there again.
    Recover,
    /// The caller wants the next part.
    Next,
    /// The vacuum switch is low: nothing on the gripper.
    Low,
    /// The vacuum switch is high: a part is on the gripper.
    High,
    /// The camera sees nothing.
    NotFound,
    /// The camera sees what it was asked for.
    Found,
    /// All devices are ready.
    Ready,
    /// The time is over.
    Elapsed,
    /// The orders of this step are answered, and the devices that it watches stand.
    AtRest,
    /// The orders of this step are answered.
    Answered,
}

impl Step {
    /// Every step.
    pub const ALL: [Self; 30] = [
        Self::AwaitDevices,
        Self::DevicesReady,
        Self::ServosOn,
        Self::SetOverride,
        Self::GoHome,
        Self::AwaitHome,
        Self::GoCamera1,
        Self::AwaitCamera1,
        Self::FindPart,
        Self::TurnPlatform,
        Self::GoCamera2,
        Self::AwaitCamera2,
        Self::FindSlot,
        Self::GoPick,
        Self::VacuumOn,
        Self::AwaitPick,
        Self::StopAtPart,
        Self::CheckGrip,
        Self::GoPlace,
        Self::AwaitPlace,
        Self::GiveUp,
        Self::Release,
        Self::Blow,
        Self::BlowOff,
        Self::Placed,
        Self::NothingFound,
        Self::Faulted,
        Self::Resetting,
        Self::Closing,
        Self::Finished,
    ];

    /// The table: what leads on from this step, and where to. When several triggers hold, the first counts.
    pub const fn transitions(self) -> &'static [(Trigger, Self)] {
        use Trigger as T;
        match self {
            // One that goes away while it is waited for is waited for again.
            Self::AwaitDevices => &[(T::Ready, Self::DevicesReady)],
            Self::DevicesReady => &[(T::Failed, Self::Faulted), (T::Answered, Self::ServosOn)],
            Self::ServosOn => &[(T::Failed, Self::Faulted), (T::Answered, Self::SetOverride)],
            Self::SetOverride => &[(T::Failed, Self::Faulted), (T::Answered, Self::GoHome)],
            Self::GoHome => &[(T::Failed, Self::Faulted), (T::Answered, Self::AwaitHome)],
            Self::AwaitHome => &[(T::Failed, Self::Faulted), (T::AtRest, Self::GoCamera1)],
            Self::GoCamera1 => &[(T::Failed, Self::Faulted), (T::Answered, Self::AwaitCamera1)],
            Self::AwaitCamera1 => &[(T::Failed, Self::Faulted), (T::AtRest, Self::FindPart)],
            Self::FindPart => &[
                (T::Failed, Self::Faulted),
                (T::Found, Self::TurnPlatform),
                (T::NotFound, Self::NothingFound),
            ],
            Self::TurnPlatform => &[(T::Failed, Self::Faulted), (T::Answered, Self::GoCamera2)],
            Self::GoCamera2 => &[(T::Failed, Self::Faulted), (T::Answered, Self::AwaitCamera2)],
            Self::AwaitCamera2 => &[(T::Failed, Self::Faulted), (T::AtRest, Self::FindSlot)],
            Self::FindSlot => {
                &[(T::Failed, Self::Faulted), (T::Found, Self::GoPick), (T::NotFound, Self::NothingFound)]
            }
            Self::GoPick => &[(T::Failed, Self::Faulted), (T::Answered, Self::VacuumOn)],
            Self::VacuumOn => &[(T::Failed, Self::Faulted), (T::Answered, Self::AwaitPick)],
            Self::AwaitPick => {
                &[(T::Failed, Self::Faulted), (T::High, Self::StopAtPart), (T::AtRest, Self::CheckGrip)]
            }
            Self::StopAtPart => &[(T::Failed, Self::Faulted), (T::AtRest, Self::CheckGrip)],
            Self::CheckGrip => {
                &[(T::Failed, Self::Faulted), (T::High, Self::GoPlace), (T::Low, Self::GiveUp)]
            }
            Self::GoPlace => &[(T::Failed, Self::Faulted), (T::Answered, Self::AwaitPlace)],
            Self::AwaitPlace => {
                &[(T::Failed, Self::Faulted), (T::Low, Self::GiveUp), (T::AtRest, Self::Release)]
            }
            Self::GiveUp => &[(T::Failed, Self::Faulted), (T::AtRest, Self::GoCamera1)],
            Self::Release => &[(T::Failed, Self::Faulted), (T::Answered, Self::Blow)],
            Self::Blow => &[(T::Failed, Self::Faulted), (T::Elapsed, Self::BlowOff)],
            Self::BlowOff => &[(T::Failed, Self::Faulted), (T::Answered, Self::Placed)],
            Self::Placed => {
                &[(T::Failed, Self::Faulted), (T::Finish, Self::Closing), (T::Next, Self::GoCamera1)]
            }
            Self::NothingFound => {
                &[(T::Failed, Self::Faulted), (T::Finish, Self::Closing), (T::Next, Self::GoCamera1)]
            }
            Self::Faulted => &[(T::Finish, Self::Closing), (T::Recover, Self::Resetting)],
            Self::Resetting => &[(T::Failed, Self::Faulted), (T::AtRest, Self::ServosOn)],
            // At the end nobody is missed.
            Self::Closing => &[(T::Answered, Self::Finished)],
            Self::Finished => &[],
        }
    }

    /// The step behind a trigger; `None` when the trigger means nothing here.
    pub fn next(self, trigger: Trigger) -> Option<Self> {
        self.transitions().iter().find(|(on, _)| *on == trigger).map(|(_, next)| *next)
    }

    /// The step's number in §6; `None` for what surrounds the 21 steps.
    pub const fn number(self) -> Option<u8> {
        Some(match self {
            Self::AwaitDevices => 1,
            Self::DevicesReady => 2,
            Self::ServosOn => 3,
            Self::SetOverride => 4,
            Self::GoHome => 5,
            Self::AwaitHome => 6,
            Self::GoCamera1 => 7,
            Self::AwaitCamera1 => 8,
            Self::FindPart => 9,
            Self::TurnPlatform => 10,
            Self::GoCamera2 => 11,
            Self::AwaitCamera2 => 12,
            Self::FindSlot => 13,
            Self::GoPick => 14,
            Self::VacuumOn => 15,
            Self::AwaitPick => 16,
            Self::StopAtPart => 17,
            Self::CheckGrip | Self::GoPlace => 18,
            Self::AwaitPlace => 19,
            Self::GiveUp => 20,
            Self::Release | Self::Blow | Self::BlowOff => 21,
            Self::Placed
            | Self::NothingFound
            | Self::Faulted
            | Self::Resetting
            | Self::Closing
            | Self::Finished => return None,
        })
    }

    /// A few words for people.
    pub const fn label(self) -> &'static str {
        match self {
            Self::AwaitDevices => "wait for devices",
            Self::DevicesReady => "devices ready",
            Self::ServosOn => "servo motors on",
            Self::SetOverride => "set override",
            Self::GoHome => "go home",
            Self::AwaitHome => "on the way home",
            Self::GoCamera1 => "go to camera 1",
            Self::AwaitCamera1 => "on the way to camera 1",
            Self::FindPart => "find part",
            Self::TurnPlatform => "turn platform",
            Self::GoCamera2 => "go to camera 2",
            Self::AwaitCamera2 => "on the way to camera 2",
            Self::FindSlot => "find place",
            Self::GoPick => "go to part",
            Self::VacuumOn => "vacuum on",
            Self::AwaitPick => "on the way to part",
            Self::StopAtPart => "stop at part",
            Self::CheckGrip => "check grip",
            Self::GoPlace => "go to place",
            Self::AwaitPlace => "on the way to place",
            Self::GiveUp => "missed or lost",
            Self::Release => "release",
            Self::Blow => "blow",
            Self::BlowOff => "blow off",
            Self::Placed => "placed",
            Self::NothingFound => "nothing found",
            Self::Faulted => "fault",
            Self::Resetting => "reset",
            Self::Closing => "close connections",
            Self::Finished => "finished",
        }
    }
}

impl Trigger {
    /// Every trigger.
    pub const ALL: [Self; 12] = [
        Self::Failed,
        Self::Finish,
        Self::Recover,
        Self::Next,
        Self::Low,
        Self::High,
        Self::NotFound,
        Self::Found,
        Self::Ready,
        Self::Elapsed,
        Self::AtRest,
        Self::Answered,
    ];

    /// A few words for people.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Failed => "a device failed",
            Self::Finish => "told to finish",
            Self::Recover => "told to recover",
            Self::Next => "told to go on",
            Self::Low => "switch low",
            Self::High => "switch high",
            Self::NotFound => "nothing seen",
            Self::Found => "found",
            Self::Ready => "all ready",
            Self::Elapsed => "time over",
            Self::AtRest => "standing",
            Self::Answered => "answered",
        }
    }
}
