"""Exit codes of `lsm`; 128 + n on signal n."""

COMPLETE, FAILED, BAD_INPUT, CLAIM_NOT_MET = 0, 1, 2, 3
CLOSED_PIPE = 128 + 13  # as of SIGPIPE
