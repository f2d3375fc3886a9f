//! `cellwire decode`: bytes in, a JSON object a line out.

use std::io::{self, Read, Write};
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::ValueEnum;

use crate::codec::{Item, Stream};
use crate::links::CodecArgs;

/// Bytes in, a JSON object a line out.
///
/// A line is {"offset":…,"length":…,"message":{…}}, or has "error" for "message" where the bytes are damaged. The lines
/// tile the input: every byte is in exactly one. Damage never stops it; the exit status is 1 if there was any.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    codec: CodecArgs,
    /// How the input is written
    #[arg(long, value_enum, default_value_t = Format::Hex)]
    format: Format,
    /// The input [default: standard input]
    file: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Hex digits; blanks and line ends anywhere, `#` begins a comment
    Hex,
    /// The bytes themselves
    Raw,
}

/// Returns true when there was no damage.
pub fn run(args: &Args) -> Result<bool> {
    let codec = args.codec.link.codec(&args.codec.options())?;
    let mut stream = Stream::new(codec);
    let mut input: Box<dyn Read> = match &args.file {
        Some(path) => {
            Box::new(std::fs::File::open(path).with_context(|| format!("cannot read {}", path.display()))?)
        }
        None => Box::new(io::stdin().lock()),
    };
    let mut out = io::BufWriter::new(io::stdout().lock());
    let mut clean = true;
    let mut emit = |item: Item| {
        clean &= item.content.is_ok();
        writeln!(out, "{}", item.to_json())?;
        Ok(())
    };
    let mut hex = HexReader::default();
    let mut buffer = vec![0; 64 * 1024];
    loop {
        let n = input.read(&mut buffer).context("cannot read the input")?;
        if n == 0 {
            break;
        }
        let bytes = buffer.get(..n).unwrap_or_default();
        match args.format {
            Format::Raw => stream.push(bytes, &mut emit)?,
            Format::Hex => stream.push(&hex.read(bytes)?, &mut emit)?,
        }
    }
    hex.finish()?;
    stream.finish(&mut emit)?;
    out.flush()?;
    Ok(clean)
}

/// Reads hex that may be cut anywhere.
struct HexReader {
    high: Option<u8>,
    comment: bool,
    line: usize,
}

impl Default for HexReader {
    fn default() -> Self {
        Self { high: None, comment: false, line: 1 }
    }
}

impl HexReader {
    fn read(&mut self, text: &[u8]) -> Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(text.len() / 2);
        for &c in text {
            match c {
                b'\n' => {
                    self.line += 1;
                    self.comment = false;
                }
                _ if self.comment => {}
                b'#' => self.comment = true,
                b' ' | b'\t' | b'\r' => {}
                _ => {
                    let digit =
                        char::from(c).to_digit(16).and_then(|d| u8::try_from(d).ok()).with_context(|| {
                            format!(
                                "line {}: `{}` is not a hex digit; use --format raw for the bytes themselves",
                                self.line,
                                char::from(c).escape_default()
                            )
                        })?;
                    match self.high.take() {
                        None => self.high = Some(digit),
                        Some(high) => bytes.push(high << 4 | digit),
                    }
                }
            }
        }
        Ok(bytes)
    }

    fn finish(&self) -> Result<()> {
        anyhow::ensure!(
            self.high.is_none(),
            "the input ends in the middle of a byte: an odd number of hex digits"
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_may_be_cut_anywhere() {
        let text = b"3C 54\n# a comment 00\n 6 9";
        for cut in 0..text.len() {
            let mut hex = HexReader::default();
            let mut bytes = hex.read(&text[..cut]).unwrap();
            bytes.extend(hex.read(&text[cut..]).unwrap());
            hex.finish().unwrap();
            assert_eq!(bytes, [0x3C, 0x54, 0x69]);
        }
    }

    #[test]
    fn what_is_not_hex_is_named_with_its_line() {
        let error = HexReader::default().read(b"00\n0G").unwrap_err();
        assert_eq!(
            error.to_string(),
            "line 2: `G` is not a hex digit; use --format raw for the bytes themselves"
        );
        let mut hex = HexReader::default();
        hex.read(b"00 1").unwrap();
        assert!(hex.finish().is_err());
    }
}
