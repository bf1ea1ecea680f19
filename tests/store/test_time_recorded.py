"""Imported trials: the order in which they were recorded, and what their first frame tells."""

from __future__ import annotations

from cases import every_case
from kept import frame, keep

from graspsense.store.dataset import labelled_store
from graspsense.store.store import Store
from graspsense.store.time_recorded import order_recorded

MADE = "2026-11-21T10:00:00+00:00"


def test_imported_trials_are_ordered_by_the_time_of_their_recording():
    stated = [
        '{"recorded_at": "2020-05-02T12:00:00"}',
        '{"recorded_at": "2020-05-02T11:00:00Z"}',
        '{"recorded_at": "2020-05-03"}',
    ]
    assert order_recorded([MADE] * 3, ["import"] * 3, stated) == ((1, 0, 2), "")


def test_the_order_of_an_import_is_not_that_of_recording():
    order, why = order_recorded([MADE] * 3, ["import"] * 3, ["{}", '{"recorded_at": "2020-05-02"}', "{}"])
    assert order is None
    assert why.startswith("2 of 3 trials were imported without the time at which they were recorded")
    assert why.endswith("(the key recorded of a manifest)")


def test_a_manifest_may_number_its_trials_instead():
    stated = ['{"order": "10"}', '{"order": "9"}']
    assert order_recorded([MADE] * 2, ["import"] * 2, stated) == ((1, 0), "")


@every_case("text", ["not JSON", '{"recorded_at": "yesterday"}', '{"recorded_at": 5}', "[]"])
def test_a_time_that_cannot_be_read_is_none(text):
    assert order_recorded([MADE], ["import"], [text])[0] is None


def test_grasps_are_ordered_by_the_time_they_were_made():
    made = ["2026-11-21T10:00:02+00:00", "2026-11-21T10:00:01+00:00", "2026-11-21T10:00:01+00:00"]
    assert order_recorded(made, ["run", "collect", "run"], ["{}"] * 3) == ((2, 0, 1), "")


def test_a_store_of_imports_has_a_first_line_and_no_order(tmp_path):
    with Store.open(tmp_path / "trials") as store:
        for label in ("can", "jar", "can"):
            keep(store, label, origin="import")
        keep(store, "jar")
        (store.folder / "recordings" / store.page(limit=4)[1].recording).write_bytes(b"damaged")
    labelled = labelled_store(str(tmp_path / "trials"))
    assert labelled.order is None
    assert "3 of 4 trials were imported without the time" in labelled.no_order
    table = labelled.first_line.table
    assert table.names[:2] == ("gap_first", "velocity_first")
    assert table.values[0, :4].tolist() == [frame(0).gap_m, frame(0).velocity_m_s, frame(0).effort_n, 0.0]
    # The third import is damaged, and the fourth trial was not imported.
    assert (table.values[2:] != table.values[2:]).all()


def test_grasps_of_our_own_have_an_order_and_no_first_line(tmp_path):
    with Store.open(tmp_path / "trials") as store:
        for label in ("can", "jar"):
            keep(store, label)
    labelled = labelled_store(str(tmp_path / "trials"))
    assert labelled.order == (0, 1)
    assert labelled.first_line is None
