"""The live page in a headless browser: page.py ROSCAUSAL AXE.js SCREENSHOTS"""

import json
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

PATIENCE = 60
QUICK = ["--method", "pcmci", "--test", "parcorr"]


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Demo:
    """A demo with a page; it ends with the test."""

    def __init__(self, roscausal, folder, *arguments):
        command = [roscausal, "demo", "--web", "--duration", "60", "--speed", "12", "--out", "out", *QUICK, *arguments]
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
    return webdriver.Chrome(options=options, service=webdriver.ChromeService("/usr/bin/chromedriver"))


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

    def violations(self):
        if not self.js("typeof window.axe === 'object'"):
            # Through the browser's protocol, because the page itself may not load anything from elsewhere.
            self.driver.execute_cdp_cmd("Runtime.evaluate", {"expression": self.axe})
        found = self.driver.execute_async_script(
            "const done = arguments[0]; axe.run().then((r) => done(r.violations.map((v) => "
            "[v.id, v.help, v.nodes.map((n) => n.target.join(' ') + ': ' + n.failureSummary).slice(0, 5)])))"
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

    def the_charts_grow(self):
        length = lambda: self.js("document.querySelector('.chart path').getAttribute('d').length")
        first = until("a course", length)
        until("the course grows", lambda: length() > first + 50)
        assert len(self.driver.find_elements(By.CLASS_NAME, "chart")) == 3

    def a_batch_fills(self):
        until("rows", lambda: re.match(r"\d+ of 100 rows", self.text("recording-text")))

    def a_model_arrives(self):
        until("a model", lambda: self.js("document.querySelectorAll('#graph .node').length") == 3)
        until("its links", lambda: "drives" in self.text("links"))
        assert re.search(r"drives", self.js("document.getElementById('graph').getAttribute('aria-label')"))
        assert self.text("model-title").startswith("Model ")

    def a_link_is_asked_by_click_and_by_key(self):
        def asked():
            return self.js("!document.getElementById('asked').hidden && document.getElementById('asked').textContent")

        # The newest model, so that no later one comes between arrow and answer.
        arrow = lambda: self.driver.find_element(By.CSS_SELECTOR, "#graph .ask[role=button]")
        said = until("a name", lambda: arrow().get_attribute("aria-label")).removeprefix("Evidence: ")
        self.js("arguments[0].dispatchEvent(new MouseEvent('click', {bubbles: true}))", arrow())
        until("the evidence", asked)
        found = until("its plots", lambda: self.js("document.querySelectorAll('#asked .plots svg').length") >= 2)
        # What is on the screen is what the model's file says.
        shown = self.js("document.querySelector('#asked h3').textContent")
        cause, lag = re.match(r"(\S+) at t-(\d+)", shown).groups()
        effect = re.search(r"drives (\S+):", shown).group(1).replace("itself", cause)
        batch = self.text("model-title").split(" samples from ")[1]
        model = json.loads((Path(self.folder.name) / "out" / "cm_pool" / f"{batch}.json").read_text())
        evidence = json.loads((Path(self.folder.name) / "out" / "cm_pool" / "evidence" / f"{batch}.json").read_text())
        same = lambda link: (link["cause"], link["effect"], link["lag"]) == (cause, effect, int(lag))
        link, seen = next(filter(same, model["links"])), next(filter(same, evidence["links"]))
        facts = self.js("Object.fromEntries([...document.querySelectorAll('#asked dl div')].map((d) => [...d.children].map((c) => c.textContent)))")
        assert abs(float(facts["strength"]) - link["value"]) < 1e-3, (facts, link)
        assert int(facts["samples"]) == seen["n_samples"], facts
        dots = self.js("document.querySelector('#asked .dots').getAttribute('d').split('M').length - 1")
        assert dots == len(seen["scatter"]), (dots, len(seen["scatter"]))
        self.driver.switch_to.active_element.send_keys(Keys.ESCAPE)
        until("it is closed", lambda: self.js("document.getElementById('asked').hidden"))
        self.js("document.querySelector('#graph .ask[role=button]').focus()")
        self.driver.switch_to.active_element.send_keys(Keys.ENTER)
        until("the evidence again", asked)
        self.driver.find_element(By.ID, "asked-close").send_keys(Keys.ENTER)
        self.driver.find_element(By.CSS_SELECTOR, "#links .asking").send_keys(Keys.ENTER)
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

    def links_that_come_or_go_are_marked(self):
        def marked():
            for index in range(int(self.js("document.getElementById('history').max"))):
                self.js("(document.getElementById('history').value = arguments[0], document.getElementById('history').dispatchEvent(new Event('input')))", index + 1)
                words = self.text("links")
                if "appeared:" in words or "vanished:" in words:
                    assert self.js("document.querySelectorAll('#graph .halo, #graph .gone').length") > 0
                    return True
            return False

        until("a link that appeared or vanished", marked)
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
        until("charts", lambda: self.js("document.querySelector('.chart path').getAttribute('d')?.length ?? 0") > 1000)

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
        self.look(390, 844, "light")
        assert self.js("document.documentElement.scrollWidth") <= 390
        self.picture("phone")
        self.violations()
        self.look(1440, 1000, "light")

    def the_keyboard_reaches_everything(self):
        self.driver.find_element(By.TAG_NAME, "body").send_keys(Keys.TAB)
        reached = set()
        for _ in range(60):
            # To whatever has the focus: a new model draws the arrows anew.
            reached.add(self.js("document.activeElement.id || document.activeElement.getAttribute('class') || document.activeElement.tagName"))
            webdriver.ActionChains(self.driver).send_keys(Keys.TAB).perform()
        assert {"skip", "history", "earlier", "newest", "SUMMARY", "messages", "ask", "asking"} <= reached, reached

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
