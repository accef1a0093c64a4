"""The proof: every test is run on each fault that it claims to find, on faults that it must ignore, and without faults.

``claims`` reads the claims of tests, ``cases`` expands them to single runs, ``suites`` writes them as suites for the
runner, ``judging`` compares the results with the claims, and ``matrix`` writes the report.
"""

from rtf.robot_testing.proof.cases import Case, Expectation, cases_of, limits_of, on_units, others_of
from rtf.robot_testing.proof.claims import Claims, ClaimsError, Reason, read_claims, read_reasons
from rtf.robot_testing.proof.judging import JudgedCase, Judgement, faulty_joints, judge
from rtf.robot_testing.proof.matrix import write_matrix
from rtf.robot_testing.proof.shipped import shipped_cases
from rtf.robot_testing.proof.suites import read_suites, write_suites

__all__ = [
    "Case",
    "Claims",
    "ClaimsError",
    "Expectation",
    "JudgedCase",
    "Judgement",
    "Reason",
    "cases_of",
    "faulty_joints",
    "judge",
    "limits_of",
    "on_units",
    "others_of",
    "read_claims",
    "read_reasons",
    "read_suites",
    "shipped_cases",
    "write_matrix",
    "write_suites",
]
