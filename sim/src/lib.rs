#![cfg_attr(any(not(doctest), all(feature = "fanuc", feature = "mma")), doc = include_str!("../README.md"))]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(feature = "ball")]
pub mod ball;
mod bench;
mod device;
#[cfg(feature = "fanuc")]
pub mod fanuc;
mod faults;
pub mod host;
#[cfg(feature = "kawasaki")]
pub mod kawasaki;
#[cfg(feature = "laser")]
pub mod laser;
pub mod ledger;
#[cfg(feature = "mma")]
pub mod mma;
mod peer;
#[cfg(unix)]
mod pty;
#[cfg(feature = "puma")]
pub mod puma;
mod running;
mod settings;
mod simulator;
#[cfg(feature = "viewer")]
pub mod viewer;

#[cfg(feature = "ball")]
pub use ball::TeachBall;
pub use bench::{Bench, Wire};
pub use device::{Device, DeviceRecord, Error, ExecutedWork};
#[cfg(feature = "fanuc")]
pub use fanuc::Fanuc;
pub use faults::{ByteFaults, Fault, Faults, FaultyProxy, NetworkFaults, Script};
#[cfg(feature = "kawasaki")]
pub use kawasaki::{KawasakiPc, KawasakiRobot};
#[cfg(feature = "laser")]
pub use laser::{Laser, LaserHost};
pub use ledger::Ledger;
#[cfg(feature = "mma")]
pub use mma::{MmaPlatform, MmaRobot};
pub use peer::{End, Peer};
#[cfg(feature = "puma")]
pub use puma::Puma;
pub use robot_session;
pub use running::RunningDevice;
pub use settings::Settings;
pub use simulator::{IndexedWork, Remote, Simulator, SimulatorReport};
#[cfg(feature = "viewer")]
pub use viewer::Viewer;
