use core::fmt::{self, Write};

/// The step of the task. The number in brackets is the step of §6.
///
/// Each step gives orders when it begins and then waits for a [`Trigger`]. [`transitions`](Self::transitions) is the whole
/// table; `docs/task.md` is drawn from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Step {
    /// \[1\] Waits until robot, platform and conditioning system are ready.
    AwaitDevices,
    /// \[2\] Robot, platform and conditioning system are ready.
    DevicesReady,
    /// \[3\] Servo motors of robot and platform on.
    ServosOn,
    /// \[4\] Override of robot and platform.
    SetOverride,
    /// \[5\] Robot and platform home.
    GoHome,
    /// \[6\] Asks both until they have arrived.
    AwaitHome,
    /// \[7\] Robot to the position at which camera 1 sees the parts.
    GoCamera1,
    /// \[8\] Asks the robot until it has arrived.
    AwaitCamera1,
    /// \[9\] Camera 1: the next part, and its position.
    FindPart,
    /// \[10\] Platform to the pose that this part needs.
    TurnPlatform,
    /// \[11\] Robot to the position at which camera 2 sees the slot.
    GoCamera2,
    /// \[12\] Asks both until they have arrived.
    AwaitCamera2,
    /// \[13\] Camera 2: the position of the slot for the part.
    FindSlot,
    /// \[14\] Robot to the part.
    GoPick,
    /// \[15\] Vacuum on. The switch was low until now: high without vacuum is a fault, not a part.
    VacuumOn,
    /// \[16\] Asks the robot until it has arrived, or until the switch goes high.
    AwaitPick,
    /// \[16\] The robot is at the part, and the vacuum has its time to build up.
    GripDwell,
    /// \[17\] The switch went high on the way: robot stop.
    StopAtPart,
    /// \[18\] The robot is at rest: is the part on the gripper? The switch is looked at before the robot is sent off.
    CheckGrip,
    /// \[18\] Robot to the place.
    GoPlace,
    /// \[19\] Asks the robot until it has arrived.
    AwaitPlace,
    /// \[19\] The robot is in the place, at rest for as long as it takes to settle.
    PlaceDwell,
    /// \[20\] The part was missed or lost: robot stop, vacuum off, and again from step 7.
    GiveUp,
    /// \[21\] Vacuum off, blow on.
    Release,
    /// \[21\] For a few milliseconds.
    Blow,
    /// \[21\] Blow off.
    BlowOff,
    /// \[21\] Waits until the switch is low: the part is off the gripper.
    CheckReleased,
    /// The part is placed. Goes on with step 7 at [`Event::Next`](crate::Event::Next).
    Placed,
    /// The part was missed or lost as often as it may be. Goes on with step 7 at [`Event::Next`](crate::Event::Next).
    Unpicked,
    /// A camera saw nothing; the source leaves the next action open. Continues with step 7 at
    /// [`Event::Next`](crate::Event::Next).
    NothingFound,
    /// A device failed, a step took too long, the switch is implausible, or the caller aborted. The source leaves the next
    /// action open: everything is stopped, and the valves are closed.
    Faulted,
    /// At [`Event::Recover`](crate::Event::Recover): reset of robot and platform, valves closed, then on from step 3.
    Resetting,
    /// At [`Event::Finish`](crate::Event::Finish): the connections are closed (§3).
    Closing,
    /// All connections are closed: the task has ended.
    Finished,
}

