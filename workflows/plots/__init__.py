"""Every picture that a workflow draws."""
