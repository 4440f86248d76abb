"""A report to look at, and a browser to look at it with."""

import functools
import os
import pathlib
import subprocess

import pytest
from left_out import leave_out

TOP = pathlib.Path(__file__).resolve().parents[2]
CHROMIUM, CHROMEDRIVER = "/usr/bin/chromium", "/usr/bin/chromedriver"
OPTIONS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
           "--disable-background-networking", "--disable-component-update", "--disable-sync")
RECORDING = pathlib.Path(os.environ.get("CFODI_DATA") or TOP / "../shared/data") / "cabinet_depth640_58.mcap"
BINARY = os.environ.get("CFODI_BIN") or TOP / "target/release/cfodi"


@pytest.fixture
def open_browser(request, tmp_path):
    """Starts browsers, each with a profile of its own; at the end of the test none is left."""
    try:
        from selenium import webdriver
    except ImportError:
        leave_out(request, "no selenium")
    if not (os.path.exists(CHROMIUM) and os.path.exists(CHROMEDRIVER)):
        leave_out(request, "no chromium with its driver: apt-get install chromium chromium-driver")
    started = []

    def start(width=1400, height=1000):
        options = webdriver.ChromeOptions()
        options.binary_location = CHROMIUM
        for option in (*OPTIONS, f"--user-data-dir={tmp_path / f'profile{len(started)}'}",
                       f"--window-size={width},{height}"):
            options.add_argument(option)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        started.append(webdriver.Chrome(options, webdriver.ChromeService(CHROMEDRIVER)))
        return started[-1]

    yield start
    for browser in started:
        browser.quit()


@pytest.fixture(scope="session")
def make_report(tmp_path_factory):
    """Replays the cabinet recording into a report, once with the same arguments."""
    @functools.cache
    def make(*arguments):
        folder = tmp_path_factory.mktemp("report")
        subprocess.run((BINARY, "replay", RECORDING, "--report", folder, *arguments), check=True, timeout=120)
        return folder / "index.html"

    return make


@pytest.fixture
def made_report(request, open_browser, make_report):
    """CFODI_REPORT, or one made here; without a browser it is not even made."""
    if given := os.environ.get("CFODI_REPORT"):
        return pathlib.Path(given).resolve()
    if not RECORDING.is_file():
        leave_out(request, "no recordings (set CFODI_DATA)")
    return make_report()


@pytest.fixture
def report_of_the_letter(request, open_browser, make_report):
    """Of mode `paper`, which knows no outline, area or class."""
    if not RECORDING.is_file():
        leave_out(request, "no recordings (set CFODI_DATA)")
    return make_report("--ros-args", "-p", "mode:=paper")


@pytest.fixture
def empty_report(request, open_browser, make_report):
    """Of a map without a voxel."""
    if not RECORDING.is_file():
        leave_out(request, "no recordings (set CFODI_DATA)")
    return make_report("--ros-args", "-p", "max_range:=0.41")


@pytest.fixture
def page(open_browser, made_report):
    from viewer import Page
    return Page(open_browser(), made_report)


@pytest.fixture
def page_of_the_letter(open_browser, report_of_the_letter):
    from viewer import Page
    return Page(open_browser(), report_of_the_letter)
