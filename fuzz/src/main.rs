//! The program of every target: libFuzzer's, in a build with `--cfg fuzzing`, where the target is the one that the program is called.
//! Otherwise it names the targets, and writes the seeds of each into a folder.
#![cfg_attr(fuzzing, no_main)]

#[cfg(fuzzing)]
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    thread_local! {
        static TARGET: cellwire_fuzz::Target = {
            let program = std::env::current_exe().expect("the program has a name");
            let name = program.file_name().and_then(|name| name.to_str()).expect("its name is a text");
            cellwire_fuzz::target(name)
        };
    }
    TARGET.with(|target| (target.body)(data));
});

#[cfg(not(fuzzing))]
fn main() -> std::io::Result<()> {
    let Some(folder) = std::env::args_os().nth(1) else {
        eprintln!("give a folder for the seeds of every target");
        std::process::exit(2);
    };
    cellwire_fuzz::write_seeds(folder.as_ref())
}
