"""Opens the report of a run, and of two runs side by side, in a real headless Chromium.

    python3 tests/pages/check_report.py ORCHESTRATOR RUN [SECOND_RUN] [--screenshots DIR]

Checks that figures have the right number of points at the right values, that the playback moves and draws, that nothing is
fetched from anywhere, and that the browser's console stays empty. Needs Chromium with its driver (Debian: chromium,
chromium-driver) and the packages of requirements.txt beside this file.
"""

import argparse
import base64
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import tomllib
import zlib

import numpy as np
from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By

from expected import BODIES, BY_DIFFERENCES, curves, linear_momenta, read_stream, rotate

def browser(folder, width=1500, height=1000):
    options = Options()
    options.binary_location = "/usr/bin/chromium"
    for flag in [
        "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
        "--disable-component-update", "--disable-sync", "--disable-quic", f"--user-data-dir={folder}/profile",
        f"--window-size={width},{height}",
        # WebGL without a graphics card.
        "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    ]:
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service("/usr/bin/chromedriver"))
    driver.set_script_timeout(300)
    driver.set_page_load_timeout(300)
    return driver


def curve(driver, figure, series):
    """x and y of a curve as the page draws it."""
    x, y, total = driver.execute_script(
        "const s = escapement.figures[arguments[0]].series[arguments[1]];"
        "return [Array.from(s.y, (_, k) => s.x(k)), Array.from(s.y), s.samples];", figure, series)
    return np.array(x), np.array([np.nan if v is None else v for v in y]), total


