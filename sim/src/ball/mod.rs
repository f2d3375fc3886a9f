//! The ISRA Robot Command Teach Ball, with a hand on it.

mod hand;

use core::convert::Infallible;
use core::time::Duration;

use isra_ball::{Ball, BallConfig, BallEvent, Keys, timing};

pub use self::hand::{Grip, PERIOD, grip};
use crate::device::{Device, DeviceRecord, Error};
use crate::settings::Settings;

/// The ball's processor makes new values this often, which the source does not give. A poll before that gets old ones.
const MEASURING: Duration = Duration::from_millis(10);

/// A ball's settings.
#[derive(Debug, Clone, Copy)]
pub struct TeachBall {
    /// The configuration of the session.
    pub config: BallConfig,
    /// The rate of the line in baud, if one is simulated.
    pub baud: u32,
    /// The force of the hand and its keys at each time.
    pub hand: fn(Duration) -> Grip,
}

impl Default for TeachBall {
    fn default() -> Self {
        Self { config: BallConfig::default(), baud: timing::BAUD, hand: grip }
    }
}

impl Settings for TeachBall {
    type Device = HeldBall;

    fn device(&self) -> Result<HeldBall, Error> {
        let ball = Ball::new(self.config).map_err(Error::settings)?;
        let grip = Grip { force: [0; 3], moment: [0; 3], keys: Keys::NONE };
        Ok(HeldBall { settings: *self, ball, measured: Duration::ZERO, held: None, grip })
    }
}

#[cfg(feature = "spec")]
impl robot_session::spec::Configure for TeachBall {
    fn configure(&mut self, fields: &mut impl robot_session::spec::FieldVisitor) {
        let Self { config, baud, hand: _ } = self;
        fields.baud(robot_session::spec::LINE, baud);
        config.configure(fields);
    }
}

/// A ball in a hand. It executes nothing.
#[derive(Debug)]
pub struct HeldBall {
    settings: TeachBall,
    ball: Ball,
    /// The time of the next values.
    measured: Duration,
    /// The grip in place of that of the settings' hand.
    held: Option<Grip>,
    /// The values of the last measurement.
    grip: Grip,
}

impl HeldBall {
    /// Makes the ball measure this grip from now on; `None`: the grip of the settings' hand again.
    pub fn hold(&mut self, grip: Option<Grip>) {
        self.held = grip;
        self.measured = Duration::ZERO;
    }

    /// Returns the values of the last measurement.
    pub fn grip(&self) -> Grip {
        self.grip
    }
}

impl Device for HeldBall {
    type Session = Ball;
    type Event = BallEvent;
    type Work = Infallible;

    fn session(&self) -> &Ball {
        &self.ball
    }

    fn session_mut(&mut self) -> &mut Ball {
        &mut self.ball
    }

    fn take(&mut self, _: Duration, event: BallEvent, notes: &mut DeviceRecord<BallEvent, Infallible>) {
        notes.event(event);
    }

    /// Measures when a poll may come.
    fn advance(&mut self, now: Duration, _: &mut DeviceRecord<BallEvent, Infallible>) {
        if now >= self.measured {
            self.grip = self.held.unwrap_or_else(|| (self.settings.hand)(now));
            let Grip { force, moment, keys } = self.grip;
            self.ball.measure(force, moment, keys);
            self.measured = now.saturating_add(MEASURING);
        }
    }

    fn due(&self) -> Option<Duration> {
        None
    }

    fn restart(&mut self, _: Duration) {
        // The same settings have worked before.
        if let Ok(ball) = Ball::new(self.settings.config) {
            self.ball = ball;
        }
    }

    /// Does nothing: the ball has no unexecuted work.
    fn forget(&mut self, _: Duration) {}
}
