//! The rows of the latch's table.

use core::time::Duration;

use cellwire_motion::latch::{Cause, Latch, LatchConfig, LatchInput};
use robot_session::end::{Machine as _, is_due};

use crate::model::{DrawnMachine, NOW, Rows};

const MS: Duration = Duration::from_millis(1);

/// The latch, with both keys.
#[derive(Debug)]
pub enum Operator {}

impl Rows for Operator {
    type Machine = Latch;

    fn states() -> Vec<Latch> {
        let (past, future) = (NOW - MS, NOW + MS);
        let mut states =
            vec![Latch::Off(Cause::NoAlter), Latch::Off(Cause::Stop), Latch::Interrupted, Latch::Halted];
        states.extend(
            [
                Cause::Start,
                Cause::Interruption,
                Cause::Halt,
                Cause::OldValues,
                Cause::InputLost,
                Cause::KeyReleased,
                Cause::Profile,
            ]
            .map(Latch::Disarmed),
        );
        let cause = Cause::Start;
        for (fresh_until, rested_at) in [(future, future + MS), (future, past), (past, past)] {
            states.push(Latch::Resting { cause, fresh_until, rested_at });
        }
        for fresh_until in [future, past] {
            states.extend([Latch::Ready { cause, fresh_until }, Latch::Armed { fresh_until }]);
        }
        states.extend([
            Latch::Stopping,
            Latch::Ending { by: future },
            Latch::Ending { by: past },
            Latch::Ended,
        ]);
        states
    }

    fn inputs() -> Vec<LatchInput> {
        use LatchInput as On;
        let hand = |rests, holds, fresh_until| LatchInput::Hand { rests, holds, fresh_until };
        vec![
            On::Connected,
            On::Disconnected,
            On::Timeout,
            On::Running,
            On::Interrupted,
            On::Halted,
            On::Silent,
            hand(true, false, NOW + 2 * MS),
            hand(false, true, NOW + 2 * MS),
            hand(false, false, NOW + 2 * MS),
            hand(true, true, NOW),
            On::OldValues,
            On::InputLost,
            On::Profile,
            On::Confirm,
            On::Stop,
            On::End,
        ]
    }

    fn config() -> LatchConfig {
        LatchConfig { confirm: true, hold_to_run: true, ..LatchConfig::default() }
    }

    fn row(machine: &Latch, now: Duration) -> String {
        let name = machine.name();
        match machine {
            Latch::Off(cause) | Latch::Disarmed(cause) => format!("{name}({cause:?})"),
            _ if machine.expires(now) => format!("{name}, over"),
            Latch::Resting { rested_at, .. } if is_due(*rested_at, now) => format!("{name}, long enough"),
            _ => name.into(),
        }
    }

    fn column(input: &LatchInput) -> String {
        match input {
            LatchInput::Hand { fresh_until, .. } if is_due(*fresh_until, NOW) => "Hand(old)".into(),
            _ => robot_session::end::Input::name(input).into(),
        }
    }
}

impl DrawnMachine for Latch {}
