"""What a machine and an installation need so that `lsm` works, and whether they have it."""
