//! The number of axes that fit a reply at a baud rate, and advice if not all of them fit (§3.4).

use val2_alter::timing::{self, Budget};
use val2_alter::{AXES, HostConfig};

/// Returns the maximum number of axes that fit a reply without doubled bytes; the others wait.
pub fn axes_that_fit(config: &HostConfig) -> usize {
    let request = timing::min_request_len(config.mode.has_transform(), config.framing);
    let fits = |values: &usize| {
        let reply = timing::min_reply_len(*values, config.framing);
        let budget = Budget::new(config.mode.accumulation(), config.baud, request, reply);
        budget.slack().is_some_and(|slack| slack >= config.reserve)
    };
    (1..=AXES).rev().find(fits).unwrap_or(0)
}

/// Returns the advice for the operator before the arm moves, if not all axes fit.
pub fn advice(config: &HostConfig) -> Option<String> {
    let axes = axes_that_fit(config);
    if axes == AXES {
        return None;
    }
    let without = config.mode.with_transform(false);
    let mut remedies = Vec::new();
    if axes_that_fit(&HostConfig { baud: timing::BAUD, ..*config }) == AXES {
        remedies.push(format!("{} baud", timing::BAUD));
    }
    if without != config.mode && axes_that_fit(&HostConfig { mode: without, ..*config }) == AXES {
        remedies.push(format!("mode {}", without.0));
    }
    let HostConfig { baud, mode, .. } = config;
    let has = if remedies.len() == 1 { "has" } else { "have" };
    let remedies = match remedies.is_empty() {
        true => String::new(),
        false => format!("; {} {has} room for all", remedies.join(" or ")),
    };
    Some(format!("{baud} baud, mode {}: only {axes} of {AXES} axes fit a reply{remedies}", mode.0))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use val2_alter::Mode;

    use super::*;

    fn at(baud: u32, mode: u8) -> HostConfig {
        HostConfig { baud, mode: Mode(mode), ..HostConfig::default() }
    }

    /// Bytes on the line: a message of 36, or 12 without transformation; a reply of 8 and two for each value.
    #[test]
    fn what_fits_is_said_where_it_is_not_everything() {
        let table = [
            (38_400, 23, 6),
            (38_400, 19, 6),
            (19_200, 23, 3),
            (19_200, 19, 6),
            (19_200, 22, 3),
            (9600, 19, 2),
        ];
        for (baud, mode, axes) in table {
            assert_eq!(axes_that_fit(&at(baud, mode)), axes, "{baud} {mode}");
        }
        assert_eq!(advice(&at(38_400, 23)), None);
        assert_eq!(advice(&at(19_200, 19)), None);
        assert_eq!(
            advice(&at(19_200, 23)).unwrap(),
            "19200 baud, mode 23: only 3 of 6 axes fit a reply; 38400 baud or mode 19 have room for all"
        );
        assert_eq!(
            advice(&at(9600, 19)).unwrap(),
            "9600 baud, mode 19: only 2 of 6 axes fit a reply; 38400 baud has room for all"
        );
        let slow = HostConfig { reserve: Duration::from_millis(14), ..at(19_200, 19) };
        assert_eq!(advice(&slow).unwrap(), "19200 baud, mode 19: only 0 of 6 axes fit a reply");
    }
}
