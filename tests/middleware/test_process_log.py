"""What processes print: kept, turned over, never more than so much."""

from __future__ import annotations

from pathlib import Path

from sonar_component.middleware.process_log import MAX_BYTES, OLDER, ProcessLog


def test_what_is_printed_stays_in_order_and_the_disk_does_not_fill(tmp_path: Path) -> None:
    log = ProcessLog(tmp_path / "fls.log")
    line = b"x" * 990 + b" %08d\n"  # 1000 bytes
    count = (OLDER + 3) * MAX_BYTES // 1000
    for number in range(count):
        log.write(line % number)
    log.close()
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["fls.log", *(f"fls.log.{number}" for number in range(1, OLDER + 1))]
    assert all(path.stat().st_size <= MAX_BYTES for path in tmp_path.iterdir())
    kept = b"".join((tmp_path / name).read_bytes() for name in [*reversed(names[1:]), names[0]]).splitlines()
    numbers = [int(line.split()[1]) for line in kept]
    assert numbers == list(range(count - len(numbers), count))
    assert len(numbers) >= OLDER * MAX_BYTES // 1000


def test_a_new_run_goes_on_in_the_same_file_behind_a_mark(tmp_path: Path) -> None:
    for number in (1, 2):
        log = ProcessLog(tmp_path / "fls.log")
        log.begin(f"process fls starts, pid {number}")
        log.write(b"half a line, ")
        log.write(f"and its end {number}\n\n".encode())
        assert log.last_line == f"half a line, and its end {number}"
        log.close()
    lines = (tmp_path / "fls.log").read_text().splitlines()
    assert [line[-5:] for line in lines if line.startswith("---")] == ["pid 1", "pid 2"]
    assert "half a line, and its end 1" in lines


def test_the_last_line_is_that_of_the_present_process(tmp_path: Path) -> None:
    log = ProcessLog(tmp_path / "fls.log")
    assert log.last_line == ""
    log.write(b"of the first\n")
    log.begin("process fls starts, pid 2")
    assert log.last_line == ""
    log.close()


def test_a_log_that_cannot_be_written_ends_nothing(tmp_path: Path) -> None:
    log = ProcessLog(tmp_path / "gone" / "fls.log")
    log.write(b"nowhere to go\n")
    assert (log.error, log.last_line) == ("No such file or directory", "nowhere to go")
