//! Threads that the processor must not keep waiting.
//!
//! The source gives the process that answers the robot a high priority by hand, `setpr [Prozeßnummer] 500` (VAL II thesis, §8.3,
//! §10.3). Where the system does not allow it (on Linux: neither root nor `rtprio` in `limits.conf`), the thread runs like any
//! other, and misses a deadline when the machine is overloaded. So does a pseudo-terminal, whatever the priority: Linux hands its
//! bytes over in a kernel thread of normal priority, which may be late by tens of milliseconds when all processors are busy.

/// Which of them is to be asked first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rank {
    /// Asks a device in a cycle of its own.
    Poll,
    /// Answers a peer within its deadline.
    Reply,
    /// Stands for a line or a device, which in reality waits for no processor.
    Hardware,
}

/// Raises the current thread above all normal ones. False where the system does not allow it.
#[cfg(unix)]
pub fn raise(rank: Rank) -> bool {
    use thread_priority::{
        RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
        set_thread_priority_and_policy, thread_native_id,
    };
    let value = match rank {
        Rank::Poll => 10,
        Rank::Reply => 20,
        Rank::Hardware => 30,
    };
    ThreadPriorityValue::try_from(value).is_ok_and(|value| {
        let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
        set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
            .is_ok()
    })
}

/// Raises the current thread above all normal ones. False where the system does not allow it.
#[cfg(not(unix))]
pub fn raise(rank: Rank) -> bool {
    use thread_priority::{ThreadPriority, set_current_thread_priority};
    match rank {
        Rank::Poll | Rank::Reply | Rank::Hardware => set_current_thread_priority(ThreadPriority::Max).is_ok(),
    }
}
