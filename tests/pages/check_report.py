"""Opens the report of a run, and of two runs side by side, in a real headless Chromium.

    python3 tests/pages/check_report.py ORCHESTRATOR RUN [SECOND_RUN] [--screenshots DIR]

Checks that figures have the right number of points at the right values, that the playback moves and draws, that nothing is
fetched from anywhere, and that the browser's console stays empty. Needs Chromium with its driver (Debian: chromium,
chromium-driver) and the packages of requirements.txt beside this file.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By

NUMPY = {"f64": "<f8", "f32": "<f4", "i64": "<i8", "i32": "<i4", "u64": "<u8", "u32": "<u4", "u8": "u1"}


def read_stream(run, port, field):
    """The records of the first stream of that port that has the field."""
    index = json.loads((run / "tape/index.json").read_text())
    for stream in index["streams"]:
        fields = stream["descriptor"]["fields"]
        if stream["port"] == port and any(f["name"] == field for f in fields):
            dtype = [("t", "<f8")] + [(f["name"], NUMPY[f["element"]], tuple(f["shape"])) for f in fields]
            return np.fromfile(run / "tape" / stream["file"], dtype=np.dtype(dtype))
    return None


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
    return webdriver.Chrome(options=options, service=Service("/usr/bin/chromedriver"))


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
        assert 2048 <= len(y) <= 4096, f"{figure}: {len(y)} points"
    k = np.searchsorted(stamps, x - 1e-9)
    assert np.allclose(x, stamps[k], rtol=0, atol=1e-9), figure
    assert np.allclose(y, values[k], rtol=1e-12, atol=1e-9), f"{figure}: {np.abs(y - values[k]).max()}"
    assert np.isclose(np.nanmin(y), values.min(), rtol=1e-12, atol=1e-12) and np.isclose(np.nanmax(y), values.max(), rtol=1e-12, atol=1e-12), figure
    return len(y)


def check_values(driver, run):
    truth = read_stream(run, "truth", "p_NE_N")
    points = check_curve(driver, "position-error", 0, truth["t"], np.linalg.norm(truth["p_NE_N"] - truth["p_NG_N"], axis=1))
    dot = np.abs(np.sum(truth["quat_NE"] * truth["quat_NG"], axis=1)).clip(max=1.0)
    a, b = truth["quat_NE"], truth["quat_NG"]
    vector = a[:, :1] * b[:, 1:] - b[:, :1] * a[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    angle = np.degrees(2 * np.arctan2(np.linalg.norm(vector, axis=1), dot))
    points += check_curve(driver, "attitude-error", 0, truth["t"], angle)
    for axis in range(3):
        points += check_curve(driver, "base-position", axis, truth["t"], truth["p_NB_N"][:, axis])
    for joint in range(7):
        points += check_curve(driver, "joint-angles", joint, truth["t"], np.degrees(truth["q"][:, joint]))
    name = next(n for n in ("torque_B", "base_torque") if read_stream(run, "command", n) is not None)
    command = read_stream(run, "command", name)
    for axis in range(3):
        points += check_curve(driver, "base-torque", axis, command["t"], command[name][:, axis])
    return points


def check_playback(driver, run):
    shown = lambda: driver.find_element(By.CSS_SELECTOR, ".hud .t").text
    picture = lambda: driver.execute_script("return escapement.player.canvas.toDataURL().length + ':' + escapement.player.canvas.toDataURL().slice(-4000)")
    driver.execute_script("escapement.clock.set(escapement.clock.start)")
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
    p = driver.execute_script("return escapement.player.scenes[0].state(escapement.clock.t).p_NB")
    expected = [np.interp(t, truth["t"], truth["p_NB_N"][:, i]) for i in range(3)]
    assert np.allclose(p, expected, atol=1e-4), f"{p} against {expected}"
    e = driver.execute_script("""
        const s = escapement.player.scenes[0], now = s.state(escapement.clock.t);
        return s.model ? s.model.bodies.map((b) => b.name) : null;""")
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


def check_quiet(driver, page):
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


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("run", type=pathlib.Path)
    arguments.add_argument("second", type=pathlib.Path, nargs="?")
    arguments.add_argument("--screenshots", type=pathlib.Path)
    args = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        page, both = pathlib.Path(folder) / "one.html", pathlib.Path(folder) / "two.html"
        subprocess.run([args.program, "report", args.run, "--out", page, "--figures", f"{folder}/figures"], check=True, stdout=sys.stderr)
        driver = browser(folder)
        try:
            driver.get(page.as_uri())
            points = check_values(driver, args.run)
            bodies = check_playback(driver, args.run)
            check_zoom(driver)
            check_quiet(driver, page)
            print(f"one run: {points} points are those of the tape; {len(bodies or [])} bodies move")
            figures = driver.execute_script("return Object.keys(escapement.figures)")
            for figure in figures:
                for kind, magic in (("svg", b"<svg"), ("png", b"\x89PNG")):
                    data = (pathlib.Path(folder) / "figures" / f"{figure}.{kind}").read_bytes()
                    assert data.startswith(magic) and len(data) > 1000, f"{figure}.{kind}"
            print(f"{len(figures)} figures as SVG and PNG")
            if args.screenshots:
                args.screenshots.mkdir(parents=True, exist_ok=True)
                for theme in ("light", "dark"):
                    driver.execute_script(f"escapement.setTheme('{theme}'); window.scrollTo(0, 0); escapement.clock.set(0.45 * escapement.clock.end);"
                                          "escapement.player.preset('overview')")
                    time.sleep(0.8)
                    driver.save_screenshot(str(args.screenshots / f"report-{theme}.png"))
                driver.find_element(By.ID, "stage").screenshot(str(args.screenshots / "playback.png"))
            if args.second:
                subprocess.run([args.program, "report", args.run, args.second, "--out", both], check=True, stdout=sys.stderr)
                driver.get(both.as_uri())
                runs, scenes, panels = driver.execute_script(
                    "return [escapement.data.runs.length, escapement.player.scenes.length, escapement.figures['base-torque'].shared.panels.length]")
                assert (runs, scenes, panels) == (2, 2, 2), "two runs, two scenes, panels side by side"
                check_quiet(driver, both)
                print("two runs: side by side and overlaid")
        finally:
            driver.quit()


if __name__ == "__main__":
    main()
