"""Headless Chromium through its driver, which speaks WebDriver over HTTP: no package is needed."""

from __future__ import annotations

import base64
import json
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request

import pytest

FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--autoplay-policy=no-user-gesture-required",
    # what a page loads from elsewhere fails
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
]
SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
WITHOUT_GL = ["--disable-gpu", "--disable-3d-apis"]
_DRIVERS = ("chromedriver", "chromium-driver")


def chromium_driver() -> str:
    """Return the path of the driver; skip the test where Chromium is absent."""
    driver = next(filter(None, map(shutil.which, _DRIVERS)), None)
    if driver is None or not (shutil.which("chromium") or shutil.which("google-chrome")):
        pytest.skip("needs Chromium and its driver (Debian: chromium, chromium-driver)")
    return driver


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Browser:
    """A window of a headless Chromium, as a context manager."""

    def __init__(self, profile, size=(1280, 800), flags=SOFTWARE_GL) -> None:
        self._port = _free_port()
        self._process = subprocess.Popen(
            [chromium_driver(), f"--port={self._port}"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        arguments = [
            *FLAGS,
            *flags,
            f"--user-data-dir={profile}",
            f"--window-size={size[0]},{size[1]}",
        ]
        options = {"args": arguments}
        wanted = {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
        try:
            self._wait_for_driver()
            made = self._send("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
        except BaseException:
            self._process.kill()
            self._process.wait()
            raise
        self._session = f"/session/{made['sessionId']}"

    def _wait_for_driver(self) -> None:
        for _ in range(300):
            try:
                self._send("GET", "/status")
                return
            except (urllib.error.URLError, ConnectionError):
                time.sleep(0.1)
        raise RuntimeError("the driver of Chromium does not answer")

    def _send(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            f"http://127.0.0.1:{self._port}{path}",
            data,
            {"Content-Type": "application/json"},
            method=method,
        )
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        try:
            with opener.open(request, timeout=120) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(json.load(error)["value"]["message"]) from None

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        try:
            self._send("DELETE", self._session)
        finally:
            self._process.terminate()
            self._process.wait(timeout=30)

    def open(self, path, address="") -> None:
        """Open a file from disk."""
        self._send("POST", f"{self._session}/url", {"url": f"{path.absolute().as_uri()}{address}"})

    def run(self, script, *arguments):
        """Return what a script returns: ``return document.title``."""
        body = {"script": script, "args": list(arguments)}
        return self._send("POST", f"{self._session}/execute/sync", body)

    def await_(self, script, *arguments):
        """Return what the promise that an expression makes resolves to."""
        wrapped = (
            "const done = arguments[arguments.length - 1];"
            f"(async () => {{ {script} }})().then(done, (e) => done('error: ' + e.message));"
        )
        body = {"script": wrapped, "args": list(arguments)}
        return self._send("POST", f"{self._session}/execute/async", body)

    def wait_until(self, condition, seconds=60.0):
        """Wait until an expression is true."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if value := self.run(f"return {condition}"):
                return value
            time.sleep(0.1)
        raise AssertionError(f"never true: {condition}; console: {self.errors()}")

    def errors(self):
        """Return the console's errors since the last call."""
        log = self._send("POST", f"{self._session}/se/log", {"type": "browser"})
        return [entry["message"] for entry in log if entry["level"] == "SEVERE"]

    def screenshot(self) -> bytes:
        """Return the window as a PNG file."""
        return base64.b64decode(self._send("GET", f"{self._session}/screenshot"))

    def resize(self, width, height) -> None:
        """Set the size of the window."""
        body = {"width": width, "height": height}
        self._send("POST", f"{self._session}/window/rect", body)
