//! Instructions, counted where the board works for the session: in its interrupts.
//!
//! An answer takes what the last byte of its request takes, in the UART's interrupt and the session's, and where the
//! protocol has it wait, as for the end of a cycle or for a silence, what the session's interrupt at the end of the wait
//! takes until the first byte is out.

use core::cell::Cell;

use critical_section::Mutex;

use crate::core_of::{TICKS, elapsed, ticks};

/// The number of measured answers.
const ANSWERS: u32 = match option_env!("ANSWERS") {
    Some(number) => match u32::from_str_radix(number, 10) {
        Ok(number) => number,
        Err(_) => panic!("a number"),
    },
    None => 10_000,
};

static MEASURE: Mutex<Cell<Measure>> =
    Mutex::new(Cell::new(Measure { waits: false, begin: 0, busy: 0, runs: 0, answers: 0, worst: 0, sum: 0 }));

#[derive(Clone, Copy)]
struct Measure {
    /// Whether a request has come that is not answered yet.
    waits: bool,
    /// The time at which the running interrupt began, in ticks.
    begin: u32,
    /// The ticks for the last byte: the UART's interrupt, then the session's.
    busy: u32,
    runs: u8,
    answers: u32,
    worst: u32,
    sum: u64,
}

/// Runs and measures an interrupt.
pub(crate) fn interrupt(does: fn()) {
    critical_section::with(|cs| {
        let cell = MEASURE.borrow(cs);
        cell.set(Measure { begin: ticks(), ..cell.get() });
        does();
        let measure = cell.get();
        if measure.runs < 2 {
            cell.set(Measure {
                busy: measure.busy + elapsed(measure.begin),
                runs: measure.runs + 1,
                ..measure
            });
        }
    });
}

/// Called when the last byte of a request is about to come.
pub(crate) fn request_ends() {
    critical_section::with(|cs| {
        let cell = MEASURE.borrow(cs);
        cell.set(Measure { waits: true, busy: 0, runs: 0, ..cell.get() });
    });
}

/// Called when a byte is sent: the first one since the request belongs to the answer.
pub(crate) fn answers() {
    critical_section::with(|cs| {
        let cell = MEASURE.borrow(cs);
        let measure = cell.get();
        if measure.waits {
            let took = measure.busy + elapsed(measure.begin);
            cell.set(Measure {
                waits: false,
                answers: measure.answers + 1,
                worst: measure.worst.max(took),
                sum: measure.sum + u64::from(took),
                ..measure
            });
        }
    });
}

/// Prints the measurements and exits, when there are enough.
pub(crate) fn report() {
    let Measure { answers, worst, sum, .. } = critical_section::with(|cs| MEASURE.borrow(cs).get());
    if answers >= ANSWERS {
        let instructions = |ticks: u64| ticks * TICKS.0 / TICKS.1;
        let mean = instructions(sum / u64::from(answers));
        semihosting::println!("{answers} answers, worst {}, mean {mean}", instructions(worst.into()));
        semihosting::process::exit(0);
    }
}
