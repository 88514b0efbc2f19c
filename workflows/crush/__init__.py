"""Parts of the experiment crush-grain."""
