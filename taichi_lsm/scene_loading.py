"""What a scene says, written into the fields of its simulation."""

from typing import Any


def load_scene(sim: Any) -> None:
    """Write everything that belongs to the scene of `sim` into fields that exist.

    Raises
    ------
    InputError
        If the shape tables have no room for the shapes.
    """
    scene = sim.scene
    sim.domain.set_lengths(scene.lengths)
    sim.error_flags.want(scene.guards)
    sim.measure.thickness = scene.thickness
    for bound, effect in zip(sim.effects, scene.effects, strict=True):
        bound.write_parameters(effect)
    if sim.surfaces:
        sim.surfaces.fill([part for s in scene.shapes for part in s.parts])
    if sim.parts:
        sim.parts.fill(scene.shapes)
    load_state(sim)
    sim.set_skin(scene.skin)
    if sim.spec.reaches:
        sim.forces.geometry.set_reach(scene.reach())
    if sim.bonds:
        sim.bonds.fill(scene)


def load_state(sim: Any) -> None:
    """Write the state of the grains of the scene; velocities at the time of the positions."""
    scene, state, spec = sim.scene, sim.state, sim.spec
    mass, inertia = scene.masses()
    state.position.from_numpy(scene.position)
    if spec.sheared:  # the mean flow is part of the velocities
        if spec.cell_servo:
            sim.domain.load(scene)
        sim.domain.set_shear(scene.shear_rate, scene.widest())
    state.velocity.from_numpy(scene.velocity + sim.domain.mean_flow(scene.position))
    state.platen_index.from_numpy(scene.platen_index)
    state.radius.from_numpy(scene.per_grain("bounding_radius"))
    state.inverse_mass.from_numpy(1.0 / mass)
    if spec.rotates:
        state.angular_velocity.from_numpy(scene.angular_velocity)
        state.inverse_inertia.from_numpy(1.0 / inertia)
    if spec.oriented:
        state.orientation.from_numpy(scene.orientation_state())
    if spec.shaped:
        state.shape_index.from_numpy(scene.shape_index)
        state.diameter.from_numpy(scene.diameter)
        state.overlap_limit.from_numpy(scene.per_grain("overlap_limit"))
        sim.search.set_half_widths(scene.per_grain("half_width"))
    if spec.has_equivalent_radius:
        state.equivalent_radius.from_numpy(scene.per_grain("equivalent_radius"))
