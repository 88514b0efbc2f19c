"""Many runs of one experiment, whose parameters vary as a file says."""
