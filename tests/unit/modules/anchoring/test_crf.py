"""Scores, training and files of the conditional random field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidInput, InvalidModel
from fluentboard_modules.anchoring.crf import Potentials, Scaling
from fluentboard_modules.anchoring.crf_data import LabelledGraphs, load_graphs
from fluentboard_modules.anchoring.crf_files import load_crf, require_classes, save_crf
from fluentboard_modules.anchoring.crf_training import TrainingConfig, of_the_thesis, train_crf
from fluentboard_modules.anchoring.datasets import LabelledScene
from fluentboard_modules.anchoring.map_inference import most_probable
from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig

Laid = Callable[..., tuple[list[LabelledScene], LabelledGraphs]]


def potentials_of(data: LabelledGraphs, graph: int, config: TrainingConfig) -> Potentials:
    nodes, edges = data.nodes_of(graph), data.edges_of(graph)
    model = train_crf(data.only(np.arange(len(data)) != graph), config).model
    return model.potentials(
        data.x[nodes], data.confidence[nodes], data.edges[edges] - nodes.start, data.e[edges]
    )


@pytest.mark.parametrize("config", [TrainingConfig(), TrainingConfig(local_form="none")])
def test_context_tells_what_local_recognition_cannot(laid_tables: Laid, config: object) -> None:
    _, data = laid_tables(12)
    assert isinstance(config, TrainingConfig)
    found = most_probable(potentials_of(data, 0, config)).labels
    assert found.tolist() == data.y[data.nodes_of(0)].tolist()


def test_the_printed_form_of_the_thesis_can_be_trained(laid_tables: Laid) -> None:
    _, data = laid_tables(6, SceneGraphConfig.of_the_thesis())
    config = replace(of_the_thesis(), iterations_max=50)
    assert train_crf(data, config).model.local_form == "product"


def test_training_twice_gives_the_same_model(laid_tables: Laid) -> None:
    _, data = laid_tables(4)
    first, second = train_crf(data).model, train_crf(data).model
    assert np.array_equal(first.node_weights, second.node_weights)
    assert np.array_equal(first.edge_weights, second.edge_weights)


def test_nothing_labelled_cannot_be_trained_on(laid_tables: Laid) -> None:
    _, data = laid_tables(2)
    with pytest.raises(InvalidInput, match="no labelled objects"):
        train_crf(data.only(np.zeros(2, dtype=bool)))


def test_unknown_features_count_as_usual_ones() -> None:
    scaling = Scaling.fit(np.array([[1.0, 2.0], [1.0, np.nan], [1.0, 4.0]]))
    assert scaling.apply(np.array([[1.0, np.nan]])).tolist() == [[1.0, 0.0]]


def test_a_saved_model_is_the_same_and_knows_its_data(laid_tables: Laid, tmp_path: Path) -> None:
    _, data = laid_tables(3)
    config = SceneGraphConfig(context_range_m=0.8)
    model = train_crf(data).model
    save_crf(tmp_path / "table.npz", model, config)
    loaded, kept = load_crf(tmp_path / "table.npz", model.classes)
    assert kept == config
    assert loaded.trained_on == data.fingerprint()
    assert np.array_equal(loaded.edge_weights, model.edge_weights)


@pytest.mark.parametrize(
    "classes", [("Fork", "Knife"), ("Fork", "Plate", "Knife"), ("Fork", "Knife", "Plate", "Mug")]
)
def test_a_model_refuses_other_classes(
    laid_tables: Laid, tmp_path: Path, classes: tuple[str, ...]
) -> None:
    _, data = laid_tables(2)
    save_crf(tmp_path / "table.npz", train_crf(data).model, SceneGraphConfig())
    with pytest.raises(InvalidModel, match="train crf"):
        load_crf(tmp_path / "table.npz", classes)


def test_the_refusal_names_the_classes(laid_tables: Laid) -> None:
    _, data = laid_tables(2)
    with pytest.raises(InvalidModel, match="does not know Mug and knows Plate besides"):
        require_classes(train_crf(data).model, ("Fork", "Knife", "Mug"))


def test_a_damaged_model_is_refused(tmp_path: Path) -> None:
    (tmp_path / "model.npz").write_bytes(b"not a model")
    with pytest.raises(InvalidModel, match="no trained CRF"):
        load_crf(tmp_path / "model.npz")


def test_graphs_of_other_features_are_refused(laid_tables: Laid) -> None:
    _, data = laid_tables(2)
    model = train_crf(data).model
    with pytest.raises(InvalidInput, match="features"):
        model.potentials(data.x[:, :3], None, data.edges, data.e)


def test_exported_graphs_read_back_as_they_were(laid_tables: Laid, tmp_path: Path) -> None:
    _, data = laid_tables(3)
    data.save(tmp_path / "out" / "tables.npz", crf=data.y)
    kept = load_graphs(tmp_path / "out" / "tables.npz")
    assert kept.fingerprint() == data.fingerprint()
    assert kept.fold.tolist() == data.fold.tolist()
    with np.load(tmp_path / "out" / "tables.npz") as arrays:
        assert {"n_classes", "x", "y", "confidence", "graph_ptr", "edges", "e"} <= set(arrays.files)
        assert {arrays["x"].dtype, arrays["confidence"].dtype} == {np.dtype("f8")}
        assert {arrays[k].dtype for k in ("y", "edges", "edge_ptr", "fold")} == {np.dtype("i8")}
        assert arrays["prediction_crf"].tolist() == data.y.tolist()


def test_graphs_that_do_not_fit_together_are_refused(laid_tables: Laid) -> None:
    _, data = laid_tables(1)
    with pytest.raises(InvalidInput, match="first node"):
        replace(data, edges=data.edges[:, ::-1])
