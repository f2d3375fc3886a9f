//! `cargo xtask new-link`: a crate that compiles, keeps the contract and is in the table.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

/// The name of the template in manifests, and in Rust.
const TOY: [&str; 2] = ["toy-link", "toy_link"];

/// Copies the template, which is a crate of the workspace itself, and enters it in the workspace, the table and the reference.
pub(crate) fn make(root: &Path, name: &str) -> Result<()> {
    let is_word = |word: &str| {
        word.starts_with(|c: char| c.is_ascii_lowercase())
            && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit())
    };
    ensure!(
        name.split('-').all(is_word),
        "{name}: a crate's name is of small letters and digits, with - between words"
    );
    let link = NewLink { root, name: [name.into(), name.replace('-', "_")] };
    ensure!(!root.join(name).exists(), "there is a folder {name} already");
    link.copy("xtask/template", Path::new(name))?;
    link.copy("xtask/row", &Path::new("links/src").join(&link.name[1]))?;
    link.copy("xtask/inputs", Path::new("testkit/reference/inputs"))?;
    link.copy("xtask/specification", Path::new("reference"))?;
    link.insert("Cargo.toml", "    \"xtask\",", &format!("    \"{name}\","))?;
    let line = format!("{name} = {{ version = \"0.1.0\", path = \"{name}\", default-features = false }}");
    link.insert("Cargo.toml", "cellwire = {", &line)?;
    let row = "links/Cargo.toml";
    let line =
        format!("{name} = {{ workspace = true, features = [\"serde\", \"settings\"], optional = true }}");
    link.insert(row, "val2-alter = {", &line)?;
    link.insert(row, "val2-alter = [", &format!("{name} = [\"dep:{name}\"]"))?;
    link.insert(row, "    \"val2-alter\"", &format!("    \"{name}\","))?;
    for feature in ["arbitrary", "model"] {
        let before = format!("    \"val2-alter?/{feature}");
        link.insert(row, &before, &format!("    \"{name}?/{feature}\","))?;
    }
    let row = "links/src/lib.rs";
    let only = format!("#[cfg(feature = \"{name}\")]");
    link.insert(row, "        feature = \"val2-alter\"", &format!("        feature = \"{name}\","))?;
    link.insert(row, "#[cfg(feature = \"val2-alter\")]", &format!("{only}\npub mod {};", link.name[1]))?;
    link.insert(row, "];", &format!("    {only}\n    {}::LINK,", link.name[1]))?;
    for target in ["decoder", "message", "host", "device"] {
        link.fuzz(&format!("{}_{target}", link.name[1]))?;
    }
    println!("{name}/, links/src/{}/, the fuzz targets and the reference's inputs are made.", link.name[1]);
    println!(
        "Next: cargo xtask bless {name}, cargo xtask check {name}, and CONTRIBUTING, \"Adding a link\"."
    );
    println!("To see it: echo G7 | cargo run -p cellwire -- decode {name} --format raw");
    Ok(())
}

/// A link that is made.
struct NewLink<'a> {
    root: &'a Path,
    /// As [`TOY`].
    name: [String; 2],
}

impl NewLink<'_> {
    /// Copies a folder, with the link's name in the place of the template's, in texts and in names of files.
    fn copy(&self, from: &str, to: &Path) -> Result<()> {
        let (from, to) = (self.root.join(from), self.root.join(to));
        for path in files(&from)? {
            let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
            let place = path.strip_prefix(&from)?.to_str().context("a name that is no text")?;
            let place = to.join(self.renamed(place));
            ensure!(!place.exists(), "there is a file {} already", place.display());
            if let Some(folder) = place.parent() {
                fs::create_dir_all(folder)?;
            }
            fs::write(&place, self.renamed(&text)).with_context(|| place.display().to_string())?;
        }
        Ok(())
    }

    /// Adds the program of a fuzz target.
    fn fuzz(&self, target: &str) -> Result<()> {
        let file = format!("fuzz_targets/{target}.rs");
        let program = format!("#![cfg_attr(fuzzing, no_main)]\ncellwire_fuzz::target!({target});\n");
        fs::write(self.root.join("fuzz").join(&file), program).with_context(|| file.clone())?;
        let manifest = self.root.join("fuzz/Cargo.toml");
        let bin =
            format!("name = \"{target}\"\npath = \"{file}\"\ntest = false\ndoc = false\nbench = false\n");
        let text = fs::read_to_string(&manifest)? + "\n[[bin]]\n" + &bin;
        fs::write(&manifest, text).with_context(|| manifest.display().to_string())
    }

    fn renamed(&self, text: &str) -> String {
        TOY.iter().zip(&self.name).fold(text.to_owned(), |text, (toy, name)| text.replace(toy, name))
    }

    /// Inserts a line before the first one that begins with `before`.
    fn insert(&self, file: &str, before: &str, line: &str) -> Result<()> {
        let path = self.root.join(file);
        let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        let Some(at) = text.lines().position(|line| line.starts_with(before)) else {
            bail!("{file} has no line that begins with {before}");
        };
        let mut lines: Vec<&str> = text.lines().collect();
        lines.insert(at, line);
        fs::write(path, lines.join("\n") + "\n")?;
        Ok(())
    }
}

/// Returns every file below a folder.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_dir() { all.extend(files(&path)?) } else { all.push(path) }
    }
    Ok(all)
}
