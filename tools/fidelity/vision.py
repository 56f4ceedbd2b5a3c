"""Eyes: grating acuity, binocular disparity, segmentation and defocus, against their theory."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from tools.fidelity.law import Curve, Law, Mark, Plot, Section, at_least, at_most
from veca_marl.sim.body import make_body
from veca_marl.sim.body.sense_organs import EYES
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.geometry import (
    Floats,
    Geom,
    GeomTable,
    Pose,
    Scene,
    Shape,
    distance,
    matrix_to_quaternion,
    quaternions_to_matrices,
)
from veca_marl.sim.physics import PlaygroundCfg, PropCfg, PropShape, World, shape_arguments
from veca_marl.sim.physics.bullet_client import BulletClient, pybullet
from veca_marl.sim.vision import Camera, EyeViews, look_at
from veca_marl.sim.vision.image_filters import (
    CONTRAST_AT_LIMIT,
    Defocus,
    Filter,
    FilterContext,
    InfantVision,
)


class TinyRenderer:
    """Renders the primitives of a scene, each as a body of a PyBullet client of its own.

    Use it as a context manager, which disconnects the client.

    Args:
        scene: The scene; its poses are those of the last `Scene.update`.
    """

    def __init__(self, scene: Scene) -> None:
        self._client = BulletClient()
        for g in range(len(scene.geoms.shapes)):
            self._add(scene.geoms, g)

    def __enter__(self) -> TinyRenderer:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Disconnect from PyBullet."""
        self._client.close()

    def segment(self, camera: Camera, pose: Pose) -> NDArray[np.int32]:
        """Return the row of the visible primitive per pixel, ``(H, W)``, -1 for none."""
        forward, _, up = pose.rotation.T
        view = pybullet.computeViewMatrix(pose.position, pose.position + forward, up)
        projection = pybullet.computeProjectionMatrix(*_frustum(camera))
        *_, segmentation = self._client.getCameraImage(
            camera.width,
            camera.height,
            view,
            projection,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
        )
        return np.reshape(segmentation, (camera.height, camera.width)).astype(np.int32)

    def _add(self, geoms: GeomTable, g: int) -> None:
        kind = shape_arguments(Shape(geoms.shapes[g]), geoms.sizes[g])
        visual = self._client.createVisualShape(**kind)
        orientation = matrix_to_quaternion(geoms.rotations[g])
        self._client.createMultiBody(0.0, -1, visual, geoms.positions[g], orientation)


def _frustum(camera: Camera) -> tuple[float, float, float, float, float, float]:
    """Return left, right, bottom and top of the near plane, and the distances near and far.

    TinyRenderer's rays pass through the lower left corners of its pixels: the frustum is shifted by
    half a pixel, so that they are those of `Camera`, through the centres.
    """
    near, far = camera.near_m, camera.far_m
    x, y = near * float(camera.lens.tan_x), near * float(camera.lens.tan_y)
    right, up = x / camera.width, y / camera.height
    return -x + right, x + right, -y + up, y + up, near, far


TELLER_CPD: dict[float, float] = {
    1.0: 0.94,
    1.5: 1.11,
    2.5: 2.16,
    4.0: 2.68,
    6.0: 5.65,
    9.0: 6.79,
    12.0: 6.42,
    18.0: 8.59,
    24.0: 9.57,
    30.0: 11.52,
    36.0: 21.81,
    48.0: 24.81,
}
"""Mean monocular grating acuity (cycles per degree) by age in months on the Teller Acuity Cards,
Mayer et al., Investigative Ophthalmology & Visual Science 36 (1995) 671-685, table 2."""

CAMERAS = 300
CLEAR_M = 0.3
_LENGTHS = {Shape.SPHERE: 1, Shape.BOX: 3, Shape.CYLINDER: 2, Shape.CAPSULE: 2}
ROOMS: dict[str, tuple[tuple[Shape, ...], float]] = {
    "boxes": ((Shape.BOX,), 99.9),
    "balls": ((Shape.SPHERE,), 97.0),
    "all shapes": (tuple(_LENGTHS), 95.0),
}
"""Shapes in the rooms that are compared with TinyRenderer, and the least mean share (%)."""
WALL_ID = 1
"""Object id of the wall of these rooms; that of the floor is less, those of the shapes are more."""
_TEXT = f"""
- **Acuity**: gratings are filtered as a child of that age sees them. The acuity is the frequency at
  which {CONTRAST_AT_LIMIT:.0%} of the contrast is left, compared with the means of Mayer et al.
  1995 on the Teller Acuity Cards. The model pools 9 and 12 months, where the means decrease.
- **Disparity**: a child fixates a point at 0.5 m while a ball is at other distances. The disparity
  is the difference of the directions in which the eyes see the ball; theory is
  2 (atan(h / d) - atan(h / 0.5)) with half the distance h between the eyes.
- **Segmentation**: fraction of equal pixels with TinyRenderer, Bullet's software renderer, for
  {CAMERAS} random cameras, each in a random room of spheres, boxes, cylinders and capsules,
  {CLEAR_M} m or more away from all of them; also of boxes only and of balls only. TinyRenderer
  draws boxes exactly, balls as polyhedra, cylinders and capsules as coarse polyhedra. The polyhedra
  of balls are inscribed: no pixel may show a ball in TinyRenderer's image only.
- **Defocus**: a thin lens with a pupil of diameter p that is focused at f spreads a point at z over
  a disc of the angular diameter p |1/z - 1/f| (Smith, Am. J. Optometry 1982). The diameter is
  measured by the contrast that a grating loses, with the variance (diameter / 4)^2 of a disc.
"""
_LINES = 64  # height of the images of gratings: `Defocus` limits its blur by the height
_PIXELS = 512


