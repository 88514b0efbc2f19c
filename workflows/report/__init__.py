"""A page about a run: how it ended, its figures, metrics, parameters, energies, files, in one file of HTML."""
