"""Headless Chromium, driven through a pipe by its DevTools protocol: no driver, no library."""

import json
import os
import re
import subprocess
import time


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
            [chromium, "--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--disable-gpu", "--disable-dev-shm-usage",
             f"--user-data-dir={profile}", "--remote-debugging-pipe", "about:blank"],
            preexec_fn=as_3_and_4, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_write)
        self._number, self._rest, self.wrong, self.requests = 0, b"", [], []
        self._seen = None
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
            text = what["entry"]["text"]
            # How the software renderer hands its pictures on is no fault of the page.
            if "GL Driver Message (OpenGL, Performance" not in text:
                self.wrong.append(text)
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

    def axe(self) -> str:
        """The source of axe-core, which Chromium carries inside its own tools (Lighthouse); empty: it does not."""
        bundle = "devtools://devtools/bundled/third_party/lighthouse/lighthouse-dt-bundle.js"
        target = self._send("Target.createTarget", url=bundle)["targetId"]
        page, self._session = self._session, None
        self._session = self._send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        text = ""
        for _ in range(100):
            text = self.run("document.readyState === 'complete' ? document.body.textContent : ''")
            if text:
                break
            time.sleep(0.05)
        self._session = page
        self._send("Target.closeTarget", targetId=target)
        # There it is a template literal.
        found = re.search(r"`(/\*! axe v(?:[^`\\]|\\.)*)`", text, re.DOTALL)
        return self.run("`" + found.group(1) + "`") if found else ""

    def before_pages(self, script: str) -> str:
        """Has every page from now on run a script before its own; gives what forget() takes."""
        return self._send("Page.addScriptToEvaluateOnNewDocument", source=script)["identifier"]

    def forget(self, script: str):
        self._send("Page.removeScriptToEvaluateOnNewDocument", identifier=script)

    def mouse(self, kind: str, x: float, y: float, **more):
        """A movement or a button, as a hand would: "mousePressed", "mouseMoved", "mouseReleased", "mouseWheel"."""
        self._send("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def drag(self, x: float, y: float, to_x: float, to_y: float):
        held = {"button": "left", "buttons": 1, "clickCount": 1}
        self.mouse("mousePressed", x, y, **held)
        self.mouse("mouseMoved", to_x, to_y, button="left", buttons=1)
        self.mouse("mouseReleased", to_x, to_y, **held)

    def key(self, key: str):
        for kind in ("keyDown", "keyUp"):
            self._send("Input.dispatchKeyEvent", type=kind, key=key)

    def paper(self, on: bool):
        """As it is printed; a call leaves nothing of what it does not name, so the scheme is named again."""
        self._send("Emulation.setEmulatedMedia", media="print" if on else "", features=self._features)

    def open(self, uri: str, width: int = 1100, height: int = 900, dark: bool = False, drawn: bool = True):
        """Loads a page afresh, with nothing held against it yet; waits until it is drawn, which one that reads itself
        again may never be."""
        self._seen = None
        self.wrong, self.requests = [], []
        self._send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = "dark" if dark else "light"
        self._features = [{"name": "prefers-color-scheme", "value": scheme}]
        self._send("Emulation.setEmulatedMedia", features=self._features)
        self._send("Page.navigate", url=uri)
        while True:
            event = self._receive()
            self._note(event)
            if event.get("method") == "Page.loadEventFired":
                break
        # Whatever a script asked to be drawn has been.
        if drawn:
            self.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def look(self, uri: str, **how):
        """As open(), but a page that the last look loaded so stays: for tests that leave it as it is."""
        if self._seen != (uri, how):
            self.open(uri, **how)
            self._seen = (uri, how)

    def run(self, script: str):
        """The value of an expression, awaited."""
        answer = self._send("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"].get("exception", {}).get("description", "an exception"))
        return answer["result"].get("value")

    def picture(self, element: str = "") -> str:
        """A screenshot, PNG as base64; of an element, named as in style sheets, whole whatever the window shows."""
        if not element:
            return self._send("Page.captureScreenshot", format="png")["data"]
        box = self.run(f"document.querySelector('{element}').getBoundingClientRect().toJSON()")
        scrolled = self.run("[window.scrollX, window.scrollY]")
        clip = {"x": box["x"] + scrolled[0], "y": box["y"] + scrolled[1], "width": box["width"], "height": box["height"],
                "scale": 1}
        return self._send("Page.captureScreenshot", format="png", clip=clip, captureBeyondViewport=True)["data"]
