"""Exit codes and messages of `lsm`."""

import io
import json
import math
import os
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import pytest
from rich.console import Console

from taichi_lsm.core.errors import InputError
from workflows.cli.main import main
from workflows.cli.progress import ProgressLine, format_line
from workflows.common.metrics import Metric, write_summary

ROOT = Path(__file__).parents[3]


def start(*args):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, "-m", "workflows.cli.main", *args],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_a_complete_run(plugins, tmp_path, capsys):
    assert main(["toy-run", "--out", "a/b", "--seed", "7", "--preset", "demo"]) == 0
    summary = json.loads((tmp_path / "a/b/summary.json").read_text())
    assert summary == {
        "workflow": "toy-run",
        "preset": "demo",
        "run_status": "complete",
        "metrics": {
            "seed": {"value": 7, "unit": "1"},
            "stress": {"value": 5e6, "unit": "Pa", "bound": 2e6, "holds": True},
        },
    }
    out = capsys.readouterr().out
    assert "strain 0.50/1.00 | mu 0.31" in out and "stress" in out


def test_the_default_folder_is_named_after_the_command(plugins, tmp_path):
    assert main(["toy-run", "--quiet"]) == 0
    assert (tmp_path / "out/toy-run/summary.json").is_file()


def test_the_parameters_reach_the_run(toy, monkeypatch):
    calls = []
    monkeypatch.setattr(toy, "run", lambda params, out, progress, existing: calls.append((params, out, progress)))
    assert main(["toy-run", "--time-step", "none", "--no-rough", "--seeds=4,5", "--out", "x", "--quiet"]) == 0
    params = toy.Params(time_step=None, rough=False, seeds=[4, 5], normal_stress=1e6)
    assert calls == [(params, Path("x"), None)]


def test_quiet_prints_no_progress_and_no_table(plugins, capsys):
    main(["toy-run", "--quiet"])
    out = capsys.readouterr().out
    assert "strain" not in out and "stress" not in out


def test_all_mistakes_at_once_and_nothing_written(plugins, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    before = sorted(tmp_path.rglob("*"))
    code = main(
        [
            "toy-run",
            "--grains",
            "1",
            "--shape",
            "sphre",
            "--normal-stress",
            "-5",
            "--preset",
            "smok",
            "--config",
            "none.toml",
            "--out",
            "file",
        ]
    )
    lines = capsys.readouterr().err.splitlines()
    assert code == 2
    assert [line.split()[1] for line in lines] == [
        "--config",
        "--preset",
        "--grains",
        "--normal-stress",
        "--shape",
        "--out",
    ]
    assert [p for p in sorted(tmp_path.rglob("*")) if "__pycache__" not in p.parts] == before


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["toy-rn"], "toy-rn: unknown command"),
        (["toy-rn"], "Did you mean toy-run?"),
        (["toy-run", "--grans", "3"], "Did you mean --grains?"),
        (["toy-run", "5"], "5: unexpected"),
        (["shear-gouge", "--platen-diameter", "1"], "--platen-diameter is now called --platen-roughness."),
        (["shear-gouge", "--platen-diameter=1"], "--platen-diameter is now called --platen-roughness."),
        (["list", "--laws"], "--laws is now called --effects."),
        (
            ["velocity-steps", "--stress-ratio", "2"],
            "--stress-ratio is one of lsm normal-stress-steps and oedometer, not",
        ),
        (
            ["shear-gouge", "--run-in=3"],
            "one of lsm normal-stress-steps, slide-hold-slide, stick-slip and velocity-steps,",
        ),
        (["velocity-steps", "--stages", "3"], "Unknown option: --stages. Did you mean"),  # a table of a file
        (["hard-cases", "--kinds", "laws", "--quiet"], "laws is now called effects."),
        (["toy-run", "--grains"], "--grains requires an argument"),
        (["info", "nowhere"], "nowhere: there is no such folder"),
        (["info", "plugins"], "plugins: holds no run"),
        (["info", "plugins/workflows/toy_run.py"], "is a file, must be the folder of a run"),
    ],
)
def test_a_mistake_in_the_command_line_is_one_line(plugins, capsys, args, words):
    assert main(args) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1


