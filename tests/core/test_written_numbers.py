"""Numbers as programs write them: how a column is written is decided from all of its rows."""

import math

import numpy as np
import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.values.written_numbers import NotNumbers, columns_of_numbers, number_in


def numbers(*cells, **others):
    return columns_of_numbers({"x": cells, **others})["x"]


@every_case(
    ("cells", "values"),
    [
        (["0", "1.5", "1.500"], [0, 1.5, 1.5]),
        (["975", "1,000", "2,475"], [975, 1000, 2475]),
        (["975", "1.000", "2.475"], [975, 1000, 2475]),
        (["0", "250", "-1.500"], [0, 250, -1500]),
        (["975", "1.203", "12.008", "inf"], [975, 1203, 12008, math.inf]),
        (["12", "1.203", "12.008"], [12, 1.203, 12.008]),
        (["100", "99.875", "0"], [100, 99.875, 0]),
        (["0", "1.500"], [0, 1.5]),
        (["0", "1,234,567", "12.5"], [0, 1234567, 12.5]),
        (["80"] * 60 + ["49,5"], [80] * 60 + [49.5]),
        (["1.234,5", "0,25"], [1234.5, 0.25]),
        (["0,500", ".", "1,250", "1,5"], [0.5, math.nan, 1.25, 1.5]),
        (["1000", "1,250"], [1000, 1.25]),
        (["1 234.5", "1'000", "12\u202f000"], [1234.5, 1000, 12000]),
        (["1.5D-03", "\u22122", "+3e2", "\u20130.5"], [0.0015, -2, 300, -0.5]),
        (["\u20101.5", "\u20112", "\uff0d3", "\u20144", "'-0.5", "'2.5'"], [-1.5, -2, -3, -4, -0.5, 2.5]),
        (["1", "", "NA", "--", "#N/A", "#DIV/0!", "NaN"], [1] + [math.nan] * 6),
        (["1", "#WERT!", "#NV", "#\u00a1VALOR!", "Err:502"], [1] + [math.nan] * 4),
        (["1", "-nan", "-nan(ind)", "1.#QNAN0"], [1] + [math.nan] * 3),
        (["1", "<NA>", "NaT", "n.a.", r"\N", ".", "\u2014"], [1] + [math.nan] * 6),
        (["1,00,000", "12,34,567.5", "250"], [100000, 1234567.5, 250]),
        (["inf", "-Infinity"], [math.inf, -math.inf]),
        (["0x7D0", "0", "", "0Xff"], [2000, 0, math.nan, 255]),
        (["1", "\u0661\u066b\u0665", "\uff0d\uff12\uff0e\uff15", "\u0967\u0968"], [1, 1.5, -2.5, 12]),
        (["1\u02bc250.5", "1\u3000250", "12\u00b75"], [1250.5, 1250, 12.5]),
        (["12.5 \u00b1 0.2", "~13", "\u2248 14.5", "9+/-1", "- 0.5"], [12.5, 13, 14.5, 9, -0.5]),
        (["(1,250.5)", "2,000.0", "(0.5)"], [-1250.5, 2000, -0.5]),
        (["<undefined>", ".a", "1"], [math.nan, math.nan, 1]),
        (["1.5 (0.2)", "12(3)", "1.25(4)e-3", "1"], [1.5, 12, 0.00125, 1]),
        (
            ["1.5 \u00d7 10^-3", "2*10**4", "1.5\u00b710\u207b\u00b3", "2x10^\u22123"],
            [1.5e-3, 2e4, 1.5e-3, 2e-3],
        ),
        (["0,5\u00d710^3", "1,25"], [500, 1.25]),
        (["0.5-", "1,250.5-", "2"], [-0.5, -1250.5, 2]),
        (["1\u2005250.5", "\u0be7\u0be8", "\u02d73"], [1250.5, 12, -3]),
    ],
)
def test_a_column_has_one_notation(cells, values):
    assert numbers(*cells).tolist() == pytest.approx(values, nan_ok=True)


@every_case(
    ("cells", "row"),
    [
        (["1.5", "0.25", "3,5"], 2),
        (["1,5", "2.5", "3,25", "4,5"], 1),
        (["1", "2", "1_0"], 2),
        (["1", "0x10"], 1),
        (["1", "<8"], 1),
        (["(1.5)", "(2)"], 0),
        (["1", "1.5 (a)"], 1),
        (["1", "12 N"], 1),
        (["1", "5\u00b2"], 1),
        (["1", "2x103"], 1),
        (["1,2,3"], 0),
        (["1,0,000"], 0),
        (["12.5", "1,5", "1,234.5"], 1),
        (["8.19", "9,802", "1,043", "7.4", "8,125"], 1),
    ],
)
def test_what_fits_no_common_notation_is_refused_with_its_row(cells, row):
    column = numbers(*cells)
    assert isinstance(column, NotNumbers)
    assert (column.row, column.cell) == (row, cells[row])


def test_the_other_columns_decide_what_a_column_alone_does_not():
    cells = ["1,250", "1,300"]
    alone = numbers(*cells)
    assert isinstance(alone, NotNumbers)
    assert "1250 or 1.25" in alone.why
    assert numbers(*cells, other=["49,5", "1"]).tolist() == [1.25, 1.3]
    assert numbers(*cells, other=["0.01", "1"]).tolist() == [1250, 1300]
    assert isinstance(numbers(*cells, other=["0.01", "1"], third=["0,5", "1"]), NotNumbers)
    assert numbers("1.500", "2.000", other=["49,5", "1"]).tolist() == [1500, 2000]
    assert numbers("1.500", "2.000").tolist() == [1.5, 2.0]
    assert isinstance(numbers("975", "1.000", other=["0.01", "1"]), NotNumbers)
    assert numbers("-999", "1.203", other=["0.01", "1"]).tolist() == [-999, 1.203]
    assert isinstance(numbers("50", "1.203"), NotNumbers)
    assert numbers("50", "1.203", other=["0.01", "1"]).tolist() == [50, 1.203]
    assert numbers("6,002", "999.9").tolist() == [6002, 999.9]
    assert numbers("1,234.567", "1,250", "0.125").tolist() == [1234.567, 1250, 0.125]
    assert isinstance(numbers("7,756", "6.002"), NotNumbers)
    contrary = numbers("6,002", "999.9", other=["49,5", "1"])
    assert isinstance(contrary, NotNumbers)
    assert "6002 or 6.002" in contrary.why


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1), st.sampled_from([".", ","]))
def test_what_a_program_writes_is_read_to_the_bit(values, sign):
    cells = [repr(value).replace(".", sign) for value in values]
    column = numbers(*cells, other=[f"0{sign}5"] * len(cells))
    assert column.tolist() == values


@given(st.lists(st.integers(-(10**9), 10**9), min_size=1))
def test_thousands_are_never_read_as_ones(values):
    column = numbers(*(f"{value:,}" for value in values))
    if isinstance(column, NotNumbers):  # only where no cell tells, as in a single 1,234
        assert "which can be" in column.why
    else:
        assert np.array_equal(column, values)


def test_a_number_on_its_own():
    read = [number_in(text) for text in ("0,5", "1.5", "1,000", "1_0", "x", "nan", "inf", "")]
    assert read == [0.5, 1.5, *[None] * 6]
