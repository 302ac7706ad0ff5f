"""The report page: what it says, that it asks nothing of the network, and how it behaves in a real browser."""

from __future__ import annotations

import io
import json
import re
import shutil
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.commands import run
from PIL import Image

from gentamp_lp import solve
from gentamp_lp.explaining.what_it_does import retrace
from gentamp_lp.learning.learn import Learned
from gentamp_lp.policy.policy import Policy
from gentamp_lp.report.page import page, report

BROWSER, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")


@pytest.fixture(scope="module")
def written(load: Learned, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle of Load, a plan, and their page, as the command writes them."""
    folder = tmp_path_factory.mktemp("report")
    load.save(folder / "load")
    plan = solve(load.task, "2-2", 1, policy=load.policy).plan
    assert plan is not None
    plan.save(folder / "plan.json")
    done = run("report", "load", "--plan", "plan.json", "--json", "--no-cache", cwd=folder)
    assert done.returncode == 0, done.stderr
    (folder / "shown.json").write_text(done.stdout)
    return folder


def test_the_page_shows_the_policy_the_plan_and_the_demonstrations(load: Learned, written: Path) -> None:
    shown = json.loads((written / "shown.json").read_text())
    assert Path(shown["file"]) == written / "load-report.html" and shown["bytes"] < 3_000_000
    assert [f["name"] for f in shown["features"]] == [f.name for f in load.policy.features]
    states = {state["state"] for state in shown["states"]}
    assert {load.policy.show(rule.valuation) for rule in load.policy.rules} <= states
    assert all(name in shown["graph"].replace("&gt;", ">") for name in states)
    assert [r["title"].split(":")[0] for r in shown["runs"]] == ["Plan", *(f"Demonstration {n}" for n in (1, 2, 3, 4))]
    frames = shown["runs"][0]["animation"]["frames"]
    steps = json.loads((written / "plan.json").read_text())["steps"]
    assert sorted({step for step, _ in frames}) == list(range(len(steps) + 1))
    assert shown["pruning"] and shown["seconds"]["total"] > 0


def test_demonstrations_follow_the_policy_to_the_goal(learned: Learned) -> None:
    for states in retrace(learned.policy, learned.dataset, learned.task):
        assert states[-1].does == "nothing: this is a goal"
        for before, after in pairwise(states):
            assert f"({before.step.split('(')[0]})" in before.does
            for name, word in re.findall(r"(f\d) (\w+)", before.does):
                change = after.values[name] - before.values[name]
                assert change > 0 if word == "rises" else change < 0 if word == "falls" else change != 0
            for name, entities in before.holds.items():
                assert len(entities) == before.values[name]


def test_the_page_asks_nothing_of_the_network_and_runs_nothing_it_is_told(written: Path) -> None:
    text = (written / "load-report.html").read_text()
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", text)
    assert "default-src 'none'" in text
    hostile = "</script><script>alert(1)</script><!--"
    shown = json.loads((written / "shown.json").read_text()) | {"task": hostile, "description": hostile}
    text = page(shown)
    assert hostile not in text
    data = text.split('id="data">')[1].split("</script>")[0]
    assert json.loads(data)["description"] == hostile


def test_names_in_the_graph_are_escaped(unstack: Learned, tmp_path: Path) -> None:
    first, *others = unstack.policy.actions
    hostile = replace(first, schemas=('"><img src=x onerror=alert(1)>',))
    policy = replace(unstack.policy, actions=(hostile, *others))
    assert "<img" not in report(policy, tmp_path, unstack.task, cache=False).graph


def test_a_bundle_without_a_report_has_a_page(unstack: Learned, tmp_path: Path) -> None:
    unstack.save(tmp_path / "old")
    (tmp_path / "old" / "report.json").unlink()
    shown = report(Policy.load(tmp_path / "old"), tmp_path / "old", unstack.task, cache=False)
    assert shown.seconds == {} and shown.pruning == [] and len(shown.runs) == 1
    page(shown.dump())


def test_a_plan_of_another_task_is_refused(written: Path, unstack: Learned) -> None:
    unstack.save(written / "unstack")
    done = run("report", "unstack", "--plan", "plan.json", "--no-cache", cwd=written)
    assert done.returncode == 2 and "is for task `load`" in done.stderr
    assert not (written / "unstack-report.html").exists()


def _browser(*arguments: str) -> Any:
    webdriver = pytest.importorskip("selenium.webdriver")
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in ("--headless=new", "--no-sandbox", "--window-size=1300,1000", *arguments):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    return webdriver.Chrome(options, webdriver.ChromeService(DRIVER))


SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
needs_browser = pytest.mark.skipif(
    not (BROWSER and DRIVER), reason="no browser: apt-get install chromium chromium-driver"
)


@needs_browser
def test_hostile_words_are_shown_and_not_run(written: Path) -> None:
    hostile = "</script><script>document.title='taken'</script><img src=https://example.org/x onerror=\"alert(1)\">"
    shown = json.loads((written / "shown.json").read_text())
    shown |= {"task": hostile, "description": hostile, "notes": [hostile]}
    shown["features"][0]["formula"] = hostile
    shown["runs"][0]["states"][0]["step"] = hostile
    (written / "hostile.html").write_text(page(shown))
    with _browser(*SOFTWARE) as browser:
        browser.get((written / "hostile.html").as_uri())
        assert browser.find_element("id", "description").text == hostile
        assert hostile in browser.find_element("id", "moment").text
        assert hostile in browser.find_element("id", "features").text
        assert browser.title.startswith("</script>") and not browser.find_elements("css selector", "img")
        assert _requests(browser) <= {"file", "data"}


@needs_browser
def test_without_webgl_the_steps_still_work(written: Path) -> None:
    with _browser("--disable-3d-apis") as browser:
        browser.get((written / "load-report.html").as_uri())
        assert "cannot draw" in browser.find_element("id", "view").text
        browser.find_element("id", "next").click()
        assert "State 1 " in browser.find_element("id", "moment").text
        browser.find_element("id", "home").click()
        assert browser.get_log("browser") == []


def _requests(browser: Any) -> set[str]:
    """The schemes of everything that the browser asked for."""
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
    assert asked
    return {url.partition(":")[0] for url in asked}


@needs_browser
@pytest.mark.parametrize(("width", "height"), [(390, 844), (1280, 800)])
def test_people_can_use_the_page(written: Path, width: int, height: int) -> None:
    pytest.importorskip("selenium.webdriver")
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.wait import WebDriverWait

    with _browser(*SOFTWARE) as browser:
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.get((written / "load-report.html").as_uri())
        WebDriverWait(browser, 60).until(lambda b: b.find_elements("css selector", "iframe[data-ready]"))
        assert browser.execute_script("return document.documentElement.scrollWidth <= innerWidth")
        shown = json.loads((written / "shown.json").read_text())

        def text(selector: str) -> str:
            return str(browser.find_element("css selector", selector).text)

        graph = browser.find_element("id", "graph").shadow_root
        for node in graph.find_elements("css selector", ".s"):
            state = next(s for s in shown["states"] if s["state"] == node.get_attribute("data-state"))
            browser.execute_script("arguments[0].focus()", node)
            node.send_keys(Keys.ENTER)
            assert state["values"][0] in text("#state")
            assert (state["does"] or "Nothing is left") in text("#state")
        node = graph.find_element("css selector", ".s")
        node.find_element("css selector", "text").click()
        assert "chosen" in str(node.get_attribute("class"))

        states = shown["runs"][0]["states"]
        browser.find_element("id", "next").click()
        assert states[1]["step"] in text("#moment") and "State 1" in text("#moment")
        browser.find_element("css selector", "h1").click()
        browser.find_element("css selector", "body").send_keys(Keys.ARROW_LEFT)
        assert "State 0" in text("#moment")
        where = "const w=document.querySelector('iframe').contentWindow; return [...Array(9).keys()].map(n=>w.scene.getObjectByName('n'+n)?.position.toArray())"  # noqa: E501
        before = browser.execute_script(where)
        browser.find_element("id", "play").click()
        WebDriverWait(browser, 60).until(lambda _: f"State {len(states) - 1} of" in text("#moment"))
        assert browser.execute_script(where) != before
        WebDriverWait(browser, 60).until(lambda _: text("#play") == "Play")
        camera = "document.querySelector('iframe').contentWindow.camera"
        seen = f"return Math.tan({camera}.fov*Math.PI/360)*{camera}.aspect"
        angle = np.radians(shown["runs"][0]["animation"]["camera"]["angle"] / 2)
        assert browser.execute_script(seen) >= np.tan(angle) * 4 / 3 - 1e-6  # things beside each other are in view
        eye = "return document.querySelector('iframe').contentWindow.camera.position.toArray()"
        first = browser.execute_script(eye)
        frame = browser.find_element("css selector", "iframe")
        browser.execute_script("arguments[0].focus()", frame)
        ActionChains(browser).send_keys(Keys.ARROW_LEFT, Keys.ARROW_UP).perform()
        WebDriverWait(browser, 60).until(lambda _: browser.execute_script(eye) != first)
        browser.find_element("id", "home").click()
        assert browser.execute_script(eye) == pytest.approx(first, abs=1e-6)
        pixels = np.asarray(Image.open(io.BytesIO(frame.screenshot_as_png)).convert("RGB")).reshape(-1, 3)
        assert len(np.unique(pixels, axis=0)) > 50  # a picture, not an empty canvas
        names = {name for found in states[0]["holds"].values() for name in found}
        browser.find_element("id", "first").click()
        assert all(name in text("#moment") for name in names)  # all of them, however many
        browser.find_element("css selector", "#run option:last-child").click()
        assert not browser.find_element("id", "stage").is_displayed()
        browser.find_element("id", "next").click()
        assert shown["runs"][-1]["states"][1]["step"] in text("#moment")
        time.sleep(0.2)
        assert browser.get_log("browser") == []
        assert _requests(browser) <= {"file", "data"}
