"""The playback of runs whose scenario says what it shows: a lander, whose height and thrust are single numbers, and a crane of two
participants in Python, with a URDF whose joints follow centimetres and degrees.

    python3 tests/pages/check_scene.py ORCHESTRATOR LANDER [--python PYTHON] [--screenshots DIR]

What is drawn at an instant is compared with what numpy makes of the tape. PYTHON is an interpreter that has the package `escapement`;
without one the crane is left out, with a message. Needs what check_report.py beside this file needs, and the
packages of tests/exports/requirements.txt.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
from check_any import streams
from check_report import browser, check_no_requests_or_messages
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from selenium.webdriver.common.by import By


def pose(driver, body, t):
    found = driver.execute_script("return escapement.player.scenes[0].pose(arguments[0], arguments[1])", body, t)
    return np.array(found["p"]), np.array(found["q"])


def at(records, field, t):
    """A field at an instant, linear between samples as the playback draws it."""
    values = np.asarray(records[field], dtype=float).reshape(len(records), -1)
    return np.array([np.interp(t, records["t"], values[:, i]) for i in range(values.shape[1])])


def instants(driver):
    """Those that the page has, so that nothing is drawn between two."""
    t = np.array(driver.execute_script("return Array.from(escapement.player.scenes[0].motion.t)"))
    return t[[0, len(t) // 5, len(t) // 2, -2, -1]]


def picture(driver):
    return driver.execute_script("""
        escapement.player.draw();
        const g = escapement.player.gl.gl, [w, h] = [g.drawingBufferWidth, g.drawingBufferHeight], p = new Uint8Array(4 * w * h);
        g.readPixels(0, 0, w, h, g.RGBA, g.UNSIGNED_BYTE, p);
        return [p.reduce((sum, x) => (31 * sum + x) | 0, 7), p.reduce((sum, x, i) => sum + (i % 4 === 3 && x > 0), 0)];""")


def check_controls(driver, marks):
    """Cameras, layers, the slider and its marks, in both themes."""
    names = [button.text for button in driver.find_elements(By.CSS_SELECTOR, ".cameras button")]
    assert names[0] == "Camera" and {"Overview", "Side", "Top"} <= set(names), names
    # Where the first arrow is longest, so that there is one to be left out.
    driver.execute_script("""
        const { motion, arrows } = escapement.player.scenes[0], length = (t) => Math.hypot(...(motion.at(arrows[0].arrow.of, t) || [0]));
        escapement.setTheme('light'); escapement.clock.set(motion.t.reduce((best, t) => length(t) > length(best) ? t : best));""")
    seen = []
    for camera in driver.find_elements(By.CSS_SELECTOR, ".cameras button"):
        camera.click()
        total, inked = picture(driver)
        # From above a descent is a point.
        assert inked > (0 if camera.text == "Top" else 500), f"{camera.text}: nothing is drawn"
        seen.append(total)
    assert len(set(seen)) == len(seen), "cameras differ"
    driver.find_elements(By.CSS_SELECTOR, ".cameras button")[0].click()
    for toggle in driver.find_elements(By.CSS_SELECTOR, ".shows button"):
        before = picture(driver)
        toggle.click()
        if toggle.text != "Labels":
            assert picture(driver) != before, f"{toggle.text} makes no difference"
        toggle.click()
    before = picture(driver)
    driver.execute_script("const s = document.getElementById('scrub'); s.value = 0.8 * s.max; s.dispatchEvent(new Event('input'))")
    assert picture(driver) != before, "the slider moves the picture"
    assert len(driver.find_elements(By.CSS_SELECTOR, "#marks button")) == marks


def check_lander(driver, run):
    lander, thrust = streams(run)["lander.motion"][3], streams(run)["autopilot.command"]
    for t in instants(driver):
        p, q = pose(driver, "lander", t)
        assert np.allclose(p, [0, 0, at(lander, "height", t)[0]], rtol=1e-6, atol=1e-4) and np.allclose(q, [1, 0, 0, 0]), (t, p, q)
        # The newest thrust at or before that instant, as a reader would see it.
        k = np.searchsorted(thrust[3]["t"], t + 1e-9) - 1
        drawn = driver.execute_script("const s = escapement.player.scenes[0]; return s.motion.at(s.arrows[0].arrow.of, arguments[0])", t)
        assert np.allclose(drawn, [0, 0, thrust[3]["thrust"][k]], rtol=1e-6), (t, drawn)
    read = driver.find_element(By.CSS_SELECTOR, ".hud table").text
    assert "to the ground" in read, read
    assert "thrust, 1 m =" in driver.find_element(By.CSS_SELECTOR, ".scale").text


def check_export(program, run):
    """In 3-D panels of other tools the lander stands where it does on the tape, and its solids hang on it."""
    subprocess.run([program, "export", run, "--to", "mcap"], check=True, stdout=sys.stderr)
    lander = streams(run)["lander.motion"][3]
    placed, solids = [], []
    with open(run / "export/run.mcap", "rb") as file:
        for _, channel, message, decoded in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics=["/tf", "/scene"]):
            if channel.topic == "/scene":
                solids += [(entity.frame_id, len(entity.cylinders) + len(entity.cubes)) for entity in decoded.entities]
            else:
                placed += [(message.log_time * 1e-9, t.translation.z) for t in decoded.transforms if (t.parent_frame_id, t.child_frame_id) == ("N", "lander")]
    t, z = np.array(placed).T
    assert len(t) > 1000 and np.allclose(z, lander["height"][np.searchsorted(lander["t"], t - 1e-6)], rtol=0, atol=1e-9)
    assert sorted(solids) == [("lander/lander", 4), ("pad/pad", 1)], solids


def check_crane(driver, run):
    hook = streams(run)["crane.hook"][3]
    for t in instants(driver):
        p, q = pose(driver, "load", t)
        assert np.allclose(p, at(hook, "load", t), atol=1e-5), (t, p)
        k = np.argmin(np.abs(hook["t"] - t))
        x, y, z, w = hook["turned"][k]
        assert np.allclose(q, [w, x, y, z], atol=1e-6), (t, q)
        # The URDF's rope ends at the load: its joints follow fields in cm and degrees.
        (_, _, (place, turn)), = driver.execute_script("""
            const s = escapement.player.scenes[0];
            return s.links(s.spec.bodies.find((body) => body.name === "gantry"), arguments[0]);""", t)
        w, x, y, z = turn
        down = np.array([-2 * (x * z + w * y), -2 * (y * z - w * x), -(1 - 2 * (x * x + y * y))])
        assert np.allclose(np.array(place) + 4 * down, at(hook, "load", t), atol=1e-4), (t, place, turn)
        assert np.isclose(place[0], at(hook, "rail", t)[0] / 100, atol=1e-5), (t, place)


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("lander")
    arguments.add_argument("--python")
    arguments.add_argument("--screenshots", type=pathlib.Path)
    args = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        environment = dict(os.environ, ESCAPEMENT=str(pathlib.Path(args.program).resolve()))
        go = lambda *words: subprocess.run([str(word) for word in words], check=True, stdout=sys.stderr, env=environment)
        runs = [("lander", args.lander, "examples/lander/lander.toml", ["--fault", "name=gust,output=lander.motion,field=velocity,kind=bias,value=0.2 m/s,at=20 s,until=21 s"], check_lander, 1)]
        if args.python:
            sets = [f"--set=participants.{name}.run.exe={json.dumps(args.python)}" for name in ("crane", "driver")]
            runs.append(("crane", args.program, "examples/python/crane.toml", sets, check_crane, 0))
        else:
            print("crane: left out, because no --python is given")
        driver = browser(str(folder))
        try:
            for name, program, scenario, more, check, marks in runs:
                go(program, "run", scenario, "--quiet", *more, "--out", folder / name)
                go(program, "report", folder / name)
                page = folder / name / "report.html"
                driver.get(page.as_uri())
                check(driver, folder / name)
                events = len([event for event in driver.execute_script("return escapement.data.runs[0].marks")])
                assert events >= marks, events
                check_controls(driver, events)
                if name == "lander":
                    check_export(program, folder / name)
                check_no_requests_or_messages(driver, page)
                print(f"{name}: bodies, joints and arrows are those of the tape; cameras, layers and slider move the picture")
                if args.screenshots:
                    args.screenshots.mkdir(parents=True, exist_ok=True)
                    driver.execute_script("escapement.setTheme('dark'); escapement.clock.set(0.3 * escapement.clock.end); window.scrollTo(0, 0)")
                    time.sleep(1.0)
                    driver.find_element(By.ID, "stage").screenshot(str(args.screenshots / f"scene-{name}.png"))
        finally:
            driver.quit()


if __name__ == "__main__":
    main()
