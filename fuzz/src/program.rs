//! The program of a target.

use core::fmt::{self, Debug, Formatter};
use std::cell::OnceCell;
use std::path::PathBuf;
use std::{env, fs, io};

use arbitrary::{Arbitrary, Result, Unstructured};

use crate::{Bytes, Target, seeds, target};

/// The program of a target: libFuzzer's in a build with `--cfg fuzzing`; otherwise it runs the body over the files that it
/// is given.
#[macro_export]
macro_rules! target {
    ($name:ident) => {
        #[cfg(fuzzing)]
        ::libfuzzer_sys::fuzz_target!(
            init: $crate::program::begin(stringify!($name)),
            |input: $crate::program::Input| input.run()
        );

        #[cfg(not(fuzzing))]
        fn main() -> ::std::io::Result<()> {
            $crate::program::replay(stringify!($name))
        }
    };
}

thread_local! {
    static TARGET: OnceCell<Target> = const { OnceCell::new() };
}

/// Makes the target, and writes its seeds into the folder of its name, if that is an argument: into the corpus of `cargo
/// fuzz run`.
///
/// # Panics
/// If a seed cannot be written.
pub fn begin(name: &str) {
    let target = target(name);
    let folders = env::args_os().skip(1).map(PathBuf::from);
    for folder in folders.filter(|path| path.ends_with(name) && path.is_dir()) {
        for (file, seed) in seeds(name, &target).unwrap() {
            fs::write(folder.join(file), seed).unwrap();
        }
    }
    TARGET.with(|cell| drop(cell.set(target))); // the first call of the program
}

/// Runs the body of a target over the files that the program is given.
///
/// # Errors
/// If a file cannot be read.
pub fn replay(name: &str) -> io::Result<()> {
    let target = target(name);
    for path in env::args_os().skip(1) {
        target.run(&fs::read(path)?);
    }
    Ok(())
}

/// An input of the target that [`begin`] has made.
pub struct Input(Bytes);

impl Input {
    /// Runs the body.
    pub fn run(&self) {
        self.with(|target, data| target.run(data));
    }

    fn with<T>(&self, act: impl FnOnce(&Target, &[u8]) -> T) -> T {
        TARGET.with(|cell| act(cell.get().expect("it was made"), &self.0.0))
    }
}

impl Arbitrary<'_> for Input {
    fn arbitrary(u: &mut Unstructured<'_>) -> Result<Self> {
        u.arbitrary().map(Self)
    }
}

/// The value that it is read as, for `cargo fuzz fmt`.
impl Debug for Input {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.with(Target::show))
    }
}