def test_a_folder_that_is_not_empty_needs_overwrite(plugins, tmp_path, capsys):
    (tmp_path / "full").mkdir()
    (tmp_path / "full/notes").write_text("mine")
    assert main(["toy-run", "--out", "full"]) == 2
    assert "full: is not empty" in capsys.readouterr().err
    assert main(["toy-run", "--out", "full", "--overwrite"]) == 0
    assert (tmp_path / "full/notes").read_text() == "mine"


def test_overwriting_another_experiment_is_told(plugins, tmp_path, capsys):
    (tmp_path / "full").mkdir()
    (tmp_path / "full/config.toml").write_text('experiment = "shear-gouge"\n')
    assert main(["toy-run", "--out", "full", "--overwrite"]) == 0
    assert capsys.readouterr().err == "lsm: note: --overwrite removes the files of the run of shear-gouge in full\n"


def test_a_folder_whose_name_is_too_long_is_refused(plugins, capsys):
    assert main(["toy-run", "--out", "x" * 300]) == 2
    error = capsys.readouterr().err
    assert "too long" in error and error.count("\n") == 1


def test_a_folder_below_a_file_is_refused(plugins, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["toy-run", "--out", "file/below"]) == 2
    assert "is a file, must be a folder" in capsys.readouterr().err


@pytest.mark.parametrize(("act", "code", "words"), [("reject", 2, "do not fit"), ("diverge", 1, "at step 7")])
def test_the_errors_of_a_run(plugins, tmp_path, capsys, act, code, words):
    assert main(["toy-run", "--act", act, "--out", "new/deep"]) == code
    assert words in capsys.readouterr().err
    assert (tmp_path / "new").exists() == (code == 1)  # bad input leaves nothing behind


@pytest.mark.parametrize(
    ("error", "words"),
    [(MemoryError(), "not enough memory"), (OSError(28, "No space left on device"), "No space left")],
)
def test_what_the_machine_refuses_is_one_line(toy, monkeypatch, capsys, error, words):
    def run(params, out, progress, existing):
        raise error

    monkeypatch.setattr(toy, "run", run)
    assert main(["toy-run", "--quiet"]) == 1
    text = capsys.readouterr().err
    assert words in text and text.count("\n") == 1


