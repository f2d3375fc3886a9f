"""Checks every JSON file of the reference that names a schema.

Usage: target/reference/venv/bin/python reference/checks/schema.py

Prints `link: passed of all` entries for each link, over all its files; exit status 1 on a failure.
"""

import json
import sys
from pathlib import Path

from jsonschema import Draft202012Validator
from referencing import Registry, Resource

REFERENCE = Path(__file__).resolve().parent.parent
# What tells one shape from another.
OTHER = ("const", "enum", "type")


def entries(document):
    """The names of the lists of entries in a document, and how many entries they have."""
    lists = {name: len(value) for name, value in document.items() if isinstance(value, list)}
    return lists or {"": 1}


def retrieve(name):
    """A schema that another one refers to, by the name of its file."""
    return Resource.from_contents(json.loads((REFERENCE / name).read_text()))


def nearest(error):
    """What is wrong by the one of several allowed shapes that a value nearly has."""
    while error.context:
        shapes = {}
        for inner in error.context:
            shapes.setdefault(inner.schema_path[0], []).append(inner)
        error = min(shapes.values(), key=lambda wrong: (sum(e.validator in OTHER for e in wrong), len(wrong)))[0]
    return error


def check(path, document):
    """How many entries a file has, and what is wrong with which of them."""
    schema = (path.parent / document["$schema"]).resolve()
    counts = entries(document)
    if not schema.is_file():
        return sum(counts.values()), {("schema",): f"there is no {document['$schema']}"}
    wrong = {}
    validator = Draft202012Validator(json.loads(schema.read_text()), registry=Registry(retrieve=retrieve))
    for error in validator.iter_errors(document):
        place = tuple(error.absolute_path)[:2]
        error = nearest(error)
        wrong.setdefault(place, f"{'/'.join(map(str, error.absolute_path))}: {error.message[:200]}")
    return sum(counts.values()), wrong


def main():
    passed, total = {}, {}
    for path in sorted(REFERENCE.rglob("*.json")):
        document = json.loads(path.read_text())
        if not isinstance(document, dict) or not document.get("$schema", "").startswith("."):
            continue
        link = document.get("link", path.stem)
        count, wrong = check(path, document)
        for text in wrong.values():
            print(f"{path.relative_to(REFERENCE)}: {text}")
        total[link] = total.get(link, 0) + count
        passed[link] = passed.get(link, 0) + max(0, count - len(wrong))
    for link, count in sorted(total.items()):
        print(f"{link}: {passed[link]} of {count}")
    sys.exit(passed != total)


if __name__ == "__main__":
    main()
