"""The window on a virtual X screen, with keys and a mouse as a person would use them."""

import os
import shutil
import struct
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("pygame", reason="the window needs the extra [play]")
TOOLS = ("Xvfb", "xdotool")
MISSING = [tool for tool in TOOLS if shutil.which(tool) is None]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}"),
]

ARGS = ["+task=ObjectNav", "playground=simple", "seed=3", "task.max_seconds=600"]
PATIENCE_S = 60.0
SERVER = ("Xvfb", "-screen", "0", "1280x720x24", "-nolisten", "tcp", "-displayfd")


class VirtualScreen:
    """An X server that shows nothing, with its picture, keys and mouse."""

    def __init__(self, folder):
        self._file = folder / "Xvfb_screen0"
        reader, writer = os.pipe()
        self.server = subprocess.Popen(
            [*SERVER, str(writer), "-fbdir", str(folder)],
            pass_fds=[writer],
            stderr=subprocess.DEVNULL,
        )
        os.close(writer)
        with os.fdopen(reader) as pipe:
            number = pipe.readline().strip()
        self.environment = {**os.environ, "DISPLAY": f":{number}", "SDL_AUDIODRIVER": "dummy"}
        self.environment.pop("SDL_VIDEODRIVER", None)

    def close(self):
        self.server.terminate()
        self.server.wait(10)

    def press(self, *words):
        """Run xdotool; return what it prints."""
        done = subprocess.run(
            ["xdotool", *words], env=self.environment, capture_output=True, text=True, timeout=30
        )
        return done.stdout.strip()

    def picture(self):
        """The screen, ``(720, 1280, 3)``; the file has the format of xwd."""
        data = self._file.read_bytes()
        header = struct.unpack(">25I", data[:100])
        size, width, height, line, colours = (header[n] for n in (0, 4, 5, 12, 19))
        rows = np.frombuffer(data, np.uint8, height * line, size + 12 * colours)
        return rows.reshape(height, line)[:, : 4 * width].reshape(height, width, 4)[..., 2::-1]


@pytest.fixture
def screen(tmp_path):
    opened = VirtualScreen(tmp_path)
    yield opened
    opened.close()


@pytest.fixture
def game(screen, tmp_path):
    """The command in a window that has the focus."""
    log = tmp_path / "log.txt"
    with log.open("w") as file:
        command = [sys.executable, "-m", "veca_marl.play", *ARGS]
        running = subprocess.Popen(
            command, env=screen.environment, stdout=file, stderr=subprocess.STDOUT
        )
    begun = time.monotonic()
    while not (window := screen.press("search", "--onlyvisible", "--class", ".")):
        assert running.poll() is None, log.read_text()
        assert time.monotonic() - begun < PATIENCE_S
        time.sleep(0.2)
    screen.press("windowfocus", "--sync", window.split()[0])
    until(lambda: screen.picture()[:230, 820:1050].std() > 10.0)
    yield running
    running.kill()
    running.wait(10)


def until(condition):
    begun = time.monotonic()
    while not condition():
        assert time.monotonic() - begun < PATIENCE_S
        time.sleep(0.1)


def left_eye(screen):
    """The panel of the left eye; its title is left out."""
    return screen.picture()[30:230, 820:1050].astype(int)


def still(screen):
    """The picture of the left eye once it does not change any more."""
    before = left_eye(screen)
    for _ in range(100):
        time.sleep(0.3)
        now = left_eye(screen)
        if np.array_equal(before, now):
            return now
        before = now
    raise AssertionError("the eye does not come to rest")


def difference(screen, before):
    return np.abs(left_eye(screen) - before).mean()


def test_keys_and_mouse_steer_the_agent_in_a_real_window(game, screen):
    ahead = still(screen)
    for key in ("w", "Left"):  # walk, turn
        before = still(screen)
        screen.press("keydown", key)
        until(lambda before=before: difference(screen, before) > 3.0)
        screen.press("keyup", key)
        assert not np.array_equal(still(screen), ahead)
    before = still(screen)
    screen.press("mousemove", "1200", "360", "click", "1")  # the eyes turn
    until(lambda: difference(screen, before) > 3.0)
    assert not np.array_equal(still(screen), before)
    screen.press("click", "3")
    until(lambda: difference(screen, before) == 0.0)  # and look ahead again
    screen.press("key", "r")
    until(lambda: difference(screen, ahead) == 0.0)  # the same episode from its start
    screen.press("key", "Escape")
    assert game.wait(PATIENCE_S) == 0
