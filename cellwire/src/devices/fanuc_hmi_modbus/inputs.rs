//! Signals that come from outside: the inputs that a cell gives to a controller.

use core::ops::Range;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use fanuc_hmi_modbus::Signal;

use super::signal;
use cellwire_sim::fanuc::Tables;

/// The setting `inputs`: `DI[1]:0-5,RI[2]:3-`, an input and the seconds since the start between which it is on.
#[derive(Debug, Clone, Default)]
pub struct Inputs(Vec<(Signal, Range<Duration>)>);

impl Inputs {
    /// Reads the setting.
    ///
    /// # Errors
    /// An item is not an input, or has no times.
    pub fn parse(text: &str) -> Result<Self> {
        let mut inputs = Vec::new();
        for item in text.split(',').map(str::trim).filter(|item| !item.is_empty()) {
            let wrong = || {
                format!(
                    "inputs={item} is not INPUT:FROM-TO with DI, RI, UI, SI or GI, such as DI[1]:0-5 or RI[2]:3-"
                )
            };
            let (name, times) = item.split_once(':').with_context(wrong)?;
            let signal = signal::parse(name).filter(is_input).with_context(wrong)?;
            ensure!(signal.place().is_some(), "inputs={item}: there is no {name}");
            let (from, to) = times.split_once('-').with_context(wrong)?;
            let seconds = |text: &str| -> Result<Duration> {
                let seconds: Option<f64> = text.trim().parse().ok().filter(|it| (0.0..=1e6).contains(it));
                Ok(Duration::from_secs_f64(seconds.with_context(wrong)?))
            };
            let to = if to.trim().is_empty() { Duration::MAX } else { seconds(to)? };
            inputs.push((signal, seconds(from)?..to));
        }
        Ok(Self(inputs))
    }

    /// Returns whether all inputs stay constant from this time on.
    pub fn are_settled(&self, now: Duration) -> bool {
        self.0.iter().all(|(_, times)| times.start <= now && (times.end <= now || times.end == Duration::MAX))
    }

    /// Sets them as they are at a time.
    pub fn set(&self, now: Duration, tables: &mut Tables) {
        for (signal, _) in &self.0 {
            let is_on = self.0.iter().any(|(other, times)| other == signal && times.contains(&now));
            let _ = tables.set_signal(*signal, u16::from(is_on));
        }
    }
}

/// Returns whether the setting has this kind of signal.
fn is_input(signal: &Signal) -> bool {
    matches!(signal, Signal::Di(_) | Signal::Ri(_) | Signal::Ui(_) | Signal::Si(_) | Signal::Gi(_))
}