def test_the_check_of_a_workflow_comes_before_its_folder(toy, monkeypatch, tmp_path, capsys):
    def check(params):
        raise InputError(f"--grains {params.grains}: must be <= 5; choose fewer")

    monkeypatch.setattr(toy, "check", check, raising=False)
    (tmp_path / "file").write_text("")
    assert main(["toy-run", "--out", "file"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "lsm: --grains 600: must be <= 5; choose fewer" and "--out file" in lines[1]


def test_a_reader_that_leaves_ends_the_command_quietly(plugins, tmp_path):
    (tmp_path / "full").mkdir()
    for i in range(5000):  # more lines than a pipe holds
        (tmp_path / f"full/{i:04d}{'x' * 60}").touch()
    write_summary(tmp_path / "full", "toy-run", None, {"drift": Metric(0.02, "1")}, quiet=True)
    with start("info", "full") as process:
        assert process.stdout.readline() != ""
        process.stdout.close()
        assert process.wait(timeout=60) == 128 + signal.SIGPIPE
        assert process.stderr.read() == ""


def test_a_broken_plugin_is_bad_input(plugins, capsys):
    (plugins / "broken.py").write_text("def\n")
    assert main(["list"]) == 2
    assert "broken.py, line 1" in capsys.readouterr().err
    assert main(["--version"]) == 0


@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_lets_the_run_flush_and_gives_128_plus_n(plugins, tmp_path, signum):
    process = start("toy-run", "--act", "wait", "--out", "run")
    wait_for(tmp_path / "run/ready", process)
    process.send_signal(signum)
    time.sleep(0.1)  # into the flush, which takes 0.2 s
    process.send_signal(signum)  # as when a terminal and a parent both send it
    _, error = process.communicate(timeout=20)
    assert process.returncode == 128 + signum
    assert (tmp_path / "run/flushed").exists()
    assert "Traceback" not in error and signal.Signals(signum).name in error


def wait_for(path, process):
    for _ in range(200):
        if path.exists():
            return
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.05)
    raise AssertionError(f"{path} did not appear")


def test_help_shows_units_bounds_and_the_standard_defaults(plugins, capsys):
    assert main(["toy-run", "--help"]) == 0
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "--normal-stress NUMBER normal stress on the layer [Pa]; greater than 0 [default: 1e+06]" in text
    assert "--dim INTEGER space dimensions; from 2 to 3 [default: 2]" in text
    assert "--rough --no-rough" in text and "--no-quiet" not in text
    assert "Only in a TOML file (--config): effects." in text


def test_version(capsys):
    assert main(["--version"]) == 0
    package, _, python = capsys.readouterr().out.splitlines()
    assert package == "taichi-lsm 0.1.0"
    assert python == f"Python {sys.version.split()[0]}"


def test_list_shows_workflows_and_effects(plugins, capsys, monkeypatch):
    effect = type("Spring", (), {"__doc__": "A spring.\n\nMore."})
    effects = types.SimpleNamespace(find_effects=lambda: {"spring": effect})
    monkeypatch.setitem(sys.modules, "taichi_lsm.effects", effects)  # the real one imports Taichi
    assert main(["list"]) == 0
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert "toy-run A toy that behaves as it is told." in lines
    assert lines[-1] == "spring A spring."


MISSED = "lsm: claim not met: stress is 3e+06 Pa, claimed 2e+06 Pa: the layer is crushed: lower --normal-stress.\n"


@pytest.mark.parametrize(("options", "code"), [((), 0), (("--strict",), 3), (("--strict", "--quiet"), 3)])
def test_a_claim_that_is_not_met_is_named_and_is_an_error_if_wanted(plugins, capsys, options, code):
    assert main(["toy-run", "--act", "judge", "--normal-stress", "3e6", "--out", "x", *options]) == code
    assert capsys.readouterr().err == MISSED
    main(["info", "x"])
    assert MISSED.removeprefix("lsm: ") in capsys.readouterr().out


def test_claims_that_are_met_and_those_of_an_earlier_run_are_no_error(toy, monkeypatch, capsys):
    assert main(["toy-run", "--act", "judge", "--normal-stress", "1e6", "--out", "x", "--strict"]) == 0
    assert main(["toy-run", "--act", "judge", "--normal-stress", "3e6", "--out", "y"]) == 0
    assert capsys.readouterr().err == MISSED
    monkeypatch.setattr(toy, "run", lambda params, out, progress, existing: None)  # writes no summary
    assert main(["toy-run", "--out", "y", "--overwrite", "--strict"]) == 0
    assert capsys.readouterr().err == ""


def test_a_gpu_that_is_not_there_is_refused_before_anything_is_made(plugins, tmp_path, capsys, monkeypatch):
    def none(arch):
        raise InputError(f"arch {arch!r}: this machine has none")

    monkeypatch.setattr("taichi_lsm.core.runtime.check_arch", none)
    assert main(["toy-run", "--arch", "gpu", "--out", "new"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("lsm: --arch gpu: refused, as") and "choose --arch cpu" in error
    assert not (tmp_path / "new").exists()


def test_what_is_not_taken_from_a_file_is_said_even_if_quiet(plugins, tmp_path, capsys):
    (tmp_path / "a.toml").write_text("grains = 30\nmost_sheared = 30\n[hard-cases]\n[toy-run]\nseed = 3\n")
    assert main(["toy-run", "--config", "a.toml", "--quiet"]) == 0
    assert capsys.readouterr().err.splitlines() == [
        "lsm: note: a.toml: most_sheared was not taken: toy-run has no such parameter, shape-roughness has",
        "lsm: note: a.toml: the table [hard-cases] was not taken: it is for that experiment",
    ]
    assert json.loads((tmp_path / "out/toy-run/summary.json").read_text())["metrics"]["seed"]["value"] == 3


@pytest.mark.parametrize(
    ("options", "note"),
    [
        ("--shape sphere", "note: --shape sphere in 2D means discs"),
        ("--shape discs --dim 3", "note: --shape discs in 3D means spheres"),
        ("--shape disc", None),
        ("--shape sphere --dim 3", None),
        ("--shape round --dim 3", None),
    ],
)
def test_a_word_for_the_round_grains_of_the_other_dimension_is_explained(tmp_path, capsys, options, note):
    full = tmp_path / "full"  # refused, so that nothing is run
    full.write_text("")
    assert main(["shear-gouge", *options.split(), "--out", str(full), "--quiet"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[:-1] == ([f"lsm: {note}"] if note else []) and "is a file" in lines[-1]


def test_summary_is_strict_json(tmp_path, capsys):
    metrics = {"lost": Metric(math.nan, "1"), "bad": Metric(2.0, "J", 1.0, False)}
    write_summary(tmp_path, "w", "demo", metrics)
    read = json.loads((tmp_path / "summary.json").read_text(), parse_constant=pytest.fail)
    assert read["metrics"] == {
        "lost": {"value": None, "unit": "1"},
        "bad": {"value": 2.0, "unit": "J", "bound": 1.0, "holds": False},
    }
    assert "FAILS" in capsys.readouterr().out
    assert os.listdir(tmp_path) == ["summary.json"]


def test_live_progress_ends_with_the_last_report_of_every_label():
    console = Console(force_terminal=True, file=io.StringIO(), width=80)
    with ProgressLine(console=console) as line:
        line({"label": "[a]", "strain": 1.0})
        line({"label": "b", "strain": 2.0})
        line({"label": "[a]", "strain": 3.0})  # too soon to be shown, but the last one
    last = console.file.getvalue().split("\r")[-1]
    assert "[a]: strain 3.00" in last and "b: strain 2.00" in last


def test_a_claim_has_both_bound_and_verdict():
    with pytest.raises(ValueError, match="together"):
        Metric(1.0, "1", bound=2.0)


def test_progress_line():
    report = {
        "strain": 1.24,
        "strain_total": 4.0,
        "friction": 0.312,
        "normal_stress": 5e6,
        "energy_residual": 0.001,
        "steps_per_second_grain": 412e3,
        "eta": 130,
    }
    assert format_line(report) == (
        "strain 1.24/4.00 | mu 0.31 | sigma_n 5.00 MPa | energy residual 0.1 % | 4.1e5 grain steps/s | ETA 02:10"
    )
    assert format_line({"strain": 0.0, "friction": math.nan, "eta": 3725}) == "strain 0.00 | ETA 1:02:05"


def test_plain_progress_is_throttled_for_each_label(capsys):
    line = ProgressLine()
    for step in range(5):
        line({"label": "a", "strain": step})
        line({"label": "b", "strain": step})
    line({"label": "a", "strain": 9, "state": "done"})
    assert capsys.readouterr().out.splitlines() == [
        "a: strain 0.00",
        "b: strain 0.00",
        "a: done | strain 9.00",
    ]


def test_an_output_that_cannot_be_written_is_one_line():
    command = [sys.executable, "-m", "workflows.cli.main", "list"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1 and "No space left on device" in done.stderr and "Traceback" not in done.stderr
