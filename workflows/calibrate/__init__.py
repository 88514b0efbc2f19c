"""Parameters of an experiment that give what a laboratory has measured, with their uncertainty."""
