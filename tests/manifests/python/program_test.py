"""eventgan.init, convert and open: the program called, its messages as exceptions, its progress,
and its end when it is interrupted."""

import json
import os
import pathlib
import pickle
import re
import shutil
import signal
import stat
import subprocess
import sys
import time
import types

import numpy as np
import pytest

import eventgan
from eventgan import program

PROGRAM = os.environ["EVENTGAN_PROGRAM"]
PACKAGE = str(pathlib.Path(eventgan.__file__).parent.parent)
PAIRS, SHARDS = 24, 4  # 12 labelled frames with gaps 1 and 2, 6 pairs a shard


@pytest.fixture(scope="session")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo") / "demo"
    subprocess.run([PROGRAM, "make-demo", folder], check=True, capture_output=True)
    return folder


@pytest.fixture
def job(demo, tmp_path, monkeypatch):
    """A manifest as a dictionary, whose relative paths start at the current folder."""
    (tmp_path / "demo").symlink_to(demo)
    monkeypatch.chdir(tmp_path)
    return {"format": "eventgan-manifest", "version": 1, "name": "job", "seed": 7,
            "sources": [{"dataset": "kitti_object", "root": pathlib.Path("demo/kitti/training"),
                         "pairs": {"gaps": [1, 2], "side": "before", "choose": "all"}}],
            "image": {"width": 64, "height": 24, "preset": "mpii"}, "generator": {"kind": "difference"},
            "output": {"directory": "out", "samples_per_shard": PAIRS // SHARDS}}


@pytest.fixture
def in_the_programs_place(tmp_path, monkeypatch):
    """A program of these lines of Python instead of eventgan."""
    def write(*lines):
        path = tmp_path / "instead"
        path.write_text("\n".join(["#!" + sys.executable, "import json, os, signal, sys, time", *lines]))
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("EVENTGAN_PROGRAM", str(path))
    return write


def said_of(*arguments):
    """Exit code and message of the program itself."""
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
    return done.returncode, done.stderr.strip().removeprefix("error: ")


def files():
    return sorted(path.name for path in pathlib.Path().iterdir())


def test_a_drafted_manifest_is_converted(demo, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    manifest = eventgan.init("kitti_object", demo / "kitti" / "training")
    assert manifest == pathlib.Path("manifest.json") and "// KITTI object: 12 labelled frames" in manifest.read_text()
    text, count = re.subn(r'^  "generator": .*$', '  "generator": { "kind": "difference" },', manifest.read_text(),
                          flags=re.M)
    assert count == 1
    manifest.write_text(text)
    shards = eventgan.convert(manifest, progress=False)
    assert len(shards) == 12 and {path.parent for path in shards.paths} == {tmp_path / "out" / "kitti-events"}
    assert pathlib.Path("out/kitti-events/dataset.json").exists()
    with pytest.raises(eventgan.ProgramError,
                       match="expected the name of a new file, got an existing one, in manifest.json") as caught:
        eventgan.init(demo / "kitti" / "training")
    assert caught.value.exit_code == 64
    assert eventgan.init(demo / "kitti" / "training", demo / "mpii", out="two.json").read_text().count('"dataset"') == 2


def test_a_dictionary_is_converted_as_a_file_of_the_current_folder(job):
    before, events = files(), []
    shards = eventgan.convert(job, progress=events.append)
    assert len(shards) == PAIRS and len(shards.paths) == SHARDS
    assert files() == sorted([*before, "out"])  # no manifest is left
    assert shards[0]["volume"].shape == (18, 24, 64) and pathlib.Path(shards[0]["pair"]["next_path"]).is_file()
    pathlib.Path("manifest.json").write_text(
        json.dumps({**job, "sources": [{**job["sources"][0], "root": "demo/kitti/training"}]}))
    same = eventgan.convert("manifest.json", "same", threads=1)
    for i in range(PAIRS):
        np.testing.assert_array_equal(shards[i]["volume"], same[i]["volume"])

    progress = [event for event in events if event["event"] == "progress" and "phase" not in event]
    assert progress[-1]["done"] == progress[-1]["total"] == PAIRS
    converted, finalized = (event for event in events if event["event"] == "report")
    assert (converted["shards_done_before"], converted["written"]) == (0, PAIRS)
    assert converted["folder"] == finalized["folder"] == os.path.abspath("out") and finalized["valid"] == PAIRS
    events.clear()
    assert len(eventgan.convert(job, progress=events.append)) == PAIRS  # what is there stays
    converted, _ = (event for event in events if event["event"] == "report")
    assert converted["shards_done_before"] == SHARDS


def test_a_trial_of_some_classes(demo, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shards = eventgan.convert(demo / "kitti" / "training", limit=3, classes=["Car"], progress=False)
    assert len(shards) == 3 and shards.paths[0].parent.name == "kitti-events-trial-3"
    assert shards.known_classes() == ["Car", "DontCare"]
    with pytest.raises(eventgan.ProgramError, match="expected classes of the source .*, got Cra"):
        eventgan.convert(demo / "kitti" / "training", tmp_path / "new", classes=["Cra"], progress=False)


@pytest.mark.parametrize("call, message", [
    (lambda: eventgan.init("/nonexistent"), "expected a folder or a video, got 'No such file or directory', in /non"),
    (lambda: eventgan.init(3), "expected the path of a folder, video or recording, got 3"),
    (lambda: eventgan.convert(3), "expected the path of a manifest, folder, video or recording, got 3"),
    (lambda: eventgan.convert("/", output=3), "expected the path of a folder, got 3"),
    (lambda: eventgan.convert("/", classes="Car"), r"expected a list of classes, such as \['person'\], got 'Car'"),
    (lambda: eventgan.Shards(3), "expected the path of a folder of shards, or a shard, got 3")])
def test_wrong_arguments_get_a_sentence(call, message):
    with pytest.raises((ValueError, eventgan.ProgramError), match=message):
        call()


def test_all_shards_are_made_whatever_a_cluster_says(job, monkeypatch):
    monkeypatch.setenv("SHARD_INDEX", "1")
    monkeypatch.setenv("SHARD_COUNT", "2")
    assert len(eventgan.convert(job, progress=False)) == PAIRS


def test_a_folder_is_converted_as_init_proposes(demo, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(eventgan.ProgramError) as caught:
        eventgan.convert(tmp_path, out)
    assert (caught.value.exit_code, str(caught.value)) == said_of("convert", tmp_path, "--output", out)
    assert caught.value.exit_code == 66
    labelled = tmp_path / "training"
    shutil.copytree(demo / "kitti" / "training", labelled)
    assert len(eventgan.convert(labelled, out, progress=False)) == 12 and (out / "manifest.json").exists()


@pytest.mark.parametrize("change", [{"sources": []}, {"image": {"width": 0, "height": 24}}, {"nobody": 1},
                                    {"generator": {"weights": "absent.safetensors"}}])
def test_what_is_wrong_with_a_manifest_is_told_in_the_programs_words(job, change):
    job["sources"][0]["root"] = "demo/kitti/training"
    pathlib.Path("manifest.json").write_text(json.dumps({**job, **change}))
    exit_code, text = said_of("convert", "manifest.json")
    assert (exit_code,
            "absent.safetensors" in text) == (66, True) or (exit_code, text[:17]) == (64, "manifest.json: $.")
    for manifest in ("manifest.json", {**job, **change}):
        with pytest.raises(eventgan.ProgramError) as caught:
            eventgan.convert(manifest)
        assert caught.value.exit_code == exit_code
        assert str(caught.value) == (text if manifest == "manifest.json" else text.replace("manifest.json", "manifest"))
    copy = pickle.loads(pickle.dumps(caught.value))
    assert (type(copy), str(copy), copy.exit_code) == (eventgan.ProgramError, str(caught.value), exit_code)
    assert not list(pathlib.Path().glob("manifest-*"))


def test_too_many_samples_in_quarantine(job, demo):
    pathlib.Path("demo").unlink()
    shutil.copytree(demo, "demo")
    image = sorted(pathlib.Path("demo/kitti/training/image_2").iterdir())[0]
    image.write_bytes(image.read_bytes()[:-40])
    job["errors"] = {"policy": "quarantine", "max_count": 0, "max_fraction": 0}
    with pytest.raises(eventgan.ProgramError, match="expected .* got 2 of 24") as caught:
        eventgan.convert(job)
    assert caught.value.exit_code == 65
    job["errors"]["max_count"], job["errors"]["max_fraction"] = 2, 1
    assert len(eventgan.convert(job, "lenient")) == PAIRS - 2


def test_a_program_that_is_not_there(job, monkeypatch, tmp_path):
    monkeypatch.setenv("EVENTGAN_PROGRAM", str(tmp_path / "nowhere"))
    for call in (lambda: eventgan.init("demo"), lambda: eventgan.convert(job)):
        with pytest.raises(FileNotFoundError,
                           match=r"expected the program eventgan, got none, in .*/nowhere \(EVENTGAN_PROGRAM\)"):
            call()
    (tmp_path / "nowhere").write_text("no program")
    with pytest.raises(FileNotFoundError, match="nowhere"):  # not executable
        eventgan.init("demo")
    monkeypatch.delenv("EVENTGAN_PROGRAM")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(program, "__file__", str(tmp_path / "a" / "b" / "eventgan" / "program.py"))
    with pytest.raises(FileNotFoundError, match="got none beside the package, on the PATH, or in EVENTGAN_PROGRAM"):
        eventgan.init("demo")


def test_where_the_program_is_looked_for(tmp_path, monkeypatch):
    def executable(*path):
        path = tmp_path.joinpath(*path)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("#!/bin/sh\n")
        path.chmod(0o755)
        return str(path)

    def found(*package):
        monkeypatch.setattr(program, "__file__", str(tmp_path.joinpath(*package, "eventgan", "program.py")))
        return program.find_program()

    monkeypatch.delenv("EVENTGAN_PROGRAM")
    on_path = executable("path", "eventgan")
    monkeypatch.setenv("PATH", str(tmp_path / "path"))
    assert found("site") == on_path
    (tmp_path / "build" / "eventgan").mkdir(parents=True)  # a folder is none
    assert found("build", "python") == on_path
    assert found("prefix", "lib", "python3", "dist-packages") == on_path
    installed, built = executable("prefix", "bin", "eventgan"), executable("tree", "eventgan")
    assert found("prefix", "lib", "python3", "dist-packages") == installed
    (tmp_path / "sources" / "eventgan").mkdir(parents=True)
    (tmp_path / "tree" / "python").mkdir()
    (tmp_path / "tree" / "python" / "eventgan").symlink_to(tmp_path / "sources" / "eventgan")
    assert found("tree", "python") == built
    monkeypatch.setenv("EVENTGAN_PROGRAM", on_path)
    assert found("tree", "python") == on_path


def test_a_bar_where_tqdm_is(job, monkeypatch, in_the_programs_place):
    bars = []

    class Bar:
        def __init__(self, total, desc, unit, leave):
            self.total, self.n, self.made_with, self.closed = total, 0, (desc, unit, leave), 0
            bars.append(self)

        def __len__(self):
            raise TypeError("a bar of no known length")

        def update(self, count):
            self.n += count

        def close(self):
            self.closed += 1

    monkeypatch.setitem(sys.modules, "tqdm.auto", types.SimpleNamespace(tqdm=Bar))
    eventgan.convert(job)
    assert (bars[-1].n, bars[-1].total, bars[-1].made_with) == (PAIRS, PAIRS, (None, " pairs", True))
    assert [bar.closed for bar in bars] == [1] * len(bars)
    in_the_programs_place("for event in ({'phase': 'planning', 'done': 2, 'total': 9, 'files_per_s': 1}, {'done': 3, "
                          "'total': 5, 'mb_per_s': 1, 'pairs_per_s': 1},",
                          "              {'done': 4, 'total': 6, 'mb_per_s': 1, 'pairs_per_s': 1}):",
                          "    print(json.dumps({'event': 'progress', **event}))", "sys.exit(1)")
    bars.clear()
    with pytest.raises(eventgan.ProgramError, match="eventgan convert ended with exit code 1"):
        eventgan.convert(job)
    assert [(bar.n, bar.total, bar.made_with, bar.closed) for bar in bars] == [
        (2, 9, ("planning", " files", False), 1), (4, 6, (None, " pairs", True), 1)]
    bars.clear()
    with pytest.raises(eventgan.ProgramError, match="exit code 1"):
        eventgan.convert(job, progress=False)
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)  # not installed
    with pytest.raises(eventgan.ProgramError, match="exit code 1"):
        eventgan.convert(job)
    assert not bars


def test_warnings_and_what_is_no_json(job, in_the_programs_place):
    in_the_programs_place("print('a library says so', flush=True)",
                          "print(json.dumps({'event': 'warning', 'text': 'beware'}), flush=True)",
                          "print('[1, 2]', flush=True)", "os.kill(os.getpid(), signal.SIGKILL)")
    with pytest.warns(UserWarning, match="beware") as warned, pytest.raises(eventgan.ProgramError,
                                                                            match="ended with exit code -9") as caught:
        eventgan.convert(job)
    assert warned[0].filename == __file__ and caught.value.exit_code == -9
    events = []
    with pytest.raises(eventgan.ProgramError, match="exit code -9"):
        eventgan.convert(job, progress=events.append)
    assert events == [{"event": "note", "text": "a library says so"}, {"event": "warning", "text": "beware"},
                      {"event": "note", "text": "[1, 2]"}]


def test_a_report_longer_than_a_pipe(job, in_the_programs_place):
    in_the_programs_place("print(json.dumps({'event': 'error', 'text': 'x' * 300000}))", "sys.exit(66)")
    with pytest.raises(eventgan.ProgramError) as caught:
        eventgan.convert(job)
    assert len(str(caught.value)) == 300000


def test_a_library_may_speak_last(job, in_the_programs_place):
    eventgan.convert(job, progress=False)
    in_the_programs_place("print(json.dumps({'event': 'report', 'folder': 'out'}))", "print('goodbye')")
    assert len(eventgan.convert(job, progress=False)) == PAIRS


COUNTS_INTERRUPTS = ["def interrupted(*_):", "    with open('interrupts', 'a') as file:", "        file.write('.')",
                     "signal.signal(signal.SIGINT, interrupted)",
                     "print(json.dumps({'event': 'note', 'text': 'ready'}), flush=True)"]


@pytest.mark.parametrize("interrupts", [1, 2])
def test_an_interrupt_reaches_the_program_once_and_it_is_awaited(job, in_the_programs_place, interrupts):
    """A terminal interrupts all processes of a group, and the program would drop its shard at the second time."""
    in_the_programs_place(*COUNTS_INTERRUPTS,
                          f"while not os.path.exists('interrupts') or os.path.getsize('interrupts') < {interrupts}:",
                          "    time.sleep(0.01)", "print('y' * 300000, flush=True)", "time.sleep(0.3)",
                          "open('ended', 'w').close()", "sys.exit(75)")
    code = (f"import eventgan, json; eventgan.convert({json.dumps(job, default=str)}, progress=lambda event: "
            "print('ready', flush=True))")
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          start_new_session=True, env={**os.environ, "PYTHONPATH": PACKAGE}) as python:
        assert python.stdout.readline() == "ready\n"
        for count in range(1, interrupts + 1):
            os.killpg(python.pid, signal.SIGINT)
            while python.poll() is None and (not os.path.exists("interrupts") or os.path.getsize("interrupts") < count):
                time.sleep(0.01)
        assert "KeyboardInterrupt" in python.communicate(timeout=60)[1]
    assert os.path.exists("ended") and os.path.getsize("interrupts") == interrupts
    assert not list(pathlib.Path().glob("manifest-*"))


def test_what_goes_wrong_in_ones_own_progress_ends_the_program(job, in_the_programs_place):
    in_the_programs_place(*COUNTS_INTERRUPTS, "while not os.path.exists('interrupts'): time.sleep(0.01)",
                          "open('ended', 'w').close()")
    with pytest.raises(ZeroDivisionError):
        eventgan.convert(job, progress=lambda event: 1 / 0)
    assert os.path.exists("ended") and os.path.getsize("interrupts") == 1


def test_an_interrupted_job_leaves_whole_shards_and_goes_on(job):
    job["output"]["samples_per_shard"] = 1
    # a tenth of a second or more each
    job["generator"], job["image"] = {"weights": "untrained:16"}, {"width": 1242, "height": 375, "preset": "mpii"}
    job["sources"][0]["root"] = "demo/kitti/training"

    def interrupt(event):
        if event["event"] == "progress" and event["done"]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        eventgan.convert(job, threads=1, progress=interrupt)
    assert not [name for name in os.listdir("out") if name.endswith(".tmp")]
    done = len(list(pathlib.Path("out").glob("*-of-*.h5")))
    assert 0 < done < PAIRS
    with pytest.raises(ValueError, match=rf"expected {PAIRS} finished shards.*: {done} of {PAIRS} shards are done, 0 "
                       r"in work; `eventgan convert`"):
        eventgan.open("out")
    assert len(eventgan.open("out", partial=True)) == done


def test_open(job, monkeypatch):
    eventgan.convert(job, progress=False)
    assert len(eventgan.open("out", where={"gap": 1})) == PAIRS / 2
    with pytest.raises(ValueError, match="^expected a split of train, got 'test', in out$"):
        eventgan.open("out", split="test")
    with pytest.raises(FileNotFoundError, match="nowhere"):
        eventgan.open("nowhere")
    os.mkdir("empty")
    with pytest.raises(ValueError, match="^expected finished shards, got none, in empty$"):
        eventgan.open("empty")
    pathlib.Path("out/dataset.json").unlink()
    sorted(pathlib.Path("out").glob("*-of-*.json"))[0].unlink()
    with pytest.raises(ValueError, match=r"got 1 unfinished .*: 3 of 4 shards are done, 0 in work; `eventgan convert`, "
                       r"or eventgan.convert, of the same"):
        eventgan.open("out")
    monkeypatch.setenv("EVENTGAN_PROGRAM", "nowhere")
    with pytest.raises(ValueError, match=r"got 1 unfinished .* uses the others\)$"):
        eventgan.open("out")


def test_an_output_whose_name_is_not_utf_8(job):
    folder = os.fsdecode(b"out-\xff")
    assert len(eventgan.convert(job, folder, progress=False)) == PAIRS
    assert (pathlib.Path(folder) / "dataset.json").exists()


@pytest.mark.parametrize("lines", [["print('hello')"], ["pass"], ["print(json.dumps({'done': 1}))"]])
def test_a_program_that_is_another(job, in_the_programs_place, lines):
    in_the_programs_place(*lines)
    with pytest.raises(eventgan.ProgramError, match="expected a report of the program eventgan, got .*, from .*inst"):
        eventgan.convert(job, progress=False)


def test_what_is_no_program(job, tmp_path, monkeypatch):
    (tmp_path / "nothing").write_bytes(b"\x7fELF")
    (tmp_path / "nothing").chmod(0o755)
    monkeypatch.setenv("EVENTGAN_PROGRAM", str(tmp_path / "nothing"))
    for call in (lambda: eventgan.convert(job, progress=False), lambda: eventgan.init("demo")):
        with pytest.raises(eventgan.ProgramError, match="got what cannot be run .*, in .*nothing"):
            call()


def test_a_process_that_ignores_how_its_programs_end(job):
    before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        for call in (lambda: eventgan.convert(job, progress=False), lambda: eventgan.init("nowhere")):
            with pytest.raises(eventgan.ProgramError, match="got one that ignores SIGCHLD"):
                call()
    finally:
        signal.signal(signal.SIGCHLD, before)


def test_a_current_folder_that_cannot_be_written(job, monkeypatch):
    def refused(*_, **__):
        raise PermissionError(13, "Permission denied", "./manifest-x.json")
    monkeypatch.setattr(program.tempfile, "NamedTemporaryFile", refused)  # root may write everywhere
    with pytest.raises(eventgan.ProgramError, match="a current folder that can be written, .*Permission denied"):
        eventgan.convert(job, progress=False)
