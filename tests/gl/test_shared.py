"""One context for several threads: they take turns, and the last one to leave closes it."""

from __future__ import annotations

import threading

import pytest

from sonar_component.gl import GLUnavailableError, share_context


def test_tasks_of_one_process_get_the_same_context_until_the_last_gives_it_back() -> None:
    one, other = share_context(), share_context()
    assert one is other
    with one as context:
        assert context.error == "GL_NO_ERROR"
    one.release()
    with other as context:
        assert context.buffer(b"1234").size == 4
    other.release()
    fresh = share_context()
    assert fresh is not one
    fresh.release()


def test_threads_take_turns_and_each_finds_what_the_other_made() -> None:
    shared = share_context()
    with shared as context:
        buffer = context.buffer(reserve=4)
    wrong: list[object] = []

    def count() -> None:
        for _ in range(200):
            with shared:
                before = int.from_bytes(buffer.read(), "little")
                buffer.write((before + 1).to_bytes(4, "little"))
                if context.error != "GL_NO_ERROR":
                    wrong.append(context.error)

    threads = [threading.Thread(target=count) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    with shared:
        assert int.from_bytes(buffer.read(), "little") == 600  # a turn that overlapped another would lose counts
        buffer.release()
    shared.release()


def test_a_turn_within_a_turn_ends_with_the_outer_one() -> None:
    shared = share_context()
    with shared as context:
        with shared:
            pass
        assert context.buffer(b"1234").read() == b"1234"  # still current
    done: list[bytes] = []

    def elsewhere() -> None:
        with shared as context:
            done.append(context.buffer(b"abcd").read())

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert done == [b"abcd"]  # a context that is still current here could not become current there
    shared.release()


def test_a_failure_in_a_turn_ends_the_turn() -> None:
    shared = share_context()
    with pytest.raises(ZeroDivisionError), shared:
        raise ZeroDivisionError
    taken = threading.Event()

    def elsewhere() -> None:
        with shared:
            taken.set()

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert taken.is_set()
    shared.release()


def test_a_device_that_is_not_there_is_refused_and_leaves_nothing_behind() -> None:
    for _ in range(2):
        with pytest.raises(GLUnavailableError, match="no EGL device 99"):
            share_context(device=99)


def test_another_device_number_is_another_context() -> None:
    default, first = share_context(), share_context(device=0)
    assert default is not first
    first.release()
    default.release()
