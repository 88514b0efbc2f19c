"""The page of `lsm report` in a browser: nothing to complain of, all figures are shown, and no script runs."""

import re
import shutil
import subprocess

import pytest
from PIL import Image  # comes with matplotlib

from tests.helpers.exported_runs import write_run
from workflows import shear_gouge
from workflows.cli.main import main
from workflows.common.parameters import to_toml

BROWSER = shutil.which("chromium")
QUIET = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-sync")
QUIET += ("--disable-background-networking", "--disable-component-update", "--enable-logging=stderr")
pytestmark = [pytest.mark.validate, pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")]
SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="40" height="20" onload="document.title = 'taken over'">
<script>document.title = 'taken over'</script><rect width="40" height="20" fill="green"/></svg>"""
# What a copy of the page without its ban on scripts says of its pictures.
COUNT = "<script>document.title = [...document.images].map(i => i.complete && i.naturalWidth).join(' ')</script></body>"


@pytest.fixture
def page(tmp_path):
    """The file of a page with two figures, one of which would run a script."""
    folder = write_run(tmp_path / "run", 2)
    (folder / "config.toml").write_text(to_toml(shear_gouge.Params(), "shear-gouge"))
    Image.new("RGB", (130, 65), "white").save(folder / "run.png")
    (folder / "a.svg").write_text(SVG)
    assert main(["report", str(folder), "--quiet"]) == 0
    return folder / "report.html"


def shown(page, tmp_path, *options):
    """(elements of the page when it has been shown, what the browser said of it)."""
    command = [BROWSER, *QUIET, f"--user-data-dir={tmp_path / 'profile'}", *options, "--dump-dom", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]


def title_of(elements):
    return re.search(r"<title>(.*?)</title>", elements)[1]


def test_the_browser_has_nothing_to_complain_of(page, tmp_path):
    elements, said = shown(page, tmp_path)
    assert said == [] and title_of(elements) == "Sheared gouge"


def test_all_figures_are_shown_and_no_script_of_theirs_runs(page, tmp_path):
    text = page.read_text(encoding="utf-8")
    open_page = page.with_name("open.html")
    open_page.write_text(re.sub(r"<meta http-equiv[^>]*>", "", text).replace("</body>", COUNT), encoding="utf-8")
    elements, said = shown(open_page, tmp_path, "--virtual-time-budget=3000")
    assert said == [] and title_of(elements) == "40 130"  # widths in pixels; 0 of one that is not shown


def test_a_script_would_be_told(page, tmp_path):
    """The ban on scripts holds, and the browser says so: what the first test listens to is there."""
    planted = page.with_name("planted.html")
    planted.write_text(page.read_text(encoding="utf-8").replace("</body>", COUNT), encoding="utf-8")
    elements, said = shown(planted, tmp_path)
    assert title_of(elements) == "Sheared gouge" and "Content Security Policy" in " ".join(said)
