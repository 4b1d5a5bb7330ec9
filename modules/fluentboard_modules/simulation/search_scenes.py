"""Rooms in which a pepper mill is hidden, for an active search to find.

Like Fig. 5.8: tables, a counter and shelves, each with a search volume around what may stand on it.
The mill stands in one of the volumes, behind other things: from where the robot starts it cannot be
seen, and only some of the places in the room show it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.simulation import belongings, furniture, tableware
from fluentboard_modules.simulation.navigation import costmap
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.placement import Place, anywhere_on, support_of, try_on_support
from fluentboard_modules.simulation.raycasting import SceneCaster
from fluentboard_modules.simulation.robots import PR2, RobotModel, View
from fluentboard_modules.simulation.rooms import empty_room, fill_shelf, with_clutter
from fluentboard_modules.simulation.scene import Instance, Scene, SearchVolume, Support
from fluentboard_modules.simulation.simulated_robot import SimulatedRobot
from fluentboard_modules.simulation.table_setting import chairs_around, lay_table, seats

SOUGHT = "pepperMill1"
SOUGHT_CLASS = "PepperMill"

_ROOM_X_M = 8.0
_ROOM_Y_M = 6.6
_SECOND_ROOM_M = 1.6
_PARTITION_X_M = 4.55
_DOOR_M = (2.9, 3.95)
_ABOVE_M = 0.3
_SEEN_SHARE = 0.3
_EYES_M = (1.484, 1.784)
_HIDDEN = (0.04, 0.6)
_TRIES = 60


@dataclass(frozen=True, slots=True)
class SearchScene:
    """A room, what is sought in it, and where the search begins.

    Attributes:
        scene: with the search volumes; the sought thing is one of its instances.
        target: name of that instance.
        hidden_in: name of the search volume it is in; the truth, not for the searcher.
        start: the robot's first view.
        visible_share: of the free places within 2.5 m of the target, from how many it is visible.
    """

    scene: Scene
    target: str
    hidden_in: str
    start: View
    visible_share: float

    def robot(
        self,
        model: RobotModel = PR2,
        seed: int = 0,
        noise: NoiseConfig | None = None,
        image_width: int = 640,
    ) -> SimulatedRobot:
        """A robot at the start, with a Kinect's noise unless told otherwise.

        Args:
            model: which robot.
            seed: of the noise.
            noise: how its camera errs.
            image_width: pixels.
        """
        tilt = min(max(self.start.tilt_rad, model.tilt_rad[0]), model.tilt_rad[1])
        return SimulatedRobot(
            model,
            self.scene,
            replace(self.start, tilt_rad=tilt),
            np.random.default_rng(seed),
            noise if noise is not None else NoiseConfig(),
            image_width,
        )


def hidden_pepper_mill(seed: int = 0, rooms: int = 1) -> SearchScene:
    """A room, or two with a door between them, with a pepper mill that has to be searched for.

    Args:
        seed: decides the room and where the mill is.
        rooms: 1 or 2.

    Raises:
        InvalidInput: there are neither one nor two rooms, or no hiding place was found.
    """
    if rooms not in (1, 2):
        raise InvalidInput(f"{rooms} rooms to hide a pepper mill in; give 1 or 2")
    rng = np.random.default_rng([seed, 0x9E99E2])
    farther = (rooms - 1) * _SECOND_ROOM_M
    scene = _room(rng, farther)
    start = View(round(0.72 * (_ROOM_X_M + farther), 2), 0.75, 0.5 * math.pi)
    free = _standing_places(scene, start)
    volumes = scene.search_volumes
    for _ in range(_TRIES):
        volume = volumes[int(rng.integers(len(volumes)))]
        trial = _with_mill(scene, volume.name, rng)
        if trial is None:
            continue
        at_start, elsewhere = _visibility(trial, free, start)
        if not at_start and _HIDDEN[0] <= elsewhere <= _HIDDEN[1]:
            return SearchScene(trial, SOUGHT, volume.name, start, elsewhere)
    raise InvalidInput(f"no hiding place for a pepper mill with seed {seed}; choose another seed")


def _room(rng: np.random.Generator, farther: float) -> Scene:
    """The furnished room with its volumes and clutter, without the mill.

    Args:
        rng: moves the furniture and strews the clutter.
        farther: how much longer the room is; if at all, a wall with a door parts it in two.
    """
    x_size = _ROOM_X_M + farther

    def near(x: float, y: float, yaw: float) -> Pose:
        dx, dy, dyaw = rng.uniform(-1.0, 1.0, 3)
        return Pose.from_rpy(x + 0.1 * dx, y + 0.1 * dy, 0.0, yaw=yaw + 0.05 * dyaw)

    shelf = furniture.shelf(width=1.0, depth=0.38, height=1.75, compartments=5)
    low = furniture.shelf(width=1.2, depth=0.38, height=1.15, compartments=3)
    table = furniture.table(width=1.2, depth=0.8, height=0.74)
    back = 0.5 * 0.38 + 0.02
    standing = [
        Instance("counter1", furniture.counter(1.8), Pose.from_rpy(0.35, 2.4, 0.0)),
        Instance("table1", table, near(2.9, 2.2, 0.5 * math.pi)),
        Instance("table2", table, near(4.7 + farther, 4.3, 0.0)),
        Instance("shelf1", shelf, Pose.from_rpy(2.0, _ROOM_Y_M - back, 0.0, yaw=-0.5 * math.pi)),
        Instance("shelf2", low, Pose.from_rpy(x_size - back, 2.6, 0.0, yaw=math.pi)),
        Instance("shelf3", shelf, Pose.from_rpy(x_size - back, 4.6, 0.0, yaw=math.pi)),
    ]
    partition = _partition() if farther > 0.0 else []
    scene = empty_room(x_size, _ROOM_Y_M).with_instances([*partition, *standing])
    number = 0
    for name, guests in (("table1", 2), ("table2", 1)):
        places = seats(scene[name], 2)
        names = [f"chair{number + k + 1}" for k in range(2)]
        number += 2
        scene = scene.with_instances(
            chairs_around(scene[name], places, furniture.chair(), names, rng)
        )
        scene = lay_table(scene, name, guests, rng, places=places)
    for name in ("shelf1", "shelf2", "shelf3"):
        scene = fill_shelf(scene, name, rng, filled=0.45)
    for name, count in (("counter1", 5), ("table2", 3)):
        scene = _without_mills(with_clutter(scene, name, count, rng))
    return replace(scene, search_volumes=tuple(_volume(i) for i in scene.objects if _may_hide(i)))


def _partition() -> list[Instance]:
    """The wall between two rooms, on both sides of its door."""
    parts = ((0.0, _DOOR_M[0]), (_DOOR_M[1], _ROOM_Y_M))
    return [
        Instance(
            f"partition{number}",
            furniture.wall(end - begin),
            Pose(_PARTITION_X_M, 0.5 * (begin + end), 0.0),
        )
        for number, (begin, end) in enumerate(parts, start=1)
    ]


def _may_hide(instance: Instance) -> bool:
    return instance.cls in ("Table", "Counter", "Shelf")


def _without_mills(scene: Scene) -> Scene:
    for mill in scene.of_class(SOUGHT_CLASS):
        scene = scene.without(mill.name)
    return scene


def _volume(instance: Instance) -> SearchVolume:
    """The space above a table or counter, or within a shelf and above it."""
    top = support_of(instance)
    box = instance.box
    if instance.cls == "Shelf":
        low, high = 0.3, box.z_size + _ABOVE_M
        x_size, y_size, x, y = box.x_size, box.y_size, 0.0, 0.0
    else:
        low, high = top.z, top.z + _ABOVE_M
        x_size, y_size, x, y = top.x_size, top.y_size, top.x, top.y
    centre = instance.T_map_model.apply(np.array([x, y, 0.5 * (low + high)]))
    pose = Pose.from_rpy(*(float(v) for v in centre), yaw=instance.pose.yaw_rad)
    return SearchVolume(f"around {instance.name}", BoundingBox(pose, x_size, y_size, high - low))


def _with_mill(scene: Scene, volume_name: str, rng: np.random.Generator) -> Scene | None:
    """The scene with the mill somewhere in a volume and something in front of it."""
    base = scene[volume_name.removeprefix("around ")]
    mill = tableware.pepper_mill()
    supports = [s for s in base.model.supports if 0.3 < s.z < 1.5 and s.clearance > 0.23]
    if not supports:
        return None
    support = supports[int(rng.integers(len(supports)))]
    is_shelf = base.cls == "Shelf"

    def draw() -> Place:
        x, y, yaw = anywhere_on(support, rng, 0.08)
        # Deep in a shelf, where boards, books and boxes hide it from most sides.
        return (support.x - 0.25 * support.x_size if is_shelf else x), y, yaw

    placed = try_on_support(scene, base, support, mill, SOUGHT, draw, 0.005)
    if placed is None:
        return None
    scene = scene.with_instances([placed])
    return _screened(scene, base, support, rng)


def _screened(scene: Scene, base: Instance, support: Support, rng: np.random.Generator) -> Scene:
    """The scene with cartons or bottles around the mill."""
    local = base.T_map_model.inverse().apply(scene[SOUGHT].T_map_model.translation)
    for _ in range(2 if base.cls == "Shelf" else 3):
        if rng.random() < 0.6:
            size = (0.1, float(rng.uniform(0.12, 0.2)), float(rng.uniform(0.16, 0.25)))
            model = belongings.carton(*(round(v, 2) for v in size))
        else:
            model = belongings.bottle()

        def draw() -> Place:
            spread = 0.6 if base.cls == "Shelf" else math.pi
            angle = float(rng.uniform(-spread, spread))
            away = float(rng.uniform(0.08, 0.18))
            x, y = local[0] + away * math.cos(angle), local[1] + away * math.sin(angle)
            return float(x), float(y), angle

        name = scene.free_name("screen")
        thing = try_on_support(scene, base, support, model, name, draw, 0.004, tries=20)
        if thing is not None:
            scene = scene.with_instances([thing])
    return scene


def _standing_places(scene: Scene, start: View) -> FloatArray:
    """`(n, 2)`; places half a metre apart from which a PR2 may look."""
    room = costmap(scene, PR2.radius_m, _EYES_M[1])
    reach = room.path_costs(start.x, start.y)
    rows, columns = np.nonzero(np.isfinite(reach))
    points = np.array([room.position(int(r), int(c)) for r, c in zip(rows, columns, strict=True)])
    keep = (rows % 8 == 0) & (columns % 8 == 0)
    return points[keep]


def _visibility(scene: Scene, places: FloatArray, start: View) -> tuple[bool, float]:
    """Whether the start shows the mill, and the share of the places near it that do."""
    caster = SceneCaster(scene)
    mill = scene[SOUGHT]
    centre = mill.T_map_model.translation
    near = places[np.linalg.norm(places - centre[:2], axis=1) < 2.5]
    if not len(near):
        return False, 0.0
    first = np.array([[start.x, start.y, z] for z in _EYES_M])
    eyes = np.concatenate([np.column_stack([near, np.full(len(near), z)]) for z in _EYES_M])
    shown = _shows(caster, mill, np.concatenate([first, eyes]))
    from_near = shown[len(first) :].reshape(len(_EYES_M), -1).any(axis=0)
    return bool(shown[: len(first)].any()), float(from_near.mean())


def _shows(caster: SceneCaster, mill: Instance, eyes: FloatArray) -> FloatArray:
    """`(n,)` bool; from which eyes `(n, 3)` enough of the mill is seen."""
    height = float(mill.model.mesh.size[2])
    along = np.linspace(0.15, 0.9, 6) * height
    points = mill.T_map_model.translation + np.column_stack([np.zeros((6, 2)), along])
    rays = np.zeros((len(eyes), len(points), 6), dtype=np.float32)
    rays[..., :3] = eyes[:, None]
    rays[..., 3:] = points[None] - eyes[:, None]
    hits = caster.cast(rays)
    labels = np.append(caster.triangle_label, np.int32(-1))[hits.triangle]
    return (labels == mill.label).mean(axis=1) >= _SEEN_SHARE
