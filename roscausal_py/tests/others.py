"""Tables of pandas, polars and Arrow; graphs of networkx; pictures of matplotlib. Run by tests/python.sh where they are installed."""

import matplotlib
import networkx
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import roscausal as rc

matplotlib.use("Agg")
SETTINGS = {"method": "pcmci", "test": "parcorr"}


@pytest.fixture
def columns(chain):
    return {name: chain[:, k] for k, name in enumerate("abc")}


def test_every_kind_of_table_gives_the_same_model(chain, columns):
    model = rc.discover(chain, columns=list("abc"), **SETTINGS)
    for table in (pd.DataFrame(columns), pl.DataFrame(columns), pa.table(columns)):
        assert rc.discover(table, **SETTINGS) == model, type(table)
    assert rc.discover(pd.DataFrame(columns).astype("Float64"), **SETTINGS) == model
    assert rc.discover([pd.DataFrame(columns), pd.DataFrame(columns)], **SETTINGS).settings["n_recordings"] == 2


def test_missing_cells_are_missing_values(columns):
    holes = {**columns, "b": [None if k == 20 else v for k, v in enumerate(columns["b"])]}
    nan = rc.discover({**columns, "b": np.where(np.arange(300) == 20, np.nan, columns["b"])}, **SETTINGS)
    assert rc.discover(pl.DataFrame(holes, strict=False), **SETTINGS) == nan
    assert rc.discover(pd.DataFrame(holes).astype("Float64"), **SETTINGS) == nan
    assert rc.discover(pa.table(holes), **SETTINGS) == nan


def test_times_give_the_step(columns):
    times = pd.date_range("2024-01-01", periods=300, freq="250ms")
    assert rc.discover(pd.DataFrame(columns, index=times), **SETTINGS).dt == pytest.approx(0.25)
    assert rc.discover(pd.DataFrame({"time": times, **columns}), **SETTINGS).dt == pytest.approx(0.25)


def test_words_are_refused_by_the_name_of_their_column(columns):
    words = {**columns, "room": ["hall"] * 300}
    for table in (pd.DataFrame(words), pl.DataFrame(words), pa.table(words)):
        with pytest.raises(rc.DataError, match="'room'"):
            rc.discover(table, **SETTINGS)
        assert rc.discover(table, columns=list("abc"), **SETTINGS).features == list("abc")


def test_a_model_becomes_a_graph_a_table_and_a_plot(columns):
    model = rc.discover(columns, **SETTINGS)
    graph = model.to_networkx()
    assert ("a", "b") in {(u, v) for u, v, facts in graph.edges(data=True) if facts["lag"] == 1}
    assert networkx.number_of_nodes(networkx.parse_graphml(model.to_graphml())) == 3
    table = model.to_pandas()
    assert list(table["cause"]) == [link.cause for link in model.links]
    assert len(model.plot().images) == 1
    open_pair = rc.discover({"x": columns["a"], "y": columns["a"] + 0.1 * columns["b"]}, tau_min=0, **SETTINGS).to_networkx()
    assert open_pair.has_edge("x", "y") and open_pair.has_edge("y", "x")
