"""The page in a browser: it draws without an error, without a network, zooms, and fits a phone."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from etac_ros.report import write_report
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium"),
]
SIZES = {"wide": (1600, 1000), "phone": (390, 844)}


@pytest.fixture(scope="module")
def html(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    run_in_process(load("wu2018", None, ["duration_s=200"]), folder / "bag")
    return write_report(folder / "bag")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    wheels = os.environ.pop("LD_LIBRARY_PATH", None)  # the ROS wheels' own libraries are none of a browser's
    try:
        with sync_api.sync_playwright() as playwright:
            found = playwright.chromium.launch(
                executable_path=CHROMIUM, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
            )
            yield found
            found.close()
    finally:
        if wheels is not None:
            os.environ["LD_LIBRARY_PATH"] = wheels


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_the_page_draws_zooms_and_turns(html: Path, browser: Any, size: str, scheme: str) -> None:
    width, height = SIZES[size]
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme, offline=True)
    page = context.new_page()
    faults: list[str] = []
    page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(html.as_uri())
    page.wait_for_selector("body[data-drawn=yes]")
    assert page.evaluate("document.documentElement.scrollWidth") == width  # nothing sticks out
    assert page.locator("#plot-attitude .main-svg").count() > 0

    # A zoom of one figure is one of all that show the same span of time.
    spans = """name => [...document.getElementById("plot-" + name)._fullLayout._subplots.xaxis]
        .map(id => document.getElementById("plot-" + name)._fullLayout[id.replace("x", "xaxis")].range)"""
    before = page.evaluate(spans, "rate")
    page.evaluate("Plotly.relayout(document.getElementById('plot-attitude'), {'xaxis.range': [1, 2]})")
    page.wait_for_function("document.getElementById('plot-rate')._fullLayout.xaxis.range[0] == 1")
    after = page.evaluate(spans, "rate")
    assert after[0] == [1, 2]
    assert after[1:] == before[1:]

    # A name in the legend hides its curve.
    hidden = "document.getElementById('plot-attitude').data[0].visible"
    page.evaluate("Plotly.restyle(document.getElementById('plot-attitude'), {visible: 'legendonly'}, [0])")
    assert page.evaluate(hidden) == "legendonly"

    where = "document.getElementById('turning-plot').data[1].x[1]"
    start = page.evaluate(where)
    page.locator("#turning-time").fill("200")
    page.wait_for_function(f"{where} != {start}")
    assert page.locator("#turning-words").inner_text() != "t = 0 s"
    assert faults == []
    context.close()
