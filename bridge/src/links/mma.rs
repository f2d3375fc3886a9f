//! The devices of an MM&A cell: their status, and commands as the link's JSON has them.

use std::marker::PhantomData;
use std::time::Duration;

use anyhow::Result;
use mmacell_proto::tokio::{Commands, Device, Error};
use mmacell_proto::{CentralConfig, CentralEvent, Command as Order, PlatformPose, Pose, Progress, RobotPose};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value as Json, json};

use super::client::{self, Listener, PollSettings, Silence, Worker};
use super::order;
use super::port::Port;
use crate::end::End;
use crate::metric::{Definition, define, text, whole};
use crate::payload::{Kind, Value};
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_links::settings::{Configure, FieldVisitor};

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

/// The settings of a cell.
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
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { is_platform, poll, silence, session } = self;
        let about = "the device: the robot has four axes, the platform two";
        fields.choice("device", &[("robot", false), ("platform", true)], about, is_platform);
        let range = Duration::from_millis(20)..=Duration::from_secs(3600);
        fields.time("poll", range, "the polling period of the status", poll);
        Silence::configure(fields, silence);
        session.configure(fields);
    }
}

/// Every event is the outcome of a call.
struct NoEvents<P>(PhantomData<fn() -> P>);

/// Asks for the status, and gives commands.
struct Mma<P: Pose + Send + 'static>(Device<P>);

pub(super) fn client(cell: &Cell, settings: Settings) -> Result<super::Client> {
    if settings.is_platform { of::<PlatformPose>(cell, &settings) } else { of::<RobotPose>(cell, &settings) }
}

fn of<P: Pose + Serialize + DeserializeOwned + Send + Sync + 'static>(
    cell: &Cell,
    settings: &Settings,
) -> Result<super::Client> {
    let (device, task) = mmacell_proto::tokio::central::<P, _>(settings.session, Port::of(cell, None)?)?;
    let silence = Silence::of_asked(settings.silence, settings.poll);
    let terms = PollSettings { silence, every: Some(settings.poll), deadline: None };
    let handle = device.handle().clone();
    Ok(client::of(cell, &METRICS, terms, (handle, task), NoEvents(PhantomData), Mma(device)))
}

impl<P: Pose + Send + 'static> Listener for NoEvents<P> {
    type Service = Commands<P>;

    fn event(&mut self, _: CentralEvent<P>, _: &End) -> Result<(), String> {
        Ok(())
    }
}

impl<P: Pose + Serialize + DeserializeOwned + Send + Sync + 'static> Worker for Mma<P> {
    async fn poll(&mut self, end: &End) {
        // The end of a connection has its own reason.
        if let Err(Error::Refused(error)) = self.status(end).await {
            end.event(&json!({"event": "refused", "error": i32::from(error)}));
        }
    }

    async fn command(&mut self, command: &Command, end: &End) -> (Outcome, String) {
        let order: Order<P> = match order(&command.order) {
            Ok(order) => order,
            Err(why) => return (Outcome::Refused, why),
        };
        let is_motion = matches!(order, Order::Move { .. } | Order::Reset);
        let executed = match order {
            Order::Status => self.status(end).await,
            order => self.0.command(order).await,
        };
        match executed {
            Ok(()) => {
                end.answered();
                let detail = if is_motion { "the motion has started: see Status/Motion" } else { "" };
                (Outcome::Done, detail.into())
            }
            Err(Error::Refused(error)) => {
                end.answered();
                (Outcome::Refused, format!("the device reports error {}", i32::from(error)))
            }
            Err(Error::Unknown(reason)) => (Outcome::Unknown, reason.to_string()),
            Err(Error::NotSent(reason)) => (Outcome::Refused, reason.to_string()),
            Err(error @ Error::Closed(_)) => (Outcome::Unknown, error.to_string()),
            Err(error) => (Outcome::Refused, error.to_string()),
        }
    }
}

impl<P: Pose + Serialize + Send + Sync + 'static> Mma<P> {
    /// Asks for the status, and reports it.
    async fn status(&self, end: &End) -> Result<(), Error> {
        let (status, motion) = self.0.status().await.inspect_err(|error| {
            if matches!(error, Error::Refused(_)) {
                end.answered();
            }
        })?;
        end.answered();
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
        Ok(())
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
