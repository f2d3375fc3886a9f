"""A source file with all of its mutants in it, each behind a condition: compiled once, one of them runs at a time.

cargo-mutants says what is changed, tree-sitter how far an operator's expression reaches.
"""

from dataclasses import dataclass, field
from itertools import takewhile

import tree_sitter_rust
from tree_sitter import Language, Node, Parser

PARSER = Parser(Language(tree_sitter_rust.language()))
OPERATORS = {"binary_expression", "compound_assignment_expr", "unary_expression", "let_chain"}

HEAD = "#![feature(core_intrinsics, const_eval_select)] #![allow(internal_features)] "
# What is evaluated by the compiler has no mutant: it would be another program.
TAIL = """
#[doc(hidden)]
#[allow(missing_docs)]
pub const fn __mutant(id: u32) -> bool {
    core::intrinsics::const_eval_select((id,), __mutant_never, __mutant_now)
}
const fn __mutant_never(_: u32) -> bool { false }
fn __mutant_now(id: u32) -> bool {
    extern crate std;
    use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
    const UNSET: u32 = u32::MAX;
    const TRACE: u32 = u32::MAX - 1;
    static ACTIVE: AtomicU32 = AtomicU32::new(UNSET);
    static SEEN: [AtomicBool; 65536] = [const { AtomicBool::new(false) }; 65536];
    let mut active = ACTIVE.load(Relaxed);
    if active == UNSET {
        active = match std::env::var("MUTANT") {
            Ok(text) => text.parse().unwrap(),
            Err(_) => if std::env::var_os("MUTANT_TRACE").is_some() { TRACE } else { 0 },
        };
        ACTIVE.store(active, Relaxed);
    }
    if active == TRACE && !SEEN[id as usize].swap(true, Relaxed) {
        use std::io::Write;
        let path = std::env::var_os("MUTANT_TRACE").unwrap();
        let mut file = std::fs::OpenOptions::new().append(true).create(true).open(path).unwrap();
        file.write_all(&id.to_le_bytes()).unwrap();
    }
    active == id
}
"""


@dataclass
class Mutant:
    """A change that cargo-mutants names, and its number."""

    id: int
    name: str
    package: str
    file: str
    genre: str
    replacement: str
    function: dict | None
    span: dict

    @property
    def is_opaque(self) -> bool:
        """Whether another value would have another type than the function's own."""
        return self.genre == "FnValue" and "impl " in self.function["return_type"]


@dataclass
class Placed:
    """A file as it is compiled, and where in it the mutants are."""

    text: bytes = b""
    own: list[tuple[int, int, int]] = field(default_factory=list)
    "A mutant's own text: from, to, its number."
    shared: list[tuple[int, int, list[int]]] = field(default_factory=list)
    "The expressions with mutants, the original in them."

    def write(self, text: bytes, id: int | None = None) -> None:
        begin = len(self.text)
        self.text += text
        if id is not None:
            self.own.append((begin, len(self.text), id))

    def find(self, begin: int, end: int) -> set[int]:
        """The mutants that the text in a range is of, the smallest first."""
        around = [(to - at, {id}) for at, to, id in self.own if at <= begin and end <= to]
        around = around or [(to - at, set(ids)) for at, to, ids in self.shared if at <= begin and end <= to]
        return min(around, key=lambda found: found[0])[1] if around else set()


