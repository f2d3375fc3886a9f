//! Collects the warnings that the SVG reader gives to the crate `log`.

use core::cell::RefCell;
use std::sync::OnceLock;

use anyhow::{Result, ensure};
use log::{LevelFilter, Log, Metadata, Record};

/// The warnings collected of one drawing; further ones are repetitions in practice.
const MAX_WARNINGS: usize = 100;

thread_local! {
    static WARNINGS: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
}

struct Collector;

impl Log for Collector {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &Record<'_>) {
        WARNINGS.with_borrow_mut(|warnings| {
            if let Some(warnings) = warnings.as_mut().filter(|it| it.len() < MAX_WARNINGS) {
                warnings.push(record.args().to_string());
            }
        });
    }

    fn flush(&self) {}
}

/// Calls `read`, and returns its result with the warnings that this thread has logged meanwhile.
///
/// # Errors
/// If the program has another logger, which would receive the warnings.
pub(super) fn collect<T>(read: impl FnOnce() -> T) -> Result<(T, Vec<String>)> {
    static INSTALLED: OnceLock<bool> = OnceLock::new();
    let is_installed = *INSTALLED.get_or_init(|| log::set_logger(&Collector).is_ok());
    ensure!(is_installed, "cannot be checked: the program has another logger");
    log::set_max_level(LevelFilter::Warn);
    WARNINGS.set(Some(Vec::new()));
    let result = read();
    Ok((result, WARNINGS.take().unwrap_or_default()))
}
