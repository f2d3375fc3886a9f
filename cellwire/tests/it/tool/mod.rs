//! The tool as a process.

#[allow(dead_code, reason = "the bridge's tests need more")]
mod running;

use std::process::{Command, Stdio};

pub(crate) use running::{DEADLINE, Running};

/// Returns the tool with these arguments, without input, its outputs captured.
pub(crate) fn cellwire(arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.args(arguments.split_whitespace());
    captured(command)
}

/// Returns the tool as [`cellwire`] does, with a limit of the shell, such as `-n 20`.
pub(crate) fn limited(limit: &str, arguments: &str) -> Command {
    let mut command = Command::new("bash");
    let script = format!("ulimit {limit}; exec \"$0\" {arguments}");
    command.args(["-c", &script, env!("CARGO_BIN_EXE_cellwire")]);
    captured(command)
}

fn captured(mut command: Command) -> Command {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Runs a command; returns the exit status and both outputs.
pub(crate) fn run(mut command: Command) -> (Option<i32>, String, String) {
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

impl Running {
    /// Starts a device on a free port.
    pub(crate) fn listening(arguments: &str) -> Self {
        Self::start(cellwire(&format!("simulate {arguments} --listen 127.0.0.1:0")))
    }
}
