"""What the command lines of all benchmarks have."""

from __future__ import annotations

import argparse


def parser_of(description: str | None) -> argparse.ArgumentParser:
    """Return a parser with `--short`, the form that `.ci/benchmarks` runs."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    return parser
