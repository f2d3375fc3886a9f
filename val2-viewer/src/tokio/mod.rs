//! Both ends in a task of their own, which reopens its port automatically: the [`workstation`] has the latest pose at any
//! time, a [`Screen`] shows poses by `.await`.
//!
//! ```no_run
//! use val2_viewer::WorkstationConfig;
//! use val2_viewer::robot_session::tokio::Tcp;
//!
//! # async fn run() -> Result<(), Box<dyn core::error::Error>> {
//! let (mut arm, task) = val2_viewer::tokio::workstation(WorkstationConfig::default(), Tcp::new("192.168.0.7:4001"))?;
//! tokio::spawn(task.run());
//! while let Ok(pose) = arm.pose.next().await {
//!     match pose {
//!         Some(pose) => println!("{pose:?}"),
//!         None => println!("the arm may be somewhere else"),
//!     }
//! }
//! # Ok(()) }
//! ```

mod host;
mod workstation;

pub use host::{Error, Poses, Screen, ShowRequest, host};
pub use workstation::{Arm, Display, PauseRequest, workstation};
