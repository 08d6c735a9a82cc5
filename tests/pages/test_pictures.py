"""Pictures as they were when somebody looked at them and found them right (pictures/).

Compared in cells of 6 by 6 pixels, a letter's size: how edges are smoothed and letters hinted may change from one
Chromium to the next, moves ink by parts of a pixel, and hardly changes a cell's mean; a curve or a label that is gone
or elsewhere changes its cells by more (the last test shows each).
UNFURL_KEEP_PICTURES=1 keeps what is drawn now: look at it before you commit it.
"""

import base64
import io
import os
import pathlib

import numpy as np
import pytest
from PIL import Image

KEPT = pathlib.Path(__file__).parent / "pictures"
CELL = 6  # pixels
CHANGED = 0.05  # of the full range: a curve's 1.5 pixels, half a pixel of them across a cell's edge, are 0.05
MOST = 0.001  # of all cells: of a chart's 12000 the eight letters of its axis cover 18

# Page, what to do before, the element.
PICTURES = {
    "motion": ("simulate", "unfurlPlayers[0].seek(0.4)", ".motion canvas"),
    "chart": ("simulate", "0", "figure.chart"),
    "paths": ("simulate", "0", "figure.paths"),
    "spectra": ("correlate", "0", "figure.chart:last-of-type"),
    "map": ("plan", "0", "figure.paths"),
    "space": ("calibrate", "unfurlSpaces[0].view.render()", ".space canvas"),
    "swing": ("modes", "unfurlPlayers[0].seek(0.002)", ".motion canvas"),
}


def cells(picture):
    """Means over cells of one shade from 0 to 1, by rows."""
    shades = np.asarray(picture.convert("L"), dtype=float) / 255.0
    rows, columns = shades.shape[0] // CELL, shades.shape[1] // CELL
    return shades[:rows * CELL, :columns * CELL].reshape(rows, CELL, columns, CELL).mean(axis=(1, 3))


def changed(one, other):
    """The share of cells that differ; 1 for pictures of unlike size."""
    if one.size != other.size:
        return 1.0
    return float(np.mean(np.abs(cells(one) - cells(other)) > CHANGED))


def drawn(browser, pages, name):
    page, before, element = PICTURES[name]
    browser.open(pages[page].as_uri())
    browser.run(before)
    # What stands above may end within a pixel, and letters would be hinted otherwise.
    browser.run(f"""(function () {{
      const of = document.querySelector({element!r}), top = of.getBoundingClientRect().top + scrollY;
      of.style.position = 'relative';
      of.style.top = `${{Math.round(top) - top}}px`;
    }})()""")
    browser.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return Image.open(io.BytesIO(base64.b64decode(browser.picture(element)))).convert("L")


@pytest.mark.parametrize("name", PICTURES)
def test_looks_as_it_did(browser, pages, name, tmp_path):
    now = drawn(browser, pages, name)
    if os.environ.get("UNFURL_KEEP_PICTURES"):
        KEPT.mkdir(exist_ok=True)
        now.save(KEPT / f"{name}.png", optimize=True)
    share = changed(now, Image.open(KEPT / f"{name}.png"))
    now.save(tmp_path / f"{name}.png")
    assert share <= MOST, f"{share:.1%} of {name}'s cells changed; drawn now: {tmp_path / name}.png, kept: {KEPT}"


def test_what_is_gone_or_elsewhere_is_seen(browser, pages):
    kept = Image.open(KEPT / "chart.png")
    assert changed(kept, kept) == 0.0
    moved = Image.new("L", kept.size, 255)
    moved.paste(kept, (6, 4))
    assert changed(kept, moved) > MOST
    browser.open(pages["simulate"].as_uri())
    for what in ("unfurlCharts.time[0].setVisibility(0, false)",  # a curve
                 "document.head.append(Object.assign(document.createElement('style'),"  # an axis's title
                 " {textContent: '.dygraph-xlabel {visibility: hidden}'}))"):
        browser.run(what + ", 0")
        browser.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        without = Image.open(io.BytesIO(base64.b64decode(browser.picture("figure.chart"))))
        assert changed(kept, without) > MOST, what
        browser.open(pages["simulate"].as_uri())