def check_curve(driver, figure, series, stamps, values):
    """Either every sample, or the least and the greatest of each bucket, each at its own stamp."""
    x, y, total = curve(driver, figure, series)
    assert total == len(values), f"{figure}: {total} samples of {len(values)}"
    if len(values) <= 8192:
        assert len(y) == len(values), f"{figure}: {len(y)} points of {len(values)}"
    else:
        buckets = -(-len(values) // -(-len(values) // 2048))
        assert buckets <= len(y) <= 2 * buckets, f"{figure}: {len(y)} points"
    k = np.searchsorted(stamps, x - 1e-9)
    assert np.allclose(x, stamps[k], rtol=0, atol=1e-9), figure
    assert np.allclose(y, values[k], rtol=1e-12, atol=1e-9), f"{figure}: {np.abs(y - values[k]).max()}"
    assert np.isclose(np.nanmin(y), values.min(), rtol=1e-12, atol=1e-12) and np.isclose(np.nanmax(y), values.max(), rtol=1e-12, atol=1e-12), figure
    return len(y)


def check_values(driver, run):
    """Every curve of every figure against the tape."""
    points, figures = 0, driver.execute_script("return escapement.data.figures.filter((f) => !f.signal).map((f) => [f.id, escapement.figures[f.id].series.length])")
    for figure, count in figures:
        if figure in BODIES:
            continue
        stamps, values = curves(run, figure)
        assert values.shape[1] == count, f"{figure}: {count} curves of {values.shape[1]}"
        for series in range(count):
            points += check_curve(driver, figure, series, stamps, values[:, series])
    assert len(figures) > 30, figures
    return points + check_bodies(driver, run)


def check_bodies(driver, run):
    """The momentum of each body: all together are what the plant has recorded, and each one follows from its motion."""
    shown = {}
    for figure in BODIES:
        labels = driver.execute_script("return escapement.figures[arguments[0]].series.map((s) => s.label)", figure)
        for series, label in enumerate(labels):
            x, y, _ = curve(driver, figure, series)
            shown[figure, label] = y
    r, momenta, centre = linear_momenta(run, tomllib.loads((run / "plan.toml").read_text())["participants"]["plant"]["parameters"])
    k = np.searchsorted(r["t"], x - 1e-9)
    assert np.allclose(x, r["t"][k], rtol=0, atol=1e-9) and len(k) > 1000 and k[0] == 0
    wheels = rotate(r["quat_NB"], r["wheel_momentum_B"])
    # About the common centre of mass, from the totals about the world's origin.
    angular = r["angular_momentum_N"] - np.cross(centre, r["linear_momentum_N"])
    # A difference of positions across the impact of the grasp is no velocity.
    jump = np.flatnonzero(np.diff(r["grasped"]))
    inside = (k > 0) & (k < len(r) - 1) & ~np.isin(k, [at + near for at in jump for near in range(-1, 3)])
    worst = 0
    for a, axis in enumerate("xyz"):
        linear = {label: y for (figure, label), y in shown.items() if figure == f"linear-momentum-{axis}"}
        assert set(linear) == set(momenta) | {"sum"}, sorted(linear)
        for name, expected in momenta.items():
            assert np.allclose(linear[name][inside], expected[k, a][inside], rtol=1e-5, atol=BY_DIFFERENCES), f"{name} along {axis}"
        own = {label: y for (figure, label), y in shown.items() if figure == f"angular-momentum-{axis}"}
        assert np.allclose(own["wheels"], wheels[k, a], rtol=1e-12, atol=1e-12)
        assert np.allclose(shown["centre-of-mass", axis], centre[k, a], rtol=1e-12, atol=1e-12)
        for parts, recorded in ((linear, r["linear_momentum_N"]), (own, angular)):
            total = sum(y for label, y in parts.items() if label != "sum")
            worst = max(worst, np.abs(total - recorded[k, a]).max(), np.abs(parts["sum"] - recorded[k, a]).max())
    assert worst < 1e-11, f"the bodies' momenta miss the recorded sum by {worst}"
    print(f"momentum of {len(momenta)} bodies and the wheels: the sum is the recorded one to {worst:.1e}")
    return len(shown) * len(k)


def check_read_off(driver, run):
    """The value shown at the pointer is the tape's value at that stamp, in every figure, and a point is drawn there."""
    figures = [figure for figure in driver.execute_script("return escapement.data.figures.filter((f) => !f.signal).map((f) => f.id)") if figure not in BODIES]
    read = 0
    for figure in figures:
        stamps, values = curves(run, figure)
        driver.execute_script("document.getElementById(arguments[0]).scrollIntoView({block: 'center'})", figure)
        for part in (0.13, 0.5, 0.87):
            t, rows, inked = driver.execute_async_script("""
                const [id, part, done] = arguments, chart = escapement.figures[id].shared.panels[0];
                const act = () => {
                  if (!chart.toX || chart.stale) return requestAnimationFrame(act);
                  const [lo, hi] = chart.xRange(), box = chart.box.getBoundingClientRect();
                  chart.box.dispatchEvent(new PointerEvent("pointermove", { clientX: box.left + chart.toX(lo + part * (hi - lo)), clientY: box.top + 50 }));
                  const { width, height } = chart.base, pixels = chart.base.getContext("2d").getImageData(0, 0, width, height).data;
                  let inked = 0;
                  for (let i = 3; i < pixels.length; i += 4) inked += pixels[i] > 0;
                  done([chart.hover, [...chart.tip.querySelectorAll("div")].slice(1).map((row) => Number(row.querySelector("b").dataset.value)), inked]);
                };
                act();""", figure, part)
            k = int(np.searchsorted(stamps, t - 1e-9))
            assert abs(stamps[k] - t) < 1e-9, f"{figure}: {t} is no stamp"
            got = rows
            # A thinned curve shows its own nearest sample, at most a bucket away.
            far = -(-len(stamps) // 2048) if len(stamps) > 8192 else 0
            near = values[max(0, k - far):k + far + 1]
            slack = 1e-12 * np.abs(values[k]) + 1e-9
            assert len(got) == values.shape[1] and (near.min(axis=0) - slack <= got).all() and (got <= near.max(axis=0) + slack).all(), \
                f"{figure} at {t}: {rows} against {values[k]}"
            assert np.isclose(got[0], values[k, 0], rtol=1e-12, atol=1e-9), f"{figure} at {t}: {rows} against {values[k]}"
            assert inked > 500, f"{figure} is blank"
            read += len(got)
    return read


def check_layout(driver, folder):
    """Light, dark, narrow and printed: nothing overflows the page, and no figure is blank."""
    blank = """return Object.values(escapement.figures).flatMap((f) => f.shared.panels.map((panel) => {
        const { width, height } = panel.base, pixels = panel.base.getContext("2d").getImageData(0, 0, width, height).data;
        for (let i = 3; i < pixels.length; i += 4) if (pixels[i] > 0) return null;
        return f.spec.id; })).filter(Boolean)"""
    grounds = []
    for theme in ("light", "dark"):
        driver.execute_script("escapement.setTheme(arguments[0])", theme)
        grounds.append(driver.execute_script("return getComputedStyle(document.body).backgroundColor"))
    assert grounds[0] != grounds[1], grounds
    for width in (1500, 760, 400):
        driver.set_window_size(width, 900)
        time.sleep(0.3)
        wide, room = driver.execute_script("return [document.documentElement.scrollWidth, document.documentElement.clientWidth]")
        assert wide <= room, f"at {room} the page is {wide} wide"
    driver.set_window_size(1500, 1000)
    driver.execute_script("window.scrollTo(0, 0); dispatchEvent(new Event('beforeprint'))")
    assert driver.execute_script(blank) == [], "on paper everything is drawn, seen before or not"
    assert driver.execute_script("return document.documentElement.dataset.theme") == "light"
    assert driver.execute_script("return getComputedStyle(document.getElementById('transport')).display") == "none"
    driver.execute_script("dispatchEvent(new Event('afterprint'))")
    assert driver.execute_script("return document.documentElement.dataset.theme") == "dark"
    paper = base64.b64decode(driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": True, "preferCSSPageSize": True})["data"])
    # The curves are on it as strokes, and nothing lies over them.
    strokes = 0
    for stream in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", paper, re.DOTALL):
        try:
            strokes += len(re.findall(rb" l\s", zlib.decompress(stream)))
        except zlib.error:
            pass
    pages = len(re.findall(rb"/Type\s*/Page\b", paper))
    assert paper.startswith(b"%PDF") and 3 < pages < 40 and strokes > 50_000, f"{pages} pages with {strokes} strokes"
    driver.execute_script("document.documentElement.classList.add('printing')")
    assert driver.execute_script("return [...document.querySelectorAll('.over')].every((one) => getComputedStyle(one).display === 'none')")
    driver.execute_script("document.documentElement.classList.remove('printing')")
    return pages


def check_playback(driver, run):
    shown = lambda: driver.find_element(By.CSS_SELECTOR, ".hud .t").text
    picture = lambda: driver.execute_script("""
        const g = escapement.player.gl.gl, [w, h] = [g.drawingBufferWidth, g.drawingBufferHeight], p = new Uint8Array(4 * w * h);
        g.readPixels(0, 0, w, h, g.RGBA, g.UNSIGNED_BYTE, p);
        return p.reduce((sum, x) => (31 * sum + x) | 0, 7);""")
    driver.execute_script("window.scrollTo(0, 0); escapement.clock.set(escapement.clock.start)")
    time.sleep(0.4)
    before, t0, frames = picture(), shown(), driver.execute_script("return escapement.player.frames")
    driver.find_element(By.ID, "play").click()
    time.sleep(2.0)
    driver.find_element(By.ID, "play").click()
    t = driver.execute_script("return escapement.clock.t")
    assert t > 0.2, f"the clock stands at {t} s after two seconds of playing"
    assert driver.execute_script("return escapement.player.frames") > frames + 2
    driver.execute_script("escapement.clock.set(0.6 * escapement.clock.end)")
    time.sleep(0.4)
    assert shown() != t0 and picture() != before, "the picture does not move"
    # What is drawn is the tape's pose at that instant.
    truth = read_stream(run, "truth", "p_NB_N")
    t = driver.execute_script("return escapement.clock.t")
    for body, field, attitude in (("servicer", "p_NB_N", "quat_NB"), ("E", "p_NE_N", "quat_NE"), ("target", "p_NT_N", "quat_NT")):
        pose = driver.execute_script("return escapement.player.scenes[0].pose(arguments[0], escapement.clock.t)", body)
        expected = [np.interp(t, truth["t"], truth[field][:, i]) for i in range(3)]
        assert np.allclose(pose["p"], expected, atol=1e-4), f"{body}: {pose} against {expected}"
        k = np.searchsorted(truth["t"], t)
        assert min(np.abs(np.array(pose["q"]) - truth[attitude][k]).max(), np.abs(np.array(pose["q"]) + truth[attitude][k]).max()) < 1e-3, body
    # The chain of joints ends where the plant says that the tool is.
    reached = driver.execute_script("""
        const s = escapement.player.scenes[0], body = s.spec.bodies.find((one) => one.name === "servicer"), links = s.links(body, escapement.clock.t)[0];
        const tool = s.pose("E", escapement.clock.t).p;
        return Math.min(...links.map(([p]) => Math.hypot(...p.map((x, i) => x - tool[i]))));""")
    assert reached < 1e-3, f"no link ends at the tool: {reached} m away"
    e = driver.execute_script("return escapement.player.scenes[0].spec.bodies.flatMap((body) => body.models.flatMap((model) => model.links.map((link) => link.name)))")
    for camera in driver.find_elements(By.CSS_SELECTOR, ".cameras button"):
        before = picture()
        camera.click()
        time.sleep(0.3)
    assert picture() != before, "cameras differ"
    return e


def check_zoom(driver):
    panel = driver.find_element(By.CSS_SELECTOR, "#position-error .panel")
    driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", panel)
    time.sleep(0.3)
    ActionChains(driver).move_to_element_with_offset(panel, -60, 0).click_and_hold().move_by_offset(80, 0).release().perform()
    lo, hi = driver.execute_script("return [escapement.range.lo, escapement.range.hi]")
    assert lo is not None and hi > lo, "dragging zooms"
    time.sleep(0.3)
    ActionChains(driver).move_to_element_with_offset(panel, 20, 0).perform()
    time.sleep(0.3)
    tip = driver.find_element(By.CSS_SELECTOR, "#position-error .tip").text
    assert "t =" in tip and "m" in tip, f"read-off: {tip!r}"
    ActionChains(driver).double_click(panel).perform()
    assert driver.execute_script("return escapement.range.lo") is None, "a double click shows everything"


def check_no_requests_or_messages(driver, page):
    """No request but for the page itself, nothing on the console."""
    for entry in driver.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            # The browser's own first tab asks for things as well.
            if not message["params"]["documentURL"].startswith(page.as_uri()):
                continue
            url = message["params"]["request"]["url"]
            assert url.startswith((page.as_uri(), "data:", "blob:")), f"the page asks for {url}"
    severe = [entry for entry in driver.get_log("browser") if entry["level"] in ("SEVERE",)]
    assert not severe, severe


def take_screenshots(driver, folder):
    """The pictures of README.md and docs/run-folder.md."""
    folder.mkdir(parents=True, exist_ok=True)
    stage = driver.find_element(By.ID, "stage")
    views = {
        "playback": ("dark", 17.0, "overview", {"yaw": 0.72, "pitch": 0.28}),
        "grasp": ("dark", 29.5, "grasp", {}),
    }
    for name, (theme, t, camera, turned) in views.items():
        driver.execute_script(
            "const [theme, t, camera, turned] = arguments, { player, clock } = escapement; escapement.setTheme(theme); window.scrollTo(0, 0);"
            "clock.set(t); player.preset(camera); Object.assign(player.view, turned); player.request()", theme, t, camera, turned)
        time.sleep(1.0)
        stage.screenshot(str(folder / f"{name}.png"))
    driver.set_window_size(1500, 1640)
    driver.execute_script("escapement.setTheme('light'); window.scrollTo(0, 0); escapement.clock.set(17); escapement.player.preset('overview')")
    time.sleep(1.0)
    driver.save_screenshot(str(folder / "report.png"))
    driver.set_window_size(1500, 1000)


def check_overlays_do_not_overlap(driver):
    """The overlays of the playback do not cover each other, at any width, even where the names of runs are long."""
    driver.execute_script("document.getElementById('stage').scrollIntoView({block: 'center'})")
    for width in (1400, 1100, 800, 600):
        driver.set_window_size(width, 900)
        time.sleep(0.5)
        boxes = {name: driver.execute_script("const b = document.querySelector(arguments[0]).getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]", name)
                 for name in (".stage .hud table", ".stage .cameras", ".stage .shows", ".stage .scale")}
        for one, a in boxes.items():
            for other, b in boxes.items():
                apart = a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
                assert one == other or apart, f"at {width} px {one} {a} covers {other} {b}"
    driver.set_window_size(1400, 900)


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("run", type=pathlib.Path)
    arguments.add_argument("second", type=pathlib.Path, nargs="?")
    arguments.add_argument("--bodies", type=pathlib.Path, action="append", default=[], help="another run whose momenta are checked")
    arguments.add_argument("--screenshots", type=pathlib.Path)
    args = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        page, both = pathlib.Path(folder) / "one.html", pathlib.Path(folder) / "two.html"
        subprocess.run([args.program, "report", args.run, "--out", page, "--figures", f"{folder}/figures"], check=True, stdout=sys.stderr)
        driver = browser(folder)
        try:
            driver.get(page.as_uri())
            points = check_values(driver, args.run)
            read = check_read_off(driver, args.run)
            bodies = check_playback(driver, args.run)
            check_zoom(driver)
            pages = check_layout(driver, folder)
            check_no_requests_or_messages(driver, page)
            print(f"one run: {points} points and {read} values read off are those of the tape; {len(bodies or [])} bodies move; {pages} pages on paper")
            figures = driver.execute_script("return Object.keys(escapement.figures)")
            for figure in figures:
                for kind, magic in (("svg", b"<svg"), ("png", b"\x89PNG")):
                    data = (pathlib.Path(folder) / "figures" / f"{figure}.{kind}").read_bytes()
                    assert data.startswith(magic) and len(data) > 1000, f"{figure}.{kind}"
            print(f"{len(figures)} figures as SVG and PNG")
            if args.screenshots:
                take_screenshots(driver, args.screenshots)
            for run in args.bodies:
                subprocess.run([args.program, "report", run, "--out", page], check=True, stdout=sys.stderr)
                driver.get(page.as_uri())
                check_bodies(driver, run)
            if args.second:
                names = [option for ms in (10, 20) for option in ("--label", f"measured.delay = {ms} ms, controller.period = {ms} ms")]
                subprocess.run([args.program, "report", args.run, args.second, *names, "--out", both], check=True, stdout=sys.stderr)
                driver.get(both.as_uri())
                runs, scenes, panels = driver.execute_script(
                    "return [escapement.data.runs.length, escapement.player.scenes.length, escapement.figures['base-torque'].shared.panels.length]")
                assert (runs, scenes, panels) == (2, 2, 2), "two runs, two scenes, panels side by side"
                if args.screenshots:
                    driver.execute_script("escapement.setTheme('dark'); escapement.clock.set(9); window.scrollTo(0, 0)")
                    time.sleep(1.0)
                    driver.save_screenshot(str(args.screenshots / "two.png"))
                check_overlays_do_not_overlap(driver)
                check_no_requests_or_messages(driver, both)
                print("two runs: side by side and overlaid")
        finally:
            driver.quit()


if __name__ == "__main__":
    main()
