"""Every request that is executed, and every answer, is checked against docs/simulate-control.schema.json."""

import json
import pathlib

import jsonschema
import pytest

import cellwire_sim

SCHEMA = json.loads((pathlib.Path(__file__).parent.parent / "simulate-control.schema.json").read_text())


def _validator(name):
    return jsonschema.Draft202012Validator({**SCHEMA, "anyOf": [{"$ref": f"#/$defs/{name}"}]})


REQUEST, ANSWER = _validator("request"), _validator("answer")
ANSWERS = {name: _validator(f"{name}_answer") for name in ["happened", "executed", "counts", "help", "get"]}
DONE = _validator("done_answer")


@pytest.fixture(autouse=True)
def checked(monkeypatch):
    exchange = cellwire_sim.Simulator.exchange

    def check(simulator, request):
        answer = exchange(simulator, request)
        ANSWER.validate(answer)
        if answer["ok"]:
            REQUEST.validate(request)
            ANSWERS.get(request["do"], DONE).validate(answer)
            assert answer.get("id") == request.get("id")
        return answer

    monkeypatch.setattr(cellwire_sim.Simulator, "exchange", check)
