"""How an experiment runs: a schedule of stages, and the one loop that goes through it and can be resumed."""
