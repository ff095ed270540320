"""What the READMEs promise: their code runs, their links lead somewhere, and the first of them is short."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
READMES = [path for path in ROOT.rglob("README.md") if not {".venv", "node_modules"} & set(path.parts)]
SONAR = (sys.executable, "-m", "sonar_component")


def blocks(language: str, text: str = README) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def sonar_lines() -> list[str]:
    return [line for block in blocks("sh") for line in block.splitlines() if line.startswith("sonar ")]


def test_the_first_readme_is_short() -> None:
    assert len(README.splitlines()) < 150


@pytest.mark.parametrize("path", READMES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_link_leads_to_a_file(path: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", path.read_text(encoding="utf-8"))
    gone = [link for link in links if "://" not in link and not (path.parent / link).exists()]
    assert gone == []


def test_every_room_of_the_package_is_on_the_map() -> None:
    rooms = {path.parent.name for path in (ROOT / "sonar_component").glob("*/__init__.py")}
    drawn = set(re.findall(r"^      (\w+)/ ", README, re.MULTILINE))
    assert drawn == rooms


def test_the_two_commands_say_what_they_do() -> None:
    (block,) = [block for block in blocks("sh") if "tools/demo" in block]
    commands = [line.split()[0] for line in block.splitlines()]
    assert commands == ["tools/demo", "tools/test"]
    done = subprocess.run([str(ROOT / "tools/demo"), "--help"], capture_output=True, text=True, timeout=30, check=True)
    assert "--seconds N" in done.stdout
    assert "--snapshot DIR" in done.stdout


def test_a_ping_is_a_library_call_of_five_lines(context: Any, tmp_path: Path) -> None:
    (block,) = [block for block in blocks("python") if "load_world" in block]
    assert len([line for line in block.splitlines() if line]) <= 5
    done = subprocess.run(
        [sys.executable, "-c", block], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=True
    )
    shape, left, greatest = re.fullmatch(r"(\(.*\)) (\S+) (\S+)\n", done.stdout).groups()  # type: ignore[union-attr]
    assert shape == "(256, 750)"
    assert float(left) > 0
    assert 0 < float(greatest) <= 1


def read_some(command: list[str], environment: dict[str, str], folder: Path) -> list[str]:
    """The first three lines of a program that would go on for ever."""
    with subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) as reader:
        assert reader.stdout is not None
        lines = [reader.stdout.readline() for _ in range(3)]
        reader.kill()
    return lines


def test_what_the_readme_shows_of_a_running_demo_works(context: Any, graph: Any, tmp_path: Path) -> None:
    demo = (ROOT / "deploy" / "demo.yaml").read_text()
    graph.start(demo, "--set", "viewer.port=0")
    graph.wait_for(lambda: graph.sonar("echo", "fls.sonar_samples", "-n", 1).returncode == 0, "a first image", 60)

    (block,) = [block for block in blocks("python") if "connect(" in block]
    assert len([line for line in block.splitlines() if line]) <= 5
    lines = read_some([sys.executable, "-u", "-c", block], graph.environment, tmp_path)
    assert all(re.fullmatch(r"\d+ \(256, 500\) \S+\n", line) for line in lines), lines

    assert sonar_lines()
    for line in sonar_lines():
        done = subprocess.run(
            [*SONAR, *shlex.split(line)[1:]],
            cwd=tmp_path, env=graph.environment, capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip
        assert done.returncode == 0, (line, done.stdout, done.stderr)
    assert {"now.png", "ping.npz"} <= {path.name for path in tmp_path.iterdir()}


def test_the_picture_is_made_by_the_command_beside_it(context: Any, tmp_path: Path) -> None:
    text = " ".join(README.split())
    command = re.search(r"Made by `(sonar ping .*?)`", text)
    assert command
    arguments = [part.replace("deploy/demo.png", "demo.png") for part in shlex.split(command[1])[1:]]
    subprocess.run([*SONAR, *arguments], cwd=tmp_path, capture_output=True, timeout=120, check=True)
    assert (tmp_path / "demo.png").stat().st_size > 0
    assert (ROOT / "deploy" / "demo.png").stat().st_size < 100_000  # pictures in the tree are small


@pytest.mark.parametrize(
    ("folder", "pattern"), [("deploy", "*.yaml"), ("configs/sonars", "*.yaml"), ("tools", "*")]
)  # fmt: skip
def test_every_file_is_in_the_list_of_its_folder(folder: str, pattern: str) -> None:
    text = (ROOT / folder / "README.md").read_text(encoding="utf-8")
    kept = subprocess.run(
        ["git", "ls-files", f"{folder}/"], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    if kept.returncode or shutil.which("git") is None:
        pytest.skip("not a git checkout: what lies beside the files is not ours")
    names = [Path(line) for line in kept.stdout.splitlines() if Path(line).parent == Path(folder)]
    listed = [name for name in names if name.match(pattern) and name.name not in ("README.md", "package.json")]
    # A family of files may be listed as its first member and the others' last words.
    idle = [name.name for name in listed if name.stem not in text and f"`_{name.stem.split('_')[-1]}`" not in text]
    assert idle == []
