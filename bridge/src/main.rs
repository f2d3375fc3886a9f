//! `cellwire-bridge`: many cells to one MQTT broker. See `cellwire-bridge --help`.

fn main() -> std::process::ExitCode {
    cellwire_bridge::main()
}
