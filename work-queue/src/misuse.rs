//! Uses that the compiler rejects. A nightly toolchain also checks the reason of each rejection.
//!
//! Everything around the refused lines compiles:
//!
//! ```
//! let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (mut writer, mut reader) = queue.split();
//! writer.claim().unwrap().push(7);
//! std::thread::scope(|scope| {
//!     scope.spawn(move || writer.free());
//! });
//! let job = reader.take().unwrap();
//! assert_eq!((job.number(), job.complete()), (1, 7));
//! drop(reader);
//! queue.split();
//! ```
//!
//! A second writer:
//!
//! ```compile_fail,E0599
//! # let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (writer, reader) = queue.split();
//! let second = writer.clone();
//! ```
//!
//! ```compile_fail,E0499
//! # let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (writer, reader) = queue.split();
//! let (second, _) = queue.split();
//! writer.free();
//! ```
//!
//! A writer, or a reader, that two threads share:
//!
//! ```compile_fail,E0277
//! # let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (writer, reader) = queue.split();
//! std::thread::scope(|scope| {
//!     scope.spawn(|| writer.free());
//! });
//! ```
//!
//! ```compile_fail,E0277
//! # let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (writer, reader) = queue.split();
//! std::thread::scope(|scope| {
//!     scope.spawn(|| reader.len());
//! });
//! ```
//!
//! An end that outlives its queue:
//!
//! ```compile_fail,E0597
//! let writer = {
//!     let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//!     queue.split().0
//! };
//! writer.free();
//! ```
//!
//! A job that outlives the reader, its guard, or its completion:
//!
//! ```compile_fail,E0505
//! # let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (writer, mut reader) = queue.split();
//! let job = reader.take().unwrap();
//! drop(reader);
//! job.number();
//! ```
//!
//! ```compile_fail,E0505
//! # let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (writer, mut reader) = queue.split();
//! let job = reader.take().unwrap();
//! let value: &u32 = &job;
//! job.complete();
//! dbg!(value);
//! ```
//!
//! ```compile_fail,E0502
//! # let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (writer, mut reader) = queue.split();
//! let (_, value) = reader.iter().next().unwrap();
//! reader.take().unwrap().complete();
//! dbg!(value);
//! ```
//!
//! Two jobs taken at once, a job completed twice, a claim committed twice:
//!
//! ```compile_fail,E0499
//! # let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (writer, mut reader) = queue.split();
//! let job = reader.take().unwrap();
//! let next = reader.take().unwrap();
//! job.complete();
//! ```
//!
//! ```compile_fail,E0382
//! # let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (writer, mut reader) = queue.split();
//! let job = reader.take().unwrap();
//! job.complete();
//! job.complete();
//! ```
//!
//! ```compile_fail,E0382
//! # let mut queue: robot_work_queue::WorkQueue<u32, 4> = robot_work_queue::WorkQueue::new(9).unwrap();
//! let (mut writer, reader) = queue.split();
//! let claim = writer.claim().unwrap();
//! claim.push(7);
//! claim.push(8);
//! ```
//!
//! A job that may not go to another thread, sent there with either end, in a claim, or in a guard:
//!
//! ```compile_fail,E0277
//! # use robot_work_queue::WorkQueue;
//! # let mut queue: WorkQueue<std::rc::Rc<u32>, 4> = WorkQueue::new(9).unwrap();
//! let (writer, reader) = queue.split();
//! std::thread::scope(|scope| {
//!     scope.spawn(move || writer.free());
//! });
//! ```
//!
//! ```compile_fail,E0277
//! # use robot_work_queue::WorkQueue;
//! # let mut queue: WorkQueue<std::rc::Rc<u32>, 4> = WorkQueue::new(9).unwrap();
//! let (writer, reader) = queue.split();
//! std::thread::scope(|scope| {
//!     scope.spawn(move || reader.len());
//! });
//! ```
//!
//! ```compile_fail,E0277
//! # use robot_work_queue::WorkQueue;
//! # let mut queue: WorkQueue<std::rc::Rc<u32>, 4> = WorkQueue::new(9).unwrap();
//! let (mut writer, reader) = queue.split();
//! let claim = writer.claim().unwrap();
//! std::thread::scope(|scope| {
//!     scope.spawn(move || claim.number());
//! });
//! ```
//!
//! ```compile_fail,E0277
//! # use robot_work_queue::WorkQueue;
//! # let mut queue: WorkQueue<std::rc::Rc<u32>, 4> = WorkQueue::new(9).unwrap();
//! let (writer, mut reader) = queue.split();
//! let job = reader.take().unwrap();
//! std::thread::scope(|scope| {
//!     scope.spawn(move || job.number());
//! });
//! ```
//!
//! A queue whose jobs borrow from something shorter-lived than the reader (jobs are invariant in their lifetimes):
//!
//! ```compile_fail,E0597
//! # use robot_work_queue::WorkQueue;
//! # let mut queue: WorkQueue<&'static u32, 4> = WorkQueue::new(9).unwrap();
//! let (mut writer, reader) = queue.split();
//! let short = 7;
//! writer.claim().unwrap().push(&short);
//! ```
