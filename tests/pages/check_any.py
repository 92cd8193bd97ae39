"""The report of runs that are no capture: springs, trolleys under names of their own, the lander of another program.

    python3 tests/pages/check_any.py ORCHESTRATOR LANDER [--screenshots DIR]

Every curve is compared with the tape value by value, as numpy reads it; then what a user does with a figure: search, cursors, zoom,
link, SVG, CSV, two runs laid over each other. Needs what check_report.py beside this file needs.
"""

import argparse
import csv
import io
import json
import pathlib
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from fractions import Fraction

import numpy as np
from check_report import browser, check_no_requests_or_messages
from expected import NUMPY
from selenium.webdriver.common.by import By

WIDTHS = (1400, 768, 420)


def streams(run):
    """By name: exact offset, period, first index, and the records."""
    def seconds(text):
        number, unit = text.split()
        return Fraction(number) * {"s": Fraction(1), "ms": Fraction(1, 1000), "us": Fraction(1, 10**6), "µs": Fraction(1, 10**6)}[unit]
    out = {}
    for stream in json.loads((run / "tape/index.json").read_text())["streams"]:
        fields = stream["descriptor"]["fields"]
        dtype = [("t", "<f8")] + [(f["name"], NUMPY[f["element"]], tuple(f["shape"])) for f in fields]
        records = np.fromfile(run / "tape" / stream["file"], dtype=np.dtype(dtype))
        out[f"{stream['participant']}.{stream['port']}"] = (seconds(stream["offset"]), seconds(stream["period"]), stream["first_index"], records, fields)
    return out


