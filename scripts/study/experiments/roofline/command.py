"""The roofline of a run and the performance of every phase against n (Tables 5 and 6, Figure 6)."""

from __future__ import annotations

import itertools
from pathlib import Path

from study.bounds import roof
from study.core import cli, table_files
from study.experiments.roofline import tables as roof_tables
from study.experiments.roofline.figures import draw
from study.numbers import analysis


def main() -> int:
    parser = cli.parser(__doc__ or "")
    parser.add_argument(
        "run", nargs="?", type=Path, metavar="RUN", help="its folder; default: the newest run"
    )
    parser.add_argument(
        "-o", "--out", type=Path, metavar="PATH", help="where figures/ and tables/ go; default: RUN"
    )
    args = parser.parse_args()
    data = analysis.load(args.run)
    counted, limits, _ = roof.read(data.path)
    table = roof.rows(data, counted, limits)
    if table.empty:
        again = f"run scripts/stepwise flops --measure --run {data.path}"
        raise cli.StudyError(f"{data.path / roof.COUNTS}: no counts of what was timed; {again}")
    out = args.out or data.path
    for remark in [*roof.remarks(roof.headline(table)), *(limits.remarks() if limits else [])]:
        cli.say(remark)
    made = roof_tables.tables(table, limits)
    figures = draw(data, table, limits, out / "figures")
    paths = table_files.write(made, out / "tables")
    if args.json:
        assert limits
        cli.emit(
            roof.to_json(table, limits) | {"files": [*itertools.chain(*figures.values()), *paths]}, data.path
        )
    else:
        print(made["roofline"][1])
        print("\n".join(str(path) for path in [*itertools.chain(*figures.values()), *paths]))
    return cli.OK