def grating_camera(degrees_per_pixel: float) -> Camera:
    """Return a camera for images of gratings with pixels of a given visual angle."""
    tan_y = math.radians(degrees_per_pixel) * _LINES / 2.0
    return Camera(_PIXELS, _LINES, math.degrees(2.0 * math.atan(tan_y)))


def contrast_left(
    apply: Filter, camera: Camera, cpd: float, depth_m: float, focal_m: float
) -> float:
    """Return the share of the contrast of a vertical grating that a filter leaves.

    Args:
        apply: The filter.
        camera: From `grating_camera`.
        cpd: Frequency in cycles per degree.
        depth_m: Distance of the grating.
        focal_m: Distance to which the eyes are accommodated.
    """
    phase = 2.0 * np.pi * cpd * camera.degrees_per_pixel * np.arange(camera.width)
    row = np.round(128.0 + 100.0 * np.cos(phase)).astype(np.uint8)
    images = np.broadcast_to(row[:, None], (1, camera.height, camera.width, 3)).copy()
    depth = np.full(images.shape[:3], depth_m, np.float32)
    filtered = apply(images, FilterContext(camera, depth, focal_m))
    middle = slice(camera.width // 4, 3 * camera.width // 4)  # away from the borders
    wave = np.exp(1j * phase[middle]) * np.hanning(len(phase[middle]))
    line = _LINES // 2
    before, after = (
        abs(np.sum((image[0, line, middle, 0] - 128.0) * wave)) for image in (images, filtered)
    )
    return float(after / before)


def bisected(decreasing: Callable[[float], float], level: float, low: float, high: float) -> float:
    """Return where a decreasing function crosses a level, on a logarithmic scale."""
    for _ in range(14):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if decreasing(middle) > level else (low, middle)
    return math.sqrt(low * high)


def measured_acuity_cpd(age_months: float) -> float:
    """Return the frequency at which the vision of a child keeps `CONTRAST_AT_LIMIT`."""
    near = TELLER_CPD[age_months]  # it only sets the resolution and the range of the search
    camera, seen = grating_camera(0.1 / near), InfantVision(age_months)

    def left(cpd: float) -> float:
        return contrast_left(seen, camera, cpd, 1.0, 1.0)

    return bisected(left, CONTRAST_AT_LIMIT, 0.5 * near, 2.0 * near)


def measured_disc_mrad(pupil_mm: float, depth_m: float, focal_m: float) -> float:
    """Return the diameter of the blur disc by the contrast that a grating loses, milliradians."""
    filtered = Defocus(pupil_mm / 1000.0)
    expected = thin_lens_mrad(pupil_mm, depth_m, focal_m)  # sets the resolution only
    camera = grating_camera(math.degrees(expected / 1000.0) / 12.0)
    cpd = 0.02 / camera.degrees_per_pixel
    left = contrast_left(filtered, camera, cpd, depth_m, focal_m)
    sigma_deg = math.sqrt(-math.log(left) / 2.0) / (math.pi * cpd)
    return 4000.0 * math.radians(sigma_deg)


def thin_lens_mrad(pupil_mm: float, depth_m: float, focal_m: float) -> float:
    """Return the angular diameter of the blur disc of a thin lens, milliradians."""
    return pupil_mm * abs(1.0 / depth_m - 1.0 / focal_m)


def disparity_deg(distance_m: float, fixation_m: float) -> tuple[float, float]:
    """Return the measured and the theoretical disparity of a ball straight ahead, degrees."""
    radius_m = 0.01 * distance_m
    mark = PropCfg("ball", PropShape.sphere, [radius_m], (0, 0, 2), tangible=False)
    world = World(PlaygroundCfg(name="eyes", props=[mark], image_order=0))
    body = make_body("child", WalkerCfg(head_pitch_deg=0.0), world)
    eyes = [body.mount(name) for name in EYES]
    middle, ahead = (eyes[0].position + eyes[1].position) / 2.0, eyes[0].rotation[:, 0]
    half_m = float(np.linalg.norm(eyes[0].position - eyes[1].position)) / 2.0
    body.look_toward_point(middle + fixation_m * ahead)
    world.prop("ball").place(middle + distance_m * ahead)
    world.refresh()
    camera = Camera(600, 600, 60.0)
    ids = EyeViews(world.scene, body, camera).views().ids
    left, right = (_direction_deg(camera, image == world.prop("ball").object_id) for image in ids)
    world.close()
    theory = 2.0 * (math.atan(half_m / distance_m) - math.atan(half_m / fixation_m))
    return left - right, math.degrees(theory)


def _direction_deg(camera: Camera, shown: NDArray[np.bool_]) -> float:
    """Return the horizontal direction of the centre of some pixels, right is positive."""
    slopes = camera.lens.columns[np.nonzero(shown)[1]]
    return math.degrees(math.atan(float(slopes.mean())))


def random_room(rng: np.random.Generator, shapes: Sequence[Shape]) -> Scene:
    """Return a scene of primitives in random poses between a floor and a wall."""
    scene = Scene()
    scene.add_object("floor", [[Geom(Shape.BOX, (3, 3, 0.1), (0, 0, -0.1))]])
    scene.add_object("wall", [[Geom(Shape.BOX, (0.1, 3, 1.2), (3.1, 0, 1.2))]])
    for number in range(24):
        shape = shapes[number % len(shapes)]
        size = tuple(rng.uniform(0.05, 0.4, _LENGTHS[shape]).tolist())
        item = scene.add_object(f"thing {number}", [[Geom(shape, size)]])
        item.positions[0] = rng.uniform((-2, -2, 0), (2, 2, 1.2))
        turn = rng.normal(size=(1, 4))
        quaternions_to_matrices(turn / np.linalg.norm(turn), item.rotations)
    scene.update()
    return scene


def _free_place(scene: Scene, rng: np.random.Generator) -> Floats:
    """Draw a place in the room that is `CLEAR_M` or more away from every primitive."""
    geoms = scene.geoms
    while True:
        place = rng.uniform((-2.8, -2.8, 0.5), (2.5, 2.8, 1.8))
        local = np.einsum("gji,gj->gi", geoms.rotations, place - geoms.positions)
        gaps = [
            distance(shape, size, *point)
            for shape, size, point in zip(geoms.shapes, geoms.sizes, local, strict=True)
        ]
        if min(gaps) >= CLEAR_M:
            return place


def segmentations(
    cameras: int, shapes: Sequence[Shape]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Yield images ``(84, 84)`` of object ids by this renderer and by TinyRenderer, -1 for none.

    Each camera is in a room of its own: the mean depends on the sizes of the shapes in a room.
    """
    rng = np.random.default_rng(0)
    camera = Camera(84, 84, 60.0, near_m=0.02, far_m=12.0)
    for _ in range(cameras):
        scene = random_room(rng, shapes)
        target = rng.uniform((-0.5, -0.5, 0.2), (0.5, 0.5, 0.6))
        pose = look_at(_free_place(scene, rng), target)
        with TinyRenderer(scene) as tiny:
            rows = tiny.segment(camera, pose)
        theirs = np.where(rows >= 0, scene.geoms.objects[rows], -1)
        yield camera.render(scene, [pose]).ids[0], theirs


def equal_shares(cameras: int, shapes: Sequence[Shape]) -> NDArray[np.float64]:
    """Return the shares of pixels that show the same primitive as TinyRenderer's, by camera."""
    return np.array([np.mean(ours == theirs) for ours, theirs in segmentations(cameras, shapes)])


def pixels_outside_balls(cameras: int) -> int:
    """Return the number of pixels of all cameras with a ball in TinyRenderer's image alone."""
    seen = segmentations(cameras, ROOMS["balls"][0])
    return sum(int(np.sum((theirs > WALL_ID) & (ours <= WALL_ID))) for ours, theirs in seen)


def acuity_laws() -> Iterator[tuple[float, float, Law]]:
    """Yield age, measured acuity and the law for each age of the norms."""
    for age_months, norm_cpd in TELLER_CPD.items():
        measured = measured_acuity_cpd(age_months)
        octaves = abs(math.log2(measured / norm_cpd))
        yield (
            age_months,
            measured,
            at_most(f"acuity at {age_months:g} months, from the norm", "octaves", 0.1, octaves),
        )


DISTANCES_M = (0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 2.0)
FIXATION_M = 0.5


def disparity_law(measured: NDArray[np.float64], theory: NDArray[np.float64]) -> Law:
    """Return the law of disparities in degrees."""
    error = float(np.abs(measured - theory).max())
    return at_most("disparity, largest error from 0.2 to 2 m", "deg", 0.05, error)


def segmentation_laws(shares: dict[str, NDArray[np.float64]]) -> list[Law]:
    """Return the laws of the shares of equal pixels, by the name of the room of `ROOMS`."""
    means = {name: 100.0 * float(share.mean()) for name, share in shares.items()}
    least = 100.0 * float(shares["boxes"].min())
    equal = "pixels equal to TinyRenderer's"
    return [at_least(f"{equal}, boxes, least", "%", 99.0, least)] + [
        at_least(f"{equal}, {name}, mean", "%", ROOMS[name][1], mean)
        for name, mean in means.items()
    ]


def outside_law(pixels: int) -> Law:
    """Return the law of the pixels that show a ball in TinyRenderer's image alone."""
    return at_most("pixels that show a ball in TinyRenderer's image only", "", 0.0, float(pixels))


PUPILS_MM = (2.0, 4.0, 8.0)
FOCUS_M = 0.5
DEPTHS_M = (0.15, 0.25, 0.4, 0.8, 2.0, 10.0)


def defocus_errors(pupil_mm: float) -> tuple[list[float], Law]:
    """Return the measured discs (mrad) at `DEPTHS_M` with one pupil, and their law."""
    measured = [measured_disc_mrad(pupil_mm, depth_m, FOCUS_M) for depth_m in DEPTHS_M]
    theory = [thin_lens_mrad(pupil_mm, depth_m, FOCUS_M) for depth_m in DEPTHS_M]
    error = max(abs(one / other - 1.0) for one, other in zip(measured, theory, strict=True))
    name = f"blur disc with a pupil of {pupil_mm:g} mm, largest error"
    return measured, at_most(name, "%", 6.0, 100.0 * error)


def section() -> Section:
    """Return the measured section."""
    acuity = list(acuity_laws())
    pairs = np.array([disparity_deg(d, FIXATION_M) for d in DISTANCES_M])
    shares = {name: equal_shares(CAMERAS, shapes) for name, (shapes, _) in ROOMS.items()}
    discs = {pupil_mm: defocus_errors(pupil_mm) for pupil_mm in PUPILS_MM}
    laws = [law for _, _, law in acuity]
    laws += [disparity_law(*pairs.T), *segmentation_laws(shares)]
    laws.append(outside_law(pixels_outside_balls(CAMERAS)))
    laws += [law for _, law in discs.values()]
    plots = [
        _acuity_plot([cpd for _, cpd, _ in acuity]),
        _disparity_plot(pairs),
        _defocus_plot({pupil_mm: measured for pupil_mm, (measured, _) in discs.items()}),
        _share_plot(shares),
    ]
    return Section("Vision", _TEXT, laws, plots)


def _acuity_plot(measured: list[float]) -> Plot:
    ages, norms = list(TELLER_CPD), list(TELLER_CPD.values())
    curves = [
        Curve("Mayer et al. 1995", ages, norms, Mark.points),
        Curve("measured in filtered images", ages, measured, Mark.line),
    ]
    return Plot("Grating acuity", "age (months)", "cycles per degree", curves, True, True)


def _disparity_plot(pairs: NDArray[np.float64]) -> Plot:
    measured, theory = pairs.T.tolist()
    curves = [
        Curve("geometry", DISTANCES_M, theory, Mark.dashes),
        Curve("measured", DISTANCES_M, measured, Mark.points),
    ]
    title = f"Disparity with fixation at {FIXATION_M:g} m"
    return Plot(title, "distance (m)", "disparity (deg)", curves, True)


def _defocus_plot(discs: dict[float, list[float]]) -> Plot:
    dioptres = [1.0 / depth_m - 1.0 / FOCUS_M for depth_m in DEPTHS_M]
    curves = []
    for pupil_mm, measured in discs.items():
        theory = [thin_lens_mrad(pupil_mm, depth_m, FOCUS_M) for depth_m in DEPTHS_M]
        curves.append(Curve(f"thin lens, {pupil_mm:g} mm", dioptres, theory, Mark.dashes))
        curves.append(Curve(f"measured, {pupil_mm:g} mm", dioptres, measured, Mark.points))
    return Plot("Blur disc", "defocus (dioptres)", "diameter (mrad)", curves)


def _share_plot(shares: dict[str, NDArray[np.float64]]) -> Plot:
    curves = [
        Curve(name, list(range(len(share))), (100.0 * np.sort(share)).tolist())
        for name, share in shares.items()
    ]
    return Plot("Pixels equal to TinyRenderer's", "camera, sorted", "%", curves)
