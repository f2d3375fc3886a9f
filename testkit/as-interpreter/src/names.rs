//! The numbers of a file's programs and variables, by name.

use std::collections::HashMap;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Variable {
    Global(usize),
    Local(usize),
}

/// The names that are known while a file is read.
#[derive(Debug, Default)]
pub(crate) struct Names {
    pub(crate) programs: HashMap<String, usize>,
    pub(crate) globals: HashMap<String, usize>,
    pub(crate) locals: HashMap<String, usize>,
}

impl Names {
    pub(crate) fn variable(&mut self, name: &str) -> Variable {
        let is_local = name.starts_with('.');
        let names = if is_local { &mut self.locals } else { &mut self.globals };
        let next = names.len();
        let at = *names.entry(name.into()).or_insert(next);
        if is_local { Variable::Local(at) } else { Variable::Global(at) }
    }
}
