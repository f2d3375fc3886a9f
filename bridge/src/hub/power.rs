//! Detects that the computer restarted while the bridge was running, for example after a power failure.

use anyhow::Result;

use crate::store::{Batch, Store};

/// The name of the boot id, which is in the store while a bridge runs.
const BOOT: &str = "boot";

/// The gap in the record numbers after a loss of power. Records of the last moments before it may be with the broker and not on
/// the disk: as many numbers as a cell can have used in that time are left out, and none is used twice.
pub(super) const NUMBER_GAP: u64 = 1000;

/// Returns whether the computer restarted while a bridge was running, and adds this run's boot id to `batch`.
pub(super) fn restarted_while_running(store: &Store, batch: &mut Batch) -> Result<bool> {
    let boot = boot();
    let before = store.get(BOOT)?;
    batch.names.push((BOOT.into(), Some(boot.clone())));
    Ok(before.is_some_and(|before| before != boot))
}

/// Adds to `batch` the removal of the boot id, because the bridge has ended.
pub(super) fn ended(batch: &mut Batch) {
    batch.names.push((BOOT.into(), None));
}

/// Returns the id of this start of the computer; if the system does not provide it, a random one.
fn boot() -> String {
    match std::fs::read_to_string("/proc/sys/kernel/random/boot_id") {
        Ok(boot) => boot.trim_end().into(),
        Err(_) => format!("{:016x}", fastrand::u64(..)),
    }
}
