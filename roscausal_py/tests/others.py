"""Tables of pandas, polars and Arrow; graphs of networkx, causal-learn and causalflow; pictures of matplotlib. Run by tests/python.sh where they are installed."""

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


def test_a_model_becomes_a_graph_of_causal_learn_and_causalflow(columns):
    model = rc.discover(columns, tau_max=2, **SETTINGS)
    pairs = {(link.cause, link.effect, link.lag) for link in model.links}
    edges = {(edge.get_node1().get_name(), edge.get_node2().get_name()) for edge in model.to_causal_learn().get_graph_edges()}
    at = {lag: f"(t-{lag})" if lag else "" for lag in range(3)}
    assert edges == {(cause + at[time + lag], effect + at[time]) for cause, effect, lag in pairs for time in range(3 - lag)}
    theirs = model.to_causalflow().get_Adj()
    assert {(cause, effect, -lag) for effect, causes in theirs.items() for cause, lag in causes} == pairs


def test_a_table_gives_the_model_of_its_csv_file_whatever_its_times_are(tmp_path, quick):
    x = np.random.default_rng(0).normal(size=(300, 3))
    x[1:, 1] += 0.8 * x[:-1, 0]
    days = pd.DataFrame(x, columns=list("abc"), index=pd.date_range("2020", periods=300))
    # 20 blocks of 10 days, with gaps of 6 days between them.
    gaps = days.iloc[np.concatenate([np.arange(i, i + 10) for i in range(0, 300, 15)])]
    seconds = pd.DataFrame(x, columns=list("abc")).assign(t=np.arange(300) * 0.1)
    holes = days.mask(np.random.default_rng(1).random(x.shape) < 0.05)
    still = days.assign(d=1.0)
    for table in (days, gaps, seconds, holes, still, days.tz_localize("UTC"), days.rename_axis("date"), days.to_period("D").rename_axis("time")):
        path = tmp_path / "table.csv"
        has_index = not isinstance(table.index, pd.RangeIndex)
        table.to_csv(path, index=has_index, index_label=(table.index.name or "time") if has_index else None)
        of_file, of_table = rc.discover(path, **quick), rc.discover(table, **quick)
        assert of_table.features == of_file.features and of_table.dt == of_file.dt
        assert np.array_equal(of_table.p_matrix, of_file.p_matrix, equal_nan=True)
        assert of_table.settings["n_recordings"] == of_file.settings["n_recordings"]
        assert len(of_table.warnings) == len(of_file.warnings), (of_table.warnings, of_file.warnings)
    assert rc.discover(gaps, **quick).settings["n_recordings"] == 20


def test_the_levels_of_an_index_are_recordings(quick):
    x = np.random.default_rng(0).normal(size=(200, 2))
    index = pd.MultiIndex.from_product([["s1", "s2"], range(100)])
    model = rc.discover(pd.DataFrame(x, columns=list("ab"), index=index), **quick)
    assert model == rc.discover([x[:100], x[100:]], columns=list("ab"), **quick)
    named = pd.DataFrame(x, columns=list("ab")).assign(id=[7] * 100 + [9] * 100)
    assert rc.discover(named, recording="id", **quick).settings["n_recordings"] == 2
    assert rc.discover(named.assign(id=["p"] * 100 + ["q"] * 100), recording="id", **quick).settings["n_recordings"] == 2


def test_an_xarray_is_its_values_and_times(quick):
    xarray = pytest.importorskip("xarray")
    x = np.random.default_rng(0).normal(size=(100, 2))
    model = rc.discover({"time": np.arange(100) * 0.5, "a": x[:, 0], "b": x[:, 1]}, **quick)
    array = xarray.DataArray(x, dims=("time", "name"), coords={"time": np.arange(100) * 0.5, "name": ["a", "b"]})
    assert rc.discover(array, **quick) == model == rc.discover(array.to_dataset("name"), **quick)
