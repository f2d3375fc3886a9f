//! `cellwire`: tests robot links without a robot. See `cellwire --help`.

fn main() -> std::process::ExitCode {
    cellwire::main()
}
