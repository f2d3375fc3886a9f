//! The operator's latch: an operator, an input and a robot that do anything at any time, and a program that is called late.

mod margins;
pub mod rows;
mod world;

pub use margins::margins;
pub use world::{Act, Operated, State, TICK};

use cellwire_motion::latch::{LatchConfig, Rule};
use robot_session::end::Rules;

use self::world::{ARMED, CONFIRMED, END, FRESH, HELD, OPEN, RESTED, RUNS, SHOWN, STOP, STOPPED};
use crate::model::{Depth, Diagram, MustFail, Pair, Setting, Table, draw};

/// The tables of the machine.
pub const TABLES: &[Table] = &[Table::of::<rows::Operator>("cellwire-motion", 40)];

/// The latch, and everything around it.
pub const PAIR: Pair =
    Pair { name: "cellwire-motion latch × operator", settings, must_fail, diagrams, refined: Vec::new };

const KEYS: [(&str, bool, bool); 4] = [
    ("a hand at rest arms", false, false),
    ("a key confirms", true, false),
    ("a key is held", false, true),
    ("a key confirms and a key is held", true, true),
];

fn settings(depth: Depth) -> Vec<Setting> {
    let ticks = match depth {
        Depth::Quick => 1,
        Depth::Deep => 2,
    };
    KEYS.map(|(name, confirm, hold_to_run)| {
        let name =
            format!("{name}, anything at any time, ticks of {} ms", TICK.as_millis() / u128::from(ticks));
        Setting::new(name, Operated::new(ticks, confirm, hold_to_run))
    })
    .into()
}

fn must_fail() -> Vec<MustFail> {
    let case =
        |rule: &'static str, property, without, (setting, confirm, hold_to_run): (&str, bool, bool)| {
            let operated = Operated::new(1, confirm, hold_to_run);
            let config = LatchConfig { rules: Rules::without(without), ..operated.config };
            MustFail::new(rule, property, setting, Operated { config, ..operated })
        };
    let [plain, confirmed, held, _] = KEYS;
    vec![
        case("the hand has to rest", RESTED, Rule::Rest, plain),
        case("a push restarts the rest", RESTED, Rule::Uninterrupted, plain),
        case("time alone does not arm", RESTED, Rule::ByValues, plain),
        case("values that are not renewed disarm", FRESH, Rule::Expire, plain),
        case("what came due is done first", RESTED, Rule::TimeFirst, plain),
        case("old values move nothing, called late or not", FRESH, Rule::FreshInUse, plain),
        case("values that are old when they come are none", ARMED, Rule::OldOnArrival, plain),
        case("a start message disarms", RUNS, Rule::Start, plain),
        case("the end of ALTER disarms", RUNS, Rule::Over, plain),
        case("an interruption disarms", RUNS, Rule::Interruption, plain),
        case("an arm that the robot stops disarms", RUNS, Rule::Halt, plain),
        case("an input without new values disarms", RESTED, Rule::OldValues, plain),
        case("a lost input disarms", RESTED, Rule::InputLost, plain),
        case("another meaning of the values disarms", RESTED, Rule::Profile, plain),
        case("the key that has to be held disarms", HELD, Rule::HoldToRun, held),
        case("a key has to confirm", CONFIRMED, Rule::Confirm, confirmed),
        case("only a hand that has rested is confirmed", RESTED, Rule::ConfirmRested, confirmed),
        case("after a stop nothing arms", STOPPED, Rule::StopHolds, plain),
        case("after an end nothing arms", STOPPED, Rule::EndHolds, plain),
        case("a stop is passed on", STOP, Rule::PassOnStop, plain),
        case("a stop is the cause until ALTER runs again", OPEN, Rule::StopIsCause, plain),
        case("the end does not wait without end", END, Rule::EndInTime, plain),
        case("the end waits for the last message alone", END, Rule::Farewell, plain),
        case("every change is reported", SHOWN, Rule::Report, plain),
    ]
}

fn diagrams() -> Vec<Diagram> {
    // A late call has the effect of two calls.
    let in_time = KEYS.map(|(name, confirm, hold_to_run)| {
        Setting::new(name, Operated { late: false, ..Operated::new(1, confirm, hold_to_run) })
    });
    draw("motion", &["latch"], &in_time)
}
