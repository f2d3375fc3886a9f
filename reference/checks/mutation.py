"""Small changes of a source file, for mutants.py: found in the tree that tree-sitter makes of it, for Python and C alike.

A change is one of: a constant one more or less, a comparison at its limit or turned round, `and` for `or`, an operand of them left out,
a condition that always or never holds, `not` left out, another operator, min for max, a statement left out.
"""

import importlib
import re
from collections import Counter
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from tree_sitter import Language as Grammar
from tree_sitter import Node, Parser

AT_LIMIT = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}
TURNED = {
    "<": ">=", ">=": "<", ">": "<=", "<=": ">", "==": "!=", "!=": "==",
    "in": "not in", "not in": "in", "is": "is not", "is not": "is",
}  # fmt: skip
AND, OR = {"and", "&&"}, {"or", "||"}
OTHER = {
    "and": "or", "or": "and", "&&": "||", "||": "&&",
    "+": "-", "-": "+", "*": "+", "/": "*", "//": "*", "%": "*", "**": "*", "<<": ">>", ">>": "<<", "&": "|", "|": "&", "^": "|",
    "+=": "-=", "-=": "+=", "*=": "+=", "|=": "&=", "&=": "|=", "^=": "|=", "<<=": ">>=", ">>=": "<<=", "++": "--", "--": "++",
}  # fmt: skip
CALLS = {"min": "max", "max": "min", "any": "all", "all": "any"}
OPERATIONS = {
    "binary_expression", "binary_operator", "boolean_operator", "comparison_operator", "augmented_assignment",
    "augmented_assignment_expression", "assignment_expression", "update_expression",
}  # fmt: skip
NUMBERS = {"integer", "float", "number_literal", "number"}
TEXTS = {"string_content", "string_fragment", "character"}
# What is no code that runs, or only words for a reader.
PASSED_OVER = {
    "type", "import_statement", "import_from_statement", "preproc_include", "decorator", "comment", "type_qualifier", "static_assert_declaration",
}  # fmt: skip
FUNCTIONS = {"function_definition", "class_definition"}


@dataclass(frozen=True)
class Language:
    """What is not the same in all languages."""

    grammar: str  # module and function
    yes: str
    no: str
    dropped: set[str]  # statements that may be left out
    nothing: str  # the statement that does nothing
    # Functions whose texts are words for a reader: of a refusal, of the state in which an input is unexpected.
    wording: set[str] = field(default_factory=set)


LANGUAGES = {
    ".py": Language(
        "tree_sitter_python language", "True", "False",
        {"expression_statement", "return_statement", "raise_statement", "break_statement", "continue_statement", "delete_statement"},
        "pass", {"Refused", "integer", "integers", "one_of", "boolean", "NotTaken", "ValueError", "self.unexpected", "self.ignored"},
    ),
    ".c": Language("tree_sitter_c language", "1", "0", {"expression_statement", "break_statement", "continue_statement"}, ";"),
}  # fmt: skip
LANGUAGES[".h"] = LANGUAGES[".c"]


@dataclass(frozen=True)
class Mutant:
    """A file with one change."""

    file: str
    function: str
    before: str  # the lines that change, as one
    after: str
    begin: int
    end: int
    new: str
    lines: range  # from the beginning of the statement, counted from 1
    nested: bool  # in a function's body
    clauses: frozenset[str]  # that the comments of its line and of its function name

    @property
    def name(self) -> tuple[str, str, str, str]:
        """What it is called in the list of those that are equivalent: no line number is in it."""
        return self.file, self.function, self.before, self.after

    def changed(self, source: bytes) -> bytes:
        """The file with it."""
        return source[: self.begin] + self.new.encode() + source[self.end :]


@cache
def parser(suffix: str) -> Parser:
    module, function = LANGUAGES[suffix].grammar.split()
    return Parser(Grammar(getattr(importlib.import_module(module), function)()))


def text(node: Node) -> str:
    return (node.text or b"").decode()


def changes(node: Node, language: Language):
    """What may stand in the place of parts of this node: its first and last byte, and the new text."""
    yield from conditions(node, language)
    if node.type in OPERATIONS:
        yield from operators(node, language)
    elif node.type in NUMBERS or (node.type == "preproc_arg" and re.fullmatch(r"\d+|0x[0-9A-F]+", text(node))):
        for value in numbers(text(node)):
            yield node, value
    elif node.type in ("true", "false"):
        yield node, language.no if node.type == "true" else language.yes
    elif node.type in TEXTS and node.text:
        yield node, other_text(text(node))
    elif node.type in ("not_operator", "unary_expression") and node.children[0].type in ("not", "!"):
        yield node, f"({text(node.children[1])})"
    elif node.type in ("call", "call_expression"):
        called = node.child_by_field_name("function")
        if called and text(called) in CALLS:
            yield called, CALLS[text(called)]
    if node.type in language.dropped and is_nested(node) and not is_docstring(node) and not is_declaration(node):
        yield node, language.nothing


def conditions(node: Node, language: Language):
    """A condition that always holds, or never; a loop without an end would only take time."""
    condition = node.child_by_field_name("condition")
    if node.type == "conditional_expression" and condition is None:
        condition = node.children[2]
    if node.type == "if_clause":
        condition = node.children[1]
    if condition is None or text(condition).strip("()") in (language.yes, language.no):
        return
    brackets = "({})" if condition.type == "parenthesized_expression" else "{}"
    if node.type not in ("while_statement", "for_statement", "do_statement"):
        yield condition, brackets.format(language.yes)
    yield condition, brackets.format(language.no)


