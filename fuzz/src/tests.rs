use std::fs;
use std::path::Path;

use super::{seeds, targets};

fn folder(name: &str) -> impl Iterator<Item = String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name().into_string().unwrap())
}

#[test]
fn every_target_holds_over_its_seeds() {
    let only = std::env::var("LINK").unwrap_or_default().replace('-', "_");
    for (name, make) in targets().filter(|(name, _)| name.starts_with(&only)) {
        let target = make();
        let seeds = seeds(&name, &target).unwrap();
        assert!(!seeds.is_empty(), "{name} has no seeds");
        for (_, seed) in seeds {
            println!("{name}: {}", target.show(&seed)); // shown when the target panics
            target.run(&seed);
        }
    }
}

#[test]
fn every_folder_of_seeds_has_a_target() {
    for name in folder("seeds") {
        assert!(targets().any(|(target, _)| target == name), "{name} is not a target");
    }
}

#[test]
fn every_target_has_its_program_as_cargo_fuzz_expects() {
    let manifest = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")).unwrap();
    let (mut files, mut bins): (Vec<_>, Vec<_>) = (
        folder("fuzz_targets").collect(),
        manifest.split("\n[[bin]]\n").skip(1).map(str::trim_end).collect(),
    );
    let mut wrong = Vec::new();
    let mut expect = |is_there: bool, what: String| {
        if !is_there {
            wrong.push(what)
        }
    };
    for (name, _) in targets() {
        let file = format!("{name}.rs");
        let program = format!("#![cfg_attr(fuzzing, no_main)]\ncellwire_fuzz::target!({name});\n");
        let found =
            fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz_targets").join(&file));
        expect(
            found.is_ok_and(|text| text == program),
            format!("fuzz/fuzz_targets/{file} has to be:\n{program}"),
        );
        files.retain(|other| *other != file);
        let bin = format!(
            "name = \"{name}\"\npath = \"fuzz_targets/{file}\"\ntest = false\ndoc = false\nbench = false"
        );
        expect(bins.contains(&bin.as_str()), format!("fuzz/Cargo.toml lacks:\n[[bin]]\n{bin}\n"));
        bins.retain(|other| *other != bin);
    }
    for file in files {
        expect(false, format!("fuzz/fuzz_targets/{file} is of no target: delete it\n"));
    }
    for bin in bins {
        expect(false, format!("fuzz/Cargo.toml has a program of no target, delete it:\n[[bin]]\n{bin}\n"));
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}
