//! The delay of USB serial adapters, compared with the deadlines of the links.

use std::path::Path;
use std::time::Duration;

use fanuc_hmi_modbus::timing::silence;
use val2_alter::AXES;
use val2_alter::timing::{min_reply_len, reply_slack};

use super::ports;

/// The time that a link leaves for delays on a serial line. The time on the line itself is subtracted already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deadline {
    /// The event that comes too late.
    of: &'static str,
    /// The delay from which on it is too late.
    left: Duration,
}

impl Deadline {
    /// Returns the deadline of a host under ALTER: the least of the assumed delay and the time that the window leaves after
    /// a reply with all axes.
    pub fn of_alter(config: &val2_alter::HostConfig) -> Self {
        let reply = min_reply_len(AXES, config.framing);
        let slack = reply_slack(config.mode.accumulation(), config.baud, reply).unwrap_or_default();
        Self { of: "a reply to the controller", left: slack.min(config.max_delay) }
    }

    /// Returns the deadline of a host of a ball: the delay after which a packet is rejected.
    pub fn of_ball(config: &isra_ball::HostConfig) -> Self {
        Self { of: "a packet of the ball", left: config.max_delay }
    }

    /// Returns the deadline between the ends of a link, if an adapter can miss it. A tap forwards bytes in the pieces in
    /// which an adapter delivers them.
    pub fn between(link: &str, baud: u32) -> Option<Self> {
        match link {
            "val2-alter" => Some(Self::of_alter(&val2_alter::HostConfig { baud, ..Default::default() })),
            "isra-ball" => Some(Self::of_ball(&isra_ball::HostConfig::default())),
            "fanuc-hmi-modbus" => Some(Self { of: "the rest of a frame", left: silence(baud) }),
            _ => None,
        }
    }

    /// Returns the advice for the settings if the adapter of a serial port delays bytes for too long; `None` if it does not,
    /// or the system does not report the delay. With `low_latency` (`setserial`), Linux reports 1 ms.
    pub fn advice(self, port: &str) -> Option<String> {
        self.advice_at(port, ports::latency_timer(Path::new(port))?)
    }

    /// Returns the advice for a delay in milliseconds.
    fn advice_at(self, port: &str, ms: u32) -> Option<String> {
        // The shortest that a chip can be set to.
        if ms <= 1 || Duration::from_millis(ms.into()) < self.left {
            return None;
        }
        let left = self.left.as_secs_f64() * 1e3;
        Some(format!(
            "{port}: its USB adapter buffers bytes for {ms} ms, and {} is too late after {left:.1} ms: \
             set its latency timer to 1 ms, see docs/alter.md",
            self.of
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_adapter_that_is_too_slow_for_a_link_is_reported_with_what_to_set() {
        let alter = Deadline::of_alter(&val2_alter::HostConfig::default());
        assert_eq!(
            alter.advice_at("/dev/ttyUSB0", 16).unwrap(),
            "/dev/ttyUSB0: its USB adapter buffers bytes for 16 ms, and a reply to the controller is too late after 9.8 ms: \
             set its latency timer to 1 ms, see docs/alter.md"
        );
        let ball = Deadline::of_ball(&isra_ball::HostConfig::default());
        assert_eq!(
            ball.advice_at("COM5", 14).unwrap(),
            "COM5: its USB adapter buffers bytes for 14 ms, and a packet of the ball is too late after 14.0 ms: \
             set its latency timer to 1 ms, see docs/alter.md"
        );
        let modbus = Deadline::between("fanuc-hmi-modbus", 19_200).unwrap();
        assert!(
            modbus.advice_at("COM5", 3).unwrap().contains("the rest of a frame is too late after 2.0 ms")
        );
    }

    #[test]
    fn nothing_is_reported_of_a_deadline_that_is_met() {
        let alter = |baud| Deadline::between("val2-alter", baud).unwrap();
        assert_eq!(alter(38_400).advice_at("COM5", 9), None);
        assert!(alter(38_400).advice_at("COM5", 10).is_some());
        // A reply takes longer on a slower line.
        assert_eq!(alter(19_200).advice_at("COM5", 4), None);
        assert!(alter(19_200).advice_at("COM5", 5).is_some());
        assert_eq!(Deadline::between("isra-ball", 9600).unwrap().advice_at("COM5", 13), None);
        // Nothing shorter can be set.
        assert_eq!(Deadline::between("fanuc-hmi-modbus", 115_200).unwrap().advice_at("COM5", 1), None);
        let hasty = val2_alter::HostConfig { max_delay: Duration::from_millis(5), ..Default::default() };
        assert!(Deadline::of_alter(&hasty).advice_at("COM5", 5).is_some());
        // A reply with all axes does not fit the window at this rate.
        assert_eq!(alter(9600).advice_at("COM5", 1), None);
        assert!(alter(9600).advice_at("COM5", 2).is_some());
        let patient = isra_ball::HostConfig { max_delay: Duration::from_millis(30), ..Default::default() };
        assert_eq!(Deadline::of_ball(&patient).advice_at("COM5", 16), None);
        for link in ["laser-eb90", "val2-viewer", "kawasaki-msg"] {
            assert_eq!(Deadline::between(link, 9600), None);
        }
        assert_eq!(alter(38_400).advice("/nowhere"), None);
    }
}
