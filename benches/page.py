"""Measures the live page in a headless browser: page.py PAGE_LOAD PEOPLE HISTORY_SECONDS (called by page.sh)."""

import os
import subprocess
import sys
import time
from pathlib import Path

from selenium import webdriver

SECONDS = 20
TICKS = os.sysconf("SC_CLK_TCK")


def server_cpu(pid):
    """CPU seconds of the threads of the page's node and server; the threads that make the load do not count."""
    total = 0.0
    for task in Path(f"/proc/{pid}/task").iterdir():
        if (task / "comm").read_text().startswith("dashboard"):
            fields = (task / "stat").read_text().rsplit(")", 1)[1].split()
            total += (int(fields[11]) + int(fields[12])) / TICKS
    return total


def page_memory(driver_pid):
    """Megabytes of the page's process as the browser's task manager counts them: its private memory, also where it is swapped out."""
    def children(pid):
        found = []
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in map(int, (task / "children").read_text().split()):
                found += [child, *children(child)]
        return found

    def private(pid):
        lines = [line.split() for line in Path(f"/proc/{pid}/status").read_text().splitlines()]
        return sum(int(words[1]) for words in lines if words and words[0] in ("RssAnon:", "VmSwap:")) / 1024

    kind = lambda pid: Path(f"/proc/{pid}/cmdline").read_bytes()
    return max(private(pid) for pid in children(driver_pid) if b"--type=renderer" in kind(pid))


def main():
    program, people, history = sys.argv[1:4]
    load = subprocess.Popen([program, people, history], stdout=subprocess.PIPE, text=True)
    url = load.stdout.readline().strip()
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--window-size=1440,1000"):
        options.add_argument(argument)
    service = webdriver.ChromeService("/usr/bin/chromedriver")
    driver = webdriver.Chrome(options=options, service=service)
    try:
        driver.set_script_timeout(SECONDS + 30)
        time.sleep(2)
        empty = page_memory(service.process.pid)
        driver.get(url)
        time.sleep(3)
        # All variables, over the whole run.
        driver.execute_script("""for (const box of document.querySelectorAll("#variables input")) if (!box.checked) box.click();
            const list = document.getElementById("window"); list.value = "all"; list.dispatchEvent(new Event("change"));""")
        time.sleep(3)
        charts = driver.execute_script("return document.querySelectorAll('.chart').length")
        shown = driver.execute_script("return document.querySelectorAll('#scene .someone').length")
        span = driver.execute_script("const s = document.getElementById('seek'); return s.max - s.min")
        assert charts == 12 and shown == int(people) and span >= 0.95 * int(history), (charts, shown, span)
        before, begun = server_cpu(load.pid), time.monotonic()
        frames, longest = driver.execute_async_script("""
            const done = arguments[1], times = [];
            const tick = (t) => { times.push(t); if (t - times[0] < 1000 * arguments[0]) requestAnimationFrame(tick);
              else done([1000 * (times.length - 1) / (t - times[0]), Math.max(...times.slice(1).map((t, i) => t - times[i]))]); };
            requestAnimationFrame(tick);""", SECONDS)
        cpu = 100 * (server_cpu(load.pid) - before) / (time.monotonic() - begun)
        memory = page_memory(service.process.pid)
        heap = driver.execute_cdp_cmd("Runtime.getHeapUsage", {})["usedSize"] / 1e6
        figures = [("server, % of a core", cpu, "at most", 10), ("browser, MB (of the page's process)", memory, "at most", 150),
                   ("frames per second", frames, "at least", 30)]
        print(f"{people} people, {charts} variables, {history} s of history, {SECONDS} s measured; load average {os.getloadavg()[0]:.1f} "
              f"on {os.cpu_count()} cores\n\n| what | measured | aim |\n| --- | --- | --- |")
        for what, value, word, aim in figures:
            print(f"| {what} | {value:.1f} | {word} {aim} |")
        print(f"\nOf the browser's memory an empty page takes {empty:.0f} MB; JavaScript heap {heap:.0f} MB, longest frame {longest:.0f} ms")
        missed = [what for what, value, word, aim in figures if (value > aim if word == "at most" else value < aim)]
        if missed:
            sys.exit(f"missed: {', '.join(missed)}")
    finally:
        driver.quit()
        load.terminate()
        load.wait(10)


main()
