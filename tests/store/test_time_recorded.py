"""Imported trials: the order in which they were recorded, and what their first frame tells."""

from cases import every_case
from kept import frame, keep

from graspsense.store.dataset import labelled_store
from graspsense.store.store import Store
from graspsense.store.time_recorded import order_recorded

MADE = "2026-11-21T10:00:00+00:00"


@every_case(
    ("made", "origins", "stated", "order"),
    [
        # Imported trials have the order of their recording, or that by which a manifest numbers them.
        (
            [MADE] * 3,
            ["import"] * 3,
            ["2020-05-02T12:00:00", "2020-05-02T11:00:00Z", "2020-05-03"],
            (1, 0, 2),
        ),
        ([MADE] * 2, ["import"] * 2, [{"order": "10"}, {"order": "9"}], (1, 0)),
        *(([MADE], ["import"], [text], None) for text in ("yesterday", 5, "[]")),
        # Other grasps have that of the time when they were made.
        ([f"2026-11-21T10:00:0{s}+00:00" for s in (2, 1, 1)], ["run", "collect", "run"], [{}] * 3, (2, 0, 1)),
    ],
)
def test_trials_are_ordered_by_the_time_of_their_recording(made, origins, stated, order):
    labels = [label if isinstance(label, dict) else {"recorded_at": label} for label in stated]
    assert order_recorded(made, origins, labels)[0] == order


def test_the_order_of_an_import_is_not_that_of_recording():
    order, why = order_recorded([MADE] * 3, ["import"] * 3, [{}, {"recorded_at": "2020-05-02"}, {}])
    assert order is None
    assert why.startswith("2 of 3 trials")
    assert "key recorded" in why


def test_a_store_of_imports_has_a_first_line_and_no_order(tmp_path):
    with Store.open(tmp_path / "trials") as store:
        for label in ("can", "jar", "can"):
            keep(store, label, origin="import")
        keep(store, "jar")
        (store.folder / "recordings" / store.page(limit=4)[1].recording).write_bytes(b"damaged")
    labelled = labelled_store(str(tmp_path / "trials"))
    assert labelled.order is None
    assert "3 of 4 trials" in labelled.no_order
    table = labelled.first_line.table
    assert table.names[:2] == ("gap_first", "velocity_first")
    assert table.values[0, :4].tolist() == [frame(0).gap_m, frame(0).velocity_m_s, frame(0).effort_n, 0.0]
    # The third import is damaged, and the fourth trial was not imported.
    assert (table.values[2:] != table.values[2:]).all()
