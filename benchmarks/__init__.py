"""Time per grain and step beside LAMMPS, on the same packed states: `python -m benchmarks.run`."""
