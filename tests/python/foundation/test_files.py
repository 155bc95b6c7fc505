"""Files are read with a word on what is wrong, and written whole or not at all."""

import errno
import os
import signal
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sysid_vehicle import InvalidInput
from sysid_vehicle._common import replace as _replace
from sysid_vehicle._common.files import check_outputs, read_text, read_toml, write_bytes, write_text
from sysid_vehicle._common.kinds import VEHICLE

needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="devices, links and limits")
root = hasattr(os, "geteuid") and os.geteuid() == 0


@pytest.fixture(params=["nameless", "named"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Files that have no name until they are whole, and systems that know none such."""
    if request.param == "named":
        monkeypatch.delattr(os, "O_TMPFILE", raising=False)
    return str(request.param)


def content(folder: Path) -> dict[str, str]:
    return {p.name: p.read_text() for p in folder.iterdir() if p.is_file()}


@pytest.mark.parametrize("path", ["a\0b.toml", "", 3, None, b"\0"])
def test_what_is_no_file_name(path: object) -> None:
    for use in (read_text, lambda p: write_text(p, ""), lambda p: check_outputs([p])):
        if path is None and use not in (read_text,):
            continue
        with pytest.raises(InvalidInput, match=r"is no (file name|path)"):
            use(path)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "text", ["a = " + "[" * 20000 + "]" * 20000, "a = " + "9" * 5000, "a = 1\na = 2"]
)
def test_toml_that_python_cannot_hold(tmp_path: Path, text: str) -> None:
    file = tmp_path / "deep.toml"
    file.write_text(text)
    with pytest.raises(InvalidInput, match=r"deep\.toml: not a TOML file: "):
        read_toml(file, VEHICLE)


def test_new_and_old_files_are_whole_and_alone(tmp_path: Path, way: str) -> None:
    target = tmp_path / "out.json"
    for text in ("first", "second\n", "zweiter \u00e4"):
        write_text(target, text)
        assert content(tmp_path) == {"out.json": text}


@needs_posix
def test_a_new_file_has_the_permissions_of_any_other(tmp_path: Path, way: str) -> None:
    (tmp_path / "plain").touch()
    write_text(tmp_path / "ours", "")
    assert os.stat(tmp_path / "ours").st_mode == os.stat(tmp_path / "plain").st_mode


@needs_posix
def test_a_file_that_is_replaced_keeps_permissions_and_owner(tmp_path: Path, way: str) -> None:
    target = tmp_path / "out.json"
    target.touch()
    target.chmod(0o640)
    if root:
        os.chown(target, 1234, 4321)
    before = target.stat()
    write_text(target, "new")
    after = target.stat()
    assert (after.st_mode, after.st_uid, after.st_gid) == (
        before.st_mode,
        before.st_uid,
        before.st_gid,
    )
    assert after.st_ino != before.st_ino


@needs_posix
def test_links_are_followed_and_stay(tmp_path: Path, way: str) -> None:
    (tmp_path / "elsewhere").mkdir()
    real = tmp_path / "elsewhere" / "real.json"
    link = tmp_path / "link.json"
    link.symlink_to(Path("elsewhere") / "real.json")
    for text in ("dangling at first", "then replaced"):
        write_text(link, text)
        assert link.is_symlink()
        assert content(real.parent) == {"real.json": text}


@needs_posix
def test_a_link_to_itself_is_refused(tmp_path: Path) -> None:
    loop = tmp_path / "loop"
    loop.symlink_to("loop")
    with pytest.raises(InvalidInput, match=r"loop: cannot be written .*symbolic links"):
        check_outputs([loop])
    with pytest.raises(InvalidInput, match=r"loop: cannot be written .*symbolic links"):
        write_text(loop, "x")


@needs_posix
def test_devices_are_written_through() -> None:
    before = os.stat("/dev/null")
    check_outputs(["/dev/null", "/dev/null"])
    write_text("/dev/null", "gone")
    after = os.stat("/dev/null")
    assert stat.S_ISCHR(after.st_mode)
    assert (after.st_ino, after.st_rdev) == (before.st_ino, before.st_rdev)


@needs_posix
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no such device")
def test_a_full_device_is_told() -> None:
    with pytest.raises(InvalidInput, match=r"^/dev/full: cannot be written \(No space left.*room"):
        write_text("/dev/full", "x")
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


@needs_posix
def test_a_pipe_is_written_through(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    check_outputs([pipe])
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write_bytes(pipe, b"x" * 300_000)  # more than a pipe holds
    reader.join()
    assert read == [b"x" * 300_000]
    assert stat.S_ISFIFO(os.stat(pipe).st_mode)


@needs_posix
@pytest.mark.parametrize("kind", ["pipe", "file"])
def test_the_output_stream_is_written_through(tmp_path: Path, kind: str) -> None:
    code = (
        "import sys; from sysid_vehicle._common.files import write_text; print('before');"
        "write_text('/dev/stdout', 'content\\n'); print('after')"
    )
    told = tmp_path / "told"
    with told.open("wb") as stream:
        where = subprocess.PIPE if kind == "pipe" else stream
        done = subprocess.run([sys.executable, "-c", code], stdout=where, check=True)
    text = done.stdout if kind == "pipe" else told.read_bytes()
    assert text == b"before\ncontent\nafter\n"


def test_outputs_are_looked_at_before_the_work(tmp_path: Path) -> None:
    old = tmp_path / "old.json"
    old.write_text("old")
    taken = tmp_path / "in.csv"
    taken.touch()
    for outputs, words in (
        ([old, tmp_path / "." / "old.json"], "is also another output of this command"),
        ([tmp_path / "new", tmp_path / "new"], "is also another output of this command"),
        ([taken], "is also an input of this command"),
        ([tmp_path], "is a folder"),
        ([tmp_path / "no" / "out"], "no does not exist"),
        ([old / "out"], "cannot be written"),
    ):
        with pytest.raises(InvalidInput, match=words):
            check_outputs(outputs, [taken])
    check_outputs([None, old, tmp_path / "new.json"], [taken])
    assert content(tmp_path) == {"old.json": "old", "in.csv": ""}


@needs_posix
def test_an_input_by_another_name_is_the_same_file(tmp_path: Path) -> None:
    taken = tmp_path / "e.py"
    taken.write_text("code")
    (tmp_path / "soft").symlink_to(taken)
    os.link(taken, tmp_path / "hard")
    for name in ("soft", "hard"):
        with pytest.raises(InvalidInput, match="is also an input of this command"):
            check_outputs([tmp_path / name], [taken])


def test_a_name_may_be_as_long_as_the_system_allows(tmp_path: Path, way: str) -> None:
    longest = tmp_path / ("x" * 250 + ".json")
    check_outputs([longest])
    write_text(longest, "1")
    write_text(longest, "2")
    assert content(tmp_path) == {longest.name: "2"}
    too_long = tmp_path / ("x" * 251 + ".json")
    for run in (lambda: check_outputs([too_long]), lambda: write_text(too_long, "")):
        with pytest.raises(InvalidInput, match=r"name too long\); choose a shorter name"):
            run()


@needs_posix
@pytest.mark.skipif(root, reason="the superuser may write everywhere")
def test_write_protection_is_respected(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("old")
    file.chmod(0o400)
    for run in (lambda: check_outputs([file]), lambda: write_text(file, "new")):
        with pytest.raises(InvalidInput, match="is write-protected"):
            run()
    tmp_path.chmod(0o500)
    try:
        for run in (
            lambda: check_outputs([tmp_path / "new"]),
            lambda: write_text(tmp_path / "new", "new"),
        ):
            with pytest.raises(InvalidInput, match=r"cannot be written \(Permission denied\)"):
                run()
    finally:
        tmp_path.chmod(0o700)


@contextmanager
def _files_no_larger_than(size: int) -> Iterator[None]:
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@needs_posix
def test_a_full_disk_leaves_the_old_file(tmp_path: Path, way: str) -> None:
    target = tmp_path / "out.json"
    write_text(target, "old")
    with (
        _files_no_larger_than(1000),
        pytest.raises(InvalidInput, match=r"out\.json: cannot be written \(File too large\); "),
    ):
        write_text(target, "new" * 1000)
    assert content(tmp_path) == {"out.json": "old"}


def test_no_space_left_is_told(tmp_path: Path, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "out.json"
    write_text(target, "old")

    def full(handle: int, data: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(InvalidInput, match=r"out\.json: .*No space left.*make room"):
        write_text(target, "new")
    monkeypatch.undo()
    assert content(tmp_path) == {"out.json": "old"}


@pytest.mark.parametrize("failing", ["fsync", "replace"])
def test_an_interrupt_leaves_the_old_file(
    tmp_path: Path, way: str, failing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "out.json"
    write_text(target, "old")

    def interrupted(*args: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, failing, interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_text(target, "new")
    monkeypatch.undo()
    assert content(tmp_path) == {"out.json": "old"}


def test_where_nameless_files_get_no_name_a_named_one_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*args: object, **how: object) -> None:
        raise PermissionError(errno.EPERM, "no links here")

    monkeypatch.setattr(os, "link", refused)
    for text in ("1", "2"):
        write_text(tmp_path / "out", text)
        assert content(tmp_path) == {"out": text}


@needs_posix
def test_leftovers_of_killed_writers_are_removed_and_those_of_living_ones_stay(
    tmp_path: Path,
) -> None:
    target = tmp_path / "out.json"
    handle, living = _replace._named_file(target)
    dead = _replace._temporary_name(target)
    dead.write_text("half")
    other = _replace._temporary_name(tmp_path / "other.json")
    other.write_text("half")
    write_text(target, "new")
    assert set(content(tmp_path)) == {"out.json", living.name, other.name}
    os.close(handle)
    write_text(target, "newer")
    assert set(content(tmp_path)) == {"out.json", other.name}


# The package is loaded once, which takes longer than all the writing. Each line asks for a writer.
_WRITERS = """
import os
import sys
from sysid_vehicle._common.files import write_text
if sys.argv[2] == "named":
    del os.O_TMPFILE
for _ in sys.stdin:
    writer = os.fork()
    k = 0
    while writer == 0:
        write_text(sys.argv[1], chr(ord("a") + k % 26) * 200_000)
        k += 1
    print(writer, flush=True)
    print(os.waitpid(writer, 0)[1], flush=True)
"""


@needs_posix
def test_killed_writers_leave_whole_files(tmp_path: Path, way: str) -> None:
    target = tmp_path / "out.txt"
    with subprocess.Popen(
        [sys.executable, "-c", _WRITERS, str(target), way],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as writers:
        assert writers.stdin is not None
        assert writers.stdout is not None
        for k in range(6):
            print(file=writers.stdin, flush=True)
            writer = int(writers.stdout.readline())
            time.sleep(0.003 + 0.011 * k)
            os.kill(writer, signal.SIGKILL)
            assert int(writers.stdout.readline()) == signal.SIGKILL  # it is gone
            if target.exists():
                assert len(target.read_text()) == 200_000
                assert len(set(target.read_text())) == 1
    write_text(target, "last")
    assert content(tmp_path) == {"out.txt": "last"}


def test_of_many_writers_one_wins_whole(tmp_path: Path, way: str) -> None:
    target = tmp_path / "out.txt"
    failures: list[BaseException] = []

    def work(letter: str) -> None:
        try:
            for _ in range(20):
                write_text(target, letter * 50_000)
        except BaseException as failure:
            failures.append(failure)

    threads = [threading.Thread(target=work, args=(x,)) for x in "abcd"]
    for t in threads:
        t.start()
    while any(t.is_alive() for t in threads):
        if target.exists():
            text = target.read_text()
            assert len(text) == 50_000
            assert len(set(text)) == 1
    for t in threads:
        t.join()
    assert failures == []
    assert list(content(tmp_path)) == ["out.txt"]


def test_a_name_that_is_no_utf8_may_stand_in_a_text(tmp_path: Path) -> None:
    write_text(tmp_path / "out", os.fsdecode(b"log\xff.csv"))
    assert (tmp_path / "out").read_text() == "log\\udcff.csv"
