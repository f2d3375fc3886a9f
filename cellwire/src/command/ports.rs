//! `cellwire ports`.

use std::io::Write as _;

use anyhow::Result;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use serde_json::json;

use cellwire_io::output::{log, remark, stdout};
use cellwire_io::ports;

/// Lists the serial ports of this machine with their adapters, by the names that other commands take.
///
/// Two adapters of one kind differ only in their serial number; on Windows an adapter keeps its COM port while it stays in
/// the same USB socket.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print one JSON object per line
    #[arg(long)]
    json: bool,
}

/// Prints the serial ports; returns false if no port was found.
///
/// # Errors
/// When the system does not say, or standard output is closed.
pub fn run(args: &Args) -> Result<bool> {
    let found = ports::list()?;
    if found.is_empty() {
        remark("no serial ports");
        return Ok(false);
    }
    if args.json {
        for port in &found {
            log(&json!(port))?;
        }
        return Ok(true);
    }
    let mut table = Table::new();
    table.load_style(NOTHING).set_header([
        "port",
        "adapter",
        "maker",
        "serial number",
        "usb",
        "latency timer",
    ]);
    for port in &found {
        let text = |text: &Option<String>| text.clone().unwrap_or_default();
        let latency = port.latency_timer_ms.map(|ms| format!("{ms} ms")).unwrap_or_default();
        let adapter = port.adapter.clone().unwrap_or_else(|| port.kind.replace('_', "-"));
        let row = [
            port.port.clone(),
            adapter,
            text(&port.maker),
            text(&port.serial_number),
            text(&port.usb),
            latency,
        ];
        table.add_row(row);
    }
    let lines = table.lines().map(|line| line.trim_end().to_owned()).collect::<Vec<_>>().join("\n");
    Ok(writeln!(stdout(), "{lines}").map(|()| true)?)
}
