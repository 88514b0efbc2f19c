"""Exit codes of `lsm` and of the processes of runs, and the reason that goes with one; 128 + n on signal n."""

COMPLETE, FAILED, BAD_INPUT, CLAIM_NOT_MET = 0, 1, 2, 3
CLOSED_PIPE = 128 + 13  # as of SIGPIPE


def reason_of(error: Exception) -> str:
    """Why a run could not be completed, as one message."""
    if isinstance(error, MemoryError):
        return f"not enough memory for a run of this size: {error or 'the system gave no more'}."
    if isinstance(error, OSError):
        return f"a file could not be read or written: {error}."
    return "; ".join([str(error), *getattr(error, "__notes__", ())])
