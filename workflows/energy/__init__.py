"""Parts of the experiment `energy_conservation`."""
