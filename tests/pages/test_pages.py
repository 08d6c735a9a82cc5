"""Pages as a browser shows them: no error, no request, what should be there is, and it moves."""

import os
import subprocess

import pytest

from browser import Browser

PROGRAM, CHROMIUM = os.environ["UNFURL_PROGRAM"], os.environ["UNFURL_CHROMIUM"]


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    one = Browser(CHROMIUM, str(tmp_path_factory.mktemp("profile")))
    yield one
    one.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")

    def run(*arguments):
        subprocess.run([PROGRAM, *arguments, "--quiet"], cwd=folder, check=True)

    for kind in ("boom", "study", "rig"):
        run("new", kind)
    run("simulate", "boom/scene.toml", "-o", "boom.h5", "--report", "simulate.html")
    run("simulate", "study/scene.toml", "-o", "drawn.h5")
    run("correlate", "study/tracks.csv", "drawn.h5", "--report", "correlate.html")
    run("plan", "rig/lab.toml", "--report", "plan.html", "--columns", "9", "--layers", "2")
    run("modes", "boom/scene.toml", "--count", "3", "--report", "modes.html")
    return {name: folder / f"{name}.html" for name in ("simulate", "correlate", "plan", "modes")}


@pytest.mark.parametrize("name", ["simulate", "correlate", "plan", "modes"])
@pytest.mark.parametrize("width", [1100, 390])
def test_opens_without_errors_requests_or_overflow(browser, pages, name, width):
    browser.open(pages[name].as_uri(), width=width)
    assert browser.wrong == [] and browser.requests == [pages[name].as_uri()]
    # Wide tables and pictures scroll in their own frames.
    assert browser.run("document.documentElement.scrollWidth - window.innerWidth") <= 0
    levels = browser.run("Array.from(document.querySelectorAll('h1,h2,h3')).map(h => +h.tagName[1])")
    assert levels[0] == 1 and levels.count(1) == 1
    assert pages[name].stat().st_size < 4e6


def test_charts_of_time_say_so(browser, pages):
    browser.open(pages["simulate"].as_uri())
    labels = browser.run("Array.from(document.querySelectorAll('.dygraph-xlabel')).map(e => e.textContent)")
    assert labels and set(labels) == {"time [s]"}


def test_the_motion_plays_and_takes_the_charts_along(browser, pages):
    browser.open(pages["simulate"].as_uri())
    found = browser.run("""(async function () {
      const player = unfurlPlayers[0], panel = document.querySelector('.motion');
      const canvas = panel.querySelector('canvas'), wait = ms => new Promise(done => setTimeout(done, ms));
      const picture = () => canvas.toDataURL();
      player.seek(0);
      const start = picture();
      panel.querySelector('.play').click();
      await wait(1000);
      panel.querySelector('.play').click();
      const reached = player.time(), moved = picture() !== start;
      await wait(200);
      const stays = player.time() === reached;
      player.seek(0.4);
      const straight = picture();
      const bending = panel.querySelector('.bending');
      bending.value = '50';
      bending.dispatchEvent(new Event('change'));
      const bent = picture() !== straight;
      player.seek(0);
      panel.querySelector('.next').click();
      const line = document.querySelector('.instant');
      return {reached, moved, stays, bent, event: player.time(), left: parseFloat(line.style.left),
              charts: document.querySelectorAll('.instant').length,
              words: panel.querySelector('.clock').textContent};
    })()""")
    assert 0.0 < found["reached"] < 2.0 and found["moved"] and found["stays"] and found["bent"]
    assert found["event"] == pytest.approx(0.80175, abs=1e-4)  # the latch, as the run says
    assert found["charts"] >= 5 and found["left"] > 50
    assert "0.802" in found["words"]
    assert browser.wrong == []


def test_a_click_on_a_chart_sets_the_time(browser, pages):
    browser.open(pages["simulate"].as_uri())
    found = browser.run("""(function () {
      const chart = window.unfurlCharts.time[0], box = chart.graphDiv.getBoundingClientRect();
      const at = {clientX: box.left + chart.toDomXCoord(1.5), clientY: box.top + 40, bubbles: true};
      chart.graphDiv.dispatchEvent(new MouseEvent('mousedown', at));
      chart.graphDiv.dispatchEvent(new MouseEvent('mouseup', at));
      return unfurlPlayers[0].time();
    })()""")
    assert found == pytest.approx(1.5, abs=0.02)


def test_modes_swing_for_ever(browser, pages):
    browser.open(pages["modes"].as_uri())
    assert browser.run("unfurlPlayers.length") == 3
    titles = browser.run("Array.from(document.querySelectorAll('.motion h3')).map(h => h.textContent)")
    assert titles[0].startswith("Mode 1: 2.19")  # Hz, as the terminal says
    found = browser.run("""(async function () {
      const player = unfurlPlayers[2], panel = document.querySelectorAll('.motion')[2];
      const period = 1 / 36.2477;
      player.seek(0.98 * period);
      panel.querySelector('.play').click();
      await new Promise(done => setTimeout(done, 800));
      return {time: player.time() / period, plays: panel.querySelector('.play').textContent};
    })()""")
    assert found["time"] < 0.98 and "Pause" in found["plays"]


def test_measured_marks_lie_over_the_simulated_ones(browser, pages):
    browser.open(pages["correlate"].as_uri())
    marks = browser.run(
        "JSON.parse(document.querySelector('script.motion-data').textContent).marks.map(m => [m.name, m.measured])")
    assert ["tip", False] in marks and ["tip, measured", True] in marks
    keys = browser.run("Array.from(document.querySelectorAll('.motion .key')).map(k => k.textContent)")
    assert "tip, measured" in keys


@pytest.mark.parametrize("dark, paper", [(False, "rgb(255, 255, 255)"), (True, "rgb(27, 33, 42)")])
def test_dark_and_light(browser, pages, dark, paper):
    browser.open(pages["simulate"].as_uri(), dark=dark)
    assert browser.run("getComputedStyle(document.querySelector('.panel')).backgroundColor") == paper
    corner = browser.run("""Array.from(document.querySelector('.motion canvas').getContext('2d')
                            .getImageData(2, 2, 1, 1).data).slice(0, 3)""")
    assert "rgb({}, {}, {})".format(*corner) == paper
