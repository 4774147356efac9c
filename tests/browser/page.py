"""The live page in a headless browser: page.py ROSCAUSAL AXE.js SCREENSHOTS"""

import json
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

PATIENCE = 60
QUICK = ["--method", "pcmci", "--test", "parcorr"]


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Demo:
    """A demo with a page; it ends with the test."""

    def __init__(self, roscausal, folder, *arguments):
        command = [roscausal, "demo", "--web", "--duration", "60", "--speed", "12", "--out", "out", "--do", "robot.speed=0.3@6..14", *QUICK, *arguments]
        self.process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        found = re.search(r"http://\S+", line)
        assert found, f"no address in {line!r}; {self.process.communicate(timeout=10)[1]}"
        self.url = found.group(0)

    def end(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        out, _ = self.process.communicate(timeout=30)
        return self.process.returncode, out


def browser():
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--window-size=1440,1000"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService("/usr/bin/chromedriver"))
    # axe takes its time on a busy machine.
    driver.set_script_timeout(100)
    return driver


def until(what, look, patience=PATIENCE):
    end = time.monotonic() + patience
    while time.monotonic() < end:
        try:
            seen = look()
        except Exception as error:  # the page is being redrawn
            seen, what = None, f"{what} ({error})"
        if seen:
            return seen
        time.sleep(0.1)
    raise AssertionError(f"not within {patience} s: {what}")


class Page:
    def __init__(self, roscausal, axe, pictures):
        self.roscausal, self.axe, self.pictures = roscausal, Path(axe).read_text(), Path(pictures)
        self.folder = tempfile.TemporaryDirectory()
        self.demo = Demo(roscausal, self.folder.name, "--port", str(free_port()))
        self.driver = browser()

    def js(self, script, *arguments):
        return self.driver.execute_script(f"return {script}", *arguments)

    def text(self, id):
        return self.driver.find_element(By.ID, id).text

    def picture(self, name, whole=True):
        if whole:
            height = self.js("document.documentElement.scrollHeight")
            width = self.js("window.innerWidth")
            self.driver.execute_cdp_cmd(
                "Emulation.setDeviceMetricsOverride",
                {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
            )
        self.driver.save_screenshot(str(self.pictures / f"{name}.png"))

    def look(self, width, height, scheme):
        self.driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
        )
        self.driver.execute_cdp_cmd(
            "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        )
        time.sleep(0.5)

    def violations(self, impacts=("minor", "moderate", "serious", "critical")):
        if not self.js("typeof window.axe === 'object'"):
            # Through the browser's protocol, because the page itself may not load anything from elsewhere.
            self.driver.execute_cdp_cmd("Runtime.evaluate", {"expression": self.axe})
        found = self.driver.execute_async_script(
            "const done = arguments[0]; axe.run().then((r) => done(r.violations.filter((v) => arguments[1].includes(v.impact)).map((v) => "
            "[v.id, v.help, v.nodes.map((n) => n.target.join(' ') + ': ' + n.failureSummary).slice(0, 5)])))".replace("arguments[1]", json.dumps(impacts))
        )
        assert found == [], json.dumps(found, indent=1)

    # The tests, in this order.

    def it_opens_and_is_live(self):
        self.driver.get(self.demo.url)
        assert self.driver.title == "roscausal"
        until("the page is live", lambda: self.text("connection") == "live")

    def the_scene_moves(self):
        place = lambda: self.js("document.querySelector('#scene #robot g').getAttribute('transform')")
        person = lambda: self.js("document.querySelector('#scene .chosen g').getAttribute('transform')")
        first = until("a robot", place), until("a person", person)
        until("the robot moves", lambda: place() != first[0])
        until("the person moves", lambda: person() != first[1])
        until("the cone", lambda: self.js("document.querySelectorAll('#scene .cone').length"))
        until("words", lambda: "from the robot, risk" in self.text("scene-text"))

    def the_charts_go_on(self):
        # On a slow machine they are full when they are first looked at; then they move on.
        course = lambda: self.js("document.querySelector('.chart .course').getAttribute('d')")
        first = until("a course", course)
        until("the course goes on", lambda: course() != first)
        assert len(self.driver.find_elements(By.CLASS_NAME, "chart")) == 3

    def a_batch_fills(self):
        until("rows", lambda: re.match(r"\d+ of 100 rows", self.text("recording-text")))

    def a_model_arrives(self):
        until("a model", lambda: self.js("document.querySelectorAll('#graph .node').length") == 3)
        until("its links", lambda: "drives" in self.text("links"))
        assert re.search(r"drives", self.js("document.getElementById('graph').getAttribute('aria-label')"))
        assert self.text("model-title").startswith("Model ")
        # How sure a link is shows in its dashes: the p-value is in the arrow's name.
        arrows = self.js("[...document.querySelectorAll('#graph .ask[role=button]')].map((a) => [a.getAttribute('aria-label').split(', ').at(-1), a.querySelector('path:not(.reach, .halo)').getAttribute('stroke-dasharray')])")
        for said, dashes in arrows:
            p = 0 if said.startswith("p <") else float(said.removeprefix("p = "))
            # Rounded, this may be on either side.
            assert p == 0.01 or dashes == (None if p == 0 else "14 5" if p < 0.01 else "5 4"), (said, dashes)

    def a_link_is_asked_by_click_and_by_key(self):
        def asked():
            return self.js("!document.getElementById('asked').hidden && document.getElementById('asked').textContent")

        # The newest model, so that no later one comes between arrow and answer.
        # Found and pressed in one step: a model that arrives draws the arrows anew.
        said = until("a name", lambda: self.js("document.querySelector('#graph .ask[role=button]')?.getAttribute('aria-label')"))
        self.js("document.querySelector('#graph .ask[role=button]').dispatchEvent(new MouseEvent('click', {bubbles: true}))")
        until("the evidence", asked)
        found = until("its plots", lambda: self.js("document.querySelectorAll('#asked .plots svg').length") >= 2)
        # What is on the screen is what the model's file says.
        shown = self.js("document.querySelector('#asked h3').textContent")
        cause, lag = re.match(r"(\S+) at t-(\d+)", shown).groups()
        effect = re.search(r"drives (\S+):", shown).group(1).replace("itself", cause)
        batch = self.text("model-title").split(" samples from ")[1]
        # Until its end a run works in a folder of its own within the one of its results.
        models = next((Path(self.folder.name) / "out").glob(".roscausal/work-*/set/cm_pool"))
        model = json.loads((models / f"{batch}.json").read_text())
        evidence = json.loads((models / "evidence" / f"{batch}.json").read_text())
        same = lambda link: (link["cause"], link["effect"], link["lag"]) == (cause, effect, int(lag))
        link, seen = next(filter(same, model["links"])), next(filter(same, evidence["links"]))
        facts = self.js("Object.fromEntries([...document.querySelectorAll('#asked dl div')].map((d) => [...d.children].map((c) => c.textContent)))")
        assert abs(float(facts["strength"]) - link["value"]) < 1e-3, (facts, link)
        assert int(facts["samples"]) == seen["n_samples"], facts
        dots = self.js("document.querySelector('#asked .dots').getAttribute('d').split('M').length - 1")
        assert dots == len(seen["scatter"]), (dots, len(seen["scatter"]))
        webdriver.ActionChains(self.driver).send_keys(Keys.ESCAPE).perform()
        until("it is closed", lambda: self.js("document.getElementById('asked').hidden"))
        self.js("document.querySelector('#graph .ask[role=button]').focus()")
        webdriver.ActionChains(self.driver).send_keys(Keys.ENTER).perform()
        until("the evidence again", asked)
        self.driver.find_element(By.ID, "asked-close").send_keys(Keys.ENTER)
        self.js("document.querySelector('#links .asking').focus()")
        webdriver.ActionChains(self.driver).send_keys(Keys.ENTER).perform()
        until("the evidence from the list", asked)
        assert said and found

    def the_history_is_a_slider_for_the_keyboard(self):
        until("three models", lambda: int(self.js("document.getElementById('history').max")) >= 3)
        slider = self.driver.find_element(By.ID, "history")
        slider.send_keys(Keys.HOME)
        until("the first model", lambda: self.text("model-title").startswith("Model 1,"))
        assert self.js("document.getElementById('newest').getAttribute('aria-pressed')") == "false"
        slider.send_keys(Keys.ARROW_RIGHT)
        until("the second", lambda: self.text("model-title").startswith("Model 2,"))
        count = int(self.js("document.getElementById('history').max"))
        until("one more model", lambda: int(self.js("document.getElementById('history').max")) > count)
        assert self.text("model-title").startswith("Model 2,"), "a new model takes the page away from the reader"
        self.driver.find_element(By.ID, "newest").send_keys(Keys.ENTER)
        until("the newest", lambda: int(re.search(r"Model (\d+)", self.text("model-title")).group(1)) > 2)

    def only_what_the_detector_confirms_is_called_a_change(self):
        # Nothing changes in this demo, and its detector is off: links that come and go between models are not called changes.
        for index in range(int(self.js("document.getElementById('history').max"))):
            self.js("(document.getElementById('history').value = arguments[0], document.getElementById('history').dispatchEvent(new Event('input')))", index + 1)
            until("its graph", lambda: self.js("document.querySelectorAll('#graph .ask[role=button]').length"))
            assert not re.search("appeared|vanished|confirmed", self.text("links")), self.text("links")
            assert self.js("document.querySelectorAll('#graph .halo, #timeline .change').length") == 0
        # What the detector confirms with the batch of a model is marked in it, and a suspicion is not.
        self.js("document.getElementById('newest').click()")
        script = """
            const done = arguments[0];
            import("/models.js").then((models) => {
              const { batch, links } = models.known()[0];
              const link = links.find((link) => link.cause !== link.effect);
              const change = (kind, text) => models.addChange({ t: 1, kind, text, regime: kind === "confirmed", batch, cause: link.cause, effect: link.effect });
              change("suspected", "a suspicion of the test");
              change("confirmed", "a change of the test");
              document.getElementById("history").value = 1;
              document.getElementById("history").dispatchEvent(new Event("input"));
              done(`${link.cause} ${link.effect}`);
            });"""
        pair = self.driver.execute_async_script(script)
        halos = "[...document.querySelectorAll('#graph .halo')].map((line) => `${line.parentNode.dataset.cause} ${line.parentNode.dataset.effect}`)"
        until("its mark in the graph", lambda: self.js(halos) == [pair])
        assert self.text("links").startswith("a change of the test") and "suspicion" not in self.text("links"), self.text("links")
        self.js("document.getElementById('newest').click()")

    def conclusion_and_advice_stand_beside_each_model(self):
        # Also beside those whose evidence is no longer kept.
        self.js("import('/models.js').then((models) => [...Array(30).keys()].forEach((k) => models.addEvidence({ batch: `other ${k}`, evidence: { links: [] } })))")
        for index in range(int(self.js("document.getElementById('history').max"))):
            self.js("(document.getElementById('history').value = arguments[0], document.getElementById('history').dispatchEvent(new Event('input')))", index + 1)
            for part in ("conclusion", "advice"):
                until(f"{part} of model {index + 1}", lambda: self.js(f"document.querySelectorAll('#{part} li').length"))
        assert self.text("next").startswith("Next\n"), self.text("next")
        self.js("document.getElementById('newest').click()")

    def nodes_and_messages_are_told(self):
        for node in ("robot", "human", "data", "discovery"):
            until(node, lambda: any(li.text.startswith(node) for li in self.driver.find_elements(By.CSS_SELECTOR, "#nodes > li")))
        assert "running" in self.text("nodes")
        until("messages", lambda: "model 1:" in self.text("messages"))
        assert int(self.text("models")) >= 3 and int(self.text("batches")) >= 3

    def whoever_comes_later_sees_the_history(self):
        self.driver.refresh()
        until("models", lambda: int(self.js("document.getElementById('history').max")) >= 3)
        until("charts", lambda: self.js("document.querySelector('.chart .course').getAttribute('d')?.length ?? 0") > 1000)

    def a_moment_of_the_past_is_shown_as_the_server_keeps_it(self):
        press = lambda id: self.driver.find_element(By.ID, id).send_keys(Keys.ENTER)
        moment = lambda: float(self.text("moment").split(" s of ")[0])
        until("half a minute", lambda: float(self.js("document.getElementById('seek').max")) > 30)
        press("pause")
        until("it stands still", lambda: self.text("pause") == "Play")
        self.driver.find_element(By.ID, "seek").send_keys(Keys.HOME)
        first = float(self.js("document.getElementById('seek').min"))
        until("the first moment", lambda: abs(moment() - first) < 0.06)
        # Whoever drags the slider sees the scene of that moment.
        self.js("(document.getElementById('seek').value = 20, document.getElementById('seek').dispatchEvent(new Event('input')))")
        kept = json.loads(urllib.request.urlopen(self.demo.url + "scene?t=20", timeout=10).read())
        assert abs(kept["t"] - 20) < 1, kept["t"]
        place = lambda: self.js("document.querySelector('#scene #robot g').getAttribute('transform')")
        wanted = f"translate({kept['robot']['x']:g} {-kept['robot']['y']:g})"
        until("the robot of that moment", lambda: place().startswith(wanted))
        assert self.text("time") == f"{kept['t']:.1f} s"
        press("pause")
        until("it plays", lambda: moment() > 20.5)
        press("follow-now")
        until("the newest", lambda: self.js("document.getElementById('follow-now').getAttribute('aria-pressed')") == "true")
        until("it follows", lambda: moment() > 30)

    def a_chart_reads_values_and_leads_to_their_moment(self):
        self.js("(document.getElementById('window').value = 'all', document.getElementById('window').dispatchEvent(new Event('change')))")
        chart = self.driver.find_element(By.CSS_SELECTOR, ".chart svg")
        self.js("arguments[0].scrollIntoView({block: 'center'})", chart)
        webdriver.ActionChains(self.driver).move_to_element(chart).perform()
        read = lambda: re.match(r"([\d.]+) m/s at ([\d.]+) s$", self.js("document.querySelector('.chart .value').textContent"))
        value, at = map(float, until("a value", read).groups())
        rows = json.loads(urllib.request.urlopen(self.demo.url + "series", timeout=10).read())["rows"]
        near = [row[1] for row in rows if abs(row[0] - at) < 0.6]
        assert near and min(near) - 0.006 <= value <= max(near) + 0.006, (value, near)
        webdriver.ActionChains(self.driver).move_to_element(chart).click_and_hold().move_by_offset(-40, 0).release().perform()
        until("a moment of the past", lambda: self.js("document.getElementById('follow-now').getAttribute('aria-pressed')") == "false")
        until("its scene", lambda: 0 < float(self.text("time").removesuffix(" s")) < float(self.js("document.getElementById('seek').max")) - 5)
        self.driver.find_element(By.ID, "follow-now").send_keys(Keys.ENTER)

    def variables_are_chosen_by_the_reader(self):
        self.driver.find_element(By.CSS_SELECTOR, "#choice summary").send_keys(Keys.ENTER)
        box = lambda: self.driver.find_element(By.CSS_SELECTOR, "#variables input[value=distance]")
        box().send_keys(Keys.SPACE)
        until("a chart more", lambda: "distance, person to robot" in self.text("charts"))
        assert len(self.driver.find_elements(By.CLASS_NAME, "chart")) == 4
        assert len(self.driver.find_elements(By.CSS_SELECTOR, ".chart:first-child text")) >= 3, "ticks"
        box().send_keys(Keys.SPACE)
        until("a chart less", lambda: len(self.driver.find_elements(By.CLASS_NAME, "chart")) == 3)
        assert "person 1000" in self.text("person")

    def the_scene_is_zoomed_moved_and_fitted_by_keys(self):
        seen = lambda: [float(part) for part in self.js("document.getElementById('scene').getAttribute('viewBox')").split()]
        scene = self.driver.find_element(By.ID, "scene")
        first = seen()
        scene.send_keys("+")
        until("nearer", lambda: seen()[2] < first[2])
        near = seen()
        scene.send_keys(Keys.ARROW_LEFT)
        until("farther left", lambda: seen()[0] < near[0])
        self.driver.find_element(By.ID, "fit").send_keys(Keys.ENTER)
        until("all of it", lambda: seen()[2] >= first[2])
        assert len(self.driver.find_elements(By.CSS_SELECTOR, "#scene .wall")) >= 4, "the walls of the map"

    def the_time_line_bears_batches_models_and_interventions(self):
        count = lambda kind: self.js(f"document.querySelectorAll('#timeline {kind}').length")
        models = lambda: int(self.js("document.getElementById('history').max"))
        until("models", lambda: count(".model") >= min(models(), 3) and count(".batch") >= 3)
        until("the intervention", lambda: count(".imposed") == 1)
        assert "do_robot_speed" in self.js("document.querySelector('#timeline .imposed').textContent")
        assert "1 intervention," in self.driver.find_element(By.ID, "timeline").get_attribute("aria-label")

    def the_graph_is_the_engines_own_picture(self):
        # That of the file, apart from what the page adds.
        number, batch = re.match(r"Model (\d+),.* samples from (.*)", self.text("model-title")).groups()
        models = next((Path(self.folder.name) / "out").glob(".roscausal/work-*/set/cm_pool"))
        drawn = json.loads(urllib.request.urlopen(f"{self.demo.url}model?number={number}", timeout=10).read())
        assert drawn["matrix"] is None
        arrows = lambda svg: set(re.findall(r'<g class="link" data-cause="([^"]+)" data-effect="([^"]+)"><title>[^<]*</title>', svg))
        file = (models / f"{batch}.dag.svg").read_text()
        assert arrows(file) and arrows(file) == arrows(drawn["graph"]), (arrows(file), arrows(drawn["graph"]))
        shown = lambda: self.js("[...document.querySelectorAll('#graph .link > path[fill=none]:not(.reach, .halo)')].map((p) => p.getAttribute('stroke'))")
        until("its arrows", lambda: {"#c2410c", "#1d4ed8", "#475569"} >= set(shown()) and len(shown()) >= len(arrows(file)))

    def a_click_on_somebody_in_the_scene_chooses_her(self):
        press = lambda id: self.driver.find_element(By.ID, id).send_keys(Keys.ENTER)
        press("pause")
        until("it stands still", lambda: self.text("pause") == "Play")
        self.js("(document.getElementById('seek').value = 21, document.getElementById('seek').dispatchEvent(new Event('input')))")
        until("the scene of that moment", lambda: abs(float(self.text("time").split(" ")[0]) - 21) < 1)
        scene = self.driver.find_element(By.ID, "scene")
        self.js("arguments[0].scrollIntoView({block: 'center'})", scene)

        def click(what):
            box = self.js("(() => { const b = document.querySelector(arguments[0]).getBoundingClientRect(); const s = document.getElementById('scene').getBoundingClientRect(); return [b.x + b.width / 2 - s.x - s.width / 2, b.y + b.height / 2 - s.y - s.height / 2]; })()".replace("arguments[0]", json.dumps(what)))
            webdriver.ActionChains(self.driver).move_to_element_with_offset(scene, round(box[0]), round(box[1])).click().perform()

        who = self.js("document.querySelector('#scene .chosen .label').textContent")
        click("#scene .chosen .person")
        until("the person chosen", lambda: self.js("document.getElementById('person').value") == who)
        click("#scene #robot .robot")
        until("the robot followed", lambda: self.js("document.getElementById('follow').value") == "robot")
        press("fit")
        assert self.js("document.getElementById('follow').value") == "all"
        Select(self.driver.find_element(By.ID, "person")).select_by_value("")
        press("follow-now")

    def what_may_come_is_a_fan_in_the_strip_charts(self):
        until("a prediction", lambda: self.text("ahead-state").startswith("Prediction from"))
        fans = lambda: self.js("[...document.querySelectorAll('.chart')].map((c) => [c.querySelector('h3').textContent.split(',')[0], c.querySelectorAll('.fan.go').length, c.querySelectorAll('.coming.go').length])")
        until("a fan for each variable of the model", lambda: fans() == [["h_v", 1, 1], ["h_dg", 1, 1], ["h_risk", 1, 1]])
        ends = lambda what: self.js(f"(() => {{ const b = document.querySelector('.chart {what}').getBBox(); return [b.x, b.x + b.width]; }})()")
        def ahead():
            fan, course = ends(".fan.go"), ends(".course")
            return fan[1] > course[1] and fan[0] < fan[1]
        until("the fan goes beyond what was", ahead)
        until("the coverage", lambda: re.search(r"Coverage: \d+ % of recent outcomes", self.text("ahead-state")), 120)

    def a_slider_asks_what_if_and_candidates_stand_side_by_side(self):
        find = lambda id: self.driver.find_element(By.ID, id)
        heads = lambda: self.js("[...document.querySelectorAll('#candidates h3')].map((h) => h.textContent)")
        value = lambda: float(self.js("document.getElementById('act-value').value"))
        Select(find("act-variable")).select_by_value("h_risk")
        Select(find("act-cost")).select_by_value("+h_v")
        find("act-value").send_keys(Keys.HOME)
        find("act-value").send_keys(Keys.ARROW_RIGHT)
        first = round(value(), 4)
        until("two candidates", lambda: heads() == ["go on", f"h_risk = {first:g}"])
        # What the page draws is what the server answers: the variable is set, so its line is flat.
        asked = {"actions": [{"variable": "h_risk", "value": first}], "cost": {"variable": "h_v", "weight": -1}}
        url = f"{self.demo.url}whatif?q={urllib.parse.quote(json.dumps(asked))}"
        answer = json.loads(urllib.request.urlopen(url, timeout=10).read())
        assert answer["status"] == "OK" and [one["action"] for one in answer["outlooks"]] == ["go on", f"h_risk = {first:g}"], answer
        of = {forecast["variable"]: forecast for forecast in answer["outlooks"][1]["forecasts"]}
        assert of["h_risk"]["mean"] == [first] * len(of["h_risk"]["mean"]) and of["h_v"]["lower"] < of["h_v"]["mean"] < of["h_v"]["upper"], of
        line = "(() => { const f = [...document.querySelectorAll('#candidates figure')][1]; const d = [...f.querySelectorAll('h4')].find((h) => h.textContent === 'h_risk').nextElementSibling.querySelector('.ahead').getAttribute('d'); return d.split(/[ML]/).filter(Boolean).slice(-5).map((p) => p.split(' ')[1]); })()"
        assert len(set(self.js(line))) == 1, self.js(line)
        # It ends with the moment of the answer, or a row or two before where the page's rows come later than the node's.
        assert len(answer["past"]["t"]) >= 20 and 0 <= answer["t"] - answer["past"]["t"][-1] < 1, (answer["past"]["t"], answer["t"])
        until("which is best", lambda: self.text("ahead-advice").startswith("Best first: "))
        assert self.js("document.querySelectorAll('#candidates .best').length") == 1
        until("its fan beside the prediction", lambda: self.js("document.querySelectorAll('.chart .fan.what').length") >= 2)
        # A second one, set beside it.
        find("act-keep").send_keys(Keys.ENTER)
        for _ in range(3):
            find("act-value").send_keys(Keys.ARROW_RIGHT)
        second = round(value(), 4)
        until("three candidates", lambda: heads() == ["go on", f"h_risk = {first:g}", f"h_risk = {second:g}"])
        until("what it rests on", lambda: self.js("document.querySelectorAll('#caveats li').length") >= 1)
        self.picture("what-if")

    def the_last_explanation_stays_for_whoever_comes_later(self):
        Select(self.driver.find_element(By.ID, "why-variable")).select_by_value("h_v")

        def explained():
            # Where the risk is missing, as in the first row of a batch, the answer says so; a moment later there is one.
            self.driver.find_element(By.ID, "why").send_keys(Keys.ENTER)
            time.sleep(0.5)
            # Text and table at once: another answer may be on its way.
            text, rows = self.js("(() => { const e = document.getElementById('explanation'); return [e.innerText, [...e.querySelectorAll('tr')].map((r) => [...r.children].slice(0, 2).map((c) => c.textContent))]; })()")
            return re.match(r"h_v (rose|fell) by", text) and (text, rows)

        said, rows = until("an explanation", explained)
        parts = [float(text.split(" ")[0]) for _, text in rows]
        change = float(re.search(r"by ([\d.]+)", said).group(1))
        assert rows[0][0] == "to be expected" and len(rows) >= 2 and abs(abs(sum(parts)) - change) < 0.01 + 0.01 * change, (rows, change)
        self.violations()
        self.driver.refresh()
        until("it is there again", lambda: self.text("explanation")[:40] == said[:40])
        # The page asks; it commands nothing.
        for path in ("whatif", "explain", "scene"):
            try:
                urllib.request.urlopen(urllib.request.Request(f"{self.demo.url}{path}", data=b"{}", method="POST"), timeout=10)
            except urllib.error.HTTPError as error:
                assert error.code == 413, (path, error.code)
            else:
                raise AssertionError(f"{path} takes what is posted")

    def many_variables_have_a_matrix_below_the_graph(self):
        # Each variable follows the one before it, with its sign.
        folder, noise, rows = Path(self.folder.name), random.Random(1), [[0.0] * 20]
        for _ in range(400):
            rows.append([(0.7 if i % 2 else -0.7) * (rows[-1][i - 1] if i else 0) + noise.gauss(0, 1) for i in range(20)])
        (folder / "many.csv").write_text("\n".join([",".join(f"v{i}" for i in range(20))] + [",".join(f"{x:.4f}" for x in row) for row in rows]))
        subprocess.run([self.roscausal, "discover", "many.csv", *QUICK, "--tau-max", "2", "--out", "many"], cwd=folder, check=True, capture_output=True, timeout=120)
        model, svg = json.loads((folder / "many" / "model.json").read_text()), (folder / "many" / "dag.svg").read_text()
        links = [{**{key: link[key] for key in ("cause", "effect", "lag", "value")}, "p": link["p_value"], "tested": True} for link in model["links"]]
        script = """
            const [model, svg, done] = arguments;
            const own = window.fetch;
            window.fetch = (url) => (url === `model?number=${model.number}` ? Promise.resolve(new Response(JSON.stringify({ graph: svg, matrix: svg }))) : own(url));
            // With one after it, so that no newer one takes the page away.
            import("/models.js").then((models) => {
              models.addModel(model);
              models.addModel({ ...model, number: model.number + 1 });
              document.getElementById("earlier").click();
            }).then(done);"""
        fake = {"number": 90000, "t": 1, "from": 0, "to": 1, "batch": "b", "method": "pcmci", "test": "parcorr", "smallest_p": 0.001, "level_name": "alpha", "level": 0.05, "dt": 1, "samples": 400, "features": model["features"], "links": links}
        self.driver.execute_async_script(script, fake, svg)
        said = until("the matrix", lambda: self.js("[...document.querySelectorAll('#matrix .cell[data-link]')].map((cell) => [cell.dataset.link, cell.querySelector('title').textContent])"))
        self.js("""document.querySelector('#matrix [data-link="v3 v4 1"]').dispatchEvent(new KeyboardEvent("keydown", { key: "Enter" }))""")
        shown, asked = self.js("[!document.getElementById('matrix-box').hidden, document.querySelector('#asked h3').textContent]")
        assert shown and len(said) == len(links) >= 19, (shown, len(said), len(links))
        # The disc that opens a link is the disc of that link.
        for link, title in said:
            cause, effect, lag = link.split(" ")
            assert title.startswith(f"{cause} → {effect}, lag {lag}:"), (link, title)
        assert asked.startswith("v3 at t-1") and "drives v4" in asked, asked
        self.picture("matrix")
        self.violations()
        self.driver.refresh()
        until("models", lambda: int(self.js("document.getElementById('history').max")) >= 3)
        assert self.js("document.getElementById('matrix-box').hidden"), "three variables need no matrix"

    def names_from_strangers_stay_text(self):
        script = """
            const done = arguments[0];
            import("/models.js").then((models) => {
              const name = '<img src=x onerror="document.title=1">';
              const link = { cause: name, effect: name, lag: 1, value: 0.5, p: 0.01, confidence: 0.9 };
              models.addEvidence({ batch: name, evidence: { links: [{ ...link, n_samples: 5, interval: null, conditions: [{ name, lag: 2 }],
                note: name, lags: [{ lag: 1, value: 0.5, p_value: 0.01 }], band: 0.2, scatter: [[1, 2], [2, 3]], residuals: [[1, 2], [2, 3]] }] } });
              models.addModel({ number: 100000, t: 1, from: 0, to: 1, batch: name, method: name, test: name, smallest_p: 0.001, level_name: "alpha", level: 0.05, dt: 1, samples: 5, features: [name], links: [link] });
              document.querySelector("#links .asking").click();
              return import("/ahead.js").then(({ Ahead }) => {
                const forecast = { variable: name, mean: [1, 1], lower: [0, 0], upper: [2, 2] };
                const ahead = new Ahead({ ahead: [] });
                ahead.prediction({ t: 1, dt: 1, coverage: 0.9, forecasts: [forecast], seen: [[name, 0, 1]] });
                ahead.action = { variable: name, value: 1 };
                ahead.show({ status: name, message: name, t: 1, dt: 1, ranking: [0], caveats: [name], past: { t: [1], values: [[name, [1]]] },
                  outlooks: [{ action: name, supported: 1, best: 1, cost: 0, text: name, forecasts: [forecast] }] });
                ahead.explanation({ variable: name, from: 0, to: 1, expected: 0, parts: [{ variable: name, value: 1, lower: 0, upper: 2 }], text: name, caveats: [name] });
                const told = ["candidates", "explanation", "caveats", "act-variable"].map((id) => document.getElementById(id).textContent.includes(name));
                done([document.querySelectorAll("main img").length, document.getElementById("asked").textContent, document.title, told]);
              });
            });"""
        images, text, title, told = self.driver.execute_async_script(script)
        assert images == 0 and title == "roscausal", (images, title)
        assert "<img src=x" in text and "90 % of the resamples" in text, text
        assert all(told), told
        self.driver.refresh()
        until("the page is live", lambda: self.text("connection") == "live")
        until("models", lambda: int(self.js("document.getElementById('history').max")) >= 3)

    def wide_and_light_it_is_accessible(self):
        self.look(1440, 1000, "light")
        # With the evidence of a link open.
        self.js("document.querySelector('#links .asking').click()")
        self.picture("wide-light")
        self.violations()

    def wide_and_dark_it_is_accessible(self):
        self.look(1440, 1000, "light")
        light = self.js("getComputedStyle(document.body).backgroundColor")
        self.look(1440, 1000, "dark")
        assert self.js("getComputedStyle(document.body).backgroundColor") != light
        self.picture("wide-dark")
        self.violations()

    def a_phone_shows_all_of_it(self):
        for scheme in ("light", "dark"):
            self.look(390, 844, scheme)
            assert self.js("document.documentElement.scrollWidth") <= 390
            self.picture(f"phone-{scheme}")
            self.violations()
        self.look(1440, 1000, "light")

    def a_large_screen_is_used(self):
        for scheme in ("light", "dark"):
            self.look(3840, 2160, scheme)
            assert self.js("document.querySelector('main').clientWidth") > 3600
            self.picture(f"large-{scheme}", whole=False)
            self.violations()
        self.look(1440, 1000, "light")

    def the_keyboard_reaches_everything(self):
        self.driver.find_element(By.TAG_NAME, "body").send_keys(Keys.TAB)
        reached = set()
        for _ in range(120):
            # To whatever has the focus: a new model draws the arrows anew.
            reached.add(self.js("document.activeElement.id || document.activeElement.getAttribute('class') || document.activeElement.tagName"))
            webdriver.ActionChains(self.driver).send_keys(Keys.TAB).perform()
        assert {"skip", "history", "earlier", "newest", "SUMMARY", "messages", "link ask", "asking", "pause", "follow-now", "seek", "scene", "fit", "window", "act-variable", "act-value", "act-cost", "act-keep", "why-variable", "why"} <= reached, reached

    def the_console_is_silent(self):
        loud = [entry for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]
        assert loud == [], loud

    def a_busy_port_is_one_clear_sentence(self):
        port = re.search(r":(\d+)/", self.demo.url).group(1)
        command = [self.roscausal, "demo", "--web", "--port", port, "--out", "other"]
        second = subprocess.run(command, cwd=self.folder.name, capture_output=True, text=True, timeout=30)
        assert second.returncode == 2, second
        said = second.stderr.strip()
        assert said.startswith("error: --port") and f"{port} on 127.0.0.1 is in use" in said, said
        assert len(said.splitlines()) == 1, said

    def another_name_is_refused(self):
        request = urllib.request.Request(self.demo.url, headers={"Host": "evil.example"})
        try:
            urllib.request.urlopen(request, timeout=10)
        except urllib.error.HTTPError as error:
            assert error.code == 403
        else:
            raise AssertionError("served under another name")

    def a_token_opens_the_page(self):
        with tempfile.TemporaryDirectory() as folder:
            demo = Demo(self.roscausal, folder, "--port", "0", "--token", "let-me-in")
            try:
                assert demo.url.endswith("?token=let-me-in"), demo.url
                for url in (demo.url.split("?")[0], demo.url.replace("let-me-in", "let-me-im")):
                    try:
                        urllib.request.urlopen(url, timeout=10)
                    except urllib.error.HTTPError as error:
                        assert error.code == 401
                    else:
                        raise AssertionError("no token was needed")
                self.driver.get(demo.url)
                until("the page is live", lambda: self.text("connection") == "live")
                assert "token" not in self.driver.current_url
            finally:
                demo.end()

    def a_report_opens_from_a_file_and_an_arrow_leads_to_its_evidence(self):
        with tempfile.TemporaryDirectory() as folder:
            command = [self.roscausal, "demo", "--duration", "60", "--out", "out", *QUICK]
            subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=120)
            report = Path(folder) / "out" / "report.html"
            model = json.loads((Path(folder) / "out" / "model.json").read_text())
            assert report.stat().st_size < 1_000_000
            self.driver.get_log("browser")
            self.driver.get(report.as_uri())
            assert self.js("document.querySelectorAll('.card').length") == len(model["links"])
            assert self.js("document.querySelectorAll('script, img, iframe, object, link').length") == 0
            arrow = self.driver.find_element(By.CSS_SELECTOR, "#main svg a")
            target = self.js("arguments[0].getAttribute('href')", arrow).removeprefix("#")
            self.js("document.querySelector('#main svg a').focus()")
            self.driver.switch_to.active_element.send_keys(Keys.ENTER)
            until("the card", lambda: self.js("document.querySelector('.card:target')?.id") == target)
            link = model["links"][int(target.split("-")[1]) - 1]
            assert f"{link['value']:.4f}" in self.text(target)
            for name, width, scheme in (("wide", 1440, "light"), ("wide", 1440, "dark"), ("tablet", 820, "light"), ("phone", 390, "light")):
                self.look(width, 900, scheme)
                self.driver.get(report.as_uri())
                assert self.js("document.documentElement.scrollWidth") <= width
                self.picture(f"report-{name}-{scheme}")
                self.violations()
            self.look(1440, 1000, "light")
            loud = [entry for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING", "INFO")]
            assert loud == [], loud

    def the_documentation_has_nothing_serious_and_can_be_searched(self):
        for page in ("index", "which-method", "data", "notebooks/2_your_own_data"):
            for scheme, width in (("light", 1440), ("dark", 1440), ("light", 390)):
                self.look(width, 900, scheme)
                self.driver.get((Path("target/docs") / f"{page}.html").absolute().as_uri())
                self.picture(f"docs-{page.replace('/', '-')}-{scheme}-{width}")
                self.violations(("serious", "critical"))
        self.look(1440, 1000, "light")
        self.driver.get(Path("target/docs/search.html").absolute().as_uri() + "?q=rejoin_time")
        until("results", lambda: "people" in self.js("document.getElementById('search-results').innerText").lower())

    def whoever_comes_after_the_end_of_a_replay_sees_all_of_it(self):
        with tempfile.TemporaryDirectory() as folder:
            record = [self.roscausal, "demo", "--duration", "40", "--out", "demo", "--record", "run.mcap", *QUICK]
            subprocess.run(record, cwd=folder, check=True, capture_output=True, timeout=180)
            command = [self.roscausal, "replay", "run.mcap", "--web", "--port", "0", "--out", "again", *QUICK]
            replay = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
            try:
                url = re.search(r"http://\S+", replay.stdout.readline()).group(0)
                self.driver.get(url)
                until("the end", lambda: self.text("connection") == "ended")
                # Now somebody comes who has seen nothing of it.
                self.driver.refresh()
                until("the end again", lambda: self.text("connection") == "ended")
                span = lambda: [float(self.js(f"document.getElementById('seek').{end}")) for end in ("min", "max")]
                until("the whole run", lambda: span()[1] - span()[0] > 35)
                until("its batches", lambda: self.js("document.querySelectorAll('#timeline .batch').length") >= 1)
                assert self.text("pause") == "Play" and self.text("follow-now") == "To the end"
                self.driver.find_element(By.ID, "pause").send_keys(Keys.ENTER)
                until("it begins again", lambda: float(self.text("moment").split(" s of ")[0]) < span()[1] - 20)
                self.picture("ended")
                self.violations()
            finally:
                replay.send_signal(signal.SIGINT)
                replay.communicate(timeout=30)

    def it_ends_and_the_page_says_so(self):
        self.driver.get(self.demo.url)
        until("the page is live", lambda: self.text("connection") == "live")
        code, out = self.demo.end()
        assert code == 0 and re.search(r"\d+ models", out), (code, out)
        until("the loss is told", lambda: "lost" in self.text("connection"))

    def run(self):
        tests = [name for name, test in vars(Page).items() if callable(test) and test.__code__.co_argcount == 1 and "_" in name.strip("_")]
        tests = [name for name in tests if name not in ("__init__", "run", "violations")]
        passed = failed = 0
        for name in tests:
            try:
                getattr(self, name)()
                passed += 1
                print("ok     ", name.replace("_", " "), flush=True)
            except Exception as error:
                failed += 1
                print("FAILED ", name.replace("_", " "), "\n", error, flush=True)
                self.driver.save_screenshot(str(self.pictures / "failed.png"))
        print(f"{passed} passed, {failed} failed")
        return failed

    def close(self):
        self.driver.quit()
        self.demo.process.poll() is None and self.demo.end()
        self.folder.cleanup()


def main():
    page = Page(*sys.argv[1:4])
    try:
        failed = page.run()
    finally:
        page.close()
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
