//! The part of Kawasaki's AS language that the program in `kawasaki-msg/controller` uses. Never published.
//!
//! Written against the rules that the manuals and public programs show, in particular the surprising ones:
//!
//! - a variable is a real, a string (`$name`) or a location; a real has 24 bits, TRUE is −1, a string ends after 255 bytes
//! - a name has at most 15 characters, an index is 0 to 9999, a line holds one statement
//! - `.name` belongs to the program that is being executed; the values of a called program's parameters are copied back when
//!   it returns
//! - `$ENCODE` writes a blank where a sign could be, unless `/L` is given
//! - a motion command is given to the arm and the program continues; `BREAK` waits for the arm
//! - tasks run side by side: between two statements of one, any number of statements of another may be executed
//!
//! Sockets, time and the arm are the [`Host`]'s: the same program runs on a virtual clock and over TCP.
//!
//! ```
//! use as_interpreter::{Machine, NoHost, Program, Step};
//!
//! let program = Program::parse(".PROGRAM main ()\n  FOR .i = 1 TO 4\n    sum = .i * .i\n  END\n  $t = \"=\" + $ENCODE (sum)\n.END")?;
//! let mut machine = Machine::new(program);
//! machine.start("main")?;
//! while machine.step(0, &mut NoHost)? == Step::Done {}
//! assert_eq!((machine.real("sum"), machine.text("$t")), (Some(16.0), Some("= 16".into())));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod controller;
mod error;
mod evaluate;
mod expression;
mod host;
mod lexer;
mod machine;
mod memory;
mod names;
mod parser;
mod program;
mod routine;
mod statement;
mod tcp;
mod value;

pub use error::{Error, Fault, ParseError};
pub use host::{Host, Motion, NoHost, Socket};
pub use machine::{Machine, Step};
pub use program::Program;
pub use tcp::TcpHost;
pub use value::{MAX_TEXT_LEN, Pose};
