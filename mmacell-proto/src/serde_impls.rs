//! Data models that a derive cannot write without an allocator: poses as lists, tagged messages read back.

use core::fmt;

use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::message::{Command, ErrorCode, Mode, Reply, Status};
use crate::pose::{AnyPose, NoPose, PlatformPose, RobotPose};

impl Serialize for RobotPose {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.x, self.y, self.z, self.c).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for RobotPose {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Deserialize::deserialize(deserializer).map(|(x, y, z, c)| Self { x, y, z, c })
    }
}

impl Serialize for PlatformPose {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.a, self.b).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for PlatformPose {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Deserialize::deserialize(deserializer).map(|(a, b)| Self { a, b })
    }
}

impl Serialize for NoPose {
    fn serialize<S: Serializer>(&self, _: S) -> Result<S::Ok, S::Error> {
        match *self {}
    }
}

impl<'de> Deserialize<'de> for NoPose {
    fn deserialize<D: Deserializer<'de>>(_: D) -> Result<Self, D::Error> {
        Err(D::Error::custom("this device has no axes"))
    }
}

impl<'de> Deserialize<'de> for AnyPose {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(FourOrTwo)
    }
}

struct FourOrTwo;

impl<'de> Visitor<'de> for FourOrTwo {
    type Value = AnyPose;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("four axes (mm, mm, mm, rad) or two (rad, rad)")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<AnyPose, A::Error> {
        let mut axes = [0.0; 4];
        let mut len = 0;
        while let Some(axis) = seq.next_element()? {
            if let Some(slot) = axes.get_mut(len) {
                *slot = axis;
            }
            len += 1;
        }
        let [x, y, z, c] = axes;
        match len {
            4 => Ok(AnyPose::Robot(RobotPose::from_mm_rad(x, y, z, c))),
            2 => Ok(AnyPose::Platform(PlatformPose::from_rad(x, y))),
            len => Err(A::Error::invalid_length(len, &self)),
        }
    }
}

impl<'de, P: Deserialize<'de>> Deserialize<'de> for Command<P> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let CommandObject { command, on, percent, mode, axes, camera, gripper, open } =
            CommandObject::deserialize(deserializer)?;
        let given = [
            on.is_some(),
            percent.is_some(),
            mode.is_some(),
            axes.is_some(),
            camera.is_some(),
            gripper.is_some(),
            open.is_some(),
        ];
        let (command, fields) = match command {
            Head::Sta => (Self::Status, 0),
            Head::Srv => (Self::Servo { on: need(on, "on")? }, 1),
            Head::Ovr => (Self::Override { percent: need(percent, "percent")? }, 1),
            Head::Mov => (Self::Move { mode: need(mode, "mode")?, pose: need(axes, "axes")? }, 2),
            Head::Stp => (Self::Stop, 0),
            Head::Rst => (Self::Reset, 0),
            Head::Clo => (Self::Close, 0),
            Head::Acq => (Self::Acquire { camera: need(camera, "camera")? }, 1),
            Head::Hnd => (Self::Grip { gripper: need(gripper, "gripper")?, open: need(open, "open")? }, 2),
        };
        no_others(&given, fields)?;
        Ok(command)
    }
}

impl<'de, P: Deserialize<'de>> Deserialize<'de> for Reply<P> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let ReplyObject { reply, moving, axes, servo, percent, error } =
            ReplyObject::deserialize(deserializer)?;
        let given = [moving.is_some(), axes.is_some(), servo.is_some(), percent.is_some(), error.is_some()];
        let (reply, fields) = match reply {
            Kind::Ok => (Self::Ok, 0),
            Kind::Error => (Self::Error { error: need(error, "error")? }, 1),
            Kind::Status => {
                let status = Status {
                    moving: need(moving, "moving")?,
                    pose: need(axes, "axes")?,
                    servo: need(servo, "servo")?,
                    percent: need(percent, "override")?,
                    error: need(error, "error")?,
                };
                (Self::Status(status), 5)
            }
        };
        no_others(&given, fields)?;
        Ok(reply)
    }
}

/// Every field that a command may have: a tagged enum would be buffered on the heap.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CommandObject<P> {
    command: Head,
    on: Option<bool>,
    percent: Option<u8>,
    mode: Option<Mode>,
    axes: Option<P>,
    camera: Option<i32>,
    gripper: Option<i32>,
    open: Option<bool>,
}

#[derive(Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Head {
    Sta,
    Srv,
    Ovr,
    Mov,
    Stp,
    Rst,
    Clo,
    Acq,
    Hnd,
}

/// Every field that a reply may have.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReplyObject<P> {
    reply: Kind,
    moving: Option<bool>,
    axes: Option<P>,
    servo: Option<bool>,
    #[serde(rename = "override")]
    percent: Option<u8>,
    error: Option<ErrorCode>,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Ok,
    Error,
    Status,
}

fn need<T, E: Error>(field: Option<T>, name: &'static str) -> Result<T, E> {
    field.ok_or_else(|| E::missing_field(name))
}

/// Checks that an object has only the fields that its message has, which is this number of them.
fn no_others<E: Error>(given: &[bool], fields: usize) -> Result<(), E> {
    if given.iter().filter(|is_given| **is_given).count() > fields {
        return Err(E::custom("a field that belongs to another message"));
    }
    Ok(())
}
