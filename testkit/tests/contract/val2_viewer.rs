use core::time::Duration;

use testkit::contract::End;
use testkit::rng::Rng;
use val2_viewer::{ENQ, HostConfig, WorkstationConfig};

pub struct Host;

impl End for Host {
    type Session = val2_viewer::Host;
    const NAME: &'static str = "val2-viewer host";

    fn new(endless: bool) -> Self::Session {
        let long = HostConfig { interval: Duration::MAX, max_age: Duration::MAX, ..HostConfig::default() };
        val2_viewer::Host::new(if endless { long } else { HostConfig::default() }).unwrap()
    }

    fn request(host: &mut Self::Session, now: Duration, rng: &mut Rng) {
        host.set_pose(now, [rng.next_u64() as i16; 12]);
    }

    fn message(_: &mut Rng) -> Vec<u8> {
        vec![ENQ]
    }
}

pub struct Workstation;

impl End for Workstation {
    type Session = val2_viewer::Workstation;
    const NAME: &'static str = "val2-viewer workstation";

    fn new(endless: bool) -> Self::Session {
        let long = WorkstationConfig {
            pause: Duration::MAX,
            stale_after: Duration::MAX,
            ..WorkstationConfig::default()
        };
        val2_viewer::Workstation::new(if endless { long } else { WorkstationConfig::default() }).unwrap()
    }

    fn request(workstation: &mut Self::Session, now: Duration, _: &mut Rng) {
        workstation.draw(now);
    }

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame("val2-viewer", None, rng)
    }
}
