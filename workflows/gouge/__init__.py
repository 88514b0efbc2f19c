"""Parts of the gouge experiments."""
