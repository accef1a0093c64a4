"""The cases of the shipped claims."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot_testing.proof.cases import cases_of, limits_of, others_of
from rtf.robot_testing.proof.claims import read_claims, read_reasons
from rtf.testing.plugins import shipped_folder

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot_testing.proof.cases import Case


def shipped_cases(
    tests: Sequence[str] = (), *, fast: bool = False, others: bool = False, limits: bool = False
) -> list[Case]:
    """Return the cases of these tests; of all of them, if none is named. Raises ClaimsError.

    ``fast``: only the fast subset; ``others``: also faults without a claim; ``limits``: also smaller ones.
    """
    folder = shipped_folder("test") / "claims"
    reasons = read_reasons(folder / "others" / "reasons.toml") if others else ()
    cases: list[Case] = []
    for file in sorted(folder.glob("*.toml")):
        claims = read_claims(file)
        if not tests or claims.test in tests:
            cases += cases_of(claims, fast=fast)
            cases += others_of(claims, reasons, fast=fast) if others else ()
            cases += limits_of(claims) if limits else ()
    return cases
