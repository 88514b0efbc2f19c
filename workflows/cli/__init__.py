"""The command line `lsm`."""
