"""The cases of fanuc-ls for testee.py: texts of programs, and of parts of them.

A vector is one request `decode`, and `encode` if it is read; a file of the streams is one request `stream`.
"""


def whole(part, text):
    """The text of a program that has this part."""
    return part["before"] + text + part["behind"] if part else text


def program(part, message):
    """The object of a program that has this part."""
    base = {"name": "A", "kind": None, "attributes": None, "application": None, "instructions": [], "positions": []}
    return base | {part["list"]: [message]} if part else message


def inside(part, error):
    """An error by its place in the program, not in its part."""
    before = part["before"] if part else ""
    return error | {"line": error["line"] + before.count("\n"), "offset": error["offset"] + len(before)}


def items_are(items, same):
    return lambda answer: same(answer.get("items"), items)


def written_as(text):
    return lambda answer: "hex" in answer and bytes.fromhex(answer["hex"]).decode() == text


def is_refused(answer):
    return "refused" in answer


def request(task, entry, **fields):
    return {"task": task, "link": "fanuc-ls", "options": entry.get("options", {})} | fields


def read(task, entry, data):
    return request(task, entry, hex=data.hex().upper() + "|", read=0)


def vector_case(vector, parts, same):
    part = parts.get(vector.get("part"))
    data = whole(part, vector["text"]).encode()
    item = {"offset": 0, "length": len(data)}
    if vector["result"] == "invalid":
        return [(read("decode", vector, data), items_are([item | {"error": inside(part, vector["error"])}], same))]
    message = program(part, vector["message"])
    text = whole(part, vector.get("written", vector["text"]))
    writes = is_refused if "refused" in vector else written_as(text)
    return [
        (read("decode", vector, data), items_are([item | {"message": message}], same)),
        (request("encode", vector, message=message), writes),
    ]


def cases(vectors, streams, same):
    """The name of each case, and its requests with what is wrong with the answer to each."""
    parts = vectors["parts"]
    for vector in vectors["vectors"]:
        yield f"vectors {vector['id']}", vector_case(vector, parts, same)
    for refused in vectors["refused"]:
        message = program(parts.get(refused.get("part")), refused["message"])
        yield f"refused {refused['id']}", [(request("encode", refused, message=message), is_refused)]
    for stream in streams["streams"]:
        data = stream["text"].encode(stream.get("encoding", "utf-8"))
        yield f"streams {stream['id']}", [(read("stream", stream, data), items_are(stream["items"], same))]
