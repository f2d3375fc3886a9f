//! Functions for Windows only: exact waits, the end of a console, and the settings of an adapter.

use std::sync::OnceLock;
use std::thread;
use std::time::Duration;

use anyhow::{Result, ensure};
use windows_registry::LOCAL_MACHINE;
use windows_sys::Win32::Foundation::FALSE;
use windows_sys::Win32::Media::timeBeginPeriod;
use windows_sys::Win32::System::Console::{
    CTRL_CLOSE_EVENT, CTRL_LOGOFF_EVENT, CTRL_SHUTDOWN_EVENT, SetConsoleCtrlHandler,
};
use windows_sys::core::BOOL;

/// Makes waits of this process end at the millisecond, not at the system's clock of 15.6 ms: for sockets, ports and other
/// threads. A thread that sleeps has a timer of its own, which is exact anyway.
pub fn exact_waits() {
    // SAFETY: it takes a number, and changes the clock alone, until the process ends.
    unsafe { timeBeginPeriod(1) };
}

/// Returns the time for which the chip of an FTDI adapter collects bytes, by the settings of its driver; `None` if the registry
/// has no such chip for the port.
pub fn latency_timer(port: &str) -> Option<u32> {
    let name = port.trim_start_matches(r"\\.\");
    let adapters = LOCAL_MACHINE.open(r"SYSTEM\CurrentControlSet\Enum\FTDIBUS").ok()?;
    adapters.keys().ok()?.find_map(|adapter| {
        let parameters = adapters.open(format!(r"{adapter}\0000\Device Parameters")).ok()?;
        let is_this = parameters.get_string("PortName").ok()?.eq_ignore_ascii_case(name);
        is_this.then(|| parameters.get_u32("LatencyTimer").ok()).flatten()
    })
}

static CLOSED: OnceLock<Box<dyn Fn() + Send + Sync>> = OnceLock::new();

/// Calls `handler` when the console is closed, the user logs off, or the machine is shut down. The system ends the process five
/// seconds later, if it has not ended.
///
/// # Errors
/// If there is a handler already.
pub fn when_closed(handler: impl Fn() + Send + Sync + 'static) -> Result<()> {
    ensure!(CLOSED.set(Box::new(handler)).is_ok(), "cannot handle interrupts twice");
    // SAFETY: `closed` is a function of the kind that is asked for, and stays.
    let set = unsafe { SetConsoleCtrlHandler(Some(closed), 1) };
    ensure!(set != FALSE, std::io::Error::last_os_error());
    Ok(())
}

/// On a thread of its own, which the system makes for it.
unsafe extern "system" fn closed(event: u32) -> BOOL {
    if !matches!(event, CTRL_CLOSE_EVENT | CTRL_LOGOFF_EVENT | CTRL_SHUTDOWN_EVENT) {
        return FALSE;
    }
    if let Some(handler) = CLOSED.get() {
        handler();
    }
    // When this returns, the process is ended at once.
    loop {
        thread::sleep(Duration::from_secs(60));
    }
}
