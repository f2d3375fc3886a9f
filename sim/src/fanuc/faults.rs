//! Faults of the simulated controller: implausible telemetry, to test a client.

use core::ops::Range;
use core::str::FromStr;
use core::time::Duration;

use fanuc_hmi_modbus::TelemetryBlock;

/// Faults of the telemetry, with times: as text `nan:1-1.5,standstill:3-4`, a fault and the seconds since the start
/// between which it is present.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TelemetryFaults(Vec<(TelemetryFault, Range<Duration>)>);

/// The error of a text that is not a telemetry fault.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NoFault(String);

/// A fault of the telemetry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TelemetryFault {
    /// The speed in X is not a number.
    Nan,
    /// The orientation's R is infinite.
    Infinite,
    /// The position's X is 1e-40.
    Denormal,
    /// The quaternion's first part is 2.
    Quaternion,
    /// The position's X is 5 m further.
    Unreachable,
    /// The background task does not run.
    Standstill,
    /// The life counter begins again, once.
    Restart,
    /// Every client is disconnected, and new ones too.
    Disconnect,
    /// Every request is refused: server device busy.
    Busy,
}

impl TelemetryFault {
    const ALL: [(Self, &'static str); 9] = [
        (Self::Nan, "nan"),
        (Self::Infinite, "infinite"),
        (Self::Denormal, "denormal"),
        (Self::Quaternion, "quaternion"),
        (Self::Unreachable, "unreachable"),
        (Self::Standstill, "standstill"),
        (Self::Restart, "restart"),
        (Self::Disconnect, "disconnect"),
        (Self::Busy, "busy"),
    ];
}

impl FromStr for TelemetryFaults {
    type Err = NoFault;

    fn from_str(text: &str) -> Result<Self, NoFault> {
        let mut faults = Vec::new();
        for item in text.split(',').map(str::trim).filter(|item| !item.is_empty()) {
            let parts = item.split_once(':').and_then(|(name, times)| Some((name, times.split_once('-')?)));
            let no_item = || NoFault(format!("faults={item} is not FAULT:FROM-TO, such as nan:1-1.5"));
            let (name, (from, to)) = parts.ok_or_else(no_item)?;
            let Some((fault, _)) = TelemetryFault::ALL.iter().find(|(_, known)| *known == name.trim()) else {
                let known: Vec<&str> = TelemetryFault::ALL.iter().map(|(_, name)| *name).collect();
                return Err(NoFault(format!("faults={name} is none of {}", known.join(", "))));
            };
            let seconds = |text: &str| {
                let seconds = text.trim().parse().ok().filter(|seconds: &f64| (0.0..=1e6).contains(seconds));
                let none = || NoFault(format!("faults={item}: {text} is not 0 to 1000000 seconds"));
                seconds.map(Duration::from_secs_f64).ok_or_else(none)
            };
            let times = seconds(from)?..seconds(to)?;
            if times.start >= times.end {
                return Err(NoFault(format!("faults={item}: it ends before it begins")));
            }
            faults.push((*fault, times));
        }
        Ok(Self(faults))
    }
}

impl TelemetryFaults {
    /// Returns the faults with one more, between these times since the start.
    #[must_use]
    pub fn with(mut self, fault: TelemetryFault, times: Range<Duration>) -> Self {
        self.0.push((fault, times));
        self
    }

    /// Returns whether a fault is active.
    pub fn has(&self, fault: TelemetryFault, now: Duration) -> bool {
        self.0.iter().any(|(found, times)| *found == fault && times.contains(&now))
    }

    /// Returns the time in which the background task has run since it was last started.
    pub fn task_time(&self, now: Duration) -> Duration {
        let started = |(fault, times): &(TelemetryFault, Range<Duration>)| {
            (*fault == TelemetryFault::Restart && times.start <= now).then_some(times.start)
        };
        let started = self.0.iter().filter_map(started).max().unwrap_or_default();
        let stopped = self.0.iter().filter(|(fault, _)| *fault == TelemetryFault::Standstill);
        let stopped = stopped.map(|(_, times)| {
            times.end.clamp(started, now.max(started)).saturating_sub(times.start.max(started))
        });
        now.saturating_sub(started).saturating_sub(stopped.sum())
    }

    /// Spoils a block.
    pub fn spoil(&self, block: &mut TelemetryBlock, now: Duration) {
        let has = |fault| self.has(fault, now);
        let ([x, ..], [.., r], [q1, ..], [vx, ..]) =
            (&mut block.position, &mut block.wpr, &mut block.quaternion, &mut block.velocity);
        if has(TelemetryFault::Nan) {
            *vx = f32::NAN;
        }
        if has(TelemetryFault::Infinite) {
            *r = f32::INFINITY;
        }
        if has(TelemetryFault::Quaternion) {
            *q1 = 2.0;
        }
        if has(TelemetryFault::Denormal) {
            *x = 1e-40;
        } else if has(TelemetryFault::Unreachable) {
            *x += 5000.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn a_fault_is_there_between_its_times() {
        let faults: TelemetryFaults = "nan:1-1.5, busy:2-3".parse().unwrap();
        assert!(
            !faults.has(TelemetryFault::Nan, SECOND * 999 / 1000) && faults.has(TelemetryFault::Nan, SECOND)
        );
        assert!(
            !faults.has(TelemetryFault::Nan, SECOND * 3 / 2) && faults.has(TelemetryFault::Busy, SECOND * 2)
        );
        for (text, message) in [
            ("nan", "faults=nan is not FAULT:FROM-TO, such as nan:1-1.5"),
            ("nan:2-1", "faults=nan:2-1: it ends before it begins"),
            ("nan:1-x", "faults=nan:1-x: x is not 0 to 1000000 seconds"),
            ("nan:NaN-2", "faults=nan:NaN-2: NaN is not 0 to 1000000 seconds"),
        ] {
            assert_eq!(text.parse::<TelemetryFaults>().unwrap_err().to_string(), message);
        }
        let error = "fire:1-2".parse::<TelemetryFaults>().unwrap_err().to_string();
        assert!(error.starts_with("faults=fire is none of nan, infinite, "), "{error}");
    }

    #[test]
    fn the_task_stands_still_and_begins_again() {
        let faults: TelemetryFaults = "standstill:1-2,restart:4-5,standstill:6-7".parse().unwrap();
        for (now, ran) in [(0.5, 0.5), (1.5, 1.0), (3.0, 2.0), (4.0, 0.0), (5.0, 1.0), (6.5, 2.0), (8.0, 3.0)]
        {
            let task = faults.task_time(Duration::from_secs_f64(now));
            assert_eq!(task, Duration::from_secs_f64(ran), "at {now} s");
        }
    }
}
