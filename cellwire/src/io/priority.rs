//! The priority of threads that have deadlines.
//!
//! In the source a user gives the process that answers the robot a high priority, `setpr [Prozeßnummer] 500` (VAL II thesis,
//! §8.3, §10.3). Where the system does not allow it (on Linux: neither root nor `rtprio` in `limits.conf`), the thread runs like
//! any other, and misses a deadline when the machine is overloaded. A pseudo-terminal can be late at any priority: Linux moves
//! its bytes in a kernel thread of normal priority, which may be late by tens of milliseconds when all processors are busy.

/// The work of a thread, the lowest priority first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThreadRole {
    /// Polls a device in its own cycle.
    Poll,
    /// Answers a peer within its deadline.
    Reply,
    /// Simulates a line or a device, which in reality does not wait for a processor.
    Hardware,
}

/// Raises the current thread above all normal ones. False where the system does not allow it.
#[cfg(unix)]
pub fn raise(rank: ThreadRole) -> bool {
    use thread_priority::{
        RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
        set_thread_priority_and_policy, thread_native_id,
    };
    let value = match rank {
        ThreadRole::Poll => 10,
        ThreadRole::Reply => 20,
        ThreadRole::Hardware => 30,
    };
    ThreadPriorityValue::try_from(value).is_ok_and(|value| {
        let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
        set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
            .is_ok()
    })
}

/// Raises the current thread above all normal ones. False where the system does not allow it.
#[cfg(not(unix))]
pub fn raise(rank: ThreadRole) -> bool {
    use thread_priority::{ThreadPriority, set_current_thread_priority};
    match rank {
        ThreadRole::Poll | ThreadRole::Reply | ThreadRole::Hardware => {
            set_current_thread_priority(ThreadPriority::Max).is_ok()
        }
    }
}
