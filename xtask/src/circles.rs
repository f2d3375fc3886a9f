//! `cargo xtask circles`: finds pairs of files of a crate that import each other.

use core::str::FromStr;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use proc_macro2::{TokenStream, TokenTree};

/// Returns a paragraph for each pair of files of the crate in `root/folder`: their paths from `root`, and the imports of both.
///
/// A re-export counts as the file that it comes from. A module and its descendants are not a pair, and inline tests import
/// what they like.
pub(crate) fn pairs(root: &Path, folder: &str) -> Result<Vec<String>> {
    let mut files = Files::default();
    files.read_folder(&root.join(folder).join("src"), &[])?;
    for file in files.0.values_mut() {
        file.path = file.path.strip_prefix(root)?.to_path_buf();
    }
    Ok(files.pairs())
}

/// The names from the root of a crate to a module or an item.
type Names = Vec<String>;

/// The files of a crate, by module. The root has one entry, even if the crate is a library and a program.
#[derive(Default)]
struct Files(BTreeMap<Names, File>);

#[derive(Default)]
struct File {
    path: PathBuf,
    imports: Vec<Import>,
}

/// A path that a file has written, in a `use` or in the code.
struct Import {
    /// The module that contains it, which may be an inline module of the file.
    within: Names,
    path: Names,
    /// The name that a `use` gives to the item.
    name: Option<String>,
}

impl Files {
    fn read_folder(&mut self, folder: &Path, module: &[String]) -> Result<()> {
        for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
            let child = [module, &[name.to_owned()]].concat();
            if path.is_dir() {
                // Each program of `bin` is a crate of its own.
                if name != "bin" || !module.is_empty() {
                    self.read_folder(&path, &child)?;
                }
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let is_root = module.is_empty() && ["lib", "main"].contains(&name);
                let module = if is_root || name == "mod" { module } else { &child };
                let text = fs::read_to_string(&path)?;
                let tokens =
                    TokenStream::from_str(&text).map_err(|error| anyhow!("{}: {error}", path.display()))?;
                let file = self.0.entry(module.to_vec()).or_default();
                file.path.clone_from(&path);
                file.read(tokens, module);
            }
        }
        Ok(())
    }

    fn pairs(&self) -> Vec<String> {
        let mut edges = BTreeMap::<_, BTreeSet<String>>::new();
        for (from, file) in &self.0 {
            for Import { within, path, .. } in &file.imports {
                if let Some((to, target)) = self.target(within, path, 4)
                    // An import from a module around this one makes no pair.
                    && !from.starts_with(to)
                {
                    edges.entry([&file.path, &target.path]).or_default().insert(path.join("::"));
                }
            }
        }
        let list = |imports: &BTreeSet<String>| imports.iter().cloned().collect::<Vec<_>>().join(", ");
        let pair = |([one, two], there): (&[&PathBuf; 2], &BTreeSet<String>)| {
            let (there, back) = (list(there), list(edges.get(&[*two, *one]).filter(|_| one < two)?));
            let (one, two) = (one.display(), two.display());
            Some(format!("two files import each other:\n  {one}: {there}\n  {two}: {back}"))
        };
        edges.iter().filter_map(pair).collect()
    }

    /// Returns the module and the file of the item of a path, after at most `further` re-exports.
    fn target(&self, within: &[String], path: &[String], further: u8) -> Option<(&Names, &File)> {
        let further = further.checked_sub(1)?;
        let of = |module: &[String], name: &str| {
            let imports = &self.0.get(module)?.imports;
            imports.iter().find(|it| it.within == module && it.name.as_deref() == Some(name))
        };
        let (first, mut rest) = path.split_first()?;
        let mut at = within.to_vec();
        match first.as_str() {
            "crate" => at.clear(),
            "self" => {}
            "super" => {
                let more = rest.iter().take_while(|name| *name == "super").count();
                at.truncate(at.len().saturating_sub(1 + more));
                rest = rest.get(more..)?;
            }
            child if self.0.contains_key(&[within, &[child.to_owned()]].concat()) => rest = path,
            name => {
                let import = of(within, name).filter(|import| import.path != path)?;
                return self.target(within, &[&import.path, rest].concat(), further);
            }
        }
        while let Some((name, after)) = rest.split_first()
            && self.0.contains_key(&[at.as_slice(), core::slice::from_ref(name)].concat())
        {
            at.push(name.clone());
            rest = after;
        }
        let exported = rest.first().filter(|_| at != within).and_then(|name| of(&at, name));
        let exported = exported.and_then(|import| self.target(&at, &import.path, further));
        exported.or(self.0.get_key_value(&at))
    }
}

