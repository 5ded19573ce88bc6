"""The program `eventgan` from Python: drafts a manifest, converts it, opens an output folder.

The program is the one named by the environment variable EVENTGAN_PROGRAM, else the one beside the package
(PREFIX/bin/eventgan for PREFIX/lib/python3/dist-packages, or the build tree's), else the first on the PATH.

If the program fails, its message is raised as ProgramError with the exit code; if there is no program,
FileNotFoundError is raised.
"""

from __future__ import annotations

import contextlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal

from .open_shards import PathLike
from .shards import Shards
from .words import listed, path_of

Event = dict[str, Any]


class ProgramError(RuntimeError):
    """The program's message, after it ended with a non-zero exit code.

    Attributes
    ----------
    exit_code : int
        1 failed, 64 bad manifest, or a folder of another job, 65 too many quarantined samples, 66 input missing, 75
        stopped: run it again; below 0: ended by that signal.
    """

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message, exit_code)  # both, so that it can be pickled
        self.exit_code = exit_code

    def __str__(self) -> str:
        return str(self.args[0])


def init(*paths: PathLike, out: PathLike = "manifest.json") -> pathlib.Path:
    """Writes one manifest for these datasets, as `eventgan init` does. Its comments say what was found.

    Parameters
    ----------
    *paths : str or path
        Folders, videos and recordings, each a source of the manifest. The first of several may be the kind of dataset
        that the others are: "kitti_object", "kitti_tracking", "kitti_raw", "mpii", "human36m", "mpii_list", "recording"
        or "frames".
    out : str or path
        The manifest to write, a new file.

    Returns
    -------
    pathlib.Path
        The manifest, to be edited, or passed to `convert`.

    Raises
    ------
    ProgramError
        No dataset is recognised, or `out` exists.
    FileNotFoundError
        There is no program.
    """
    _output("init", "--out", path_of(out, "a new file"), "--",
            *(path_of(path, "a folder, video or recording") for path in paths))
    return pathlib.Path(out)


def convert(manifest: PathLike | Mapping[str, Any], output: PathLike | None = None, *, limit: int | None = None,
            classes: Sequence[str] | None = None, threads: int | None = None,
            progress: Literal[False] | Callable[[Event], object] | None = None) -> Shards:
    """Makes the shards of a manifest and completes the dataset, as `eventgan convert` does.

    A second call keeps what is finished and makes the rest. KeyboardInterrupt (Ctrl-C, a notebook's stop button) stops
    the program cleanly: it finishes or drops the current shard, then the exception is raised. A second interrupt drops
    the shard at once.

    Parameters
    ----------
    manifest : str, path or dict
        A manifest; a folder, video or recording, converted as `init` proposes; or a dictionary with a manifest's keys,
        whose relative paths start at the current folder (there the program reads it from a temporary file).
    output : str or path, optional
        Output folder. None: the manifest's.
    limit : int, optional
        A trial run of so many pairs, the first of each source, into OUTPUT-trial-LIMIT unless `output` is given.
    classes : sequence of str, optional
        Of a folder, video or recording: takes only the boxes of these; others are left out and counted.
    threads : int, optional
        How many threads the program uses. None: all cores.
    progress : None, False or callable
        None: a bar, if tqdm is installed. False: none. A callable gets every event of the program as a dictionary:
        {"event": "progress", "done": 3, "total": 41, "seconds_left": 1.9, ...}, {"event": "warning" or "note", "text":
        ...}, and the report at the end of either command. Without one, warnings are Python's.

    Returns
    -------
    Shards
        All samples of the output folder.

    Raises
    ------
    ProgramError
        The manifest is not valid, an input is missing, more samples are quarantined than `errors` allows, or any other
        failure of the program.
    FileNotFoundError
        There is no program.
    """
    given = [] if output is None else ["--output", path_of(output, "a folder")]
    given += [] if limit is None else ["--limit", str(limit)]
    given += [] if classes is None else ["--classes", ",".join(listed(classes, "classes"))]
    given += [] if threads is None else ["--threads", str(threads)]
    shown = _Shown(bars=progress is None)
    on_event: Callable[[Event], object] = progress or shown
    with contextlib.closing(shown), _manifest_file(manifest) as file:
        # All shards, even in a cluster's job: the whole folder is returned.
        report = _follow(on_event, "convert", "--progress", "json", "--shards", "all", "--no-finalize", *given, "--",
                         file)
        if "folder" not in report:
            raise ProgramError(f"expected a report of the program eventgan, got {json.dumps(report)[:1000]}, from "
                               f"{find_program()}", 1)
        # JSON is UTF-8, which the name of a folder need not be.
        folder = report["folder"] if output is None else output
        _follow(on_event, "finalize", "--progress", "json", "--", folder)
    return Shards(folder)


def open(folder: PathLike, **options: Any) -> Shards:
    """The samples of an output folder as `Shards`; if the folder is incomplete, the error also says how far the
    conversion is.

    Parameters
    ----------
    folder : str or path
        The output folder of `eventgan convert`.
    **options
        Those of `Shards`: split, ids, where, partial...

    Returns
    -------
    Shards

    Raises
    ------
    ValueError
        The folder is incomplete, or `Shards` refuses the options.
    """
    try:
        return Shards(folder, **options)
    except ValueError as error:
        try:
            status = json.loads(_output("status", "--json", "--", folder))
        except (ProgramError, FileNotFoundError):
            raise error from None
        if status["complete"]:
            raise
        shards = status["shards"]
        raise ValueError(f"{error}: {shards['done']} of {shards['planned']} shards are done, {shards['running']} in "
                         "work; `eventgan convert`, or "
                         "eventgan.convert, of the same manifest makes the others") from error


