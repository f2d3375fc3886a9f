//! Libraries that `cargo test` leaves out: one with `test = false` has no test in `src`, and one with `doctest = false` no
//! example.

use std::fs;
use std::path::{Path, PathBuf};

/// Finds the Rust files in a folder and in those below it.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Returns whether a documentation comment of the text begins an example that is run or compiled.
fn has_example(text: &str) -> bool {
    let mut fences = text.lines().filter_map(|line| {
        let line = line.trim_start();
        let line = line.strip_prefix("//!").or_else(|| line.strip_prefix("///"))?;
        line.trim_start().strip_prefix("```")
    });
    // Every second fence closes a block.
    std::iter::from_fn(|| Some((fences.next()?, fences.next()).0)).any(|words| {
        matches!(words.split(',').next(), Some("" | "rust" | "no_run" | "should_panic" | "compile_fail"))
    })
}

#[test]
fn what_is_not_run_is_not_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let workspace = fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let members = workspace.split_once("members = [").unwrap().1.split_once(']').unwrap().0;
    let (mut without_tests, mut without_examples) = (0, 0);
    for member in members.split('"').skip(1).step_by(2) {
        let manifest = fs::read_to_string(root.join(member).join("Cargo.toml")).unwrap();
        let library = manifest.split("\n[").find(|table| table.starts_with("lib]")).unwrap_or("");
        let mut files = Vec::new();
        sources(&root.join(member).join("src"), &mut files);
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            if library.contains("\ntest = false") {
                assert!(
                    !["#[test]", "::test]", "::test("].iter().any(|mark| text.contains(mark)),
                    "{}: this test is not run ([lib] test = false)",
                    file.display()
                );
            }
            if library.contains("\ndoctest = false") {
                let file = file.display();
                assert!(!has_example(&text), "{file}: this example is not run ([lib] doctest = false)");
            }
        }
        without_tests += usize::from(library.contains("\ntest = false"));
        without_examples += usize::from(library.contains("\ndoctest = false"));
    }
    assert!(
        without_tests > 5 && without_examples > 5,
        "{without_tests} and {without_examples} libraries were looked at"
    );
    assert!(has_example("/// ```\n/// x();\n/// ```") && !has_example("//! ```text\n//! x\n//! ```"));
}
