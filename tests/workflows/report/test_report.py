"""`lsm report`: the page is whole, holds what the folder holds, escapes it, and says how the run ended."""

import base64
import json
import re
import struct
import zlib
from importlib import resources
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray
from PIL import Image, PngImagePlugin  # comes with matplotlib

import taichi_lsm as lsm
from tests.helpers.exported_runs import write_run
from tests.helpers.html_pages import check_page
from tests.helpers.sweep_tables import write_sweep_table
from workflows import shear_gouge
from workflows.cli.inspect_run import require_run
from workflows.cli.main import main
from workflows.common import run_folder
from workflows.common.discovery import find_workflows
from workflows.common.metrics import Metric, write_summary
from workflows.common.parameters import merge, to_toml
from workflows.report.energy import _table, budget_of
from workflows.report.page import write_report

WORKFLOWS = find_workflows()
DOCUMENT = (Path(__file__).resolve().parents[3] / "docs" / "report.md").read_text(encoding="utf-8")
CSS = resources.files("workflows.report").joinpath("templates", "page.css").read_text(encoding="utf-8")
HOSTILE = "<script>alert('1')</script>\"'&<img src=x onerror=alert(2)>"
SVG = b'<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg" onload="alert(3)"><script>alert(4)</script></svg>'


def png(path, words=""):
    """A small picture that says what it shows."""
    about = PngImagePlugin.PngInfo()
    if words:
        about.add_itxt("Description", words)
    Image.new("RGB", (130, 65), "white").save(path, pnginfo=about, dpi=(130, 130))


def begin(folder, params, name):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "config.toml").write_text(to_toml(params, name))
    return folder