def find_program() -> str:
    """The path of the program `eventgan`. Raises FileNotFoundError if there is none."""
    named = os.environ.get("EVENTGAN_PROGRAM")
    if named:
        if not shutil.which(named):
            raise FileNotFoundError(f"expected the program eventgan, got none, in {named} (EVENTGAN_PROGRAM)")
        return named
    package = os.path.dirname(__file__)
    # In the wheel; from PREFIX/lib/python3/dist-packages/eventgan, and from build/release/python/eventgan.
    for name in ("./bin/eventgan", "../../../../bin/eventgan", "../../eventgan", "eventgan"):
        found = shutil.which(os.path.normpath(os.path.join(package, name)) if "/" in name else name)
        if found:
            return found
    raise FileNotFoundError("expected the program eventgan, got none beside the package, on the PATH, or in "
                            "EVENTGAN_PROGRAM (install the Debian package eventgan, or build it)")


@contextlib.contextmanager
def _running(*arguments: PathLike, **how: Any) -> Iterator[subprocess.Popen[str]]:
    """The program with these arguments."""
    if signal.getsignal(signal.SIGCHLD) is signal.SIG_IGN:
        raise ProgramError("expected a process that learns how its programs end, got one that ignores SIGCHLD "
                           "(signal.signal(signal.SIGCHLD, signal.SIG_DFL) mends that)", 1)
    program = find_program()
    try:
        process = subprocess.Popen([program, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                   encoding="utf-8", errors="replace", **how)
    except OSError as error:
        raise ProgramError(f"expected the program eventgan, got what cannot be run ({error.strerror}), in {program}",
                           1) from error
    with process:
        yield process


def _output(*arguments: PathLike) -> str:
    """The program's standard output."""
    with _running(*arguments, stderr=subprocess.PIPE) as process:
        output, errors = process.communicate()
    if process.returncode:
        raise ProgramError(errors.strip().removeprefix("error: ") or _ended(arguments[0], process.returncode),
                           process.returncode)
    return output


def _follow(on_event: Callable[[Event], object], *arguments: PathLike) -> Event:
    """Runs a command with --progress json, calls `on_event` with each event, and returns the report at its end."""
    # In a session of its own: a terminal or a notebook interrupts the whole session, and a second interrupt would drop
    # the current shard.
    event: Event = {}
    report: Event = {}
    told: list[str] = []
    with _running(*arguments, stderr=subprocess.STDOUT, start_new_session=True) as process:
        assert process.stdout
        try:
            for line in process.stdout:
                event = _event_of(line.rstrip("\n"))
                if event["event"] == "error":
                    told.append(event["text"])
                if event["event"] == "report":
                    report = event
                on_event(event)
            process.wait()
        except BaseException:
            _stop(process)
            raise
    if process.returncode:
        raise ProgramError("\n".join(told) or f"{_ended(arguments[0], process.returncode)}: {json.dumps(event)[:1000]}",
                           process.returncode)
    return report or event


def _event_of(line: str) -> Event:
    try:
        event = json.loads(line)
    except ValueError:
        event = None
    if not isinstance(event, dict):
        return {"event": "note", "text": line}  # such as a library's own output
    return {"event": "report", **event}


def _stop(process: subprocess.Popen[str]) -> None:
    """Interrupts the program and waits until it ends; a further interrupt is passed on."""
    assert process.stdout
    while True:
        try:
            process.send_signal(signal.SIGINT)
            process.stdout.read()  # a full pipe would block it
            process.wait()
            return
        except KeyboardInterrupt:
            continue


def _ended(command: PathLike, exit_code: int) -> str:
    return f"eventgan {os.fspath(command)} ended with exit code {exit_code}"


@contextlib.contextmanager
def _manifest_file(manifest: PathLike | Mapping[str, Any]) -> Iterator[PathLike]:
    """The manifest's path; for a dictionary that of a temporary file."""
    if not isinstance(manifest, Mapping):
        yield path_of(manifest, "a manifest, folder, video or recording")
        return
    try:
        temporary = tempfile.NamedTemporaryFile("w", dir=".", prefix="manifest-", suffix=".json", encoding="utf-8")
    except OSError as error:
        raise ProgramError(f"expected a current folder that can be written, since the manifest's relative paths start "
                           f"there, got {os.getcwd()} ({error.strerror}); write the manifest elsewhere and pass its "
                           "path", 1) from error
    with temporary as file:
        json.dump(dict(manifest), file, indent=1, default=os.fspath)
        file.flush()
        try:
            yield file.name
        except ProgramError as error:
            raise ProgramError(str(error).replace(file.name, "manifest"), error.exit_code) from None


class _Shown:
    """Shows the program's warnings as Python's, and its progress as tqdm's bars if wanted and installed."""

    def __init__(self, bars: bool) -> None:
        self._tqdm: Callable[..., Any] | None = None
        self._bar: Any = None
        self._phase: str | None = None
        if bars:
            with contextlib.suppress(ImportError):
                from tqdm.auto import tqdm

                self._tqdm = tqdm

    def __call__(self, event: Event) -> None:
        kind = event.get("event")
        if kind == "warning":
            warnings.warn(event["text"], stacklevel=4)  # where convert was called
        if kind != "progress" or not self._tqdm:
            return
        phase = event.get("phase")
        if self._bar is None or phase != self._phase:
            self.close()
            unit = next((key[:-len("_per_s")] for key in event if key.endswith("_per_s") and key != "mb_per_s"), "")
            self._bar, self._phase = self._tqdm(total=event["total"], desc=phase, unit=" " + unit,
                                                leave=not phase), phase
        self._bar.total = event["total"]
        self._bar.update(event["done"] - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None
