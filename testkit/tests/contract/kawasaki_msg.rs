use core::time::Duration;

use kawasaki_msg::{JobKind, Line, PcConfig, Point, RobotConfig};
use testkit::contract::End;
use testkit::rng::Rng;

const LINK: &str = "kawasaki-msg";
const LINES: [Line; 3] = [Line { kind: JobKind::Draw, start: Point::new(0, 0), end: Point::new(2500, 0) }; 3];

pub struct Pc<const UDP: bool>;

impl<const UDP: bool> End for Pc<UDP> {
    type Session = kawasaki_msg::Pc<'static, &'static [Line]>;
    const NAME: &'static str = if UDP { "kawasaki-msg pc, UDP" } else { "kawasaki-msg pc, TCP" };
    const DATAGRAMS: bool = UDP;

    fn new(endless: bool) -> Self::Session {
        let config = if UDP { PcConfig::UDP } else { PcConfig::TCP };
        let long = PcConfig { reply_delay: Duration::MAX, silence: Duration::MAX, ..config };
        kawasaki_msg::Pc::new(if endless { long } else { config }).unwrap()
    }

    fn request(pc: &mut Self::Session, _: Duration, rng: &mut Rng) {
        // What the state does not allow is an error, and changes nothing.
        let _ = match rng.below(5) {
            0 => pc.end(),
            1 => pc.interrupt(),
            2 => pc.command(1, 50),
            _ => pc.start(rng.below(3) as u16, &LINES[..]),
        };
    }

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame(LINK, Some("robot"), rng)
    }
}

pub struct Robot<const UDP: bool>;

impl<const UDP: bool> End for Robot<UDP> {
    type Session = kawasaki_msg::Robot<'static, Line>;
    const NAME: &'static str = if UDP { "kawasaki-msg robot, UDP" } else { "kawasaki-msg robot, TCP" };
    const DATAGRAMS: bool = UDP;

    fn new(endless: bool) -> Self::Session {
        let config = if UDP { RobotConfig::UDP } else { RobotConfig::TCP };
        let long = RobotConfig {
            patience: Duration::MAX,
            pause: Duration::MAX,
            reply_timeout: Duration::MAX,
            exchange: Duration::MAX,
            reconnect_delay: Duration::MAX,
            status_period: Duration::MAX,
            ..config
        };
        let (writer, reader) = robot_work_queue::boxed(8, 9999).unwrap();
        // Its motion task is there, and executes nothing.
        core::mem::forget(reader);
        kawasaki_msg::Robot::new(if endless { long } else { config }, writer).unwrap()
    }

    fn request(robot: &mut Self::Session, now: Duration, rng: &mut Rng) {
        // What the state does not allow is an error, and changes nothing.
        let _ = match rng.below(8) {
            0 => robot.clear_queue(),
            1 => robot.reset_order(),
            _ => robot.job_done(now, rng.below(4) as u16),
        };
    }

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame(LINK, Some("pc"), rng)
    }
}
