"""Watches a run in a real headless Chromium while it goes on: the curves grow, the page pauses, steps and resumes it, and at
the end shows what its report shows.

    python3 tests/pages/check_live.py ORCHESTRATOR [--screenshots DIR]

Needs what check_report.py beside this file needs.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile
import time

import numpy as np
from check_report import browser, curve
from expected import BODIES, curves
from selenium.webdriver.common.by import By


def wait_for(what, condition, seconds=60):
    end = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < end, what
        time.sleep(0.02)
    return value


def check_points(driver, run):
    """Every point of every curve so far is a sample of the tape."""
    points = 0
    for figure, count in driver.execute_script("return escapement.data.figures.filter((f) => !f.signal).map((f) => [f.id, escapement.figures[f.id].series.length])"):
        for series in range(count):
            x, y, _ = curve(driver, figure, series)
            assert len(x) > 5 and (np.diff(x) > 0).all(), f"{figure}: {len(x)} points"
            if figure not in BODIES:
                stamps, values = curves(run, figure)
                k = np.searchsorted(stamps, x - 1e-9)
                assert np.allclose(x, stamps[k], rtol=0, atol=1e-9) and np.allclose(y, values[k, series], rtol=1e-12, atol=1e-9), figure
                points += len(y)
    return points


def check(driver, url, run, screenshots):
    driver.get(url)
    points = lambda: driver.execute_script("return escapement.figures['position-error'].series[0].samples")
    frames = lambda: driver.execute_script("return escapement.player.scenes[0].motion.frames")
    text = lambda: driver.find_element(By.CSS_SELECTOR, "#live .state").text
    button = lambda name: next(b for b in driver.find_elements(By.CSS_SELECTOR, "#live button") if b.text == name)
    # The run waits at its first stop, however long the browser took to start.
    wait_for("it rests at its stop", lambda: "t = 0.500 s" in text() and ", paused" in text())
    first = (points(), frames())
    button("Resume").click()
    wait_for("the curves grow", lambda: points() > first[0] + 200 and frames() > first[1] + 10)
    button("Pause").click()
    wait_for("it comes to rest", lambda: ", paused" in text())
    wait_for("it says whether its pace is met", lambda: " of 2 × real time " in text() and "met" in text())
    # The page has the last samples when it next asks for them, which on a busy machine takes a while.
    recorded = lambda: len(curves(run, "position-error")[0])
    newest = lambda: (time.sleep(0.5), (points(), text()))[1]
    wait_for("the page has caught up", lambda: points() == recorded() and newest() == newest())
    still = (points(), text())
    time.sleep(0.6)
    assert (points(), text()) == still, "a run at rest does not move"
    points_now = check_points(driver, run)
    if screenshots:
        screenshots.mkdir(parents=True, exist_ok=True)
        driver.execute_script("escapement.setTheme('light')")
        time.sleep(1.0)
        driver.save_screenshot(str(screenshots / "live.png"))
    driver.execute_script("const s = document.querySelector('#live select'); s.value = 'of plant'; s.dispatchEvent(new Event('change'))")
    button("Step").click()
    wait_for("a step of the plant is one more sample", lambda: points() == still[0] + 1)
    driver.execute_script("const s = document.querySelector('#live select'); s.value = 'time'; s.dispatchEvent(new Event('change'))")
    driver.execute_script("document.querySelector('#live input').value = '0.25 s'")
    button("Step").click()
    wait_for("a step of time is 250 more samples", lambda: points() == still[0] + 251)
    driver.execute_script("document.querySelector('#live input').value = 'soon'")
    button("Step").click()
    wait_for("a wrong time is refused in words", lambda: "soon" in text())
    button("Resume").click()
    wait_for("the page says the end", lambda: "complete" in text(), 120)
    result = driver.execute_script("return [escapement.data.runs[0].digest, escapement.data.summary.length, escapement.clock.end]")
    for entry in driver.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent" and message["params"]["documentURL"].startswith("http"):
            asked = message["params"]["request"]["url"]
            assert asked.startswith((url, "data:", "blob:")), f"the page asks for {asked}"
    # The browser notes the refusal of the wrong time; nothing else is wrong.
    severe = [entry for entry in driver.get_log("browser") if entry["level"] == "SEVERE" and "/control - " not in entry["message"]]
    assert not severe, severe
    return *result, points_now


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("--screenshots", type=pathlib.Path)
    args = arguments.parse_args()
    for how in ([], ["--in-process"]):
        with tempfile.TemporaryDirectory() as folder:
            run = pathlib.Path(folder) / "close"
            command = [args.program, "run", "scenarios/close.toml", "--duration", "12 s", "--real-time=2", "--pause-at", "0.5 s", "--live", "--quiet", "--out", run, *how]
            program = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            driver = browser(folder)
            try:
                url = program.stderr.readline().strip().removeprefix("live: ")
                digest, rows, end, compared = check(driver, url, run, None if how else args.screenshots)
                assert program.wait(timeout=60) in (0, 3)
                summary = json.loads((run / "summary.json").read_text())
                assert digest == summary["tape_digest"] and rows > 3 and end == 12.0, (digest, rows, end)
                # The program is gone; the page is not.
                assert driver.execute_script("return escapement.figures['position-error'].series[0].length") > 1000
                print(f"live{' in one process' if how else ''}: grows, pauses, steps, resumes, and ends as the report; {compared} points at rest are those of the tape")
            finally:
                driver.quit()
                program.kill()
                program.wait()


if __name__ == "__main__":
    main()
