//! `cellwire`: robot links at the bench. See `cellwire --help`.

fn main() -> std::process::ExitCode {
    cellwire::main()
}
