"""A headless Chromium, driven over the pipe of its DevTools protocol, and its screenshots.

Nothing but the standard library: the protocol's messages are JSON, each ended by a zero byte, on the
descriptors 3 (to the browser) and 4 (from it).
"""

import base64
import json
import os
import select
import shutil
import struct
import subprocess
import tempfile
import time
import zlib

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
SECONDS = 120  # until what does not answer counts as hung


def find():
    """The path of a browser, None without one. OVOID_CHROMIUM names another."""
    asked = os.environ.get("OVOID_CHROMIUM")
    return asked or next((path for path in map(shutil.which, NAMES) if path), None)


class Browser:
    def __init__(self, width, height, program=None):
        self.home = tempfile.mkdtemp(prefix="ovoid-page-")
        to_child, from_us = os.pipe()
        from_child, to_us = os.pipe()

        def pass_pipes():  # to the descriptors 3 and 4, which the pipes themselves may have
            reading, writing = os.dup(to_child), os.dup(to_us)
            os.dup2(reading, 3)
            os.dup2(writing, 4)

        self.process = subprocess.Popen(
            [program or find(), "--headless=new", "--remote-debugging-pipe", "--no-sandbox",
             "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars",
             "--no-first-run", "--disable-extensions", "--disable-background-networking",
             "--disable-component-update", "--disable-sync", "--disable-default-apps",
             "--force-prefers-reduced-motion", "--mute-audio", "--disable-dev-shm-usage",
             f"--window-size={width},{height}", f"--user-data-dir={self.home}", "about:blank"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env={**os.environ, "HOME": self.home}, close_fds=False, preexec_fn=pass_pipes)
        os.close(to_child)
        os.close(to_us)
        self.writing, self.reading = from_us, from_child
        self.left, self.number, self.session = b"", 0, None
        self.events = []
        targets = self.call("Target.getTargets")["targetInfos"]
        page = next(t["targetId"] for t in targets if t["type"] == "page")
        self.session = self.call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(domain + ".enable")
        self.resize(width, height)

    def resize(self, width, height, mobile=False, dark=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=1, mobile=mobile)
        self.call("Emulation.setEmulatedMedia",
                  features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])

    def receive(self, deadline):
        """The next message."""
        while b"\0" not in self.left:
            ready, _, _ = select.select([self.reading], [], [], max(0.0, deadline - time.monotonic()))
            more = os.read(self.reading, 1 << 20) if ready else b""
            if not more:
                raise RuntimeError("the browser does not answer")
            self.left += more
        message, self.left = self.left.split(b"\0", 1)
        return json.loads(message)

    def call(self, method, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self.writing, data):]
        deadline = time.monotonic() + SECONDS
        while True:
            answer = self.receive(deadline)
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self.events.append(answer)

    def ask(self, expression):
        """The value of a JavaScript expression in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True,
                           awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def wait(self, expression):
        """Until it is true in the page. What it waits for is an answer, not a time."""
        deadline = time.monotonic() + SECONDS
        while not self.ask(expression):
            if time.monotonic() > deadline:
                raise RuntimeError(f"in vain: {expression}")
            time.sleep(0.02)

    def open(self, path, fragment=""):
        self.call("Page.navigate", url="about:blank")
        self.events.clear()
        self.call("Page.navigate", url="file://" + os.path.abspath(path) + fragment)
        self.wait("document.readyState === 'complete' && location.protocol === 'file:'")

    def settle(self):
        """Until what was asked for is drawn."""
        self.ask("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def key(self, key):
        for kind in ("keyDown", "keyUp"):
            text = {"text": key} if len(key) == 1 and kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=key, **text)

    def mouse(self, kind, x, y, buttons=0, **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, buttons=buttons,
                  button="left" if buttons or kind == "mouseReleased" else "none",
                  clickCount=0 if kind == "mouseMoved" else 1, **more)

    def click(self, x, y):
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y, 1)
        self.mouse("mouseReleased", x, y)

    def drag(self, x, y, dx, dy):
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y, 1)
        for part in range(1, 5):
            self.mouse("mouseMoved", x + dx * part / 4, y + dy * part / 4, 1)
        self.mouse("mouseReleased", x + dx, y + dy)

    def screenshot(self, path=None):
        png = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        if path:
            with open(path, "wb") as file:
                file.write(png)
        return pixels(png)

    def complaints(self):
        """Errors and warnings of the page, and what it asked the network for."""
        found = []
        for event in self.events:
            method, data = event.get("method"), event.get("params", {})
            if method == "Runtime.exceptionThrown":
                found.append(str(data["exceptionDetails"]))
            elif method == "Runtime.consoleAPICalled" and data["type"] in ("error", "warning"):
                found.append(str([a.get("value") for a in data["args"]]))
            elif method == "Log.entryAdded":
                found.append(data["entry"]["text"])
            elif method == "Network.requestWillBeSent":
                url = data["request"]["url"]
                if not url.startswith(("file:", "data:", "blob:", "about:")):
                    found.append("request of " + url)
        return found

    def close(self):
        self.process.terminate()
        self.process.wait()
        os.close(self.writing)
        os.close(self.reading)
        shutil.rmtree(self.home, ignore_errors=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def pixels(png):
    """Width, height, and bytes of red, green, blue of a PNG file of 8-bit RGB or RGBA."""
    at, packed = 8, b""
    while at < len(png):
        length, kind = struct.unpack(">I4s", png[at:at + 8])
        data = png[at + 8:at + 8 + length]
        if kind == b"IHDR":
            width, height, _, colour = struct.unpack(">IIBB", data[:10])
        elif kind == b"IDAT":
            packed += data
        at += 12 + length
    step = {2: 3, 6: 4}[colour]
    raw, row = zlib.decompress(packed), bytearray(width * step)
    out = bytearray()
    for y in range(height):
        begin = y * (width * step + 1)
        filtering, line = raw[begin], bytearray(raw[begin + 1:begin + 1 + width * step])
        for x in range(len(line) if filtering else 0):
            a = line[x - step] if x >= step else 0
            b = row[x]
            c = row[x - step] if x >= step else 0
            if filtering == 1:
                guess = a
            elif filtering == 2:
                guess = b
            elif filtering == 3:
                guess = (a + b) >> 1
            else:
                guess = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            line[x] = (line[x] + guess) & 255
        row = line
        out += line if step == 3 else bytes(v for i, v in enumerate(line) if i % 4 < 3)
    return width, height, bytes(out)
