"""Names of the checkpoints in the folder of a run, for those that read it without Taichi."""

LAST, PREVIOUS, NEW = "checkpoint.nc", "checkpoint.previous.nc", "checkpoint.new.nc"
