"""Parts of the experiment on a sheared cell without walls."""
