//! The requests that each handle makes, and the meaning of the answers.

use core::marker::PhantomData;
use core::ops::Range;

use cellwire_sim::fanuc::Write;
use cellwire_sim::laser::Job;
use cellwire_sim::mma::{Mma, MmaRobot, Motion};
use cellwire_sim::{Fanuc, KawasakiRobot, Laser, Peer, Puma, TeachBall};
use fanuc_hmi_modbus::{ClientConfig, DecodeError, Failure, Frame, ServerConfig, Side, tokio as fanuc};
use isra_ball::tokio as ball;
use kawasaki_msg::{JobKind, Line, PcConfig, Point, tokio as kawasaki};
use laser_eb90::{ControllerConfig, HostConfig, tokio as laser};
use mmacell_proto::{CentralConfig, Command, RobotPose, tokio as mma};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};
use val2_alter::Message as _;
use val2_alter::tokio as alter;
use val2_viewer::tokio as viewer;

use super::{HandledLink, MS, Plug, Simulated, Work, session};
use crate::link::{End, Faults};
use crate::soak::{Check, ReportedOutcome, Row};

use ReportedOutcome::{Done, NotDone, Unknown};

/// One row a link.
pub const ROWS: [Row; 8] = [
    row::<kawasaki::Pc<Line, ()>>("kawasaki-msg", "jobs"),
    row::<alter::Arm>("val2-alter", "motions"),
    row::<viewer::Arm>("val2-viewer", "poses"),
    row::<ball::Ball>("isra-ball", "values"),
    row::<Modbus<Tcp>>("fanuc-hmi-modbus", "writes"),
    Row { transport: "handle, rtu", ..row::<Modbus<Rtu>>("fanuc-hmi-modbus", "writes") },
    row::<laser::Laser>("laser-eb90", "instructions"),
    row::<mma::Device<RobotPose>>("mmacell-proto", "motions"),
];

/// Rows whose server drops an acknowledged write, and whose network repeats bytes: the soak must detect both.
pub const SABOTAGED: [Row; 2] = [
    row::<Modbus<Forgetful>>("fanuc-hmi-modbus", "writes"),
    row::<Modbus<Repeating>>("fanuc-hmi-modbus", "writes"),
];

const fn row<L: HandledLink>(link: &'static str, job: &'static str) -> Row
where
    Simulated<L>: 'static,
{
    Row { link, transport: "handle", job, one_in: L::ONE_IN, session: session::<L> }
}

/// A line whose port vanishes now and then.
const SERIAL: Faults = Faults { disconnect: 0.003, ..Faults::SERIAL };

/// Returns the outcomes of `count` jobs: the first are done, the next are unknown, and the others are not done.
fn split(count: usize, done: usize, unknown: usize) -> Vec<ReportedOutcome> {
    let each = |index| match index {
        _ if index < done => Done,
        _ if index < done + unknown => Unknown,
        _ => NotDone,
    };
    (0..count).map(each).collect()
}

/// Returns a number as a word of the wire.
fn word(job: usize) -> u16 {
    u16::try_from(job).expect("fewer jobs")
}

impl HandledLink for kawasaki::Pc<Line, ()> {
    type Device = KawasakiRobot<Line>;
    const FAULTS: Faults = Faults::TCP;

    fn device() -> Self::Device {
        KawasakiRobot { job_time: 20 * MS, queue: 4, ..KawasakiRobot::default() }
    }

    fn spawn(plug: Plug) -> Self {
        let (pc, task) = kawasaki::pc(PcConfig::tcp(), (), plug).unwrap();
        tokio::spawn(task.run());
        pc
    }

    async fn work(&mut self, jobs: Range<usize>) -> Vec<ReportedOutcome> {
        let line = |n: usize| Line {
            kind: JobKind::Draw,
            start: Point::new(word(n).into(), 0),
            end: Point::new(1, 1),
        };
        let (order, count) = (1 + word(jobs.start), jobs.len());
        match self.run(order, jobs.map(line).collect::<Vec<_>>()).await {
            Ok(over) => split(count, over.executed as usize, 0),
            Err(kawasaki::Error::OutcomeUnknown { executed, sent }) => {
                split(count, executed as usize, (sent - executed) as usize)
            }
            Err(kawasaki::Error::Closed(_)) => split(count, 0, count),
            Err(_) => {
                // An order continues whose call was dropped.
                sleep(200 * MS).await;
                split(count, 0, 0)
            }
        }
    }