def operators(node: Node, language: Language):
    for child in node.children:
        operator = child.type
        if child.is_named or (operator in ("++", "--") and node.parent and node.parent.child_by_field_name("update") == node):
            continue
        if operator in AT_LIMIT:
            yield child, AT_LIMIT[operator]
        if operator in TURNED and not is_condition(node):
            yield child, TURNED[operator]
        if operator in OTHER:
            yield child, OTHER[operator]
        if operator in AND | OR:
            for operand in (node.children[0], node.children[-1]):
                yield operand, language.yes if operator in AND else language.no


def is_condition(node: Node) -> bool:
    """Whether the change to always or never turns it round already."""
    parent = node.parent
    if parent and parent.type == "parenthesized_expression":
        node, parent = parent, parent.parent
    return bool(parent) and (parent.child_by_field_name("condition") == node or parent.type == "if_clause")


def numbers(literal: str):
    """One more, and one less."""
    match = re.fullmatch(r"(0[xX])?([0-9A-Fa-f_]+?)([uUlLn]*)", literal)
    if not match or (not match[1] and not match[2].replace("_", "").isdigit()):
        if real := re.fullmatch(r"([0-9.]+(?:e[+-]?\d+)?)(f?)", literal):
            yield f"{float(real[1]) + 1}{real[2]}"
        return
    prefix, digits, suffix = match[1] or "", match[2].replace("_", ""), match[3]
    value = int(digits, 16 if prefix else 10)
    for new in (value + 1, value - 1):
        if new >= 0:
            yield f"{prefix}{new:0{len(digits)}X}{suffix}" if prefix else f"{new}{suffix}"


def other_text(content: str) -> str:
    """Without its last character; one character is another one."""
    characters = re.findall(r"\\x[0-9A-Fa-f]{2}|\\u[0-9A-Fa-f]{4}|\\.|.", content, re.DOTALL)
    if len(characters) > 1:
        return "".join(characters[:-1])
    return chr(ord(content) ^ 1) if content.isalnum() and len(content) == 1 else "~"


def is_declaration(node: Node) -> bool:
    """Whether a statement of Python only says of what type a field is."""
    return node.type == "expression_statement" and node.children[0].type == "assignment" and node.children[0].child_by_field_name("right") is None


def is_docstring(node: Node) -> bool:
    return node.type == "expression_statement" and node.child_count > 0 and node.children[0].type == "string"


def is_passed_over(node: Node, language: Language) -> bool:
    if node.type in PASSED_OVER or is_docstring(node):
        return True
    if node.type == "assignment" and text(node).startswith("__all__"):
        return True
    if node.type == "string" and node.parent and node.parent.type == "argument_list" and node.parent.parent:
        called = node.parent.parent.child_by_field_name("function")
        return called is not None and text(called) in language.wording
    # How much memory there is: more is no fault, and less is one only for sanitizers.
    return bool(node.parent) and node.parent.type == "array_declarator" and node.parent.child_by_field_name("size") == node


def function_of(node: Node) -> str:
    """The names of the functions and classes around a node."""
    names = []
    while node := node.parent:
        if node.type in FUNCTIONS:
            name = node.child_by_field_name("name") or node.child_by_field_name("declarator")
            while name and (inner := name.child_by_field_name("declarator")):
                name = inner
            names.insert(0, text(name) if name else "?")
    return ".".join(names)


def clauses_of(node: Node, line: str) -> frozenset[str]:
    """The clauses that a line names, and the comment of the innermost function: before it, or its docstring."""
    while node.parent and node.type not in FUNCTIONS:
        node = node.parent
    body, before = node.child_by_field_name("body"), node.prev_sibling
    comments = [line]
    if node.parent and body and body.named_children and is_docstring(body.named_children[0]):
        comments.append(text(body.named_children[0]))
    if node.parent and before and before.type == "comment":
        comments.append(text(before))
    return frozenset(re.findall(r"\b[A-Z]{2}-\d+\b", " ".join(comments)))


def statement_of(node: Node) -> Node:
    while node.parent and not node.type.endswith(("statement", "_definition", "_clause", "declaration")):
        node = node.parent
    return node


def walk(node: Node, language: Language):
    """Each place of a change, and its new text."""
    if not is_passed_over(node, language):
        yield from changes(node, language)
        for child in node.children:
            yield from walk(child, language)


def mutants(path: Path, root: Path) -> list[Mutant]:
    """All changes of a file, in its order; of alike ones in a function the second, third … is called so."""
    language, source = LANGUAGES[path.suffix], path.read_bytes()
    found: list[Mutant] = []
    seen: set[tuple[int, int, str]] = set()
    names: Counter[tuple[str, ...]] = Counter()
    for node, new in walk(parser(path.suffix).parse(source).root_node, language):
        begin, end = node.start_byte, node.end_byte
        if (begin, end, new) in seen or source[begin:end] == new.encode():
            continue
        seen.add((begin, end, new))
        first, last = source.rfind(b"\n", 0, begin) + 1, source.find(b"\n", end)
        clauses = clauses_of(node, source[first:last].decode())
        before = " ".join(source[first:last].decode().split())
        after = " ".join((source[first:begin] + new.encode() + source[end:last]).decode().split())
        function = function_of(node)
        names[function, before, after] += 1
        if names[function, before, after] > 1:
            after += f"  #{names[function, before, after]}"
        lines = range(statement_of(node).start_point.row + 1, node.end_point.row + 2)
        nested = is_nested(node)
        found.append(Mutant(path.relative_to(root).as_posix(), function, before, after, begin, end, new, lines, nested, clauses))
    return found


def is_nested(node: Node) -> bool:
    """Whether it is in the body of a function, not in its head, and not in a module or a class."""
    while parent := node.parent:
        if parent.type == "function_definition":
            return parent.child_by_field_name("body") == node
        node = parent
    return False
