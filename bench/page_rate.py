#!/usr/bin/env python3
"""Frames per second of pages in motion, in headless Chromium's software renderer, and how large the pages are.

    bench/page_rate.py /usr/bin/chromium fit.html correlate.html rig.html ..

Of a page with a player: while it plays, for 5 s. Of a rig in space: while it is turned by a step a frame.
"""

import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "tests" / "pages"))
from browser import Browser  # noqa: E402

# Calls `each` with every frame, for 5 s; how many there were in a second, and the longest wait for one [ms].
RATE = """function (each) {
  return new Promise(function (done) {
    let frames = 0, begin = performance.now(), last = begin, longest = 0;
    (function step() {
      const now = performance.now();
      longest = Math.max(longest, now - last);
      last = now;
      each();
      if (now - begin < 5000) { frames += 1; requestAnimationFrame(step); }
      else done({rate: 1000 * frames / (now - begin), longest});
    })();
  });
}"""


def main():
    chromium, pages = sys.argv[1], [pathlib.Path(name).resolve() for name in sys.argv[2:]]
    with tempfile.TemporaryDirectory() as profile:
        browser = Browser(chromium, profile)
        for page in pages:
            browser.open(page.as_uri())
            found = []
            if browser.run("typeof unfurlPlayers !== 'undefined' && unfurlPlayers.length > 0"):
                browser.run("unfurlPlayers[0].seek(0), document.querySelector('.motion .play').click()")
                found.append(("playing", browser.run(f"({RATE})(() => {{}})")))
            if browser.run("typeof unfurlSpaces !== 'undefined' && unfurlSpaces.length > 0"):
                browser.run("document.querySelector('.space canvas').scrollIntoView()")
                turn = """() => document.querySelector('.space canvas').dispatchEvent(
                    new KeyboardEvent('keydown', {key: 'ArrowRight'}))"""
                found.append(("turning", browser.run(f"({RATE})({turn})")))
            for what, rate in found:
                print(f"{page.name}: {page.stat().st_size / 1e6:.2f} MB, {what}: {rate['rate']:.1f} frames/s, "
                      f"longest wait {rate['longest']:.0f} ms", flush=True)
        browser.close()


if __name__ == "__main__":
    main()
