"""What imports what: layers, declared dependencies, and no file that nobody reads."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:  # the standard library has it from 3.11 on; mypy and pytest bring this one before
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "sonar_component"
MODULES = sorted(PACKAGE.rglob("*.py"))


def name_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(path: Path) -> set[str]:
    """Modules named in import statements, and in texts that look like a module of ours (entry points, lazy names)."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found.add(node.module)
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found |= set(re.findall(r"sonar_component(?:\.\w+)+", node.value))
    return found


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", re.split(r"[\s<>=!;\[(]", name)[0]).lower()


def distributions_of_modules() -> dict[str, set[str]]:
    """Top-level module -> distributions with files in it; the standard library's own table is incomplete in 3.10."""
    found: dict[str, set[str]] = {}
    for distribution in distributions():
        for file in distribution.files or []:
            found.setdefault(file.parts[0].split(".")[0], set()).add(normal(distribution.metadata["Name"]))
    return found


def test_the_layers_hold() -> None:
    tool = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [str(tool) if tool.exists() else str(shutil.which("lint-imports")), "--no-cache"],
        cwd=ROOT, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


def test_every_package_that_is_imported_is_declared_and_the_other_way_round(project: dict[str, Any]) -> None:
    table = project["project"]
    needed = {normal(line) for line in table["dependencies"]}
    optional = {normal(line) for name in ("viewer", "reference") for line in table["optional-dependencies"][name]}
    home = distributions_of_modules()
    tops = {name.split(".")[0] for path in MODULES for name in imports_of(path)}
    foreign = tops - set(sys.stdlib_module_names) - {"sonar_component"}
    used = {distribution for top in foreign for distribution in home.get(top, {f"nobody brings {top}"})}
    assert used <= needed | optional
    assert needed <= used


def test_every_dependency_has_a_lower_bound(project: dict[str, Any]) -> None:
    table = project["project"]
    extras = [line for lines in table["optional-dependencies"].values() for line in lines]
    assert [line for line in [*table["dependencies"], *extras] if ">=" not in line] == []


def test_no_file_of_the_package_is_read_by_nobody(project: dict[str, Any]) -> None:
    readers = [*MODULES, *(ROOT / "tools").glob("*.py"), *(ROOT / "tests").rglob("*.py")]  # a reference is for tests
    named = set().union(*(imports_of(path) for path in readers))
    named |= {target.split(":")[0] for target in project["project"]["scripts"].values()}
    for group in project["project"]["entry-points"].values():
        named |= {target.split(":")[0] for target in group.values()}
    groups = (PACKAGE / "cli" / "app.py").read_text(encoding="utf-8")  # verbs are imported by the names in a list
    idle = [
        name_of(path)
        for path in MODULES
        if path.name not in ("__init__.py", "__main__.py") and name_of(path) not in named
        and not (path.parent.name == "cli" and f'"{path.stem}"' in groups)
        and not any(f'"{path.stem}"' in other.read_text(encoding="utf-8") for other in path.parent.glob("__init__.py"))
    ]  # fmt: skip
    assert idle == []


def test_nothing_but_the_agreed_entries_stands_at_the_top() -> None:
    kept = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    if kept.returncode:
        pytest.skip("not a git checkout: what lies beside the files is not ours")
    tops = {line.split("/")[0] for line in kept.stdout.splitlines()}
    agreed = {"pyproject.toml", "sonar_component", "deploy", "configs", "tests", "tools", "README.md"}
    assert {top for top in tops if not top.startswith(".")} == agreed
