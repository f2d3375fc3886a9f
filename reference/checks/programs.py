"""The cases of fanuc-ls for testee.py: texts of programs, and of parts of them.

For fuzz.py: the same, changed at random. A vector is one request `decode`, and `encode` if it is read; a file of the streams is one request `stream`.
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


PIECES = " \t\r\n:;[]{}\"'!,=.*%/0123456789-+PRJLCASGUTFDXYZWEN_axßé\u00a0\ufeff"


def change(text, rng):
    """A text as a careless editor leaves it."""
    for _ in range(rng.randrange(1, 4)):
        at, end = sorted(rng.randrange(len(text) + 1) for _ in range(2))
        end = min(end, at + rng.choice([1, 1, 1, 5, 40]))
        new = rng.choice(["", text[at:end] * 2, rng.choice(PIECES), "".join(rng.choices(PIECES, k=rng.randrange(4)))])
        text = text[:at] + new + text[end:]
    return text


def change_value(value, rng):
    """A message object of which one text or number is another one."""
    if isinstance(value, dict) and value:
        key = rng.choice(list(value))
        return value | {key: change_value(value[key], rng)}
    if isinstance(value, list) and value:
        at = rng.randrange(len(value))
        return [*value[:at], change_value(value[at], rng), *value[at + 1 :]]
    if isinstance(value, str):
        return change(value, rng)
    if isinstance(value, float):
        return rng.choice([0.0, -0.0, value * 10 ** rng.randrange(-12, 12), rng.uniform(-1000, 1000), round(rng.uniform(-9, 9), 3)])
    if isinstance(value, int) and not isinstance(value, bool):
        return rng.choice([0, value + 1, value * 256, 2**32])
    return value


def changed(vectors, streams, rng, count):
    """Requests with files and message objects that are like those of the vectors and streams."""
    parts = vectors["parts"]
    texts = [whole(parts.get(vector.get("part")), vector["text"]) for vector in vectors["vectors"]]
    texts += [stream["text"] for stream in streams["streams"]]
    read_ones = [vector for vector in vectors["vectors"] if "message" in vector]
    requests = []
    for _ in range(count):
        text = change(rng.choice(texts), rng)
        data = text.encode(rng.choice(["utf-8", "utf-8", "latin-1"]), errors="replace")
        requests += [read(task, {}, data) for task in ("decode", "stream")]
        vector = rng.choice(read_ones)
        message = change_value(program(parts.get(vector.get("part")), vector["message"]), rng)
        requests.append(request("encode", {"options": rng.choice([{}, {"comment": "truncate"}])}, message=message))
    return requests
