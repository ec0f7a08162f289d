"""``needlefem study``."""

import argparse

from needlefem.casefile.load import load_case
from needlefem.cli.common import say, say_json
from needlefem.cli.experiments import PAIRED, studies, study
from needlefem.cli.ignored import refuse_unused_options
from needlefem.io.expectations import judged


def run_study(options: argparse.Namespace) -> int:
    """Run a study on a case and print its tables; 1 if something demanded doesn't hold."""
    if options.study == "list":
        for name, sentence in studies().items():
            say(f"{name:14s}{sentence}")
        return 0
    run = study(options.study)
    if options.study not in PAIRED:
        unused = f"study '{options.study}' looks at one case"
        refuse_unused_options(options, [("on", unused)])
    scene = load_case(options.case, options.overrides)
    other = load_case(options.on) if options.on else None
    tables = run(scene, other)
    summary = {key: value for table in tables for key, value in table.summary.items()}
    expected, why = judged(scene, summary, options.study)
    if expected is not None:
        tables.append(expected)
    if options.json:
        record = {"study": options.study, "tables": [table.record() for table in tables]}
        say_json(record | {"expect_skipped": why or None})
    else:
        say("\n\n".join([*(table.text() for table in tables), *([why] if why else [])]))
    return 0 if all(table.passed for table in tables) else 1