/// The cause of a step's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Trigger {
    /// A device failed, or the caller aborted.
    Failed,
    /// The caller requests the end.
    Finish,
    /// The caller requests to continue after a failure, and all devices are present again.
    Recover,
    /// The caller requests the next part.
    Next,
    /// The vacuum switch is low: nothing on the gripper.
    Low,
    /// The vacuum switch is high: a part is on the gripper, if the vacuum is on.
    High,
    /// The vacuum switch has gone high since the vacuum was ordered on.
    Risen,
    /// The vacuum switch has gone low since the robot was sent to the place.
    Fallen,
    /// The camera sees neither a part nor a place.
    NotFound,
    /// The camera sees the requested object.
    Found,
    /// All devices are connected and ready.
    Ready,
    /// The dwell time of this step has passed.
    Elapsed,
    /// As [`AtRest`](Self::AtRest), and this part was picked as often as it may be.
    Exhausted,
    /// The orders of this step are answered, and the devices that it watches have arrived.
    AtRest,
    /// The orders of this step are answered.
    Answered,
    /// The step has taken too long.
    TimedOut,
}

/// The limit of a step that no trigger ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wait {
    /// No limit: the caller decides.
    Caller,
    /// The dwell time of the step.
    Time,
    /// `ready_timeout`
    Devices,
    /// `order_timeout`
    Replies,
    /// `motion_timeout`
    Motion,
}

impl Step {
    /// Every step.
    pub const ALL: [Self; 34] = [
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
        Self::GripDwell,
        Self::StopAtPart,
        Self::CheckGrip,
        Self::GoPlace,
        Self::AwaitPlace,
        Self::PlaceDwell,
        Self::GiveUp,
        Self::Release,
        Self::Blow,
        Self::BlowOff,
        Self::CheckReleased,
        Self::Placed,
        Self::Unpicked,
        Self::NothingFound,
        Self::Faulted,
        Self::Resetting,
        Self::Closing,
        Self::Finished,
    ];

