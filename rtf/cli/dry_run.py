"""``--dry-run``: load every plug-in, fill every parameter, say what would run with what, and run nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.cli.check_plan import problems_of
from rtf.cli.running import Plan, show_diagnostics, show_plan
from rtf.testing.verdict import ExitCode, Severity

if TYPE_CHECKING:
    import argparse


def dry_run(plan: Plan, options: argparse.Namespace) -> ExitCode:
    """Print the plan and every problem. Exit code 0 when a run could begin."""
    show_plan(plan)
    problems = tuple(problems_of(plan, options.overrides))
    show_diagnostics(problems)
    errors = sum(problem.severity is Severity.ERROR for problem in problems)
    print(f"dry run: nothing was run, {errors} error{'s' if errors != 1 else ''} found")
    return ExitCode.USAGE if errors else ExitCode.PASSED
