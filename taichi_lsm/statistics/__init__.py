"""Statistics of runs: means with honest errors. Plain functions on xarray objects, without a kernel."""

from .steady_means import Estimate, combine_replicas, difference, steady_ratio, steady_state

__all__ = ["Estimate", "combine_replicas", "difference", "steady_ratio", "steady_state"]
