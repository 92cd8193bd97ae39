"""The page of a list of cases: every value is the table's, a click sorts, and what failed is named.

    python3 tests/pages/check_cases.py ORCHESTRATOR [--screenshots DIR]

Needs what check_report.py beside this file needs.
"""

import argparse
import csv
import math
import pathlib
import subprocess
import sys
import tempfile
import time

from check_report import browser, check_no_requests_or_messages

CASES = """
title = "Springs that are not as they should be"

[[case]]
name = "healthy"

[[case]]
name = "far <b>apart</b>"
set = { "participants.left.parameters.position" = 0.3 }

[[case]]
name = "late"
set = { "connections.to-right.delay" = "0.1 s" }
faults = [{ at = "1 s", until = "2 s", connection = "to-left", drop = 0.5 }]

[[case]]
name = "no such thing"
set = { "participants.right.parameters.position" = "much" }
"""


def cells(driver):
    return driver.execute_script("return [...document.querySelectorAll('#cases tbody tr')].map((row) => [...row.cells].map((cell) => cell.textContent))")


def number(text):
    return math.nan if text in ("", "—") else float(text.replace("−", "-"))


def check_values(driver, table):
    """Each cell is what the table has, to the six digits that are shown."""
    heads = driver.execute_script("return [...document.querySelectorAll('#cases thead th')].map((head) => head.textContent)")
    rows = cells(driver)
    assert [row[1] for row in rows] == ["healthy", "far <b>apart</b>", "late", "no such thing"] == [row["case"] for row in table], rows
    outcome = heads.index("outcome")
    assert [row[outcome] for row in rows] == [row["outcome"] for row in table], rows
    assert rows[0][outcome] == "met" and rows[1][outcome] == "not-met" and rows[3][outcome] not in ("met", "not-met"), rows
    # What has a limit is compared, and nothing else.
    swing = outcome + 1
    assert heads[swing].startswith("swing") and heads[swing + 1] == "connections.to-right.delay", heads
    key = next(name for name in table[0] if name.startswith("swing"))
    for row, own in zip(rows, table):
        shown, there = number(row[swing]), number(own[key])
        assert math.isnan(shown) and math.isnan(there) or math.isclose(shown, there, rel_tol=1e-5), (row, own)
    red = driver.execute_script("return [...document.querySelectorAll('#cases tbody tr')].map((row) => row.cells[arguments[0]].style.background.includes('--bad'))", swing)
    assert red == [False, True, red[2], False], red
    return len(rows) * len(heads), swing


def check_sorting(driver, at):
    for again in (False, True):
        driver.execute_script("document.querySelectorAll('#cases thead button')[arguments[0]].click()", at)
        values = [number(row[at]) for row in cells(driver)]
        there = [value for value in values if not math.isnan(value)]
        assert there == sorted(there, reverse=again) and len(there) == 3, values
    driver.execute_script("document.querySelector('#cases thead th button').click()")
    assert [row[0] for row in cells(driver)] == ["1", "2", "3", "4"]


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("--screenshots", type=pathlib.Path)
    args = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "cases.toml").write_text(CASES)
        out = folder / "out"
        words = [args.program, "faults", "examples/spring/spring.toml", "--cases", folder / "cases.toml", "--quiet", "--out", out]
        done = subprocess.run([str(word) for word in words], stdout=sys.stderr)
        # one point did not run to its end
        assert done.returncode == 1, done
        with open(out / "table.csv", newline="") as text:
            table = list(csv.DictReader(text))
        driver = browser(str(folder))
        try:
            page = out / "report.html"
            driver.get(page.as_uri())
            count, swing = check_values(driver, table)
            check_sorting(driver, swing)
            wrong = driver.execute_script("return document.querySelector('#success').textContent")
            assert "2 of 3" not in wrong and "no such thing" in wrong and "much" in wrong, wrong
            drawn = driver.execute_script("return document.querySelectorAll('#figures canvas').length")
            assert drawn == 3, drawn
            check_no_requests_or_messages(driver, page)
            print(f"cases: {count} cells are those of the table, {drawn} figures are drawn")
            if args.screenshots:
                args.screenshots.mkdir(parents=True, exist_ok=True)
                driver.get(page.as_uri())
                time.sleep(1.0)
                driver.save_screenshot(str(args.screenshots / "cases.png"))
        finally:
            driver.quit()


if __name__ == "__main__":
    main()
