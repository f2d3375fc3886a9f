//! `cellwire encode`: reads message objects, writes one frame of hex per line.

use std::io::{BufRead as _, Write};
use std::path::PathBuf;

use anyhow::{Context, Result};
use serde_json::Value;

use super::codec::CodecArgs;
use cellwire_io::input;
use cellwire_io::output::{remark, stdout};

/// Reads message objects and writes one frame of hex per line.
///
/// Reads what `cellwire decode` prints (a whole line, or just the message object), one object per line. An object that the
/// link cannot send is reported with its line number; nothing is written for it.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    codec: CodecArgs,
    /// The input; - is standard input [default: -]
    file: Option<PathBuf>,
}

/// Returns true when every object was written.
pub fn run(args: &Args) -> Result<bool> {
    let codec = args.codec.codec()?;
    let input = input::open(args.file.as_deref())?;
    let mut out = stdout();
    let mut all = true;
    for (index, line) in input.lines().enumerate() {
        let line = line.context("cannot read the input")?;
        if line.trim().is_empty() {
            continue;
        }
        let frame = message(&line).and_then(|message| Ok(codec.encode(message)?));
        match frame {
            Ok(frame) => writeln!(out, "{}", hex(&frame))?,
            Err(error) => {
                all = false;
                remark(&format!("line {}: {error:#}", index + 1));
            }
        }
    }
    Ok(all)
}

/// Returns bytes as upper-case hex, separated by spaces.
pub(super) fn hex(bytes: &[u8]) -> String {
    let pairs: Vec<String> = bytes.iter().map(|b| format!("{b:02X}")).collect();
    pairs.join(" ")
}

fn message(line: &str) -> Result<Value> {
    let mut value: Value = input::json(line).context("not a JSON object")?;
    match value.get_mut("message") {
        Some(message) if message.is_object() => Ok(message.take()),
        _ => Ok(value),
    }
}
