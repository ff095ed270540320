"""The command line as a whole: one line for a mistake, exit codes, lazy imports."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer.main

from sonar_component.cli.app import build, main

# What takes a moment to import and what a verb like `list` has no use for.
HEAVY = ("moderngl", "numba", "trimesh", "matplotlib", "PIL")


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main([*arguments])
    printed = capsys.readouterr()
    assert isinstance(caught.value.code, int)
    return caught.value.code, printed.out, printed.err


def verbs() -> dict[str, Any]:
    return typer.main.get_command(build()).commands  # type: ignore[attr-defined, no-any-return]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["pnig"], "sonar: No such command 'pnig'. Did you mean 'ping'? See: sonar --help"),
        (["ping"], "sonar ping: Missing option '--scene'. See: sonar ping --help"),
        (["ping", "--scene", "x", "--out", "x.npz", "--noise", "loud"], "sonar ping: Invalid value for '--noise': "),
        (["ping", "--scene", "x", "--out", "x.npz", "--position", "1", "2"], "Option '--position' requires 3 arg"),
        (["ping", "--scene", "x", "--out", "x.npz", "--position", "1", "2", "up"], "Invalid value for '--position'"),
        (["run", "--seconds", "-1", "x.yaml"], "sonar run: Invalid value for '--seconds'"),
        (["run", "nowhere.yaml"], "nowhere.yaml: no such file"),
        (["--frobnicate"], "sonar: No such option: --frobnicate"),
    ],
)
def test_a_wrong_command_line_gets_one_line_and_exit_code_2(
    capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_nothing_asked_gives_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys)
    assert (code, err) == (0, "")
    assert all(verb in out for verb in ("run", "check", "ping", "list", "echo", "hz", "snapshot", "doctor"))


def test_every_verb_explains_itself(capsys: pytest.CaptureFixture[str]) -> None:
    for verb in verbs():
        code, out, _ = run(capsys, verb, "--help")
        assert (code, "Usage: " in out) == (0, True), verb


def test_every_verb_but_run_prints_json() -> None:
    without = {name for name, verb in verbs().items() if "--json" not in [o for p in verb.params for o in p.opts]}
    doing = {"run", "emulate", "record", "replay", "set", "call", "keys"}  # the others print what they found
    doing |= {"schema"}  # is JSON in any case
    assert without <= doing


def test_every_option_has_a_word_of_help() -> None:
    for name, verb in verbs().items():
        for parameter in verb.params:
            assert parameter.name == "help" or getattr(parameter, "help", None), f"{name} {parameter.name}"


def test_a_full_disk_is_told_in_one_line_with_exit_code_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        with open("/dev/full", "wb", buffering=0) as file:
            file.write(b"x")

    monkeypatch.setattr("sonar_component.settings.paths.find_file", full)
    code, _, err = run(capsys, "check", "x.yaml")
    assert (code, err) == (1, "No space left on device\n")


def test_ctrl_c_ends_without_a_traceback(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("sonar_component.settings.paths.find_file", interrupted)
    assert run(capsys, "check", "x.yaml")[0] == 130


def test_python_m_is_the_same_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "sonar_component", "pnig"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert "Did you mean 'ping'?" in done.stderr


@pytest.mark.parametrize("arguments", [["list"], ["check", "deploy/demo.yaml"]])
def test_a_verb_that_only_looks_imports_no_renderer(arguments: list[str]) -> None:
    script = (
        "import sys\nfrom sonar_component.cli.app import main\n"
        f"try:\n    main({arguments})\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_a_check_imports_neither_the_command_line_library_nor_what_draws() -> None:
    # An editor runs it at every save: what it imports is its time.
    unwanted = (*HEAVY, "typer", "rich", "zmq", "msgpack", "sonar_component.gl", "sonar_component.pictures")
    code = (
        "import sys; from sonar_component.cli.app import main\n"
        "try: main(['check', 'deploy/wreck_with_camera.yaml'])\n"
        "finally: print([name for name in sys.argv[1:] if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code, *unwanted], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.splitlines()[1:]) == (0, ["[]"]), done.stderr


def test_a_check_says_the_same_however_it_is_asked(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    good, wrong = "deploy/demo.yaml", tmp_path / "wrong.yaml"
    wrong.write_text("version: 1\ntasks: {a: {type: ScneTask}}\n", encoding="utf-8")
    quick, parsed = run(capsys, "check", good, str(wrong)), run(capsys, "check", "--", good, str(wrong))
    assert quick == parsed
    assert quick[0] == 2
    assert "wrong.yaml:2:" in quick[2]
