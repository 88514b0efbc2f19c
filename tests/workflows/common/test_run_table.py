"""Files of results hold the values, what they are, and of which run, in one group or in several."""

import numpy as np
import xarray as xr

from workflows.common.run_table import write_result
from workflows.gouge.parameters import Params

RESULT = xr.Dataset({"slip": ("event", [1e-6, np.nan], {"units": "m"})}, {"event": [0, 1]}, {"onset": 2.0})
WORDS = "Slips", "One row per event."


def test_a_result_keeps_values_and_attributes_and_is_marked_complete(tmp_path):
    path = tmp_path / "events.nc"
    write_result(path, RESULT, Params(seed=7), *WORDS, dt=1e-9)
    with xr.open_dataset(path) as found:
        xr.testing.assert_equal(found, RESULT)
        assert found.slip.attrs == {"units": "m"} and "_FillValue" not in found.slip.encoding
        assert found.onset == 2.0 and found.title == "Slips" and found.run_status == "complete"
        assert found.seed == 7 and found.dt == 1e-9
    assert RESULT.attrs == {"onset": 2.0}  # what was given is not changed


def test_groups_share_one_head(tmp_path):
    path = tmp_path / "cycles.nc"
    write_result(path, xr.DataTree.from_dict({"/up": RESULT, "/down": 2.0 * RESULT}), Params(), *WORDS)
    with xr.open_datatree(path) as found:
        assert found.run_status == "complete" and found.summary == "One row per event."
        for name, factor in (("up", 1.0), ("down", 2.0)):
            np.testing.assert_equal(found[name].slip.values, factor * RESULT.slip.values)
            assert "_FillValue" not in found[name].slip.encoding
