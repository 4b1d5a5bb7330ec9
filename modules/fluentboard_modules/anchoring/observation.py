"""What one frame tells about objects, and what recognisers and context models make of it.

The contract between the parts of anchoring: segmentation makes a `Cluster` of every object that it
sees on a table, a `Recogniser` rates its classes, and a `ContextModel` rates the classes of all
objects of a scene together. Everything is given in the map frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, FloatArray
from fluentboard_modules.frames.sensor_frame import SensorFrame


@dataclass(frozen=True, slots=True, eq=False)
class SupportPlane:
    """The top of a table, or another level surface that objects stand on.

    Attributes:
        height_m: of the top above the floor at the centre.
        boundary_map: `(k, 2)`; corners of its outline in x and y, in order, not closed; it need be
            neither rectangular nor convex.
        centre_map: `(2,)`; x and y of its centre of area.
        name: of its placing area on the board, empty if the board knows none.
        slope: `(2,)`; how much the top rises per metre in x and y, about the centre: real depth
            cameras bend and tilt a level table by a degree or two.
    """

    height_m: float
    boundary_map: FloatArray
    centre_map: FloatArray
    name: str = ""
    slope: tuple[float, float] = (0.0, 0.0)

    def height_at(self, points_map: FloatArray) -> FloatArray:
        """`(n,)`; height of the top below (or above) points `(n, 2)` or `(n, 3)`."""
        offset = points_map[..., :2] - self.centre_map
        return self.height_m + offset @ np.asarray(self.slope)


@dataclass(frozen=True, slots=True, eq=False)
class Cluster:
    """The points of one object in one frame.

    Attributes:
        points_map: `(n, 3)`; its points.
        pixels: `(n, 2)`; row and column of each point in the depth image.
        box: smallest upright box around the points: it is turned about the vertical only.
        stamp_s: when the frame was taken, in seconds on the board's time axis.
        viewpoint_map: `(3,)`; where the camera was.
        colours: `(n, 3)` uint8 RGB of each point; None if the frame has no colour.
        support: what it stands on; None if that was not seen.
        track_id: the number it keeps as long as it is seen frame after frame; None if not tracked.
        is_cut_off: whether the border of the image may hide a part of it.
        is_occluded: whether something nearer to the camera may hide a part of it.
        sensor: name of the sensor.
    """

    points_map: FloatArray
    pixels: NDArray[np.int64]
    box: BoundingBox
    stamp_s: float
    viewpoint_map: FloatArray
    colours: NDArray[np.uint8] | None = None
    support: SupportPlane | None = None
    track_id: int | None = None
    is_cut_off: bool = False
    is_occluded: bool = False
    sensor: str = "camera"

    @property
    def centroid_map(self) -> FloatArray:
        """`(3,)`; centre of the box; unlike the mean of the points, hardly depends on the view."""
        return np.array([self.box.pose.x, self.box.pose.y, self.box.pose.z])


@dataclass(frozen=True, slots=True, eq=False)
class Recognition:
    """How sure a recogniser is of each class.

    Attributes:
        classes: names of the classes, as in the ontology.
        confidence: `(k,)`; one number per class in [0, 1]; they need not sum to 1.

    Raises:
        InvalidInput: the numbers do not fit the classes, or are not confidences.
    """

    classes: tuple[str, ...]
    confidence: FloatArray

    def __post_init__(self) -> None:
        values = np.asarray(self.confidence, dtype=np.float64)
        if values.shape != (len(self.classes),):
            raise InvalidInput(
                f"{values.size} confidences for {len(self.classes)} classes "
                f"{', '.join(self.classes)}; give one number per class"
            )
        if not np.all((values >= 0.0) & (values <= 1.0)):
            raise InvalidInput(f"confidences {values.tolist()}; each must lie between 0 and 1")
        object.__setattr__(self, "confidence", values)

    @property
    def best(self) -> str:
        """The most confident class; the first of several; empty if there are no classes."""
        return self.classes[int(np.argmax(self.confidence))] if self.classes else ""


class Recogniser(Protocol):
    """Local object recognition: what is this cluster, regardless of what stands beside it?"""

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes it can tell apart, as named in the ontology."""
        ...

    def recognise(self, cluster: Cluster) -> FloatArray:
        """`(k,)`; confidence per class, in the order of `classes`, each in [0, 1]."""
        ...


@runtime_checkable
class FrameRecogniser(Protocol):
    """Local recognition of all clusters of a frame at once, for those that look at whole images."""

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes it can tell apart, as named in the ontology."""
        ...

    def recognise_frame(
        self, clusters: Sequence[Cluster], frame: SensorFrame
    ) -> Sequence[FloatArray]:
        """Per cluster `(k,)`; confidence per class, in the order of `classes`, each in [0, 1]."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """One object as one frame shows it, with the result of local recognition."""

    cluster: Cluster
    recognition: Recognition

    @property
    def track_id(self) -> int | None:
        """The cluster's track, if it has one."""
        return self.cluster.track_id


@dataclass(frozen=True, slots=True, eq=False)
class SceneObject:
    """An anchored object as a context model sees it, in view or not.

    Attributes:
        name: of the anchor.
        box: its upright bounding box, filtered over all observations.
        confidence: `(k,)`; of local recognition, fused over observations, in the order of the
            classes of the recogniser.
        support: what it stands on; None if unknown.
        is_tracked: whether it is seen at present.
    """

    name: str
    box: BoundingBox
    confidence: FloatArray
    support: SupportPlane | None = None
    is_tracked: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class ContextBelief:
    """What a context model believes of one object.

    Attributes:
        best: the object's class in the most probable joint assignment.
        marginals: `(k,)`; probability of each class, summing to 1, in the order of the model's
            classes.
        neighbours: names of the objects that the belief draws on.
    """

    best: str
    marginals: FloatArray
    neighbours: tuple[str, ...] = ()


class ContextModel(Protocol):
    """Joint recognition: what is each object, given all the others?"""

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes, in the order of confidences and marginals."""
        ...

    def infer(self, objects: Sequence[SceneObject]) -> Mapping[str, ContextBelief]:
        """Beliefs by the names of the objects.

        Objects that are neither seen nor within context range of one that is may be left out.
        """
        ...
