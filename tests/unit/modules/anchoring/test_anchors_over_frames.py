"""The world model over frames: names outlive absence, what is gone goes, glass and shadows stay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.anchoring.anchors import Functionality
from fluentboard_modules.anchoring.config import AnchoringConfig, WorldConfig
from fluentboard_modules.anchoring.geometric import GeometricRecogniser
from fluentboard_modules.anchoring.observation import ContextBelief, SceneObject
from fluentboard_modules.anchoring.pipeline import AnchoringPipeline
from fluentboard_modules.anchoring.similarity import load_mismatch
from fluentboard_modules.frames.sensor_frame import SensorFrame

TABLE = (-0.6, 1.0, 0.70, 0.6, 1.8, 0.74)
MUG = (0.1, 1.3, 0.04, 0.74, 0.84)
CARTON = (-0.3, 1.4, 0.74, -0.2, 1.48, 0.92)
AWAY = (3.0, 1.3, 0.7)
Render = Callable[..., SensorFrame]


class Story:
    """A pipeline that is shown scenes, half a second apart."""

    def __init__(self, render: Render, pipeline: AnchoringPipeline | None = None) -> None:
        self._render = render
        self.pipeline = pipeline or AnchoringPipeline(GeometricRecogniser(), load_mismatch())
        self.now_s = 1.0
        self.happened: list[tuple[Functionality, int]] = []

    def show(
        self, *things: tuple[float, ...], times: int = 3, glass: bool = False, **view: object
    ) -> None:
        for _ in range(times):
            frame = self._render([TABLE, *things], stamp_s=self.now_s, **view)
            if glass:
                assert frame.labels is not None
                depth = np.where(frame.labels > 1, 0.0, frame.depth_m).astype(np.float32)
                frame = replace(frame, depth_m=depth)
            step = self.pipeline.update(frame)
            self.happened += [
                (decision.functionality, decision.anchor)
                for decision in step.decisions
                if decision.functionality is not Functionality.TRACK
            ]
            self.now_s += 0.5

    @property
    def identifiers(self) -> list[int]:
        return [anchor.identifier for anchor in self.pipeline.world.anchors]


@pytest.fixture
def story(render: Render) -> Story:
    return Story(render)


def test_object_is_anchored_once_it_was_seen_in_three_frames(story: Story) -> None:
    story.show(MUG, times=2)
    assert story.identifiers == []
    story.show(MUG, times=1)
    assert story.happened == [(Functionality.DISCOVER, 1)]
    (anchor,) = story.pipeline.world.anchors
    assert anchor.centroid_map[:2] == pytest.approx([0.1, 1.3], abs=0.02)
    assert anchor.is_tracked


def test_object_keeps_its_anchor_while_nobody_looks(story: Story) -> None:
    story.show(MUG, CARTON)
    story.show(MUG, CARTON, target=AWAY)
    assert not any(anchor.is_tracked for anchor in story.pipeline.world.anchors)
    story.show(MUG, CARTON, eye=(0.6, 0.3, 1.5))
    assert story.identifiers == [1, 2]
    assert {f for f, _ in story.happened} == {
        Functionality.DISCOVER,
        Functionality.LOSE,
        Functionality.REACQUIRE,
    }


def test_object_that_was_taken_away_goes(story: Story) -> None:
    story.show(MUG, CARTON)
    story.show(target=AWAY)
    story.show(CARTON, times=4)
    assert len(story.identifiers) == 1
    assert story.happened[-1][0] is Functionality.DESTROY


def test_hidden_object_stays(story: Story) -> None:
    story.show(MUG, times=3)
    screen = (-0.1, 1.05, 0.74, 0.3, 1.1, 1.2)
    story.show(MUG, screen, times=5)
    assert 1 in story.identifiers


def test_object_without_depth_stays(story: Story) -> None:
    story.show(MUG, times=3)
    story.show(MUG, times=6, glass=True)
    assert story.identifiers == [1]


def test_held_object_stays_though_its_place_is_empty(story: Story) -> None:
    story.show(MUG, times=3)
    (anchor,) = story.pipeline.world.anchors
    story.pipeline.world.change(replace(anchor, is_held=True))
    story.show(times=6)
    assert story.identifiers == [1]


def test_object_put_down_elsewhere_is_known_by_its_look(story: Story) -> None:
    story.show(MUG, times=3)
    (anchor,) = story.pipeline.world.anchors
    story.pipeline.world.change(replace(anchor, is_held=True))
    story.show(times=6)
    (anchor,) = story.pipeline.world.anchors
    story.pipeline.world.change(replace(anchor, is_held=False, is_adrift=True))
    story.show((-0.4, 1.5, 0.04, 0.74, 0.84), times=3)
    (anchor,) = story.pipeline.world.anchors
    assert anchor.identifier == 1
    assert anchor.centroid_map[:2] == pytest.approx([-0.4, 1.5], abs=0.03)


def test_object_that_the_board_knows_is_found(story: Story) -> None:
    box = BoundingBox(Pose(0.13, 1.31, 0.79), 0.08, 0.08, 0.1)
    story.pipeline.world.find("mug7", "Mug", box)
    story.show(MUG, times=1)
    (anchor,) = story.pipeline.world.anchors
    assert (anchor.name, anchor.is_tracked) == ("mug7", True)


def test_object_moved_in_view_keeps_its_anchor(story: Story) -> None:
    for k in range(8):
        story.show((0.1 + 0.04 * k, 1.3, 0.04, 0.74, 0.84), times=1)
    (anchor,) = story.pipeline.world.anchors
    assert anchor.centroid_map[0] == pytest.approx(0.38, abs=0.04)


def test_without_tracks_anchors_are_reacquired_in_every_frame(render: Render) -> None:
    pipeline = AnchoringPipeline(GeometricRecogniser(), load_mismatch())
    for k in range(3):
        frame = render([TABLE, MUG], stamp_s=1.0 + k)
        detections = [
            replace(d, cluster=replace(d.cluster, track_id=None))
            for d in pipeline.recognise(pipeline.observe(frame), frame)
        ]
        decisions = [d.functionality for d in pipeline.world.update(detections, frame)]
        assert decisions[-1] is (Functionality.REACQUIRE if k else Functionality.DISCOVER)
    assert len(pipeline.world.anchors) == 1


class Neighbourly:
    """A context model that believes what it is told."""

    classes = GeometricRecogniser().classes

    def infer(self, objects: Sequence[SceneObject]) -> dict[str, ContextBelief]:
        marginals: FloatArray = np.full(len(self.classes), 1.0 / len(self.classes))
        return {thing.name: ContextBelief("Mug", marginals) for thing in objects}


def test_context_sets_the_belief_of_every_anchor(render: Render) -> None:
    pipeline = AnchoringPipeline(GeometricRecogniser(), load_mismatch(), context=Neighbourly())
    story = Story(render, pipeline)
    story.show(MUG, CARTON)
    beliefs = [anchor.belief for anchor in pipeline.world.anchors]
    assert [belief.best for belief in beliefs if belief] == ["Mug", "Mug"]


def test_same_frames_make_the_same_anchors(render: Render) -> None:
    def run() -> list[BoundingBox]:
        story = Story(render)
        for seed in range(4):
            story.show(MUG, CARTON, times=1, noise=np.random.default_rng(seed))
        return [anchor.box for anchor in story.pipeline.world.anchors]

    assert run() == run()


def test_one_frame_is_enough_where_the_config_says_so(render: Render) -> None:
    config = AnchoringConfig(world=WorldConfig(confirm_frames=1))
    story = Story(render, AnchoringPipeline(GeometricRecogniser(), load_mismatch(), config))
    story.show(MUG, times=1)
    assert story.identifiers == [1]
