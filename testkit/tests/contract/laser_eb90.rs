use core::time::Duration;

use laser_eb90::{ControllerConfig, HostConfig, Instruction, Refusal};
use testkit::contract::End;
use testkit::rng::Rng;

const LINK: &str = "laser-eb90";

/// What the motion task takes: anything.
#[derive(Debug)]
pub struct Job;

impl TryFrom<Instruction<'_>> for Job {
    type Error = ();

    fn try_from(_: Instruction<'_>) -> Result<Self, ()> {
        Ok(Self)
    }
}

pub struct Host;

impl End for Host {
    type Session = laser_eb90::Host;
    const NAME: &'static str = "laser-eb90 host";

    fn new(endless: bool) -> Self::Session {
        let long = HostConfig {
            answer_timeout: Duration::MAX,
            execution_timeout: Duration::MAX,
            settle: Duration::MAX,
            max_pause: Duration::MAX,
            reply_time: Duration::MAX,
            earlier_execution: Duration::MAX,
            backoff: Duration::MAX,
            full_timeout: Duration::MAX,
            ..HostConfig::default()
        };
        laser_eb90::Host::new(if endless { long } else { HostConfig::default() }).unwrap()
    }

    fn request(host: &mut Self::Session, _: Duration, rng: &mut Rng) {
        match rng.below(8) {
            0 => drop(host.take_back()),
            1 | 2 => host.resume(),
            _ => {
                let word = [0x0101, 0x0101, 0x0201, 0x0301, 0xBAD][rng.below(5)];
                // Full, or no command word: nothing has changed then.
                let _ = host.submit(word, |payload| payload.f32(&[1.5, -2.0]).map(drop));
            }
        }
    }

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame(LINK, None, rng)
    }
}

pub struct Controller;

impl End for Controller {
    type Session = laser_eb90::Controller<'static, Job>;
    const NAME: &'static str = "laser-eb90 controller";

    fn new(endless: bool) -> Self::Session {
        let long = ControllerConfig { silence: Duration::MAX, ..ControllerConfig::default() };
        let (writer, _) = robot_work_queue::boxed(8, 9999).unwrap();
        laser_eb90::Controller::new(if endless { long } else { ControllerConfig::default() }, writer).unwrap()
    }

    fn request(controller: &mut Self::Session, now: Duration, rng: &mut Rng) {
        // Nothing may be executing: that is an error then, and changes nothing.
        let _ = if rng.chance(0.5) {
            controller.answer(now, |payload| payload.f32(&[0.5]).map(drop))
        } else {
            controller.refuse(now, Refusal::BadParameters)
        };
    }

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame(LINK, None, rng)
    }
}
