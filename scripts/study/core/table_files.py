"""Tables of a run as files: CSV for programs, Markdown for people, JSON with intervals whole."""

from pathlib import Path

import pandas as pd

from study.core import store

# Name of a file → its data and, for people, the Markdown text.
Made = dict[str, tuple[pd.DataFrame, str]]


def flat(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows for CSV: an interval's entries as columns of their own, `ms.value`, `ms.low` …"""
    if not any(isinstance(value, dict) for value in rows.to_numpy().ravel()):
        return rows
    made = pd.json_normalize(rows.to_dict("records"), sep=".")
    split = {name for name in made if any(other.startswith(f"{name}.") for other in made)}
    return made.drop(columns=sorted(split))  # what is left of them: rows that had none


def write(made: Made, folder: Path) -> list[Path]:
    """NAME.csv, NAME.json (a list of rows, no NaN) and NAME.md of each table."""
    paths = []
    for name, (rows, text) in made.items():
        paths += [folder / f"{name}.{suffix}" for suffix in ("csv", "md", "json")]
        store.write_text(paths[-3], flat(rows).to_csv(index=False))
        store.write_text(paths[-2], text)
        store.write_json(paths[-1], rows.to_dict("records"))
    return paths
