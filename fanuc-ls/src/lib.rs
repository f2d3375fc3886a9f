#![doc = include_str!("../README.md")]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

extern crate alloc;

#[cfg(feature = "arbitrary")]
extern crate std;

#[cfg(feature = "arbitrary")]
mod arbitrary;
mod attribute;
mod builder;
mod check;
mod complete;
mod cursor;
mod document;
mod edit;
mod entry;
mod error;
mod expression;
mod finding;
mod grammar;
mod insert;
mod inspect;
mod instruction;
mod layout;
mod mistake;
mod motion;
mod operation;
mod parts;
mod position;
mod program;
mod references;
mod rewrite;
#[cfg(feature = "spec")]
mod spec;
mod statement;
mod syntax;
mod text;
mod view;

pub use attribute::{Attribute, AttributeValue};
pub use builder::Builder;
pub use check::CheckContext;
pub use complete::Completion;
pub use document::{Document, Encoding};
pub use entry::{Content, Entry};
pub use error::{DecodeError, EncodeError, Reason, Warning};
pub use expression::{Expression, Function, Index, Item, ItemKind, Operator};
pub use finding::{Finding, Problem};
pub use instruction::Instruction;
pub use mistake::{Block, Expected, Level, Mistake};
pub use motion::{Motion, MotionKind, Speed, SpeedUnit, Target, Termination};
pub use operation::{Operation, TimerAction};
pub use position::{Axis, AxisName, AxisUnit, Configuration, Group, Position};
pub use program::{COMMENT_LENGTH, CommentRule, Program, Rules};
pub use references::Reference;
pub use statement::Statement;
pub use syntax::Syntax;
