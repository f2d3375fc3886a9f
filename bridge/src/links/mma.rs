//! The devices of an MM&A cell: their status, and commands as the link's JSON has them.

use std::marker::PhantomData;
use std::time::Duration;

use anyhow::Result;
use mmacell_proto::{
    Central, CentralConfig, CentralEvent, Closing, Command as Order, PlatformPose, Pose, Progress, RobotPose,
    Unfinished,
};
use robot_session::{Session, now};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value as Json, json};

use super::client::{self, Adapter, Silence};
use super::order;
use crate::end::{ENDS, End};
use crate::metric::{Definition, define, text, whole};
use crate::payload::{Kind, Value};
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_links::settings::{Configure, Fields};

const AXES: [&str; 4] = ["Status/Axes/1", "Status/Axes/2", "Status/Axes/3", "Status/Axes/4"];

const METRICS: [Definition; 9] = [
    define("Status/Moving", Kind::Boolean),
    define("Status/Servo", Kind::Boolean),
    define("Status/Override", Kind::Int64),
    define("Status/Error", Kind::Int64),
    define("Status/Motion", Kind::String),
    define("Status/Axes/1", Kind::Double),
    define("Status/Axes/2", Kind::Double),
    define("Status/Axes/3", Kind::Double),
    define("Status/Axes/4", Kind::Double),
];

/// What can be set.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    is_platform: bool,
    poll: Duration,
    silence: Duration,
    session: CentralConfig,
}

impl Default for Settings {
    fn default() -> Self {
        let (poll, silence) = (Duration::from_millis(500), Duration::from_secs(5));
        Self { is_platform: false, poll, silence, session: CentralConfig::DEFAULT }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { is_platform, poll, silence, session } = self;
        let about = "the device: the robot has four axes, the platform two";
        fields.choice("device", &[("robot", false), ("platform", true)], about, is_platform);
        let range = Duration::from_millis(20)..=Duration::from_secs(3600);
        fields.time("poll", range, "the polling period of the status", poll);
        Silence::configure(fields, silence);
        session.configure(fields);
    }
}

struct Mma<P> {
    poll: Duration,
    next: Duration,
    order: Option<Order<P>>,
    /// The session has the order.
    is_running: bool,
    pose: PhantomData<P>,
}

pub(super) fn client(cell: &Cell, settings: Settings) -> Result<super::Client> {
    if settings.is_platform { of::<PlatformPose>(cell, &settings) } else { of::<RobotPose>(cell, &settings) }
}

fn of<P>(cell: &Cell, settings: &Settings) -> Result<super::Client>
where
    P: Pose + Serialize + DeserializeOwned + Send + 'static,
    Central<P>: Session<Event = CentralEvent<P>> + Send,
{
    let session = Central::<P>::new(settings.session)?;
    let adapter = Mma::<P> {
        poll: settings.poll,
        next: Duration::ZERO,
        order: None,
        is_running: false,
        pose: PhantomData,
    };
    let silence = Silence::of_asked(settings.silence, settings.poll);
    client::of(cell, &METRICS, None, silence, session, adapter)
}

impl<P> Adapter for Mma<P>
where
    P: Pose + Serialize + DeserializeOwned,
    Central<P>: Session<Event = CentralEvent<P>>,
{
    type Session = Central<P>;

    fn is_answer(event: &CentralEvent<P>) -> bool {
        matches!(
            event,
            CentralEvent::Done { .. } | CentralEvent::Refused { .. } | CentralEvent::Status { .. }
        )
    }

    fn step(&mut self, central: &mut Central<P>, end: &mut End) -> Option<Duration> {
        let now = now();
        if !central.is_idle() {
            return None;
        }
        if let Some(order) = self.order.take() {
            if end.is_stopped() {
                end.finish(Outcome::Refused, ENDS);
                return None;
            }
            match central.request(order) {
                Ok(()) => self.is_running = true,
                Err(error) => end.finish(Outcome::Refused, error.to_string()),
            }
        } else if now >= self.next {
            self.next = now.saturating_add(self.poll);
            let _ = central.request(Order::Status);
        }
        Some(self.next.saturating_sub(now).max(Duration::from_millis(1)))
    }

    fn event(&mut self, _: &mut Central<P>, event: CentralEvent<P>, end: &mut End) -> Result<(), String> {
        match event {
            CentralEvent::Status { status, motion } => {
                if core::mem::take(&mut self.is_running) {
                    end.finish(Outcome::Done, "");
                }
                let axes = serde_json::to_value(status.pose).unwrap_or_default();
                let axes = axes.as_array().into_iter().flatten().filter_map(Json::as_f64).map(Value::Double);
                let values = [
                    ("Status/Moving", Value::Boolean(status.moving)),
                    ("Status/Servo", Value::Boolean(status.servo)),
                    ("Status/Override", whole(status.percent)),
                    ("Status/Error", whole(i32::from(status.error))),
                    ("Status/Motion", text(name(motion))),
                ];
                end.values(values.into_iter().chain(AXES.into_iter().zip(axes)).collect());
            }
            CentralEvent::Done { command } if core::mem::take(&mut self.is_running) => {
                let is_motion = matches!(command, Order::Move { .. } | Order::Reset);
                end.finish(
                    Outcome::Done,
                    if is_motion { "the motion has started: see Status/Motion" } else { "" },
                );
            }
            CentralEvent::Refused { error, .. } => {
                if core::mem::take(&mut self.is_running) {
                    end.finish(Outcome::Refused, format!("the device reports error {}", i32::from(error)));
                } else {
                    end.event(&json!({"event": "refused", "error": i32::from(error)}));
                }
            }
            CentralEvent::Closed { reason, unfinished } => {
                if core::mem::take(&mut self.is_running) {
                    let why = format!("{reason:?}");
                    match unfinished {
                        Unfinished::NotSent(_) => end.finish(Outcome::Refused, why),
                        Unfinished::Unknown(_) => end.finish(Outcome::Unknown, why),
                        // What is finished has had its own event, except an agreed close.
                        Unfinished::Nothing => end.finish(Outcome::Done, why),
                    }
                }
                if reason != Closing::Disconnected {
                    return Err(format!("the connection has ended: {reason:?}"));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn command(&mut self, _: &mut Central<P>, command: Command) -> Result<(), String> {
        self.order = Some(order(&command.order)?);
        Ok(())
    }

    fn lost(&mut self) {
        (self.order, self.is_running) = (None, false);
    }
}

fn name(motion: Progress) -> &'static str {
    match motion {
        Progress::Still => "still",
        Progress::Starting => "starting",
        Progress::Moving => "moving",
        Progress::Stopping => "stopping",
        Progress::Arrived => "arrived",
        Progress::Missed(_) => "missed",
    }
}
