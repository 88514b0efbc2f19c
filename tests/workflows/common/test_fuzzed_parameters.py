"""Parameters that anyone may have written are valid, or refused in words that name what is wrong; drawn at random.

`make validate` tries 10 000 files, `make test` some hundred of the same kinds.
"""

import re
import time
from collections import Counter

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from taichi_lsm.core.errors import InputError
from tests.helpers import fuzzed_parameters
from workflows.common.discovery import find_workflows
from workflows.common.parameters import ParameterError, merge, to_toml
from workflows.common.run_cost import RunCost

WORKFLOWS = find_workflows()
FIELDS = {name: set(module.Params.model_fields) for name, module in WORKFLOWS.items()}
SHORT, LONG = 25, 1700  # files for each experiment; the long form makes more than 10 000
SLOWEST = 2.0  # s of processor time, on a machine that may be busy
LONGEST = 2000  # characters of a message


def tried(name, path, examples):
    """Counts of the outcomes of so many files for the experiment `name`, and the longest time of one [s]."""
    module, count, longest = WORKFLOWS[name], Counter(), [0.0, ""]
    others = {other: fields for other, fields in FIELDS.items() if other != name}

    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(fuzzed_parameters.files(name, module.Params, sorted(WORKFLOWS)))
    def attempt(text):
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
        began = time.process_time()
        try:
            params = merge(module.Params, None, path, None, name, others)
            module.check(params)
            assert isinstance(module.estimate(params), RunCost)
            count["valid"] += 1
        except InputError as error:
            count["refused"] += 1
            check_message(error, name, text, path)
        else:
            path.write_text(to_toml(params, name), encoding="utf-8")
            again = merge(module.Params, None, path, None, name)  # but for what has no effect, and is a comment
            acting = set(FIELDS[name]) - params.idle().keys()
            assert again.model_dump(include=acting) == params.model_dump(include=acting)
        longest[:] = max(longest, [time.process_time() - began, text])

    attempt()
    return count, longest


def check_message(error, name, text, path):
    """Each problem is one line, not too long, and names a parameter, a key of the file, or the file."""
    problems = error.problems if isinstance(error, ParameterError) else [str(error)]
    assert problems
    for problem in problems:
        assert problem.isprintable() and len(problem) < LONGEST, problem
        options = {option.strip("-").replace("-", "_") for option in re.findall(r"--[\w-]+", problem)}
        named = options & (FIELDS[name] | FIELDS["shear-gouge"] | {"preset", "config"})
        assert named or str(path) in problem or re.match(r"effects\b|\.\.\. and ", problem), problem


@pytest.mark.parametrize("name", sorted(WORKFLOWS))
def test_parameters_are_valid_or_refused_by_name(tmp_path, name):
    count, (longest, text) = tried(name, tmp_path / "a.toml", SHORT)
    assert count.total() >= SHORT and min(count["valid"], count["refused"]) > 0
    assert longest < 5 * SLOWEST, text  # a hang, whatever else the machine does


@pytest.mark.validate
def test_ten_thousand_files_of_parameters(tmp_path):
    total, times = Counter(), []
    for name in sorted(WORKFLOWS):
        count, longest = tried(name, tmp_path / "a.toml", LONG)
        print(f"{name}: {count['valid']} valid, {count['refused']} refused, longest {longest[0]:.2f} s")
        total += count
        times.append(longest)
    print(f"{total.total()} files of parameters, longest {max(times)[0]:.2f} s")
    assert total.total() >= 10_000 and min(total["valid"], total["refused"]) > 1000
    assert max(times)[0] < SLOWEST, max(times)[1]
