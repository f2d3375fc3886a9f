//! Whether the machine has ended without the bridge, as at a loss of power.

use anyhow::Result;

use crate::store::{Batch, Store};

/// In the store while a bridge runs: which start of the machine it runs in.
const BOOT: &str = "boot";

/// What was made in the last moments before a loss of power may be with the broker and not on the disk. So the numbers of records leave
/// out as many as a cell can have made in that time: none is used twice.
pub(super) const JUMP: u64 = 1000;

/// Whether a bridge ran when the machine ended. From now on one runs.
pub(super) fn is_lost(store: &Store, batch: &mut Batch) -> Result<bool> {
    let boot = boot();
    let before = store.get(BOOT)?;
    batch.names.push((BOOT.into(), Some(boot.clone())));
    Ok(before.is_some_and(|before| before != boot))
}

/// The bridge has ended.
pub(super) fn ended(batch: &mut Batch) {
    batch.names.push((BOOT.into(), None));
}

/// What another start of the machine has another of. Where the system does not say, each is another one.
fn boot() -> String {
    match std::fs::read_to_string("/proc/sys/kernel/random/boot_id") {
        Ok(boot) => boot.trim_end().into(),
        Err(_) => format!("{:016x}", fastrand::u64(..)),
    }
}
