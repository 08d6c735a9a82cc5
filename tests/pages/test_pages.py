"""Pages as a browser shows them: no error, no request, what should be there is, and it moves."""

import subprocess
import time
from xml.etree import ElementTree

import pytest

from conftest import NAMES, PROGRAM, WHERE


@pytest.fixture(scope="session")
def axe(browser):
    return browser.axe()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("where", WHERE)
def test_opens_without_errors_requests_or_overflow(browser, pages, axe, name, where):
    browser.look(pages[name].as_uri(), **WHERE[where])
    assert browser.wrong == [] and browser.requests == [pages[name].as_uri()]
    # Wide tables and pictures scroll in their own frames.
    assert browser.run("document.documentElement.scrollWidth - window.innerWidth") <= 0
    levels = browser.run("Array.from(document.querySelectorAll('h1,h2,h3')).map(h => +h.tagName[1])")
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(below - above <= 1 for above, below in zip(levels, levels[1:]))
    assert pages[name].stat().st_size < 4e6
    # A Chromium without its own tools carries none. Colours and the order of things are of all pages: half of them
    # are looked at on the desk, half on a telephone in the dark.
    if not axe or (NAMES.index(name) % 2 == 0) != (where == "desk"):
        return
    browser.run(axe + ";0")
    # Drawings have a name each; within them there is nothing to look at for axe but time.
    assert browser.run("""axe.run({exclude: [['svg']]}).then(r => r.violations.map(v =>
        `${v.id}: ${v.help}: ${v.nodes.slice(0, 3).map(n => n.html.slice(0, 150)).join(' | ')}`))""") == []


@pytest.mark.parametrize("name", ["calibrate", "check", "correlate", "reconstruct"])
@pytest.mark.parametrize("where", ["desk"])
def test_residuals_are_drawn_as_people_judge_them(browser, pages, name, where):
    browser.look(pages[name].as_uri(), **WHERE[where])
    titles = browser.run("Array.from(document.querySelectorAll('h2,h3,figcaption,caption')).map(e => e.textContent)")
    for wanted in ["Against a normal distribution", "Residuals by"]:
        assert any(title.startswith(wanted) for title in titles), titles
    assert any("neighbours" in title or "utocorrelation" in title for title in titles), titles


