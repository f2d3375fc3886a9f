//! A wait-free ring of numbered jobs between the two tasks of a robot program: the communication task, which decodes jobs from
//! packets, and the motion task, which executes them.
//!
//! ```text
//!    motion task                                             communication task
//! +----------------+                                         +-----------------+
//! |     Reader     |                                         |     Writer      |
//! | take, complete |                                         |  claim, commit  |
//! +----------------+                                         +-----------------+
//!         |                                                           |
//!         +---------------+                             +-------------+
//!                         v                             v
//!               +----+----+----+----+----+----+----+----+----+----+----+
//!               |    |    | 11 | 12 | 13 | 14 | 15 | 16 |    |    |    |
//!               +----+----+----+----+----+----+----+----+----+----+----+
//!                  free    executing, then waiting           free
//! ```
//!
//! One [`Writer`], one [`Reader`]; neither waits for the other, and nothing is allocated after creation.
//!
//! ```
//! use robot_work_queue::{NumberError, WorkQueue};
//!
//! let mut queue: WorkQueue<[i16; 6], 64> = WorkQueue::new(1000)?;
//! let (mut writer, mut reader) = queue.split();
//!
//! let claim = writer.claim()?;                        // returns `Full` before anything is decoded
//! claim.commit(1, [100, 0, 0, 0, 0, 0])?;
//! assert_eq!(writer.claim()?.commit(1, [0; 6]), Err(NumberError::Repeated { number: 1 }));
//! assert_eq!(writer.claim()?.commit(3, [0; 6]), Err(NumberError::Unexpected { expected: 2, found: 3 }));
//!
//! let job = reader.take().expect("job 1 waits");
//! assert_eq!((job.number(), job[0]), (1, 100));       // a reference: the slot stays taken while the robot moves
//! assert_eq!(writer.free(), 63);
//! job.complete();
//! assert_eq!(writer.free(), 64);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Jobs arrive in packets and leave one by one. So the two ends share one index each instead of a stamp per slot: the jobs of a
//! packet are published by one store ([`Writer::claim_batch`]), and a slot is as large as its job. The cost is one more
//! shared cache line when jobs are queued singly.
//!
//! Without the feature `alloc` the storage is inline, in a [`WorkQueue`]; with it, `boxed` returns ends that own their storage.
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![deny(unsafe_code)]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(loom)]
extern crate std;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod cursor;
mod error;
#[cfg(doctest)]
mod misuse;
#[allow(unsafe_code)]
mod ring;
mod sync;
mod wake;

pub use error::{ConfigError, Full, NumberError};
pub use ring::{Batch, Claim, Ends, Iter, Reader, TakenBatch, TakenJob, WorkQueue, Writer};
#[cfg(all(feature = "alloc", target_has_atomic = "8"))]
pub use ring::{boxed, boxed_with};
#[cfg(loom)]
#[doc(hidden)]
pub use sync::{check, order};
pub use wake::{NoWake, Wake};
