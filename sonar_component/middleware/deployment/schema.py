"""The JSON Schema of a deployment file: an editor then completes keys and marks mistakes while one types.

# yaml-language-server: $schema=deployment.schema.json
"""

from __future__ import annotations

from typing import Any

from sonar_component.middleware.deployment.file import DeploymentFile
from sonar_component.middleware.deployment.task_types import task_type, task_type_names


def deployment_schema() -> dict[str, Any]:
    """Draft 2020-12; for each installed task type it says which properties there are."""
    schema = DeploymentFile.model_json_schema(by_alias=True)
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "sonar deployment"
    definitions = schema["$defs"]
    task = definitions["TaskFile"]
    task["properties"]["type"] = {"enum": task_type_names()}
    task["allOf"] = [_properties_of(name, definitions) for name in task_type_names()]
    # What the loader also takes beside the models: single words for policies, one text for lists of one.
    policy = {"const": "data"}
    connection = definitions["ConnectionFile"]["properties"]
    connection["policy"] = {"anyOf": [policy, {"$ref": "#/$defs/PolicyFile"}]}
    connection["to"] = {"anyOf": [{"type": "string"}, connection["to"]]}
    task["properties"]["config"] = {"anyOf": [{"type": "string"}, task["properties"]["config"]]}
    return schema


def _properties_of(name: str, definitions: dict[str, Any]) -> dict[str, Any]:
    model = task_type(name).Properties.model_json_schema(ref_template="#/$defs/{model}")
    definitions.update(model.pop("$defs", {}))
    model.pop("required", None)  # a config file may give what is required
    definitions[f"{name}.properties"] = model
    return {
        "if": {"properties": {"type": {"const": name}}},
        "then": {"properties": {"properties": {"$ref": f"#/$defs/{name}.properties"}}},
    }
