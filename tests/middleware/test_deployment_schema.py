"""The published JSON Schema, by an implementation of JSON Schema that is not ours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jsonschema
import pytest

from sonar_component.middleware.deployment.schema import deployment_schema
from sonar_component.settings import load_yaml

DEPLOYMENTS = sorted((Path(__file__).parents[2] / "deploy").glob("*.yaml"))


@pytest.fixture(scope="module")
def validator() -> Any:
    schema = deployment_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("file", DEPLOYMENTS, ids=lambda file: file.stem)
def test_every_deployment_fits_the_schema(validator: Any, file: Path) -> None:
    assert [f"{error.json_path}: {error.message}" for error in validator.iter_errors(load_yaml(file).data)] == []


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"taks": {}}, "$"),
        ({"tasks": {"a": {"type": "ScneTask"}}}, "$.tasks.a.type"),
        ({"tasks": {"a": {"type": "SceneTask", "properties": {"wrld": "x"}}}}, "$.tasks.a.properties"),
        ({"tasks": {"a": {"type": "SceneTask", "activity": {"periodc": 1}}}}, "$.tasks.a.activity"),
        ({"connections": [{"from": "a.b", "to": ["c.d"], "policy": {"bufer": 1}}]}, "$.connections[0].policy"),
    ],
)
def test_the_schema_marks_a_mistake_where_it_stands(validator: Any, change: dict[str, Any], place: str) -> None:
    document = {"version": 1, "tasks": {"a": {"type": "SceneTask", "properties": {"world": "x.yaml"}}}, **change}
    assert place in {error.json_path for error in validator.iter_errors(document)}
