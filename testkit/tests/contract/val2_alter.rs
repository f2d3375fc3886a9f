use core::time::Duration;

use testkit::contract::End;
use testkit::rng::Rng;
use val2_alter::{ControllerConfig, HostConfig, Policy};

const LINK: &str = "val2-alter";

pub struct Host;

impl End for Host {
    type Session = val2_alter::Host;
    const NAME: &'static str = "val2-alter host";

    fn new(endless: bool) -> Self::Session {
        let long = HostConfig {
            gap: Some(Duration::MAX),
            target_timeout: Duration::MAX,
            max_delay: Duration::MAX,
            silence_cycles: u32::MAX,
            ..HostConfig::default()
        };
        val2_alter::Host::new(if endless { long } else { HostConfig::default() }).unwrap()
    }

    fn request(host: &mut Self::Session, now: Duration, rng: &mut Rng) {
        match rng.below(8) {
            0 => host.clear_target(now),
            1 => host.stop(now),
            2 => host.set_policy(now, [Policy::Accept, Policy::Refuse, Policy::Ignore][rng.below(3)]),
            3 => host.set_subroutine(now, rng.chance(0.5)),
            _ => host.set_target(now, [rng.next_u64() as i16; 6]),
        }
    }

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame(LINK, Some("robot"), rng)
    }
}

pub struct Controller;

impl End for Controller {
    type Session = val2_alter::Controller;
    const NAME: &'static str = "val2-alter controller";

    fn new(endless: bool) -> Self::Session {
        let long = ControllerConfig { gap: Some(Duration::MAX), ..ControllerConfig::default() };
        val2_alter::Controller::new(if endless { long } else { ControllerConfig::default() }).unwrap()
    }

    fn request(controller: &mut Self::Session, now: Duration, rng: &mut Rng) {
        // What the state does not allow is an error, and changes nothing.
        let _ = match rng.below(5) {
            0 => controller.finish(now),
            1 => controller.resume(now),
            2 => controller.interrupt(now),
            _ => controller.start(now),
        };
    }

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame(LINK, Some("host"), rng)
    }
}
