"""The roofline of a run and the performance of every phase against n (Tables 5 and 6, Figure 6)."""

from __future__ import annotations

import itertools

from study.bounds import roof
from study.core import cli, table_files
from study.experiments.roofline import tables as roof_tables
from study.experiments.roofline.figures import draw
from study.numbers import analysis


def main() -> int:
    parser = cli.parser(__doc__ or "")
    cli.of_run(parser, "where figures/ and tables/ go; default: RUN")
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
    files = [*itertools.chain(*figures.values()), *paths]
    if args.json:
        assert limits
        cli.emit(roof.to_json(table, limits) | {"files": files}, data.path)
    else:
        print("\n".join(map(str, [made["roofline"][1], *files])))
    return cli.OK