class Source:
    """A source file, and what is written into it."""

    def __init__(self, text: bytes, mutants: list[Mutant]):
        self.text, self.tree = text, PARSER.parse(text)
        self.lines = text.split(b"\n")
        self.begins = [0]
        for line in self.lines:
            self.begins.append(self.begins[-1] + len(line) + 1)
        self.replaced: dict[tuple[int, int], list[tuple[int, bytes]]] = {}
        self.inserted: dict[int, list[tuple[int | None, bytes]]] = {}
        for mutant in mutants:
            self.add(mutant)

    def offset(self, place: dict) -> int:
        line, column = place["line"] - 1, place["column"] - 1
        return self.begins[line] + len(self.lines[line].decode()[:column].encode())

    def ancestor(self, begin: int, end: int, kinds: set[str]) -> Node:
        node = self.tree.root_node.descendant_for_byte_range(begin, end)
        while node.type not in kinds:
            node = node.parent
        return node

    def add(self, mutant: Mutant) -> None:
        begin, end = (self.offset(mutant.span[at]) for at in ("start", "end"))
        if is_elsewhere(self.tree.root_node.descendant_for_byte_range(begin, begin)):
            return
        replacement = mutant.replacement.encode()
        if mutant.genre == "FnValue":
            text = f"if crate::__mutant({mutant.id}) {{ return {mutant.replacement}; }} "
            self.insert(begin, mutant.id, text)
        elif mutant.genre == "MatchArm":
            pattern = next(child for child in self.ancestor(begin, end, {"match_arm"}).children if child.type == "match_pattern")
            guard = pattern.child_by_field_name("condition")
            if guard is None:
                self.insert(pattern.end_byte, mutant.id, f" if !crate::__mutant({mutant.id})")
            else:
                self.insert(guard.start_byte, mutant.id, f"!crate::__mutant({mutant.id}) && (")
                self.insert(guard.end_byte, None, ")")
        elif mutant.genre == "MatchArmGuard":
            self.replace(begin, end, mutant.id, replacement)
        else:
            kinds = {"struct_expression"} if mutant.genre == "StructField" else OPERATORS
            whole = self.ancestor(begin, end if mutant.genre == "StructField" else begin + 1, kinds)
            if not has_let(whole):
                text = self.text[whole.start_byte : begin] + replacement + self.text[end : whole.end_byte]
                self.replace(whole.start_byte, whole.end_byte, mutant.id, text)

    def insert(self, at: int, id: int | None, text: str) -> None:
        self.inserted.setdefault(at, []).append((id, text.encode()))

    def replace(self, begin: int, end: int, id: int, text: bytes) -> None:
        self.replaced.setdefault((begin, -end), []).append((id, text))

    def place(self, is_root: bool) -> Placed:
        """The file; a crate's root has the condition."""
        placed = Placed(HEAD.encode() if is_root else b"")
        ranges = [(begin, -end, texts) for (begin, end), texts in sorted(self.replaced.items(), key=lambda item: item[0])]
        self.write(0, len(self.text), ranges, placed, set())
        if is_root:
            forbidden, allowed = b"#![forbid(unsafe_code)]", b"#![allow(unsafe_code)] "
            placed.text = placed.text.replace(forbidden, allowed) + TAIL.encode()
        return placed

    def write(self, begin: int, end: int, ranges: list, placed: Placed, done: set[int]) -> None:
        """A range with all that is in it, except the mutants of the whole."""
        while ranges:
            (first, last, texts), *rest = ranges
            inside = list(takewhile(lambda each: each[0] < last, rest))
            ranges = rest[len(inside) :]
            self.write_text(begin, first, placed, done)
            self.write_inserted(first, placed, done)
            at = len(placed.text)
            placed.write(b"(")
            for id, text in texts:
                placed.write(f"if crate::__mutant({id}) {{ ".encode())
                placed.write(text, id)
                placed.write(b" } else ")
            placed.write(b"{ ")
            self.write(first, last, inside, placed, done)
            placed.write(b" })")
            placed.shared.append((at, len(placed.text), [id for id, _ in texts]))
            begin = last
        self.write_text(begin, end, placed, done)

    def write_text(self, begin: int, end: int, placed: Placed, done: set[int]) -> None:
        for at in sorted(at for at in self.inserted if begin <= at < end):
            placed.write(self.text[begin:at])
            self.write_inserted(at, placed, done)
            begin = at
        placed.write(self.text[begin:end])

    def write_inserted(self, at: int, placed: Placed, done: set[int]) -> None:
        if at not in done:
            done.add(at)
            for id, text in self.inserted.get(at, []):
                placed.write(text, id)


def is_elsewhere(node: Node | None) -> bool:
    """Whether it is compiled on other platforms alone."""
    while node is not None:
        before = node.prev_named_sibling
        while before is not None and before.type in ("attribute_item", "line_comment"):
            if before.text in (b"#[cfg(windows)]", b"#[cfg(not(unix))]", b'#[cfg(target_vendor = "apple")]'):
                return True
            before = before.prev_named_sibling
        node = node.parent
    return False


def has_let(node: Node) -> bool:
    """Whether it is a chain of conditions with a `let`, which takes no other operator."""
    return node.type in ("let_chain", "let_condition") or (
        node.type == "binary_expression" and any(has_let(child) for child in node.children)
    )
