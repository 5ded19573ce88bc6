"""What a person sees: on terminals of several widths, resized ones, dumb ones, without colours, and in pipes."""

import errno
import fcntl
import os
import pty
import re
import shlex
import shutil
import signal
import struct
import subprocess
import termios
import time
import unittest

import moving_texture
import program

PAIRS = 24
HEIGHT, WIDTH = 160, 240
WIPE = "\r\x1b[J"  # to the start of the row, and everything from there on goes: before messages, and at a phase's end
RED, YELLOW, PLAIN = "\x1b[1;31m", "\x1b[1;33m", "\x1b[0m"
PATIENCE_S = 300


def set_columns(terminal, columns):
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))


def on_terminal(*arguments, columns=80, resized=None, typed=(), expect=0, **environment):
    """Everything the program writes to a pseudo-terminal. `resized`: its columns from the first bar on. `typed`: pairs
    of what has to be there, as a regular expression, and of what a person types then."""
    terminal, other_end = pty.openpty()
    set_columns(terminal, columns)
    process = subprocess.Popen([program.PROGRAM, *map(str, arguments)], stdin=other_end, stdout=other_end,
                               stderr=other_end,
                               env={**os.environ, "TERM": "xterm-256color", "NO_COLOR": "", **environment},
                               start_new_session=True, preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0))
    os.close(other_end)
    written = b""
    typed = list(typed)
    while True:
        try:
            data = os.read(terminal, 1 << 16)
        except OSError as error:
            if error.errno != errno.EIO:  # what Linux says when the other end is closed
                raise
            break
        written += data
        if typed and re.search(typed[0][0], written.decode(errors="replace")):
            os.write(terminal, typed.pop(0)[1])
        if resized and b"\x1b[K" in written:
            set_columns(terminal, resized)
            at_resize, resized = len(written), None
    os.close(terminal)
    text = written.decode()
    if process.wait() != expect:
        raise AssertionError(f"expected exit code {expect}, got {process.returncode}: {text}")
    if "at_resize" in locals():
        return text[:at_resize], text[at_resize:]
    return text


def bars(text):
    """The rows that were drawn to be wiped again."""
    return re.findall(r"\x1b\[\?7l([^\r\n\x1b]+)\x1b\[\?7h\r", text)


