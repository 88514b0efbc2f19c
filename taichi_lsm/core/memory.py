"""How much memory the machine has."""

import os


def machine_memory() -> float:
    """Memory of this machine [bytes]; infinity where the system does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):  # Windows has no sysconf
        return float("inf")
