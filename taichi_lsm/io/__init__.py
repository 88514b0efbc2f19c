"""Files: NetCDF series and snapshots, checkpoints."""
