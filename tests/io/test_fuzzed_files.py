"""Files that were damaged or altered are read or refused by name, whatever is wrong with them; changed at random.

`make validate` tries 2000 files and more, `make test` some of each kind.
"""

import multiprocessing
from collections import Counter

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from tests.helpers import fuzzed_files
from tests.helpers.changed_files import changes

SHORT, LONG = 6, 150  # files of each kind
SLOWEST = 2.0  # s of processor time
LONGEST = 3000  # characters of a message


@pytest.fixture(scope="module")
def children(tmp_path_factory):
    """(a process that changes files, one that reads them); either may die of what it finds."""
    for name in ("matplotlib.figure", "scipy.optimize", "shapely", "trimesh", "manifold3d", "xarray"):
        pytest.importorskip(name)  # before the fork
    folder = tmp_path_factory.mktemp("fuzzed")
    fuzzed_files.make_good_files(folder)
    both = fuzzed_files.Child(folder / "made"), fuzzed_files.Child(folder / "read")
    yield both
    for child in both:
        child.close()


def tried(children, kind, examples):
    """Counts of the outcomes of so many files of a kind, and the longest time of one [s]."""
    maker, reader = children
    count, longest = Counter(), [0.0, ""]
    good = reader.read(kind, fuzzed_files.GOOD[kind].read_bytes())
    assert good.outcome == "valid", good.message

    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(changes(kind in fuzzed_files.NETCDF))
    def attempt(steps):
        data = maker.made(kind, steps)
        if data is None:
            count["not made"] += 1
            return
        outcome, message, seconds = reader.read(kind, data)
        count[outcome] += 1
        assert outcome != "crash", message
        if outcome == "refused":
            assert fuzzed_files.GOOD[kind].name in message or "effects" in message or "--" in message, message
            assert all(line.isprintable() for line in message.split("\n")) and len(message) < LONGEST, message
        longest[:] = max(longest, [seconds, str(steps)])

    attempt()
    return count, longest


@pytest.mark.parametrize("kind", fuzzed_files.READERS)
def test_a_file_is_read_or_refused_by_name(children, kind):
    count, (longest, steps) = tried(children, kind, SHORT)
    assert count["valid"] + count["refused"] >= SHORT // 2
    assert longest < 5 * SLOWEST, steps  # a hang, whatever else the machine does


@pytest.mark.validate
def test_checkpoints_are_restored_or_refused_by_name(children, tmp_path):
    fuzzed_files.GOOD["checkpoint"] = tmp_path / "checkpoint.nc"
    context = multiprocessing.get_context("fork")
    process = context.Process(target=fuzzed_files.make_checkpoint, args=(fuzzed_files.GOOD["checkpoint"],))
    process.start()
    process.join()
    maker = fuzzed_files.Child(tmp_path / "made")
    reader = fuzzed_files.Child(tmp_path / "read", fuzzed_files.prepare_checkpoints)
    count, longest = tried((maker, reader), "checkpoint", LONG)
    maker.close()
    reader.close()
    print(f"checkpoint: {dict(count)}, longest {longest[0]:.2f} s")
    assert count["refused"] > 0.5 * LONG and longest[0] < SLOWEST


@pytest.mark.validate
def test_two_thousand_files(children):
    total, times = Counter(), []
    for kind in fuzzed_files.READERS:
        count, longest = tried(children, kind, LONG)
        print(f"{kind}: {dict(count)}, longest {longest[0]:.2f} s")
        total += count
        times.append(longest)
    print(f"{total['valid'] + total['refused']} files, longest {max(times)[0]:.2f} s")
    assert total["valid"] + total["refused"] >= 2000 and min(total["valid"], total["refused"]) > 200
    assert max(times)[0] < SLOWEST, max(times)[1]
