"""Completion as bash asks for it, installed into a home that is fresh."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from sonar_component.cli import complete

CHAIN = """
    version: 1
    tasks:
      pose: {type: SourceTask}
      fls: {type: PoseToSonarTask}
    connections:
      - {from: pose.pose_samples, to: fls.sonar_pose_cmd}
"""
ASK = """
    source ~/.bashrc
    ask() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _sonar_completion sonar; echo "${COMPREPLY[*]}"; }
    ask sonar de
    ask sonar run --s
    ask sonar echo pose.s
    ask sonar state fls st
"""


def test_bash_completes_verbs_options_and_what_runs(graph: Any) -> None:
    graph.start(CHAIN)
    graph.wait_until_said("fls: RUNNING")
    graph.wait_until_said("pose: RUNNING")
    home = graph.folder / "home"
    home.mkdir()
    paths = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = {**graph.environment, "HOME": str(home), "PATH": paths, "SHELL": "/bin/bash"}
    # It asks which shell it was called from, and whoever runs the tests may have come from another.
    install = ["bash", "--noprofile", "--norc", "-c", "sonar --install-completion; exit $?"]
    subprocess.run(install, env=environment, capture_output=True, text=True, check=True)
    bash = ["bash", "--noprofile", "--norc", "-c", ASK]
    done = subprocess.run(bash, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["delay", "--seconds --set", "pose.state pose.sonar_samples", "start stop"]
    assert done.stderr == ""


def test_properties_and_operations_of_a_task_are_offered_once_it_is_clear_which(graph: Any) -> None:
    graph.start(CHAIN)
    graph.wait_until_said("fls: RUNNING")
    graph.wait_until_said("pose: RUNNING")
    assert complete.properties("") == ["fls", "pose"]
    assert complete.properties("po") == ["pose.beams", "pose.bins", "pose.gain"]
    assert complete.properties("pose.b") == ["pose.beams", "pose.bins"]
    assert complete.operations("pose.ren") == ["pose.rendered_count"]
    assert complete.tasks("f") == ["fls"]


def test_where_nothing_runs_nothing_is_offered_and_nothing_is_said(graph: Any) -> None:
    assert complete.outputs("") == complete.properties("x") == complete.tasks("") == []
