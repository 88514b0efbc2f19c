"""Experiments: every module here that defines Params and run is a command of `lsm`."""
