"""The loop over cases fails with every case that fails, and each case has its own folder and patches."""

import os

import pytest
from cases import every_case


def test_every_case_that_fails_is_told():
    @every_case(("number", "limit"), [(1, 2), (3, 2), (5, 2), (4, 4)])
    def within(number, limit):
        assert number <= limit
        with pytest.raises(ValueError):
            int("x" if number < limit else "1")

    with pytest.raises(BaseExceptionGroup) as failed:
        within()
    assert [error.__notes__ for error in failed.value.exceptions] == [
        ["case 1: 3, 2"],
        ["case 2: 5, 2"],
        ["case 3: 4, 4"],
    ]


@every_case("text", ["a", "b"])
def test_a_case_has_its_own_folder_and_patches(text, tmp_path, monkeypatch, capsys):
    assert "GRASPSENSE_CASE" not in os.environ
    assert not any(tmp_path.iterdir())
    monkeypatch.setenv("GRASPSENSE_CASE", text)
    (tmp_path / "file").touch()
    print(text)  # noqa: T201
    assert capsys.readouterr().out == f"{text}\n"


def test_a_test_without_cases_is_refused():
    with pytest.raises(ValueError, match="case of name"):
        every_case("name", [])


@pytest.mark.parametrize(
    ("cases", "outcome"), [([1, 2, 9], BaseExceptionGroup), ([1, 2, 3], pytest.skip.Exception)]
)
def test_a_skipped_case_hides_no_failure_and_does_not_count_as_passed(cases, outcome):
    @every_case("number", cases)
    def ends(number):
        if number == 2:
            pytest.skip("not here")
        assert number < 9

    with pytest.raises(outcome):
        ends()