    fn job(work: &Work<Self>) -> Option<usize> {
        usize::try_from(work.work.start.x).ok()
    }
}

impl HandledLink for alter::Arm {
    type Device = Puma;
    const FAULTS: Faults = SERIAL.at_baud(val2_alter::timing::BAUD);
    const NAMES_JOBS: bool = false;
    const ONE_IN: Option<u32> = Some(256);
    const MAX_MESSAGE_LEN: usize = val2_alter::Frame::MAX_LEN;

    fn device() -> Puma {
        Puma { restart: 100 * MS, is_paced: false, ..Puma::default() }
    }

    fn spawn(plug: Plug) -> Self {
        let (arm, task) = alter::host(val2_alter::HostConfig::default(), None, plug).unwrap();
        tokio::spawn(task.run());
        arm
    }

    /// Moves to and fro.
    async fn work(&mut self, jobs: Range<usize>) -> Vec<ReportedOutcome> {
        let mut reported = Vec::new();
        for job in jobs {
            let (speed, from) = (if job % 2 == 0 { 8 } else { -8 }, self.commanded()[0]);
            let moves = async {
                while (self.commanded()[0] - from) * i32::from(speed) < 64 * 8 {
                    self.set_target([speed, 0, 0, 0, 0, 0]);
                    sleep(20 * MS).await;
                }
            };
            reported.push(timeout(2000 * MS, moves).await.map_or(NotDone, |()| Done));
        }
        reported
    }

    fn check(from: End, bytes: &[u8]) -> Check {
        let framing = val2_alter::Framing::DEFAULT;
        let (frame, length) = match val2_alter::Frame::decode(bytes, framing) {
            Ok(Some(found)) => found,
            Err(val2_alter::DecodeError::Checksum { .. }) => return Check::Refused,
            Ok(None) | Err(_) => return Check::Nothing,
        };
        let reads = match from {
            End::A => val2_alter::HostMessage::decode(frame.data(), framing).is_ok(),
            End::B => val2_alter::RobotMessage::decode(frame.data(), framing).is_ok(),
        };
        if reads { Check::Good(length) } else { Check::Nothing }
    }

    fn job(_: &Work<Self>) -> Option<usize> {
        None
    }
}

impl HandledLink for viewer::Arm {
    type Device = Peer<val2_viewer::Host>;
    const FAULTS: Faults = SERIAL.at_baud(val2_viewer::timing::BAUD);
    const NAMES_JOBS: bool = false;
    const ONE_IN: Option<u32> = Some(256);
    const MAX_MESSAGE_LEN: usize = val2_viewer::PosePacket::MAX_LEN;

    fn device() -> Self::Device {
        let config = val2_viewer::HostConfig {
            max_age: core::time::Duration::MAX,
            ..val2_viewer::HostConfig::default()
        };
        let mut host = val2_viewer::Host::new(config).unwrap();
        host.set_pose(robot_session::now(), [7; 12]);
        Peer(host)
    }

    fn spawn(plug: Plug) -> Self {
        let (arm, task) = viewer::workstation(val2_viewer::WorkstationConfig::default(), plug).unwrap();
        tokio::spawn(task.run());
        arm
    }

    async fn work(&mut self, jobs: Range<usize>) -> Vec<ReportedOutcome> {
        let mut reported = Vec::new();
        for _ in jobs {
            let pose = async { while !matches!(self.pose.next().await, Ok(Some(_))) {} };
            let has_come = timeout(2000 * MS, pose).await.is_ok();
            if !has_come {
                // An operator whose picture is frozen.
                self.pause(true);
                sleep(3000 * MS).await;
                self.pause(false);
            }
            reported.push(if has_come { Done } else { NotDone });
        }
        reported
    }

    /// Checks bytes: a request of one byte has no checksum, so one out of noise is answered with a pose.
    fn check(from: End, bytes: &[u8]) -> Check {
        match val2_viewer::PosePacket::decode(bytes) {
            _ if from == End::A => Check::Nothing,
            Ok(Some((_, length))) => Check::Good(length),
            Err(val2_viewer::DecodeError::Checksum { .. }) => Check::Refused,
            Ok(None) | Err(_) => Check::Nothing,
        }
    }

    fn job(_: &Work<Self>) -> Option<usize> {
        None
    }
}

