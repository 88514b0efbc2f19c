"""Time integration: state, forces, schemes, step loops, guards."""
