"""Headless Chromium, driven through a pipe by its DevTools protocol: no driver, no library."""

import json
import os
import subprocess


class Browser:
    """One browser, one page at a time. What goes wrong in a page is kept in `wrong`."""

    def __init__(self, chromium: str, profile: str):
        to_read, self._commands = os.pipe()
        self._answers, to_write = os.pipe()

        def as_3_and_4():
            # Copies first: either end may be 3 or 4 itself.
            read, write = os.dup(to_read), os.dup(to_write)
            os.dup2(read, 3)
            os.dup2(write, 4)

        self._process = subprocess.Popen(
            [chromium, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
             f"--user-data-dir={profile}", "--remote-debugging-pipe", "about:blank"],
            preexec_fn=as_3_and_4, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_write)
        self._number, self._rest, self.wrong, self.requests = 0, b"", [], []
        target = self._send("Target.createTarget", url="about:blank")["targetId"]
        self._session = None
        self._session = self._send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._send(f"{domain}.enable")

    def close(self):
        self._process.kill()
        self._process.wait()

    def _receive(self) -> dict:
        while b"\0" not in self._rest:
            piece = os.read(self._answers, 1 << 16)
            if not piece:
                raise RuntimeError("the browser has gone")
            self._rest += piece
        line, self._rest = self._rest.split(b"\0", 1)
        return json.loads(line)

    def _note(self, event: dict):
        name, what = event.get("method"), event.get("params", {})
        if name == "Runtime.exceptionThrown":
            self.wrong.append(what["exceptionDetails"].get("exception", {}).get("description", "an exception"))
        elif name == "Runtime.consoleAPICalled" and what["type"] in ("error", "warning"):
            self.wrong.append(" ".join(str(a.get("value", a)) for a in what["args"]))
        elif name == "Log.entryAdded" and what["entry"]["level"] in ("error", "warning"):
            self.wrong.append(what["entry"]["text"])
        elif name == "Network.requestWillBeSent" and not what["request"]["url"].startswith(("data:", "blob:")):
            self.requests.append(what["request"]["url"])

    def _send(self, method: str, **parameters) -> dict:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if getattr(self, "_session", None):
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._receive()
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self._note(answer)

    def open(self, uri: str, width: int = 1100, height: int = 900, dark: bool = False):
        """Loads a page afresh, with nothing held against it yet."""
        self.wrong, self.requests = [], []
        self._send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = "dark" if dark else "light"
        self._send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self._send("Page.navigate", url=uri)
        while True:
            event = self._receive()
            self._note(event)
            if event.get("method") == "Page.loadEventFired":
                break
        self.run("new Promise(done => setTimeout(done, 300))")

    def run(self, script: str):
        """The value of an expression, awaited."""
        answer = self._send("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"].get("exception", {}).get("description", "an exception"))
        return answer["result"].get("value")

    def picture(self) -> str:
        """A screenshot, PNG as base64."""
        return self._send("Page.captureScreenshot", format="png")["data"]