impl HandledLink for ball::Ball {
    type Device = TeachBall;
    const FAULTS: Faults = SERIAL.at_baud(9600);
    const NAMES_JOBS: bool = false;
    const ONE_IN: Option<u32> = Some(256);
    const MAX_MESSAGE_LEN: usize = isra_ball::Frame::MAX_LEN;

    fn device() -> TeachBall {
        TeachBall::default()
    }

    fn spawn(plug: Plug) -> Self {
        let (ball, task) = ball::host(isra_ball::HostConfig::default(), plug).unwrap();
        tokio::spawn(task.run());
        ball
    }

    async fn work(&mut self, jobs: Range<usize>) -> Vec<ReportedOutcome> {
        let mut reported = Vec::new();
        for _ in jobs {
            let value = async { while !matches!(self.values.next().await, Ok(Some(_))) {} };
            reported.push(timeout(1000 * MS, value).await.map_or(NotDone, |()| Done));
        }
        reported
    }

    /// Checks bytes: a poll of one byte has no checksum, so an ENQ out of noise is answered.
    fn check(from: End, bytes: &[u8]) -> Check {
        match isra_ball::Frame::decode(bytes) {
            _ if from == End::A => Check::Nothing,
            Ok(Some((_, length))) => Check::Good(length),
            Err(isra_ball::DecodeError::Checksum { .. }) => Check::Refused,
            Ok(None) | Err(_) => Check::Nothing,
        }
    }

    fn job(_: &Work<Self>) -> Option<usize> {
        None
    }
}

/// The register that is written.
const REGISTER: u16 = 201;

/// A client on a line.
struct Modbus<L>(fanuc::Client, PhantomData<L>);

/// The transport of a client and a server, and what is wrong with it.
trait Transport {
    const FAULTS: Faults;
    const FORGETS: f64 = 0.0;
    const IS_RTU: bool = false;
}

enum Tcp {}
enum Rtu {}
enum Forgetful {}
enum Repeating {}

impl Transport for Tcp {
    const FAULTS: Faults = Faults::TCP;
}

impl Transport for Rtu {
    const FAULTS: Faults = SERIAL.at_baud(BAUD);
    const IS_RTU: bool = true;
}

impl Transport for Forgetful {
    const FAULTS: Faults = Faults::TCP;
    const FORGETS: f64 = 0.05;
}

impl Transport for Repeating {
    const FAULTS: Faults = Faults { datagrams: true, repeat: 0.2, split: 0.0, merge: 0.0, ..Faults::TCP };
}

const BAUD: u32 = 19_200;

impl<L: Transport> HandledLink for Modbus<L> {
    type Device = Fanuc;
    const FAULTS: Faults = L::FAULTS;
    const FORGETS: f64 = L::FORGETS;
    const ONE_IN: Option<u32> = if L::IS_RTU { Some(65_536) } else { None };
    const MAX_MESSAGE_LEN: usize = Frame::MAX_RTU_LEN;

    fn device() -> Fanuc {
        let config = if L::IS_RTU { ServerConfig::rtu(1, BAUD) } else { Fanuc::default().config };
        Fanuc { config, ..Fanuc::default() }
    }

    fn spawn(plug: Plug) -> Self {
        let config = if L::IS_RTU { ClientConfig::rtu(BAUD) } else { ClientConfig::tcp() };
        let (client, task) = fanuc::client(config, plug).unwrap();
        tokio::spawn(task.run());
        Self(client, PhantomData)
    }

    /// Submits all jobs at once.
    async fn work(&mut self, jobs: Range<usize>) -> Vec<ReportedOutcome> {
        let mut calls = JoinSet::new();
        for job in jobs {
            let client = self.0.clone();
            calls.spawn(async move { (job, client.write_register(REGISTER, word(job)).await) });
        }
        let mut outcomes = calls.join_all().await;
        outcomes.sort_by_key(|(job, _)| *job);
        let reported = outcomes.into_iter().map(|(_, outcome)| match outcome {
            Ok(()) => Done,
            Err(fanuc::Error::Failed(Failure::NotSent)) => NotDone,
            Err(fanuc::Error::Failed(_) | fanuc::Error::Closed(_)) => Unknown,
            Err(_) => NotDone,
        });
        reported.collect()
    }