@pytest.mark.parametrize("name, where", [("simulate", "desk")])
def test_charts_of_time_say_so(browser, pages, name, where):
    browser.look(pages[name].as_uri(), **WHERE[where])
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
      const began = performance.now();
      panel.querySelector('.play').click();
      while (player.time() === 0) await wait(100);
      await wait(500);
      panel.querySelector('.play').click();
      const reached = player.time(), moved = picture() !== start;
      const took = (performance.now() - began) / 1000 * +panel.querySelector('.speed').value;
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
      return {reached, took, moved, stays, bent, event: player.time(), left: parseFloat(line.style.left),
              charts: document.querySelectorAll('.instant').length,
              words: panel.querySelector('.clock').textContent};
    })()""")
    # A frame is drawn for when it will be shown: a hundredth of a second ahead.
    assert 0.0 < found["reached"] <= found["took"] + 0.1 and found["moved"] and found["stays"] and found["bent"]
    assert found["event"] == pytest.approx(0.80175, abs=1e-4)  # the latch, as the run says
    assert found["charts"] >= 5 and found["left"] > 50
    assert "0.802" in found["words"]
    assert browser.wrong == []


def test_the_pointer_names_what_it_is_at(browser, pages):
    browser.open(pages["simulate"].as_uri())
    found = browser.run("""(function () {
      const canvas = document.querySelector('.motion canvas'), box = canvas.getBoundingClientRect();
      const context = canvas.getContext('2d'), written = [], write = context.fillText;
      context.fillText = function (text) { written.push(text); return write.apply(context, arguments); };
      unfurlPlayers[0].seek(0);
      written.length = 0;
      for (let x = 0; x < box.width; x += 6) {
        for (let y = 0; y < box.height; y += 6) {
          canvas.dispatchEvent(new PointerEvent('pointermove', {clientX: box.left + x, clientY: box.top + y}));
        }
      }
      const over = Array.from(new Set(written));
      written.length = 0;
      canvas.dispatchEvent(new PointerEvent('pointerleave', {}));
      const data = JSON.parse(document.querySelector('script.motion-data').textContent);
      return {over, after: written, names: data.marks.concat(data.pins).map(m => m.name)};
    })()""")
    named = set(found["names"]) & set(found["over"])
    assert len(named) >= 2  # at the start some stand on one another
    assert not named & set(found["after"])
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
    titles = browser.run("Array.from(document.querySelectorAll('.motion h2, .motion h3')).map(h => h.textContent)")
    assert titles[0].startswith("Mode 1: 2.19")  # Hz, as the terminal says
    found = browser.run("""(async function () {
      const player = unfurlPlayers[2], panel = document.querySelectorAll('.motion')[2];
      const period = 1 / 36.2477;
      player.seek(0.98 * period);
      panel.querySelector('.play').click();
      while (player.time() >= 0.98 * period) await new Promise(done => setTimeout(done, 100));
      return {time: player.time() / period, plays: panel.querySelector('.play').textContent};
    })()""")
    assert found["time"] < 0.98 and "Pause" in found["plays"]


@pytest.mark.parametrize("name, where", [("correlate", "desk")])
def test_measured_marks_lie_over_the_simulated_ones(browser, pages, name, where):
    browser.look(pages[name].as_uri(), **WHERE[where])
    marks = browser.run(
        "JSON.parse(document.querySelector('script.motion-data').textContent).marks.map(m => [m.name, m.measured])")
    assert ["tip", False] in marks and ["tip, measured", True] in marks
    keys = browser.run("Array.from(document.querySelectorAll('.motion .key')).map(k => k.textContent)")
    assert "tip, measured" in keys


# A pendulum that an encoder alone recorded.
@pytest.mark.parametrize("name, where", [("fit", "desk")])
def test_the_structure_at_the_estimate_moves(browser, pages, name, where):
    browser.look(pages[name].as_uri(), **WHERE[where])
    names = browser.run("""(() => {
      const motion = JSON.parse(document.querySelector('script.motion-data').textContent);
      return [motion.lines.map(l => l.name), motion.pins.map(p => p.name)];
    })()""")
    assert "arm" in names[0] and "hinge" in names[1]


@pytest.mark.parametrize("name", ["simulate"])
@pytest.mark.parametrize("where, paper", zip(WHERE, ["rgb(255, 255, 255)", "rgb(27, 33, 42)"]))
def test_dark_and_light(browser, pages, name, where, paper):
    browser.look(pages[name].as_uri(), **WHERE[where])
    assert browser.run("getComputedStyle(document.querySelector('.panel')).backgroundColor") == paper
    corner = browser.run("""Array.from(document.querySelector('.motion canvas').getContext('2d')
                            .getImageData(2, 2, 1, 1).data).slice(0, 3)""")
    assert "rgb({}, {}, {})".format(*corner) == paper


def test_a_page_is_printed_where_chromium_is(pages):
    folder = pages["plan"].parent
    plan = [PROGRAM, "plan", "rig/lab.toml", "--columns", "3", "--report", "printed.html", "--pdf"]
    done = subprocess.run([*plan, "a page.pdf"], cwd=folder, check=True, capture_output=True, text=True)
    assert done.stdout.endswith("-> a page.pdf\n") and done.stderr == ""
    printed = (folder / "a page.pdf").read_bytes()
    # Text stays text: fonts are in it; and the still of the view in space, which is drawn by lines.
    assert printed.startswith(b"%PDF-") and b"/FontFile" in printed and len(printed) < 4e6
    (folder / "printed.html").unlink()
    lacking = subprocess.run([*plan, "b.pdf"], cwd=folder, capture_output=True, text=True, env={"PATH": "/nowhere"})
    assert lacking.returncode == 4 and lacking.stderr.count("\n") == 1 and "apt install chromium" in lacking.stderr
    assert not (folder / "b.pdf").exists() and not (folder / "printed.html").exists()
    alone = subprocess.run([PROGRAM, "plan", "rig/lab.toml", "--pdf", "c.pdf"], cwd=folder, capture_output=True, text=True)
    assert alone.returncode == 2 and "--report" in alone.stderr


def saved(browser, figure, kind):
    """What a click on a button beneath a figure would save: its name, and its text or the size of its picture."""
    return browser.run("""(async function () {
      const got = new Promise(done => { window.unfurlSave = (blob, name) => done([blob, name]); });
      Array.from(document.querySelectorAll('%s .exports button')).find(b => b.textContent === '%s').click();
      const [blob, name] = await got;
      if (blob.type !== 'image/png') return {name, text: await blob.text()};
      const image = await createImageBitmap(blob), canvas = document.createElement('canvas');
      canvas.width = image.width; canvas.height = image.height;
      const pen = canvas.getContext('2d');
      pen.drawImage(image, 0, 0);
      const shades = new Set(pen.getImageData(0, 0, image.width, image.height).data);
      return {name, width: image.width, shades: shades.size};
    })()""" % (figure, kind))


def test_charts_are_saved_as_numbers_and_pictures(browser, pages):
    browser.open(pages["simulate"].as_uri())
    data = browser.run("JSON.parse(document.querySelector('script.chart-data').textContent)")
    csv = saved(browser, "figure.chart", "CSV")
    rows = [line.split(",") for line in csv["text"].splitlines()]
    assert csv["name"].endswith(".csv") and rows[0][0] == '"time [s]"'
    assert len(rows[0]) == 1 + len(data["series"]) and {len(row) for row in rows} == {len(rows[0])}
    for k, series in enumerate(data["series"]):
        here = {float(row[0]): float(row[k + 1]) for row in rows[1:] if row[k + 1]}
        assert here == {x: y for x, y in zip(data["axes"][series["axis"]], series["y"]) if y is not None}
    svg = saved(browser, "figure.chart", "SVG")
    root = ElementTree.fromstring(svg["text"])
    words = [e.text for e in root.iter("{http://www.w3.org/2000/svg}text")]
    assert "time [s]" in words and data["y"]["title"] in words
    assert {s["name"] for s in data["series"]} < set(words)
    png = saved(browser, "figure.chart", "PNG")
    assert png["width"] == 2 * int(root.get("width")) and png["shades"] > 10
    drawing = saved(browser, "figure.paths", "SVG")
    ElementTree.fromstring(drawing["text"])
    assert saved(browser, "figure.paths", "PNG")["shades"] > 10
    browser.open(pages["plan"].as_uri())
    cells = saved(browser, "figure.paths", "CSV")["text"].splitlines()
    assert cells[0].startswith('"pane","x [m]","y [m]"') and len(cells) == 1 + 9 * 9 * 2
    assert browser.wrong == []


SPACES = ("plan", "calibrate", "check", "reconstruct")


@pytest.mark.parametrize("name", SPACES)
@pytest.mark.parametrize("where", ["desk"])
def test_a_rig_stands_in_space(browser, pages, name, where):
    browser.look(pages[name].as_uri(), **WHERE[where])
    found = browser.run("""(function () {
      const space = unfurlSpaces[0], data = JSON.parse(document.querySelector('script.space-data').textContent);
      const visible = e => e && e.getClientRects().length > 0;
      return {eyes: data.eyes.map(e => e.name), fields: data.eyes.map(e => e.field.length),
              tags: Array.from(document.querySelectorAll('.tags span')).map(e => e.textContent),
              still: visible(document.querySelector('.space .still')),
              canvas: visible(document.querySelector('.space canvas')),
              ellipsoids: data.ellipsoids.map(e => e.name), chosen: space.chosen(),
              words: document.querySelector('.space .chosen').textContent};
    })()""")
    assert found["eyes"] == ["door", "window", "bench", "crane"] and found["fields"] == [4] * 4
    assert set(found["eyes"]) < set(found["tags"]) and "z [m]" in found["tags"]
    assert found["canvas"] and not found["still"]
    if name == "plan":
        assert found["ellipsoids"] == ["all cameras"] + ["without " + eye for eye in found["eyes"]]
    else:
        assert found["chosen"] >= 0 and "seen by door" in found["words"]


# How far apart two pictures of one view are, as a share of the full range, mean over all pixels.
DIFFERENCE = """async function (one, other) {
  const pixels = async source => {
    const image = new Image();
    image.src = source;
    await image.decode();
    const canvas = document.createElement('canvas');
    canvas.width = image.width; canvas.height = image.height;
    const pen = canvas.getContext('2d');
    pen.drawImage(image, 0, 0);
    return pen.getImageData(0, 0, image.width, image.height).data;
  };
  const a = await pixels(one), b = await pixels(other);
  let sum = 0;
  for (let k = 0; k < a.length; k++) sum += Math.abs(a[k] - b[k]);
  return a.length === b.length ? sum / a.length / 255 : 1;
}"""


def test_a_space_is_turned_by_keys_and_mouse_and_comes_back(browser, pages):
    browser.open(pages["calibrate"].as_uri())
    canvas = "document.querySelector('.space canvas')"
    picture = "(unfurlSpaces[0].view.render(), " + canvas + ".toDataURL())"
    box = browser.run(f"""({canvas}.scrollIntoView({{block: 'center'}}), {canvas}.focus(),
                          {canvas}.getBoundingClientRect().toJSON())""")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def difference(name):
        browser.run(f"window.now = {picture}")
        return browser.run(f"({DIFFERENCE})(window.first, window.now)")

    browser.run(f"window.first = {picture}")
    assert difference("same") == 0.0
    for _ in range(3):
        browser.key("ArrowRight")
    turned = difference("turned")
    # 72 steps of 5 degrees are a whole turn.
    browser.run(f"""for (let k = 3; k < 72; k++) {{
      {canvas}.dispatchEvent(new KeyboardEvent('keydown', {{key: 'ArrowRight'}}));
    }}""")
    # A turn of 2 pi ends some 1e-15 beside where it began: at most the edges of lines, a hundredth of the
    # picture, fall to a neighbour's side, and the eight bits of a colour round once.
    assert difference("a whole turn") < 1e-3 < turned
    browser.drag(x, y, x + 150, y + 40)
    assert difference("dragged") > 1e-3
    browser.key("+")
    browser.key("Home")
    assert difference("home") < 1e-3
    found = browser.run("""(function () {
      const space = unfurlSpaces[0], slider = document.querySelector('.space .scrub');
      const before = document.querySelector('.space .chosen').textContent;
      slider.value = '3';
      slider.dispatchEvent(new Event('input'));
      const at = space.view.floats(JSON.parse(document.querySelector('script.space-data').textContent).clouds[0].at);
      const p = space.view.onScreen(new THREE.Vector3(at[15], at[16], at[17]));
      return {before, after: document.querySelector('.space .chosen').textContent, x: p.x, y: p.y};
    })()""")
    assert found["after"] != found["before"] and found["after"].startswith("P004")
    at = {"button": "left", "clickCount": 1}
    browser.mouse("mousePressed", box["x"] + found["x"], box["y"] + found["y"], **at)
    browser.mouse("mouseReleased", box["x"] + found["x"], box["y"] + found["y"], **at)
    assert browser.run("document.querySelector('.space .chosen').textContent").startswith("P006")
    browser.key("p")
    assert browser.run("document.querySelector('.space .chosen').textContent").startswith("P005")
    assert browser.wrong == []


def test_without_webgl_and_on_paper_a_still_stands_in_its_place(browser, pages):
    visible = """['.view', '.still'].map(part => {
        const e = document.querySelector('.space ' + part);
        return getComputedStyle(e).display !== 'none' && e.getClientRects().length > 0; })"""
    script = browser.before_pages("""(function (get) {
      HTMLCanvasElement.prototype.getContext = function (kind, more) {
        return kind.startsWith('webgl') ? null : get.call(this, kind, more);
      };
    })(HTMLCanvasElement.prototype.getContext)""")
    try:
        browser.open(pages["calibrate"].as_uri())
        assert browser.run(visible) == [False, True] and browser.wrong == []
    finally:
        browser.forget(script)
    browser.open(pages["calibrate"].as_uri())
    assert browser.run(visible) == [True, False]
    browser.paper(True)
    try:
        assert browser.run(visible) == [False, True]
    finally:
        browser.paper(False)


def until(browser, script):
    """Until the script gives something true; a page that reads itself again has moments without a script."""
    for _ in range(200):
        try:
            found = browser.run(script)
        except RuntimeError:
            found = None
        if found:
            return found
        time.sleep(0.1)
    raise AssertionError(f"never true: {script}")


def test_a_live_page_follows_and_says_when_its_program_has_gone(browser, pages):
    folder = pages["live"].parent
    stream = subprocess.run([PROGRAM, "stream", "trial.h5"], cwd=folder, check=True, capture_output=True).stdout
    half = len(stream) // 2
    with subprocess.Popen([PROGRAM, "reconstruct", "--live", "--rig", "rig.h5", "--report", "now.html", "--quiet"],
                          cwd=folder, stdin=subprocess.PIPE) as live:
        live.stdin.write(stream[:half])
        live.stdin.flush()
        page = folder / "now.html"
        while not page.exists() or "Who sees what" not in page.read_text():
            time.sleep(0.05)
        browser.open(page.as_uri(), drawn=False)
        lines = "+((document.body.innerText.match(/([0-9]+) lines/) || [])[1] || 0)"
        before = until(browser, lines)
        live.stdin.write(stream[half:-100])  # without its end
        live.stdin.flush()
        # In one look: between two the page may be reading itself again.
        until(browser, f"{lines} > {before} && document.getElementById('stale').hidden")
        assert browser.wrong == [] and set(browser.requests) == {page.as_uri()}
        live.kill()
    until(browser, "!document.getElementById('stale').hidden && "
                   "document.getElementById('stale').innerText.includes('has stopped')")
    browser.open(pages["live"].as_uri())  # the last one stays, and is not read again
    assert browser.run("document.querySelector('meta[http-equiv=refresh]')") is None
