//! Reads every LS file below a folder, and counts what comes of it: `corpus FOLDER`. The first folders below it are the
//! repositories. A row is: files, repositories, what, the first example. With `corpus FOLDER every`, each finding is a line
//! before it.
#![allow(clippy::expect_used, clippy::indexing_slicing, reason = "a program for developers")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use fanuc_ls::{Document, Instruction, Operation, Rules};

fn main() {
    let folder = PathBuf::from(std::env::args().nth(1).expect("usage: corpus FOLDER [every]"));
    let every = std::env::args().nth(2).is_some_and(|word| word == "every");
    let mut files = Vec::new();
    walk(&folder, &mut files);
    let mut rows: BTreeMap<String, (usize, BTreeSet<PathBuf>, String)> = BTreeMap::new();
    for path in &files {
        let name = path.strip_prefix(&folder).expect("it is below the folder");
        let bytes = std::fs::read(path).expect("the file can be read");
        let place = name.display().to_string();
        for (what, example) in found(&bytes, every.then_some(place.as_str())) {
            let example = || format!("{}: {example}", name.display());
            let (count, repositories, _) =
                rows.entry(what).or_insert_with(|| (0, BTreeSet::new(), example()));
            *count += 1;
            repositories.insert(name.iter().next().map(PathBuf::from).unwrap_or_default());
        }
    }
    for (what, (files, repositories, example)) in rows {
        let example: String = example.chars().filter(|c| !c.is_control()).take(240).collect();
        println!("{files:6} {:4}  {what:36} {example}", repositories.len());
    }
}

/// Returns the properties of a file, each with an example. With the file's name (`every`), prints each finding.
fn found(bytes: &[u8], every: Option<&str>) -> BTreeMap<String, String> {
    let mut found = BTreeMap::from([("  files".to_owned(), String::new())]);
    let document = match Document::decode_bytes(bytes) {
        Ok(document) => document,
        Err(error) => {
            found.insert(format!("! not read: {:?}", error.reason), error.to_string());
            return found;
        }
    };
    found.insert("  read".into(), String::new());
    let same = if document.to_bytes() == bytes { "  written as it was" } else { "! written otherwise" };
    found.insert(same.into(), String::new());
    if document.program().is_ok() {
        found.insert("  understood whole".into(), String::new());
    }
    for finding in document.findings(&Rules::default()) {
        let level = finding.problem.level().text();
        found.entry(format!("  has: {level}")).or_default();
        let what = format!("{level} {:?}", finding.problem);
        let what = what.split(" {").next().unwrap_or(&what).to_owned();
        let text = document.as_str();
        let start = text[..finding.offset].rfind('\n').map_or(0, |at| at + 1);
        let line = text[start..].lines().next().unwrap_or("").trim();
        if let Some(file) = every {
            println!("@{what}\t{finding} | {line}\t{file}");
        }
        found.entry(what).or_insert_with(|| format!("{finding} | {line}"));
    }
    let (mut typed, mut macros) = (true, false);
    for statement in document.statements() {
        let instruction = statement.instruction();
        match instruction.operation() {
            Some(Operation::Macro { name, .. }) => {
                macros = true;
                found.entry(format!("macro {name}")).or_insert_with(|| statement.body().to_owned());
            }
            None if matches!(&instruction, Instruction::Other(text) if !text.is_empty()) => {
                typed = false;
                let word: String = statement.body().chars().take_while(|c| c.is_alphanumeric()).collect();
                found.entry(format!("text {word}")).or_insert_with(|| statement.body().to_owned());
            }
            _ => {}
        }
    }
    if typed {
        found.insert("  every statement typed".into(), String::new());
    }
    if typed && !macros {
        found.insert("  every statement typed, no macro".into(), String::new());
    }
    found
}

fn walk(folder: &Path, files: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = std::fs::read_dir(folder).expect("the folder can be read").flatten().collect();
    entries.sort_by_key(std::fs::DirEntry::path);
    for entry in entries {
        let path = entry.path();
        if path.is_dir() {
            walk(&path, files);
        } else if path.extension().is_some_and(|end| end.eq_ignore_ascii_case("ls")) {
            files.push(path);
        }
    }
}