def value_by_delivery_rule(lead, other, field):
    """`field` of a stream at the stamps of another, by the delivery rule in exact arithmetic; NaN before its first sample."""
    (o1, p1, f1, records, _), (o2, p2, f2, theirs, _) = lead, other
    index = [((o1 + (f1 + k) * p1 - o2) // p2) - f2 for k in range(len(records))]
    values = np.asarray(theirs[field], dtype=float)
    return np.array([np.nan if k < 0 or k > len(values) else values[min(k, len(values) - 1)] for k in index])


def curves(driver, figure):
    """Stamps, horizontal place, values and count of samples of each curve, as the page has them."""
    found = driver.execute_script(
        "return escapement.open(arguments[0]).series.map((s) => [Array.from(s.y, (_, k) => s.t(k)), Array.from(s.y, (_, k) => s.x(k)), Array.from(s.y), s.samples]);", figure)
    number = lambda values: np.array([np.nan if v is None else v for v in values], dtype=float)
    return [(number(t), number(x), number(y), count) for t, x, y, count in found]


def compare(name, curve, stamps, expected):
    """Every point is a sample of the tape at its own stamp, and no extreme is lost."""
    t, _, y, count = curve
    assert count == len(expected), f"{name}: {count} samples of {len(expected)}"
    k = np.searchsorted(stamps, t - 1e-9)
    assert np.allclose(t, stamps[k], rtol=0, atol=1e-9), name
    assert np.allclose(y, expected[k], rtol=1e-12, atol=1e-15, equal_nan=True), f"{name}: {np.nanmax(np.abs(y - expected[k]))}"
    assert len(y) == count or len(y) >= 256, name
    assert np.isclose(np.nanmin(y), np.nanmin(expected), rtol=1e-12, atol=0) and np.isclose(np.nanmax(y), np.nanmax(expected), rtol=1e-12, atol=0), name
    return len(y)


def check_signals(driver, run):
    """Each field of each stream has a figure, with its unit and frame."""
    points, listed = 0, {f["id"]: f for f in driver.execute_script("return escapement.data.figures") if f["signal"]}
    known = {f"{name}.{field['name']}": (name, field) for name, (*_, fields) in streams(run).items() for field in fields}
    assert set(listed) == set(known), set(listed) ^ set(known)
    for figure, (name, field) in known.items():
        records = streams(run)[name][3]
        values = records[field["name"]].reshape(len(records), -1)
        drawn = curves(driver, figure)
        assert (listed[figure]["unit"], listed[figure]["frame"]) == (field["unit"], field["frame"])
        assert len(drawn) == values.shape[1], figure
        for column, curve in enumerate(drawn):
            points += compare(figure, curve, records["t"], values[:, column].astype(float))
    return points


def check_panels(driver, run):
    """The panels of trolleys.toml, computed here by another way."""
    all_streams = streams(run)
    heavy, light = all_streams["heavy.motion"], all_streams["light.motion"]
    th, tl = heavy[3]["t"], light[3]["t"]
    both, apart, phases = curves(driver, "both"), curves(driver, "apart"), curves(driver, "phases")
    points = compare("both", both[0], th, 1000 * heavy[3]["position"]) + compare("both", both[1], tl, 1000 * light[3]["position"])
    points += compare("apart", apart[0], th, heavy[3]["position"] - value_by_delivery_rule(heavy, light, "position"))
    points += compare("apart", apart[1], tl, np.abs(light[3]["position"] - value_by_delivery_rule(light, heavy, "position")))
    t, x, y, _ = phases[0]
    k = np.searchsorted(tl, t - 1e-9)
    assert np.allclose(x, light[3]["position"][k], rtol=1e-12) and np.allclose(y, light[3]["velocity"][k], rtol=1e-12) and len(k) > 1000
    specs = {f["id"]: f for f in driver.execute_script("return escapement.data.figures")}
    limits = lambda figure: sorted((round(limit["y"], 9), limit["text"]) for limit in specs[figure]["limits"])
    assert limits("both") == [(-180, "guard buffer"), (110, "limit"), (160, "guard buffer")], limits("both")
    assert limits("heavy.motion.position") == [(-0.18, "guard buffer"), (0.16, "guard buffer")], limits("heavy.motion.position")
    marks = driver.execute_script("return escapement.data.runs[0].marks.map((m) => [m.t, m.kind])")
    assert [2, "fault"] in marks and [6, "instant"] in marks, marks
    assert len(driver.find_elements(By.CSS_SELECTOR, "#marks button")) == len(marks)
    return points + len(k)


def check_controls(driver, run, page):
    """Search, cursors, zoom, link, SVG, CSV."""
    search = driver.find_element(By.CSS_SELECTOR, "input[type=search]")
    shown = lambda: [card.get_attribute("id") for card in driver.find_elements(By.CSS_SELECTOR, "#signals .figure") if card.is_displayed()]
    search.send_keys("light.motion vel")
    assert shown() == ["light.motion.velocity"], shown()
    search.clear()
    search.send_keys("nothing of that name")
    assert shown() == [] and "nothing has that name" in driver.find_element(By.CSS_SELECTOR, "#signals .search").text
    driver.execute_script("escapement.cursors.set(1.2, 4.7)")
    time.sleep(0.2)
    cells = driver.execute_script("return [...document.querySelectorAll('#both .measured tbody tr')].map((row) => [...row.querySelectorAll('td[data-value]')].map((c) => Number(c.dataset.value)))")
    records = streams(run)["light.motion"][3]
    inside = (records["t"] >= 1.2 - 1e-9) & (records["t"] <= 4.7 + 1e-9)
    t, y = records["t"][inside], 1000 * records["position"][inside]
    h, a, b = np.diff(t), y[:-1], y[1:]
    at = lambda instant: 1000 * records["position"][np.argmin(np.abs(records["t"] - instant))]
    expected = [at(1.2), at(4.7), at(4.7) - at(1.2), y.min(), y.max(), (h * (a + b) / 2).sum() / h.sum(), np.sqrt((h * (a * a + a * b + b * b) / 3).sum() / h.sum())]
    assert np.allclose(cells[1], expected, rtol=1e-6, atol=1e-9), (cells[1], expected)

    unzoom = driver.find_element(By.ID, "unzoom")
    assert not unzoom.is_displayed()
    driver.execute_script("escapement.range.set(1.5, 2.5); escapement.clock.set(1.75)")
    time.sleep(0.6)
    assert unzoom.is_displayed()
    address = driver.execute_script("return location.href")
    table = driver.execute_script("return escapement.figures.both.csv()")
    rows = list(csv.reader(io.StringIO(table)))
    heavy = streams(run)["heavy.motion"][3]
    assert rows[0] == ["t [s]", "heavy position [mm]", "light [mm]"], rows[0]
    instants = np.array([float(row[0]) for row in rows[1:]])
    assert instants.min() >= 1.5 and instants.max() <= 2.5 and (np.diff(instants) > 0).all() and len(instants) > 400
    for row in rows[1:]:
        if row[2]:
            k = np.argmin(np.abs(records["t"] - float(row[0])))
            assert np.isclose(float(row[2]), 1000 * records["position"][k], rtol=1e-12)
    picture = ElementTree.fromstring(driver.execute_script("return escapement.figures.both.svg()"))
    texts = [node.text for node in picture.iter("{http://www.w3.org/2000/svg}text")]
    assert "Both trolleys" in texts and any("mm" in (text or "") for text in texts) and len(list(picture)) > 10, texts
    unzoom.click()
    assert driver.execute_script("return escapement.range.lo") is None and not unzoom.is_displayed()
    # The link opens what was seen, in a page that knows nothing else.
    driver.get("about:blank")
    driver.get(address)
    state = driver.execute_script("return [escapement.range.lo, escapement.range.hi, escapement.clock.t, escapement.cursors.a, escapement.cursors.b]")
    assert np.allclose(state, [1.5, 2.5, 1.75, 1.2, 4.7]), (address, state)


def check_times(driver, run):
    """Computing and waiting add up to the wall time."""
    wall = json.loads((run / "summary.json").read_text())["wall_time_s"]
    sums = driver.execute_script("return [...document.querySelectorAll('#time .track')].map((track) => [...track.children].map((part) => Number(part.dataset.seconds)))")
    assert len(sums) == 2 and all(np.isclose(sum(parts), wall, rtol=1e-6) and parts[0] > 0 for parts in sums), (wall, sums)
    assert driver.find_elements(By.CSS_SELECTOR, "#time .keys span")


def check_widths(driver):
    """Nothing overflows the page, and no title is truncated."""
    for theme in ("light", "dark"):
        driver.execute_script("escapement.setTheme(arguments[0])", theme)
        for width in WIDTHS:
            driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False})
            time.sleep(0.3)
            wide, room = driver.execute_script("return [document.documentElement.scrollWidth, document.documentElement.clientWidth]")
            assert wide <= room, f"at {width} the page is {wide} wide"
            cut = driver.execute_script("""return [...document.querySelectorAll('h1, h2, h3, #runs span, .verdict, .legend span, .name')].filter((node) => {
                const box = node.getBoundingClientRect();
                return box.width && (box.right > document.documentElement.clientWidth + 1 || node.scrollWidth > node.clientWidth + 1 && getComputedStyle(node).overflow !== 'visible');
            }).map((node) => node.textContent)""")
            assert not cut, f"at {width} cut off: {cut}"
    driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def check_two(driver, first, second):
    """Two runs: a curve of each, and their difference at the samples of the first."""
    names = driver.execute_script("return escapement.data.runs.map((run) => run.name)")
    assert names == ["forward.delay = 20 ms", "forward.delay = 0.1 s"] or names == ["forward.delay = 20 ms", "forward.delay = 100 ms"], names
    assert [row["key"] for row in driver.execute_script("return escapement.data.differences")] == ["connections.forward.delay"]
    for figure, stream, field, scale in (("light.motion.velocity", "light.motion", "velocity", 1), ("both", "heavy.motion", "position", 1000)):
        a, b = streams(first)[stream][3], streams(second)[stream][3]
        found = driver.execute_script("return escapement.open(arguments[0]).differences.map((s) => [Array.from(s.y, (_, k) => s.t(k)), Array.from(s.y)])", figure)
        t, y = np.array(found[0][0]), np.array(found[0][1])
        k = np.searchsorted(a["t"], t - 1e-9)
        expected = scale * b[field] - scale * a[field]
        assert len(y) > 500 and np.allclose(y, expected[k], rtol=1e-9, atol=1e-12), figure
        assert np.isclose(y.max(), expected.max(), rtol=1e-9) and np.isclose(y.min(), expected.min(), rtol=1e-9), figure
        assert driver.execute_script("return escapement.open(arguments[0]).below.panels.length", figure) == 1


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("lander")
    arguments.add_argument("--screenshots", type=pathlib.Path)
    args = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        go = lambda *words: subprocess.run([str(word) for word in words], check=True, stdout=sys.stderr)
        go(args.program, "run", "examples/spring/spring.toml", "--quiet", "--out", folder / "spring")
        go(args.program, "run", "tests/pages/trolleys.toml", "--quiet", "--out", folder / "trolleys")
        go(args.program, "run", "tests/pages/trolleys.toml", "--quiet", "--set", "connections.forward.delay=100ms", "--out", folder / "late")
        go(args.lander, "run", "examples/lander/lander.toml", "--in-process", "--quiet", "--out", folder / "lander")
        for program, run in ((args.program, "spring"), (args.program, "trolleys"), (args.lander, "lander")):
            go(program, "report", folder / run, "--figures", folder / f"{run}-figures")
        go(args.program, "report", folder / "trolleys", folder / "late", "--out", folder / "two.html")
        go(args.program, "report", folder / "trolleys", folder / "late", "--label", "as it was", "--out", folder / "named.html")
        driver = browser(str(folder))
        try:
            for run in ("spring", "trolleys", "lander"):
                page = folder / run / "report.html"
                driver.get(page.as_uri())
                points = check_signals(driver, folder / run)
                if run == "trolleys":
                    points += check_panels(driver, folder / run)
                    check_controls(driver, folder / run, page)
                if run != "lander":
                    check_times(driver, folder / run)
                check_widths(driver)
                check_no_requests_or_messages(driver, page)
                pictures = sorted(path.stem for path in (folder / f"{run}-figures").glob("*.svg"))
                print(f"{run}: {points} points are those of the tape; as files: {', '.join(pictures)}")
                if args.screenshots:
                    args.screenshots.mkdir(parents=True, exist_ok=True)
                    driver.get(page.as_uri())
                    time.sleep(1.0)
                    driver.save_screenshot(str(args.screenshots / f"{run}.png"))
            driver.get((folder / "two.html").as_uri())
            check_two(driver, folder / "trolleys", folder / "late")
            check_widths(driver)
            driver.get((folder / "named.html").as_uri())
            assert driver.execute_script("return escapement.data.runs[0].name") == "as it was"
            print("two runs: named by what differs, with their difference at each sample")
        finally:
            driver.quit()


if __name__ == "__main__":
    main()