impl File {
    /// Adds the imports of a piece of code of the module `within`.
    fn read(&mut self, code: TokenStream, within: &[String]) {
        let tokens: Vec<TokenTree> = code.into_iter().collect();
        let mut rest = tokens.as_slice();
        while let [first, after @ ..] = rest {
            rest = after;
            match (first, after) {
                (TokenTree::Group(attribute), [keyword, _, TokenTree::Group(_), after @ ..])
                    if attribute.to_string() == "[cfg (test)]" && keyword.to_string() == "mod" =>
                {
                    rest = after;
                }
                (TokenTree::Ident(keyword), [name, TokenTree::Group(body), after @ ..])
                    if keyword == "mod" =>
                {
                    self.read(body.stream(), &[within, &[name.to_string()]].concat());
                    rest = after;
                }
                (TokenTree::Ident(keyword), [TokenTree::Ident(_) | TokenTree::Group(_), ..])
                    if keyword == "use" =>
                {
                    let end = after.iter().position(|token| is(token, ';')).unwrap_or(after.len());
                    self.read_use(after.get(..end).unwrap_or_default(), &[], within);
                    rest = after.get(end..).unwrap_or_default();
                }
                (TokenTree::Ident(root), [colon, _, ..]) if is(colon, ':') => {
                    let mut path = vec![root.to_string()];
                    while let [colon, _, TokenTree::Ident(name), after @ ..] = rest
                        && is(colon, ':')
                    {
                        path.push(name.to_string());
                        rest = after;
                    }
                    self.imports.push(Import { within: within.to_vec(), path, name: None });
                }
                (TokenTree::Group(group), _) => self.read(group.stream(), within),
                _ => {}
            }
        }
    }

    /// Adds the imports of the tree of a `use` below `prefix`.
    fn read_use(&mut self, tree: &[TokenTree], prefix: &[String], within: &[String]) {
        for branch in tree.split(|token| is(token, ',')) {
            let mut path = prefix.to_vec();
            let names = branch.iter().filter(|token| matches!(token, TokenTree::Ident(_)));
            path.extend(names.map(ToString::to_string).filter(|name| name != "self" || prefix.is_empty()));
            if let Some(TokenTree::Group(group)) = branch.last() {
                let tree: Vec<TokenTree> = group.stream().into_iter().collect();
                self.read_use(&tree, &path, within);
                continue;
            }
            let name = path.last().cloned();
            if let Some(at) = path.iter().position(|name| name == "as") {
                path.truncate(at);
            }
            self.imports.push(Import { within: within.to_vec(), path, name });
        }
    }
}

fn is(token: &TokenTree, character: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == character)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn two_files_that_import_each_other_are_a_pair_even_through_a_reexport() {
        let root = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = root.path().join("toy/src").join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write("lib.rs", "mod direct;\nmod links;\nmod other;\npub use other::Other;");
        write("direct.rs", "use crate::{links::Table, other::{self, Other as Another}};");
        write("other.rs", "pub struct Other(Box<crate::direct::Direct>);");
        // A parent and its children, of which two meet through what the parent exports.
        write(
            "links/mod.rs",
            "mod row;\nmod table;\npub use row::Row;\npub use table::Table;\npub struct Kind;",
        );
        write("links/row.rs", "use crate::links as all;\nstruct First(all::Table, super::Kind);");
        write(
            "links/table.rs",
            "fn rows() -> Vec<super::Row> { vec![super::row::row(\"crate::direct\")] }\n#[cfg(test)]\nmod tests { use crate::direct::Direct; }",
        );
        let pair = |[one, ones]: [&str; 2], [two, twos]: [&str; 2]| {
            format!("two files import each other:\n  toy/src/{one}: {ones}\n  toy/src/{two}: {twos}")
        };
        assert_eq!(
            pairs(root.path(), "toy").unwrap(),
            [
                pair(
                    ["direct.rs", "crate::other, crate::other::Other"],
                    ["other.rs", "crate::direct::Direct"]
                ),
                pair(["links/row.rs", "all::Table"], ["links/table.rs", "super::Row, super::row::row"]),
            ]
        );
    }
}