class Terminal(program.InFolder):
    @classmethod
    def setUpClass(cls):
        cls.job = program.pathlib.Path(program.tempfile.mkdtemp(prefix="eventgan-"))
        cls.addClassCleanup(shutil.rmtree, cls.job)
        moving_texture.write_images(cls.job / "frames" / "scene", [4 * index for index in range(PAIRS + 1)], HEIGHT,
                                    WIDTH, seed=3)
        cls.manifest, cls.longer = cls.job / "manifest.json", cls.job / "longer.json"  # four times as long
        for path, part in ((cls.manifest, 2), (cls.longer, 1)):
            path.write_text(program.json.dumps(program.manifest(
                [{"dataset": "frames", "root": "frames", "pairs": program.pairs([1])}],
                image={"width": WIDTH // part, "height": HEIGHT // part, "preset": "mpii"},
                generator={"kind": "difference"},
                output={"directory": "out", "samples_per_shard": 6, "dtype": "float32", "deflate_level": 9})))

    def convert(self, manifest=None, **how):
        return on_terminal("convert", manifest or self.manifest, "--output", self.folder / "out", "--overwrite",
                           "--threads", 1, **how)

    def test_the_bar_fits_the_terminal(self):
        for columns in (40, 80, 200):
            with self.subTest(columns=columns):
                text = self.convert(columns=columns)
                drawn = [row for row in bars(text) if "/24 pairs" in row]
                self.assertGreater(len(drawn), 1)
                self.assertLess(max(map(len, drawn)), columns)
                self.assertTrue(all(row.startswith("[") and "left" in row for row in drawn), drawn)
                self.assertEqual("MB/s" in drawn[-1], columns > 40)
                self.assertIn("24/24 pairs", drawn[-1])
                # One row for all of it, which stays: then comes the report.
                before, _, after = text.rpartition(drawn[-1])
                self.assertNotIn("\n", before[before.index(drawn[0]):])
                self.assertTrue(after.startswith("\x1b[?7h\r\r\n24 of 24 pairs written"), after)

    def test_make_demo_shows_how_far_it_is(self):
        text = on_terminal("make-demo", self.folder / "demo")
        drawn = [row for row in bars(text) if "/19 images" in row]  # 12 of a drive and 7 of figures
        self.assertGreater(len(drawn), 1)
        after = text.rpartition(drawn[-1])[2]  # it goes when it is done
        self.assertTrue(after.startswith(f"\x1b[?7h\r{WIPE}a small KITTI, MPII and Human3.6M dataset is in "), after)
        # Elsewhere there are lines, of what takes long.
        self.assertRegex(program.run("make-demo", self.folder / "piped")[1], r"\A(drawing: .* images/s\n)*\Z")

    def test_the_bar_follows_a_resized_terminal(self):
        before, after = self.convert(self.longer, columns=200, resized=40)
        self.assertGreater(max(map(len, bars(before))), 40)
        drawn = bars(after)
        # What was on its way when the terminal became narrow has the old width.
        self.assertLess(max(map(len, drawn[1:])), 40, drawn)
        self.assertIn("24/24 pairs", drawn[-1])

    def test_pipes_and_dumb_terminals_get_lines(self):
        dumb = self.convert(TERM="dumb")
        self.assertNotIn("\x1b", dumb)
        self.assertIn("\n24/24 pairs, 0m00s left", "\n" + dumb.replace("\r", ""))
        out, err = program.run("convert", self.manifest, "--output", self.folder / "piped", "--threads", 1)
        self.assertNotRegex(out + err, r"[\r\x1b]")
        self.assertIn("24/24 pairs", err)

    def test_colours_are_for_errors_and_warnings_alone(self):
        missing = ["convert", self.folder / "none.json"]
        self.assertIn(f"{RED}error: {PLAIN}", on_terminal(*missing, expect=66))
        for environment in [{"NO_COLOR": "1"}, {"TERM": "dumb"}, {"TERM": ""}]:
            self.assertNotIn("\x1b[1", on_terminal(*missing, expect=66, **environment))
        _, err = program.run(*missing, expect=66, environment={"TERM": "xterm-256color"})
        self.assertTrue(err.startswith("error: "), err)

        self.convert()
        record = sorted((self.folder / "out").glob("*-of-*.json"))[0]
        record.write_text("torn")
        text = on_terminal("convert", self.manifest, "--output", self.folder / "out")
        self.assertIn(f"{YELLOW}warning: {PLAIN}{record}", text)
        self.assertIn(f"{YELLOW}warning: {PLAIN}dataset.json and dataset.h5 described {record.stem}", text)
        self.assertEqual(text.count("\x1b[1"), 2, text)
        for row in bars(text):
            self.assertNotIn("\x1b", row)

    def test_a_message_stands_above_the_bar(self):
        self.convert()
        record = sorted((self.folder / "out").glob("*-of-*.json"))[0]
        record.write_text("torn")
        text = on_terminal("convert", self.manifest, "--output", self.folder / "out", NO_COLOR="1")
        self.assertRegex(text, re.escape(WIPE) + r"warning: [^\r\n]*making it again\r\n")

    def test_ctrl_c_is_answered_at_once(self):
        one_shard = program.json.loads(self.longer.read_text())
        one_shard["output"].update(samples_per_shard=PAIRS)
        manifest = self.job / "one_shard.json"
        manifest.write_text(program.json.dumps(one_shard))
        command = ["convert", manifest, "--output", self.folder / "out", "--overwrite", "--threads", 1, "--grace", 3600]
        told = ("stopping: finishing the current shard if it takes at most 3600 s; press Ctrl-C again to quit "
                "immediately")
        begun = (r"\] [1-9]\d*/24 pairs", b"\x03")
        text = on_terminal(*command, typed=[begun])  # that shard is all there is
        before, _, after = text.partition(f"{WIPE}{told}\r\n")
        self.assertNotIn("24/24 pairs", before)
        self.assertGreater(len([row for row in bars(after) if "/24 pairs" in row]), 1, "the bar goes on below")
        self.assertIn("24 of 24 pairs written", after)
        text = on_terminal(*command, typed=[begun, ("again to quit immediately", b"\x03")], expect=-signal.SIGINT)
        self.assertEqual(text.count(told), 1)
        self.assertNotIn("pairs written", text)

    def test_help_fits_80_columns_without_cutting_words(self):
        out, _ = program.run("help")
        commands = re.findall(r"(?m)^  ([a-z-]+) {2,}", out.split("Subcommands:")[1])
        self.assertIn("convert", commands)
        for command in [None, *commands]:
            with self.subTest(command=command):
                out, _ = program.run("help", *([command] if command else []))
                self.assertLessEqual(max(map(len, out.splitlines())), 80)
        texts = re.sub(r"\s+", " ", program.run("help", "convert")[0])  # lines are broken between words
        for words in ["Number of threads; default: all cores",
                      "a bar on a terminal, lines elsewhere; json: machine-readable lines and report"]:
            self.assertIn(words, texts)

    def test_verify_says_how_far_it_is(self):
        large = program.json.loads(self.manifest.read_text())  # there must be something to read
        large["image"].update(height=2 * HEIGHT, width=2 * WIDTH)
        large["output"].update(deflate_level=1)
        manifest = self.job / "large.json"
        manifest.write_text(program.json.dumps(large))
        program.run("convert", manifest, "--output", self.folder / "out")
        text = on_terminal("verify", self.folder / "out", columns=80)
        self.assertRegex(text, r"\[[#.]+\] verifying \d/4 shards, ")
        self.assertIn(WIPE, text)
        report = text[text.rindex(WIPE) + len(WIPE):]  # nothing is left of the bar
        self.assertRegex(report,
                         r"^job-train-00000-of-00004.h5: sound, [\d.]+ [kM]B hashed, 6 samples read, 0 quarantined\r\n")

    @unittest.skipUnless(shutil.which("tmux"), "no tmux")
    def test_one_row_of_a_real_terminal_which_wraps_its_rows_anew(self):
        server = ["tmux", "-L", self.folder.name, "-f", "/dev/null"]
        tmux = lambda *command: subprocess.run([*server, *map(str, command)], capture_output=True,
                                               text=True, check=True).stdout
        script = self.folder / "script"
        convert = shlex.join(map(str, (program.PROGRAM, "convert", self.longer, "--output",
                                       self.folder / "tmux", "--threads", 1)))
        script.write_text(f"seq 15\necho begun\n{convert}\necho exit code $?\nexec sleep 1000\n")
        tmux("new-session", "-d", "-x", 200, "-y", 24, "sh", script)
        self.addCleanup(subprocess.run, [*server, "kill-server"])
        widths = iter([40, 120, 60, 80])
        seen = set()
        deadline = time.monotonic() + PATIENCE_S
        while "exit code" not in (screen := tmux("capture-pane", "-p")):
            self.assertLess(time.monotonic(), deadline, screen)
            done = re.search(r"(\d+)/24 pairs", screen)
            if done and int(done[1]) not in seen and len(seen) < 16:
                seen.add(int(done[1]))
                if len(seen) % 3 == 0 and (width := next(widths, None)):
                    tmux("resize-window", "-x", width, "-y", 24)
            time.sleep(0.02)
        screen = tmux("capture-pane", "-p", "-S", "-")  # with the rows that have left it at the top
        rows = [row for row in screen.splitlines() if row]
        self.assertGreater(len(seen), 3, "the job was too quick to look at")
        rows = rows[rows.index("begun"):]  # tmux pushes the topmost rows out when it wraps others: those of seq
        self.assertEqual(sum("/24 pairs" in row for row in rows), 1, screen)
        self.assertIn("24/24 pairs", rows[1])
        self.assertTrue(rows[2].startswith("24 of 24 pairs written"), screen)


if __name__ == "__main__":
    program.main()