    /// Returns the transitions from this step: triggers and next steps. If several triggers apply, the first one counts.
    pub const fn transitions(self) -> &'static [(Trigger, Self)] {
        use Trigger as T;
        match self {
            // One that goes away while it is waited for is waited for again.
            Self::AwaitDevices => &[(T::Ready, Self::DevicesReady), (T::TimedOut, Self::Faulted)],
            Self::DevicesReady => &[(T::Failed, Self::Faulted), (T::Answered, Self::ServosOn)],
            Self::ServosOn => {
                &[(T::Failed, Self::Faulted), (T::Answered, Self::SetOverride), (T::TimedOut, Self::Faulted)]
            }
            Self::SetOverride => {
                &[(T::Failed, Self::Faulted), (T::Answered, Self::GoHome), (T::TimedOut, Self::Faulted)]
            }
            Self::GoHome => {
                &[(T::Failed, Self::Faulted), (T::Answered, Self::AwaitHome), (T::TimedOut, Self::Faulted)]
            }
            Self::AwaitHome => {
                &[(T::Failed, Self::Faulted), (T::AtRest, Self::GoCamera1), (T::TimedOut, Self::Faulted)]
            }
            Self::GoCamera1 => {
                &[(T::Failed, Self::Faulted), (T::Answered, Self::AwaitCamera1), (T::TimedOut, Self::Faulted)]
            }
            Self::AwaitCamera1 => {
                &[(T::Failed, Self::Faulted), (T::AtRest, Self::FindPart), (T::TimedOut, Self::Faulted)]
            }
            Self::FindPart => &[
                (T::Failed, Self::Faulted),
                (T::Found, Self::TurnPlatform),
                (T::NotFound, Self::NothingFound),
                (T::TimedOut, Self::Faulted),
            ],
            Self::TurnPlatform => {
                &[(T::Failed, Self::Faulted), (T::Answered, Self::GoCamera2), (T::TimedOut, Self::Faulted)]
            }
            Self::GoCamera2 => {
                &[(T::Failed, Self::Faulted), (T::Answered, Self::AwaitCamera2), (T::TimedOut, Self::Faulted)]
            }
            Self::AwaitCamera2 => {
                &[(T::Failed, Self::Faulted), (T::AtRest, Self::FindSlot), (T::TimedOut, Self::Faulted)]
            }
            Self::FindSlot => &[
                (T::Failed, Self::Faulted),
                (T::Found, Self::GoPick),
                (T::NotFound, Self::NothingFound),
                (T::TimedOut, Self::Faulted),
            ],
            Self::GoPick => &[
                (T::Failed, Self::Faulted),
                (T::High, Self::Faulted),
                (T::Answered, Self::VacuumOn),
                (T::TimedOut, Self::Faulted),
            ],
            Self::VacuumOn => {
                &[(T::Failed, Self::Faulted), (T::Answered, Self::AwaitPick), (T::TimedOut, Self::Faulted)]
            }
            Self::AwaitPick => &[
                (T::Failed, Self::Faulted),
                (T::Risen, Self::StopAtPart),
                (T::AtRest, Self::GripDwell),
                (T::TimedOut, Self::Faulted),
            ],
            Self::GripDwell => {
                &[(T::Failed, Self::Faulted), (T::Risen, Self::CheckGrip), (T::Elapsed, Self::CheckGrip)]
            }
            Self::StopAtPart => {
                &[(T::Failed, Self::Faulted), (T::AtRest, Self::CheckGrip), (T::TimedOut, Self::Faulted)]
            }
            Self::CheckGrip => {
                &[(T::Failed, Self::Faulted), (T::High, Self::GoPlace), (T::Low, Self::GiveUp)]
            }
            Self::GoPlace => {
                &[(T::Failed, Self::Faulted), (T::Answered, Self::AwaitPlace), (T::TimedOut, Self::Faulted)]
            }
            Self::AwaitPlace => &[
                (T::Failed, Self::Faulted),
                (T::Fallen, Self::GiveUp),
                (T::AtRest, Self::PlaceDwell),
                (T::TimedOut, Self::Faulted),
            ],
            Self::PlaceDwell => {
                &[(T::Failed, Self::Faulted), (T::Fallen, Self::GiveUp), (T::Elapsed, Self::Release)]
            }
            Self::GiveUp => &[
                (T::Failed, Self::Faulted),
                (T::Exhausted, Self::Unpicked),
                (T::AtRest, Self::GoCamera1),
                (T::TimedOut, Self::Faulted),
            ],
            Self::Release => {
                &[(T::Failed, Self::Faulted), (T::Answered, Self::Blow), (T::TimedOut, Self::Faulted)]
            }
            Self::Blow => &[(T::Failed, Self::Faulted), (T::Elapsed, Self::BlowOff)],
            Self::BlowOff => &[
                (T::Failed, Self::Faulted),
                (T::Answered, Self::CheckReleased),
                (T::TimedOut, Self::Faulted),
            ],
            Self::CheckReleased => {
                &[(T::Failed, Self::Faulted), (T::Low, Self::Placed), (T::TimedOut, Self::Faulted)]
            }
            Self::Placed | Self::Unpicked | Self::NothingFound => {
                &[(T::Failed, Self::Faulted), (T::Finish, Self::Closing), (T::Next, Self::GoCamera1)]
            }
            Self::Faulted => &[(T::Finish, Self::Closing), (T::Recover, Self::Resetting)],
            Self::Resetting => {
                &[(T::Failed, Self::Faulted), (T::AtRest, Self::ServosOn), (T::TimedOut, Self::Faulted)]
            }
            // At the end a missing device does not matter.
            Self::Closing => &[(T::Answered, Self::Finished), (T::TimedOut, Self::Finished)],
            Self::Finished => &[],
        }
    }

    /// Returns the limit of the step if no trigger ends it.
    pub(crate) const fn waits_for(self) -> Wait {
        match self {
            Self::AwaitDevices => Wait::Devices,
            Self::AwaitHome
            | Self::AwaitCamera1
            | Self::AwaitCamera2
            | Self::AwaitPick
            | Self::StopAtPart
            | Self::AwaitPlace
            | Self::GiveUp
            | Self::Resetting => Wait::Motion,
            Self::GripDwell | Self::PlaceDwell | Self::Blow => Wait::Time,
            Self::DevicesReady
            | Self::ServosOn
            | Self::SetOverride
            | Self::GoHome
            | Self::GoCamera1
            | Self::FindPart
            | Self::TurnPlatform
            | Self::GoCamera2
            | Self::FindSlot
            | Self::GoPick
            | Self::VacuumOn
            | Self::CheckGrip
            | Self::GoPlace
            | Self::Release
            | Self::BlowOff
            | Self::CheckReleased
            | Self::Closing => Wait::Replies,
            Self::Placed | Self::Unpicked | Self::NothingFound | Self::Faulted | Self::Finished => {
                Wait::Caller
            }
        }
    }

    /// Returns the step after a trigger; `None` if the trigger has no effect in this step.
    pub fn next(self, trigger: Trigger) -> Option<Self> {
        self.transitions().iter().find(|(on, _)| *on == trigger).map(|(_, next)| *next)
    }

    /// Returns the step's number in §6; `None` for the states around the 21 steps.
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
            Self::AwaitPick | Self::GripDwell => 16,
            Self::StopAtPart => 17,
            Self::CheckGrip | Self::GoPlace => 18,
            Self::AwaitPlace | Self::PlaceDwell => 19,
            Self::GiveUp => 20,
            Self::Release | Self::Blow | Self::BlowOff | Self::CheckReleased => 21,
            Self::Placed
            | Self::Unpicked
            | Self::NothingFound
            | Self::Faulted
            | Self::Resetting
            | Self::Closing
            | Self::Finished => return None,
        })
    }

    /// Returns a short name of the step for people.
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
            Self::GripDwell => "wait at part",
            Self::StopAtPart => "stop at part",
            Self::CheckGrip => "check grip",
            Self::GoPlace => "go to place",
            Self::AwaitPlace => "on the way to place",
            Self::PlaceDwell => "wait at place",
            Self::GiveUp => "missed or lost",
            Self::Release => "release",
            Self::Blow => "blow",
            Self::BlowOff => "blow off",
            Self::CheckReleased => "check release",
            Self::Placed => "placed",
            Self::Unpicked => "missed too often",
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
    pub const ALL: [Self; 16] = [
        Self::Failed,
        Self::Finish,
        Self::Recover,
        Self::Next,
        Self::Low,
        Self::High,
        Self::Risen,
        Self::Fallen,
        Self::NotFound,
        Self::Found,
        Self::Ready,
        Self::Elapsed,
        Self::Exhausted,
        Self::AtRest,
        Self::Answered,
        Self::TimedOut,
    ];

    /// Returns a short name for people.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Failed => "failed or aborted",
            Self::Finish => "finish requested",
            Self::Recover => "recovery requested",
            Self::Next => "next part requested",
            Self::Low => "switch low",
            Self::High => "switch high",
            Self::Risen => "switch gone high",
            Self::Fallen => "switch gone low",
            Self::NotFound => "nothing seen",
            Self::Found => "found",
            Self::Ready => "all ready",
            Self::Elapsed => "time passed",
            Self::Exhausted => "at rest, no attempt left",
            Self::AtRest => "arrived",
            Self::Answered => "answered",
            Self::TimedOut => "too long",
        }
    }
}

/// The words of the name, such as `await pick`.
impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(WordWriter { out: f, is_first: true }, "{self:?}")
    }
}

/// Writes a name in camel case as words.
struct WordWriter<'a, 'f> {
    out: &'a mut fmt::Formatter<'f>,
    is_first: bool,
}

impl Write for WordWriter<'_, '_> {
    fn write_str(&mut self, name: &str) -> fmt::Result {
        for character in name.chars() {
            if !self.is_first && !character.is_ascii_lowercase() {
                self.out.write_char(' ')?;
            }
            self.is_first = false;
            self.out.write_char(character.to_ascii_lowercase())?;
        }
        Ok(())
    }
}
