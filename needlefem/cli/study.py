"""``needlefem study``."""

import argparse

from needlefem.casefile.load import load_case
from needlefem.cli.common import say, say_json
from needlefem.output.expectations import compare
from needlefem.planning.studies import STUDIES, study


def main(options: argparse.Namespace) -> int:
    """Run a study on a case and print its tables; 1 if something demanded doesn't hold."""
    if options.study == "list":
        for name, sentence in STUDIES.items():
            say(f"{name:14s}{sentence}")
        return 0
    run = study(options.study)
    scene = load_case(options.case, options.overrides)
    other = load_case(options.on) if options.on else None
    tables = run(scene, other)
    summary = {key: value for table in tables for key, value in table.summary.items()}
    expected = compare(scene.expect, summary, options.study, scene.axes)
    if expected is not None:
        tables.append(expected)
    if options.json:
        say_json({"study": options.study, "tables": [table.record() for table in tables]})
    else:
        say("\n\n".join(table.text() for table in tables))
    return 0 if all(table.passed for table in tables) else 1