    fn check(from: End, bytes: &[u8]) -> Check {
        if !L::IS_RTU {
            return Check::Nothing;
        }
        match Frame::decode_rtu(bytes, if from == End::A { Side::Client } else { Side::Server }) {
            Ok(Some((_, length))) => Check::Good(length),
            Err(DecodeError::Crc { .. }) => Check::Refused,
            Ok(None) | Err(_) => Check::Nothing,
        }
    }

    fn is_in(job: usize, message: &[u8]) -> bool {
        L::IS_RTU && message.windows(2).any(|value| value == word(job).to_be_bytes())
    }

    fn job(work: &Work<Self>) -> Option<usize> {
        match work {
            Write::Registers(REGISTER, values) => values.first().copied().map(usize::from),
            _ => None,
        }
    }
}

impl HandledLink for laser::Laser {
    type Device = Laser;
    const FAULTS: Faults = SERIAL.at_baud(laser_eb90::timing::BAUD);
    const ONE_IN: Option<u32> = Some(256);
    const MAX_MESSAGE_LEN: usize = laser_eb90::Frame::MAX_LEN;
    /// The queue of the laser is lost with its power.
    const RESTARTS: bool = false;

    fn device() -> Laser {
        // As long as the longest frame, or a frame would wait forever.
        Laser { queue: 7, ..Laser::default() }
    }

    fn spawn(plug: Plug) -> Self {
        let (laser, task) = laser::host(HostConfig::default(), plug).unwrap();
        tokio::spawn(task.run());
        laser
    }

    async fn work(&mut self, jobs: Range<usize>) -> Vec<ReportedOutcome> {
        let count = jobs.len();
        let commands = jobs.map(|job| {
            laser::Command::new(0x0101, move |values| values.f32(&[f32::from(word(job))]).map(drop))
        });
        match self.run(commands).await {
            Ok(()) => split(count, count, 0),
            Err(laser::Error::Unfit { index, .. }) => split(count, index, 0),
            Err(laser::Error::Refused { taken, .. }) => {
                // A full queue: it has free space again then.
                sleep(200 * MS).await;
                split(count, taken, 0)
            }
            Err(laser::Error::Unknown { taken, count: unknown, .. }) => split(count, taken, unknown),
            Err(laser::Error::Closed(_)) => split(count, 0, count),
            Err(_) => split(count, 0, 0),
        }
    }

    fn check(_: End, bytes: &[u8]) -> Check {
        let mut payload = [0; laser_eb90::MAX_PAYLOAD];
        match laser_eb90::Frame::decode(bytes, &mut payload, &laser_eb90::Profile::default()) {
            Ok(Some((frame, used))) if frame.items().check().is_ok() => Check::Good(used),
            Err(laser_eb90::DecodeError::Checksum { .. }) => Check::Refused,
            Ok(_) | Err(_) => Check::Nothing,
        }
    }

    fn is_in(job: usize, message: &[u8]) -> bool {
        message.windows(4).any(|value| value == f32::from(word(job)).to_le_bytes())
    }

    fn job(work: &Job) -> Option<usize> {
        let floats = work.floats(&ControllerConfig::default());
        floats.first().filter(|float| float.fract() == 0.0).map(|float| *float as usize)
    }
}

impl HandledLink for mma::Device<RobotPose> {
    type Device = MmaRobot;
    const FAULTS: Faults = Faults::TCP;

    fn device() -> MmaRobot {
        Mma { speed: 100, ..Mma::default() }
    }

    fn spawn(plug: Plug) -> Self {
        let (robot, task) = mma::central(CentralConfig::DEFAULT, plug).unwrap();
        tokio::spawn(task.run());
        robot
    }

    async fn work(&mut self, jobs: Range<usize>) -> Vec<ReportedOutcome> {
        let mut reported = Vec::new();
        // A motion that is refused without it reports that.
        let _ = self.command(Command::Servo { on: true }).await;
        for job in jobs {
            let to = RobotPose::from_mm_rad(300.0, f64::from(word(job)), 100.0, 0.0);
            reported.push(match self.move_to(to).await {
                Ok(_) => Done,
                Err(mma::Error::Unknown(_) | mma::Error::Missed(_) | mma::Error::Stopped) => Unknown,
                Err(mma::Error::Closed(_)) => Unknown,
                Err(_) => NotDone,
            });
        }
        reported
    }

    fn job(motion: &Motion<RobotPose>) -> Option<usize> {
        usize::try_from(motion.to.units()[1] / 1000).ok()
    }
}
