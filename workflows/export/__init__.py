"""The grains of a run in the formats of other programs: one module per format, see `lsm export`."""
