#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Runs a small study and looks at its report in headless Chromium. usage: report_test.py STIPPLE
KEEP=DIR keeps the report and screenshots there."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

STUDY = {
    "scene": "ball.scene.json", "title": "A ball </script> & more", "text": "First.\n\nSecond.",
    "settings": {"width": 64, "height": 48}, "repetitions": 2, "later_frames": 1, "reference_rays": 16,
    "sweeps": [
        {"name": "points", "axes": {"samples": [1, 2, 4], "subpixels": [1, 2]}},
        {"name": "raycast", "settings": {"method": "raycast", "subpixels": 1}, "axes": {"samples": [1, 4]},
         "reference": True}],
    "plots": [
        {"title": "Quality", "x": "later_seconds", "y": "psnr", "series": ["subpixels"], "x_scale": "log"},
        {"title": "Time", "x": "points_drawn", "y": "later_seconds", "sweeps": ["points"], "fit": "linear"}]}
SCENE = {
    "version": 1, "root": "ball", "assets": {"ball": {"generate": "sphere", "triangles": 500}},
    "cameras": [{"name": "front", "eye": [0, 0, 3], "target": [0, 0, 0]}]}


def check(condition, what):
    if not condition:
        sys.exit("FAILED: " + what)


def browse(page, folder):
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1200,900"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
    try:
        browser.get(page.as_uri())
        run = browser.execute_script
        check(run("return document.title") == STUDY["title"], "the title")
        check(run("return charts.length") == 2, "two charts")
        # Every line has points with numbers, and something is painted in its colour.
        points = run("return charts.map(c => c.data.datasets.filter(d => !d.band).map(d => d.data.length))")
        check(points == [[3, 3, 2], [6]], f"points of the lines: {points}")
        bands = run("return charts[0].data.datasets.filter(d => d.band).length")
        check(bands >= 4, f"bands: {bands}")
        painted = run("""const c = charts[0].canvas, d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
            let n = 0; for (let i = 0; i < d.length; i += 4)
                n += Math.abs(d[i] - 0x1f) + Math.abs(d[i+1] - 0x6f) + Math.abs(d[i+2] - 0x54) < 30 && d[i+3] > 200;
            return n""")
        check(painted > 50, f"the first line is not painted ({painted} pixels)")
        check(len(run("return [...document.querySelectorAll('#answers tbody tr')].map(r => r.innerText)")) == 2, "two answers")
        # The slider uncovers the other picture.
        widths = run("""const s = document.getElementById('slider'), w = [];
            for (const v of [200, 800]) { s.value = v; s.dispatchEvent(new Event('input')); w.push(document.getElementById('over').clientWidth); }
            return w""")
        check(widths[1] > 3 * widths[0] > 0, f"slider: {widths}")
        # The difference of two different pictures is not black, and the wheel zooms into it.
        browser.set_script_timeout(10)
        bright = browser.execute_async_script("""const done = arguments[0]; setTimeout(() => {
            const c = document.getElementById('difference'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
            let n = 0; for (let i = 0; i < d.length; i += 4) n += d[i] > 0; done(n) }, 500)""")
        check(bright > 10, "the difference is black")
        scale = run("""const c = document.getElementById('difference');
            const pixels = () => c.getContext('2d').getImageData(0, 0, c.width, c.height).data.join();
            const before = pixels();
            c.dispatchEvent(new WheelEvent('wheel', { deltaY: -700, clientX: c.getBoundingClientRect().x + 100,
                clientY: c.getBoundingClientRect().y + 100, bubbles: true, cancelable: true }));
            return before !== pixels()""")
        check(scale, "the wheel does not zoom")
        browser.save_screenshot(str(folder / "wide.png"))
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                                {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True})
        browser.get(page.as_uri())
        over = run("return document.documentElement.scrollWidth - document.documentElement.clientWidth")
        check(over <= 1, f"{over} pixels too wide for a phone")
        browser.save_screenshot(str(folder / "phone.png"))
        # The test itself reads pixels back more often than Chromium likes.
        log = [entry["message"] for entry in browser.get_log("browser")
               if "willReadFrequently" not in entry["message"]]
        check(not log, f"console: {log}")
    finally:
        browser.quit()


def main():
    stipple = sys.argv[1]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(os.environ.get("KEEP", name))
        folder.mkdir(exist_ok=True)
        (folder / "ball.scene.json").write_text(json.dumps(SCENE))
        (folder / "ball.study.json").write_text(json.dumps(STUDY))
        environment = {**os.environ, "STIPPLE_CACHE": str(folder / "cache")}
        subprocess.run([stipple, "study", "ball.study.json", "-o", "result", "-q"], cwd=folder, check=True, env=environment)
        browse(folder / "result" / "report.html", folder)
    print("passed")


main()