def page_of(folder):
    write_report(folder, *require_run(folder), folder / "report.html")
    return check_page((folder / "report.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A complete run with two figures, one of them drawn afterwards."""
    folder = write_run(tmp_path_factory.mktemp("report") / "a", 2)
    begin(folder, merge(shear_gouge.Params, "smoke", options={"strain": "3", "inertial_number": "0.01"}), "shear-gouge")
    metrics = {
        "friction_mean": Metric(0.31, "1", interval=(0.3, 0.32)),
        "friction_se": Metric(0.004, "1", note="of 20 samples"),
        "stiffness_number": Metric(1000.0, "1"),
        "energy_residual": Metric(0.02, "1", 0.01, False, note="over the throughput", remedy="lower --step-safety"),
        "layer_thickness": Metric(1e-3, "m", "any", True),
    }
    write_summary(folder, "shear-gouge", "smoke", metrics, quiet=True)
    png(folder / "run.png", "friction 0.31")
    (folder / "plots").mkdir()
    (folder / "plots" / "energy.svg").write_bytes(SVG)
    return folder


def test_figures_are_in_the_page_with_what_they_show(folder):
    page = page_of(folder)
    images = page.all("img")
    names = [folder / "run.png", folder / "plots" / "energy.svg"]
    assert [base64.b64decode(image["src"].split(",")[1]) for image in images] == [p.read_bytes() for p in names]
    assert [image["src"].split(";")[0] for image in images] == ["data:image/png", "data:image/svg+xml"]
    assert [image["alt"] for image in images] == ["Friction 0.31", "Figure energy of: Sheared gouge"]
    assert int(images[0]["width"]) == 2 * int(images[0]["height"]) > 96  # an inch, and a little more
    assert page.words("b") == ["run.png", "plots/energy.svg"]


def test_metrics_stand_beside_their_errors_and_claims(folder):
    page = page_of(folder)
    head = ["metric", "value", "standard error", "95 % interval", "unit", "claimed", "holds", "note"]
    begin = page.rows.index(head)
    assert page.rows[begin + 1 : begin + 5] == [
        ["friction_mean", "0.31", "0.004", "0.3 to 0.32", "", "", "", "of 20 samples"],
        ["stiffness_number", "1000", "", "", "", "", "", ""],
        ["energy_residual", "0.02", "", "", "", "0.01", "no", "over the throughput"],
        ["layer_thickness", "0.001", "", "", "m", "any", "yes", ""],
    ]
    assert page.all("tr")[begin + 3] == {"class": "fails"} and "class" not in page.all("tr")[begin + 4]
    texts = page.words("p")
    assert "1 of 2 claimed bounds hold." in texts and "But one of its claims does not hold, see the metrics." in texts
    assert "Claim not met: energy_residual is 0.02, claimed 0.01: lower --step-safety." in texts


def test_parameters_are_told_apart(folder):
    rows = page_of(folder).rows
    given = rows.index(["parameter", "value", "unit", "in the preset", "meaning"])
    assert rows[given + 1] == ["strain", "3.0", "1", "2.0", "shear strain to reach"]
    assert rows[given + 2] == ["parameter", "value", "unit", "meaning"]  # the inertial number is that of the preset
    assert ["inertial_number", "0.01", "1", "I = shear rate d sqrt(rho/P)"] in rows[given:]
    idle = rows.index(["parameter", "value", "unit", "why"])
    assert ["width", "4.0", "mean diameters", "with --dim 2"] in rows[idle:]


def test_what_is_scaled_is_beside_the_laboratory(folder):
    """(E/P)^(2/3) of glass at 5 MPa is 581; a layer of 10 diameters d = 127 um is 1.27 mm thick and is sheared at
    10 um/s: I = 1e-5/1.27e-3 d sqrt(2500/5e6) = 2.236e-8."""
    rows = page_of(folder).rows
    assert next(row for row in rows if row[0].startswith("stiffness number"))[1:3] == ["1000", "581"]
    assert next(row for row in rows if row[0].startswith("inertial number"))[1:3] == ["0.01", "2.2e-08"]
    assert ["thickness", "1.27 mm", "2 to 3 mm", "10 mean diameters"] in rows
    assert next(row for row in rows if row[0] == "velocity of the shear")[1] == "4.47 m/s"  # I h/(d sqrt(rho/P))


def test_where_it_comes_from_and_what_it_left(folder):
    page = page_of(folder)
    found = {row[0]: row[1] for row in page.rows if len(row) == 2}
    assert found["made by"].startswith("taichi_lsm ") and found["time step [s]"] == "1e-08" and found["seed"] == "7"
    again = f"lsm shear-gouge --config {folder / 'config.toml'} --out {folder}-again"
    assert found["to repeat it"] == again and found["threads"] == "1" and len(found["id"]) == 36
    sizes = {row[0]: row[1:] for row in page.rows if len(row) == 3}
    assert sizes["run.nc"][1].startswith("time 3, ") and sizes["plots/energy.svg"] == [f"{len(SVG)} B", ""]
    assert "report.html" not in sizes  # that is this page
    listing = page.words("pre")
    assert any("friction (time) [1]: shear stress over normal stress" in text for text in listing)
    assert (folder / "config.toml").read_text().strip() in listing


def test_the_sections_are_those_of_the_documents(folder):
    told = re.findall(r"^\| ([A-Z][\w, ]+) \|", DOCUMENT, re.MULTILINE)
    assert [title for title in told if title not in ("Energy budget", "Results, row by row", "Runs")] == page_of(
        folder
    ).words("h2")


def test_what_files_say_is_escaped(tmp_path):
    """In attributes, parameters, metrics, figures and names; letters that no page may hold are left out."""
    folder = tmp_path / "<b>run"
    folder.mkdir()
    with netCDF4.Dataset(folder / "run.nc", "w") as file:
        file.setncatts({"title": HOSTILE + "\x07\x1b[2J", "run_status": HOSTILE, "source": HOSTILE, "id": HOSTILE})
        file.createDimension("d<dim>", 2)
        file.createVariable("x<i>", "f8", ("d<dim>",)).setncatts({"units": HOSTILE, "long_name": HOSTILE})
    with netCDF4.Dataset(folder / "events.nc", "w") as file:
        file.setncatts({"title": HOSTILE, "run_status": "complete"})
        file.createDimension("event", 2)
        file.createVariable("x<u>", str, ("event",))[:] = np.array([HOSTILE, "</td>"], object)
    entry = {"value": HOSTILE, "unit": HOSTILE, "bound": HOSTILE, "holds": False, "note": HOSTILE, "remedy": HOSTILE}
    (folder / "summary.json").write_text(
        json.dumps({"workflow": HOSTILE, "preset": HOSTILE, "metrics": {HOSTILE: entry}})
    )
    (folder / "config.toml").write_text(f"experiment = '''{HOSTILE}'''\n# </pre></style>{HOSTILE}\n")
    png(folder / f"{HOSTILE.replace('/', '_')}.png", HOSTILE)
    (folder / "a.svg").write_bytes(SVG.replace(b"<script>", f"<dc:description>{HOSTILE}</dc:description>".encode()))
    page = page_of(folder)
    assert page.words("h1") == [HOSTILE + "  [2J"] and page.words("td").count(HOSTILE) >= 5
    assert {image["alt"] for image in page.all("img")} == {HOSTILE}
    assert ["0", HOSTILE] in page.rows and ["1", "</td>"] in page.rows
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "<script" not in text and "onerror=alert" not in re.sub(r"&lt;.*?&gt;", "", text)
    assert "default-src &#39;none&#39;" in text or "default-src 'none'" in text


def test_formulas_are_words_in_what_a_figure_shows(tmp_path):
    png(tmp_path / "run.png", "slip law: $D_c$ unknown, 5 $")
    begin(tmp_path, shear_gouge.Params(), "shear-gouge")
    assert page_of(tmp_path).all("img")[0]["alt"] == "Slip law: D_c unknown, 5 $"


def luminance(colour):
    """Relative luminance of #rrggbb (WCAG 2.2)."""
    parts = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_letters_can_be_read_on_light_and_on_dark():
    """Contrast of at least 4.5 (WCAG 2.2, AA), of all colours of letters on all grounds that they stand on."""
    palettes = re.findall(r":root \{(.*?)\}", CSS, re.DOTALL)
    assert len(palettes) == 2 and "prefers-color-scheme: dark" in CSS.split(palettes[1])[0]
    for palette in palettes:
        colours = dict(re.findall(r"--(\w+): (#\w{6})", palette))
        for letters in ("text", "quiet", "link", "good", "bad", "warn"):
            for ground in ("page", "panel", *(["shade"] if letters in ("text", "bad") else [])):
                light, dark = sorted((luminance(colours[letters]), luminance(colours[ground])), reverse=True)
                assert (light + 0.05) / (dark + 0.05) >= 4.5, (letters, ground)


def test_pictures_that_are_none_are_told(tmp_path):
    png(tmp_path / "whole.png")
    data = (tmp_path / "whole.png").read_bytes()
    (tmp_path / "half.png").write_bytes(data[: len(data) // 2])
    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "page.svg").write_text("<html><script>alert(1)</script></html>")
    for name in ("run.pdf", "whole.pdf"):  # of which one is there as PNG too
        (tmp_path / name).write_text("")
    size = struct.pack(">IIBBBBB", 10**5, 10**5, 8, 2, 0, 0, 0)  # more than any memory holds
    header = b"IHDR" + size
    (tmp_path / "bomb.png").write_bytes(
        data[:8] + struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header)) + data[33:]
    )
    begin(tmp_path, shear_gouge.Params(), "shear-gouge")
    page = page_of(tmp_path)
    assert page.words("b") == ["whole.png"]
    (told,) = [text for text in page.words("p") if text.startswith("Not shown: ")]
    assert all(f"{name}.png (cannot be read" in told for name in ("half", "text", "bomb"))
    assert "page.svg (cannot be read" in told and "run.pdf (PDF" in told and "whole" not in told


@pytest.mark.parametrize(
    ("status", "headline", "more"),
    [
        ("failed", "Failed.", "An error stopped it; what it computed until then is below."),
        ("interrupted", "Interrupted.", "It was stopped before its end."),
        ("running", "Killed.", "It ended without a word, as if killed."),
        ("complete", "Not complete.", "All rows are there, its summary is missing."),
    ],
)
def test_how_a_run_ended_is_said_first(tmp_path, status, headline, more):
    folder = write_run(tmp_path / "a", 2)
    begin(folder, shear_gouge.Params(), "shear-gouge")
    with netCDF4.Dataset(folder / "run.nc", "a") as file:
        file.run_status = status
    (folder / "checkpoint.nc").write_bytes(b"")  # from which it can go on
    (folder / "stopped.nc").write_bytes(b"")
    page = page_of(folder)
    assert page.words("strong") == [headline]
    texts = page.words("p")
    assert more in texts and f"To go on with it: lsm resume {folder}" in texts
    assert "summary.json is not there yet: a run writes it last." in texts
    assert ("The state in which it was stopped is in stopped.nc." in texts) == (status == "failed")


def test_a_run_that_goes_on_is_told(tmp_path):
    folder = write_run(tmp_path / "a", 2)
    begin(folder, shear_gouge.Params(), "shear-gouge")
    with netCDF4.Dataset(folder / "run.nc", "a") as file:
        file.run_status = "running"
    with lsm.locked(folder):
        page = page_of(folder)
    assert page.words("strong") == ["Still running."] and "lsm resume" not in " ".join(page.words("p"))
    assert any("writes to it; more will follow." in text for text in page.words("p"))


@pytest.mark.parametrize("name", sorted(WORKFLOWS))
def test_every_experiment_has_a_page_from_its_begin_on(tmp_path, name):
    params = merge(WORKFLOWS[name].Params, "smoke")
    page = page_of(begin(tmp_path / "a", params, name))
    parameters = {row[0] for row in page.rows}
    assert set(type(params).model_fields) <= parameters and page.words("strong") == ["Not complete."]
    assert page.words("h2")[-3:] == ["Configuration", "Provenance", "Files"]


def test_runs_of_an_experiment_and_its_tables_have_rows(tmp_path):
    """A sweep of four runs, of which one failed, and the folder of one is there."""
    folder = tmp_path / "sweep"
    (folder / "runs").mkdir(parents=True)
    write_sweep_table(
        folder,
        [("shape", [{"shape": "round"}, {"shape": "angular"}]), ("seed", [{"seed": 1}, {"seed": 2}])],
        failed={3},
    )
    (folder / "sweep.toml").write_text('experiment = "shear-gouge"\n[sweep]\nreplicas = 2\n')
    write_run(folder / "runs" / "1", 2)
    claim = Metric(1.0, "1", 0.5, False)
    write_summary(folder / "runs" / "1", "shear-gouge", "smoke", {"energy_residual": claim}, quiet=True)
    page = page_of(folder)
    head = page.rows.index(next(row for row in page.rows if row[:3] == ["run", "shape", "seed"]))
    assert [row[1:3] for row in page.rows[head + 1 : head + 5]] == [[s, n] for s in ("round", "angular") for n in "12"]
    assert page.rows[head][3] == "friction mean" and page.rows[head + 4][3] == "unknown"
    assert "The same in all rows: seconds 10." in page.words("p")
    assert ["runs/1", "complete", "energy_residual"] in page.rows
    assert "[sweep]\nreplicas = 2" in " ".join(page.words("pre"))
    found = {row[0]: row[1] for row in page.rows if len(row) == 2}
    assert found["to repeat it"] == f"lsm sweep {folder / 'sweep.toml'} --out {folder}-again"


def test_the_budget_is_that_of_the_shear():
    """Of 10 J of work 3 J are stored and 6.5 J dissipated by two effects; the residual is 0.5 J."""
    rows = {"stage": ("time", ["consolidate", "consolidate", "shear", "shear"])}
    values = {
        "external_work": [0.0, 5.0, 6.0, 16.0],
        "translational_energy": [0.0, 1.0, 1.0, 2.0],
        "elastic_energy": [0.0, 2.0, 2.0, 4.0],
        "energy_residual": [0.0, 0.1, 0.1, 0.6],
        "work_throughput": [0.0, 0.0, 1.0, 21.0],
    }
    data = {name: ("time", column) for name, column in values.items()} | rows
    data["dissipated_energy"] = (("time", "effect"), [[0.0, 0.0], [1.0, 1.0], [1.0, 2.0], [6.0, 3.5]])
    budget = budget_of(xarray.Dataset(data, coords={"effect_name": ("effect", ["damping", "coulomb_friction"])}))
    assert budget is not None and budget.since == "since shear began"
    assert (budget.work, budget.residual, budget.throughput) == (10.0, 0.5, 20.0)
    assert budget.stored == {"translational_energy": 1.0, "elastic_energy": 2.0}
    assert budget.dissipated == {"damping": 5.0, "coulomb_friction": 1.5}
    assert "dissipated by Coulomb friction" in [row[0] for row in _table("of a run", budget).rows]
    assert budget_of(xarray.Dataset({"external_work": ("time", [1.0, 2.0])})) is None


def test_only_a_report_is_written_over(folder, tmp_path, capsys):
    target = tmp_path / "mine.html"
    target.write_text("<p>mine</p>")
    assert main(["report", str(folder), "--out", str(target)]) == 2
    assert "is there and no report of lsm" in capsys.readouterr().err and target.read_text() == "<p>mine</p>"
    for _ in range(2):
        assert main(["report", str(folder), "--out", str(tmp_path / "page.html")]) == 0
    assert capsys.readouterr().out.splitlines()[0] == f"report: {tmp_path / 'page.html'}, 2 figures"
    assert main(["report", str(folder), "--out", str(tmp_path)]) == 2
    assert main(["report", str(folder), "--out", str(tmp_path / "none" / "a.html")]) == 2
    assert main(["report", str(tmp_path / "none")]) == 2
    err = capsys.readouterr().err
    assert "is a folder, must be a file" in err and "there is no folder" in err and "there is no such folder" in err


def test_the_page_of_a_former_run_is_removed_with_it(tmp_path):
    folder = begin(tmp_path / "a", shear_gouge.Params(), "shear-gouge")
    page_of(folder)
    run_folder.clear(folder)
    assert list(folder.iterdir()) == []


def test_a_summary_of_other_content_is_told(tmp_path):
    folder = begin(tmp_path / "a", shear_gouge.Params(), "shear-gouge")
    for content in ('{"metrics": {"a": 1, "inertial_number": 2}}', '{"metrics": {"a": {"value": 1, "holds": false}}}'):
        (folder / "summary.json").write_text(content)
        assert "summary.json holds something else than metrics." in page_of(folder).words("p")


def test_damaged_files_are_told_and_the_rest_is_shown(tmp_path):
    folder = write_run(tmp_path / "a", 2)
    (folder / "run.nc").write_bytes((folder / "run.nc").read_bytes()[:3000])
    (folder / "events.nc").write_bytes(b"half a file")
    (folder / "summary.json").write_text("{")
    (folder / "config.toml").write_text('experiment = "shear-gouge"\nstrain = -1\n')
    page = page_of(folder)
    texts = " ".join(page.words("p"))
    assert all(f"{name} cannot be read" in texts for name in ("summary.json", "run.nc", "events.nc"))
    assert "The parameters cannot be told apart: --strain -1" in texts
    assert 'experiment = "shear-gouge"\nstrain = -1' in page.words("pre")
