use core::time::Duration;

use isra_ball::{BallConfig, ENQ, HostConfig, Keys};
use testkit::contract::End;
use testkit::rng::Rng;

pub struct Host;

impl End for Host {
    type Session = isra_ball::Host;
    const NAME: &'static str = "isra-ball host";

    fn new(endless: bool) -> Self::Session {
        let long = HostConfig {
            period: Duration::MAX,
            max_delay: Duration::MAX,
            max_age: Duration::MAX,
            ..HostConfig::default()
        };
        isra_ball::Host::new(if endless { long } else { HostConfig::default() }).unwrap()
    }

    fn request(_: &mut Self::Session, _: Duration, _: &mut Rng) {}

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame("isra-ball", None, rng)
    }
}

pub struct Ball;

impl End for Ball {
    type Session = isra_ball::Ball;
    const NAME: &'static str = "isra-ball ball";

    fn new(_: bool) -> Self::Session {
        isra_ball::Ball::new(BallConfig::default()).unwrap()
    }

    fn request(ball: &mut Self::Session, _: Duration, rng: &mut Rng) {
        ball.measure([rng.next_u64() as i8; 3], [rng.next_u64() as i8; 3], Keys::default());
    }

    fn message(_: &mut Rng) -> Vec<u8> {
        vec![ENQ]
    }
}
