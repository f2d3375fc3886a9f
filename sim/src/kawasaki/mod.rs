//! Both ends of the Kawasaki link.

mod pc;
mod robot;

pub use self::pc::{Jobs, KawasakiPc, Pc};
pub use self::robot::{Kawasaki, KawasakiRobot, TimeOf};
