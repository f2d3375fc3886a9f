//! The program of the target that `FUZZ` in the environment named when it was built: libFuzzer's, in a build with `--cfg fuzzing`. It
//! holds no other target, since libFuzzer looks at every counter of a program after each execution.
#![cfg_attr(fuzzing, no_main)]

#[cfg(fuzzing)]
const TARGET: cellwire_fuzz::Target =
    cellwire_fuzz::target(env!("FUZZ", "give the name of a target: a folder of fuzz/corpus"));

#[cfg(fuzzing)]
libfuzzer_sys::fuzz_target!(|data: &[u8]| TARGET(data));

#[cfg(not(fuzzing))]
fn main() {
    eprintln!("not built for fuzzing: use .ci/fuzz or cargo fuzz run");
    std::process::exit(2);
}
