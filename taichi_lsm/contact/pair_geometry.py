"""Where two listed grains touch: spheres in closed form, all others by the geometry of their surfaces."""

from typing import Any

from ..core.allocation import when_allocated, write
from ..core.rotation import torque_of, unrotate
from ..core.runtime import current, ti
from ..effects.base import LENGTHS
from .error_flags import OVERLAP
from .pair_storage import HAS_IMPULSE, PART_BASE, RESTING
from .primitives import SPHERE_OVERLAP_LIMIT, sphere_overlap


@ti.func
def half_width(reduced_radius, depth, bounding_radius):
    """Half [m] of the width in which two outlines overlap: sqrt(2 R d), at most half of the bounding radius [m].

    A circle of radius R stands out by x^2/(2 R) at the distance x from its lowest point. Where a side that is nearly
    flat sinks in by more than it stands out, the overlap ends at its corners; the bound stands for them.
    """
    return ti.min(ti.sqrt(2.0 * reduced_radius * ti.max(depth, 0.0)), 0.5 * bounding_radius)


@ti.data_oriented
class PairGeometry:
    """Distances and overlaps of the pairs of the list.

    Parameters
    ----------
    spec : KernelSpec
        What the scene needs.
    grains
        State of the grains.
    surfaces
        Table of the patches (`surface_table`), None for spheres.
    parts : PartTable or None
        Table of the parts, None if every grain has one part.
    domain : Domain
        The cell.
    pairs : Pairs
        Storage of the pairs.
    error_flags : ErrorFlags
        Receives a depth that reaches the overlap limit, where no pair of patches faces each other uniquely any more.
    reach : float
        Distance of the surfaces up to which an effect acts [m]; 0 if all effects need a contact.
    """

    def __init__(
        self,
        spec: Any,
        grains: Any,
        surfaces: Any,
        parts: Any,
        domain: Any,
        pairs: Any,
        error_flags: Any,
        reach: float = 0.0,
    ) -> None:
        self.spec = spec
        self.grains, self.domain, self.pairs, self.error_flags = grains, domain, pairs, error_flags
        self.parts = parts
        if spec.shaped:
            self.surface = surfaces.contact(grains, pairs, error_flags, domain)
        self.real = current().real
        self.dim = grains.dim
        if spec.reaches:
            self.reach = ti.field(self.real, ())
            when_allocated(lambda: self.set_reach(reach))

    def set_reach(self, reach: float) -> None:
        """Set the distance of the surfaces [m] up to which effects act."""
        write(self.reach, reach)

    @ti.func
    def least_depth(self):
        """Depth [m] above which effects act on a pair: minus the reach, hence negative if there is one."""
        least = ti.cast(0.0, self.real)
        if ti.static(self.spec.reaches):
            least = -self.reach[None]
        return least

    @ti.func
    def counted_depth(self, s, overlap):
        """What counts as depth [m] of the overlap [m] of slot s: all but its rest overlap, that of a broken bond."""
        depth = overlap
        if ti.static(self.spec.has_rest_overlaps):
            depth -= self.pairs.rest_overlap[s]
        return depth

    @ti.func
    def whole_overlap(self, s, depth):
        """The overlap [m] of slot s of which this depth [m] counts."""
        overlap = depth
        if ti.static(self.spec.has_rest_overlaps):
            overlap += self.pairs.rest_overlap[s]
        return overlap

    @ti.func
    def radii_of_spheres(self, k, l, s):
        """Radii [m] of two spheres of slot s, each less half of their rest overlap, from which the depth counts."""
        r_k, r_l = self.grains.radius[k], self.grains.radius[l]
        if ti.static(self.spec.has_rest_overlaps):
            half = 0.5 * self.pairs.rest_overlap[s]
            r_k, r_l = r_k - half, r_l - half
        return r_k, r_l

    @ti.func
    def shrink_rest_overlap(self, s, depth):
        """Let the rest overlap of slot s fall with the overlap, of which `depth` [m] counts; RESTING if some is left.

        It is min(rest overlap, overlap): where the depth has fallen to zero the pair has parted, and what is left of
        the overlap is no depth until the pair comes closer again. It changes only where no effect acts, so that the
        energy, a function of the depth alone, is kept; once the grains are apart it is zero for good.
        """
        rest = self.pairs.rest_overlap[s]
        rest = ti.max(rest + ti.min(depth - self.least_depth(), 0.0), 0.0)
        self.pairs.rest_overlap[s] = rest
        return ti.select(rest > 0.0, RESTING, 0)

    @ti.func
    def equivalent_radius(self, k):
        """Radius [m] of the disc or the sphere as large as grain k."""
        result = self.grains.radius[k]
        if ti.static(self.spec.has_equivalent_radius):
            result = self.grains.equivalent_radius[k]
        return result

    @ti.func
    def rolling_radius(self, k, l):
        """Reduced radius R_k R_l/(R_k + R_l) [m] of the equivalent radii."""
        r_k, r_l = self.equivalent_radius(k), self.equivalent_radius(l)
        return r_k * r_l / (r_k + r_l)

    @ti.func
    def reduced_radius(self, k, l, s):
        """Reduced radius [m] of the grains of slot s, or of the surfaces with which they touch if an effect wants it.

        That of the grains is the same wherever they touch, so that a force which depends on it is the gradient of one
        potential: see `Hertz`.
        """
        radius = self.rolling_radius(k, l)
        if ti.static(self.spec.local_radius):
            a, b = self.parts_of(k, l, s)
            r_k, r_l = self.surface.radii(a, b, k, l, s)
            radius = r_k * r_l / (r_k + r_l)
        return radius

    @ti.func
    def footprint(self, k, l, s, depth):
        """Half [m] of the width in which the outlines of the grains of slot s overlap; depth [m]."""
        g = self.grains
        r_k, r_l = g.radius[k], g.radius[l]
        if ti.static(self.spec.shaped):
            a, b = self.parts_of(k, l, s)
            r_k, r_l = self.surface.radii(a, b, k, l, s)
        return half_width(r_k * r_l / (r_k + r_l), depth, ti.min(g.radius[k], g.radius[l]))

    @ti.func
    def length(self, name: ti.template(), k, l, s, depth):
        """The one of `LENGTHS` that is called `name` [m], of the grains of slot s; depth [m]."""
        result = ti.cast(0.0, self.real)
        if ti.static(name == "reduced_radius"):
            result = self.reduced_radius(k, l, s)
        elif ti.static(name == "rolling_radius"):
            result = self.rolling_radius(k, l)
        else:
            result = self.footprint(k, l, s, depth)
        return result

    @ti.func
    def put_lengths(self, needs: ti.template(), block: ti.template(), i, k, l, s):
        """Put the lengths that effects need into contact i of a block, whose depth is there."""
        for name in ti.static(LENGTHS):
            if ti.static(name in needs):
                block[name][i] = self.length(name, k, l, s, block.depth[i])

    @ti.func
    def shortest(self, k, l):
        """Branch vector [m] from grain k to the nearest image of grain l, in the precision of the contacts."""
        # The difference is taken in f64: positions grow with the cell, branch vectors do not.
        return ti.cast(self.domain.displacement(self.grains.position[k], self.grains.position[l]), self.real)

    @ti.func
    def relative_velocity(self, k, l):
        """Velocity [m s-1] of the centre of the nearest image of grain l relative to that of grain k."""
        g = self.grains
        v = g.velocity[l] - g.velocity[k]
        # An image across a sheared border moves with the flow of its own layer of cells.
        if ti.static(self.spec.sheared):
            v[0] -= self.domain.border_speed(g.position[k], g.position[l])
        if ti.static(self.spec.cell_servo):
            v[1] += self.domain.stretch_rate() * self.domain.displacement(g.position[k], g.position[l])[1]
        return ti.cast(v, self.real)

    @ti.func
    def add_shear_work(self, k, moment):
        """Add the work of shearing, -rate sigma_xy V dt [J]; moment [N m s]: share of a contact in sigma_xy V dt."""
        g = self.grains
        g.shear_work[k] = g.shear_work[k] - self.domain.shear_rate[0] * moment

    @ti.func
    def add_to_cell(self, k, s, f, status, dt):
        """Add what the contact in slot s does to the cell in a step of dt [s]: work of the shear, and normal stress.

        f [N]: its force; the impulse that goes with it is stored. Work of the shear is that of force and impulse times
        the branch along the gradient.
        """
        branch = self.shortest(k, self.pairs.second_slot[s])[1]
        push = ti.cast(f[0], ti.f64) * dt
        if ti.static(self.spec.onset):
            if status & HAS_IMPULSE:
                push += self.pairs.pair_impulse[s][0]
        self.add_shear_work(k, push * branch)
        if ti.static(self.spec.cell_servo):
            g, across = self.grains, ti.cast(f[1], ti.f64)
            if ti.static(self.spec.onset):
                if status & HAS_IMPULSE:  # at no time there is none
                    across += ti.cast(self.pairs.pair_impulse[s][1], ti.f64) / dt
            g.virial[k] = g.virial[k] + across * ti.cast(branch, ti.f64)

    @ti.func
    def parts_of(self, k, l, s):
        """Rows of the surface table of list slot s: that of the part of grain k and that of the part of grain l."""
        g = self.grains
        a, b = g.shape_index[k], g.shape_index[l]
        if ti.static(self.spec.multi_part):
            code = self.pairs.part_code[s]
            a = self.parts.first_row[a] + code // PART_BASE
            b = self.parts.first_row[b] + code % PART_BASE
        return a, b

    @ti.func
    def near(self, k, l, s, d):
        """1 if the bounding spheres of slot s, d = c_l - c_k apart [m], overlap, Eq. (1), else 0.

        Shaped grains that were a gap apart are not near until the path lengths of their surfaces add up to the gap.
        """
        g = self.grains
        near = d.dot(d) < (g.radius[k] + g.radius[l] - self.least_depth()) ** 2
        # Parts: by their own bounding balls, as those of the grains overlap for many pairs of parts that are apart.
        if ti.static(self.spec.multi_part):
            code = self.pairs.part_code[s]
            near = self.parts.gap(k, l, code // PART_BASE, code % PART_BASE, d) < -self.least_depth()
        if ti.static(self.spec.remembers_features):
            near = near and g.travel[k] + g.travel[l] >= self.pairs.free_until[s]
        return ti.cast(near, ti.i32)

    @ti.func
    def overlap(self, k, l, s, d, previous_status):
        """Depth [m], normal k -> l, arm_k and arm_l [m] of grains d = c_l - c_k apart; depth < 0 if they are apart.

        Beyond the bounding spheres, Eq. (1), only a pair that touched in the last step (`previous_status`) is examined.
        The arms run from the centres to the contact point, so that arm_l = arm_k - d: the middle of the whole overlap,
        also where only a part of it counts as depth.
        """
        g = self.grains
        depth = ti.cast(-1.0, self.real)
        n, arm_k, arm_l = 0.0 * d, 0.0 * d, 0.0 * d
        r_k, r_l = g.radius[k], g.radius[l]
        if d.dot(d) < (r_k + r_l - self.least_depth()) ** 2 or previous_status != 0:
            if ti.static(self.spec.shaped):
                a, b = self.parts_of(k, l, s)
                depth, n, arm_k = self.surface.overlap(a, b, k, l, s, d)
                # Patches that do not face each other are apart, however near they are.
                if ti.static(self.spec.kind == "cones" and self.spec.reaches):
                    if depth < 0.0 and not self.surface.faces(a, b, k, l, n):
                        depth -= self.reach[None]
            else:
                depth, n, at = sphere_overlap(d, r_k, r_l)
                arm_k = at * n
                self.check_overlap_limit(k, l, depth)
            arm_l = arm_k - d
        # The balls around parts may reach out of the bounding sphere of the grain; then only the gap between the
        # spheres is known, a lower bound of that between the surfaces.
        else:
            depth = r_k + r_l - d.norm()
        return self.counted_depth(s, depth), n, arm_k, arm_l

    @ti.func
    def check_overlap_limit(self, k, l, depth):
        """Report two spheres whose depth [m] reached their overlap limit; they are then nearly concentric."""
        g = self.grains
        if depth >= SPHERE_OVERLAP_LIMIT * (g.radius[k] + g.radius[l]):
            self.error_flags.report(OVERLAP, g.id[k], g.id[l])

    @ti.func
    def remembered(self, s):
        """Features (2,) and normal (dim,) that list slot s stores; zero where the geometry stores none."""
        features = ti.Vector([0, 0])
        n = ti.Vector([ti.cast(0.0, self.real)] * self.dim)
        if ti.static(self.spec.remembers_features):
            features = self.pairs.feature[s]
            if ti.static(self.spec.remembers_normal):
                n = self.pairs.normal[s]
        return features, n

    @ti.func
    def mobility(self, k, lever):
        """Acceleration of a point of grain k per force [kg-1]; lever = arm x direction of the force [m]."""
        result = self.grains.inverse_mass[k]
        if ti.static(self.spec.rotates):
            if ti.static(self.spec.tumbles):  # to the axes that inverse_inertia belongs to
                lever = unrotate(ti.cast(self.grains.orientation[k], self.real), lever)
            result += (lever * lever * self.grains.inverse_inertia[k]).sum()
        return result

    @ti.func
    def inverse_effective_mass(self, k, l, n, arm_k, arm_l):
        """Acceleration of the depth per force along n at a contact of grains k and l [kg-1]; arms [m]."""
        return self.mobility(k, torque_of(arm_k, n)) + self.mobility(l, torque_of(arm_l, n))
