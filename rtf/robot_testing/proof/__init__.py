"""The proof: every test is run on every fault it claims to find, on faults it must not mind, and on the healthy robot.

``claims`` reads what tests claim, ``cases`` unfolds that into single runs, ``suites`` writes them as suites for the
ordinary runner, ``judging`` compares its events with the claims, and ``matrix`` writes the result down. Statistics over
seeds and machines would repeat the cases with other parameters of the fixture; the place for that is ``cases``.
"""

from rtf.robot_testing.proof.cases import Case, Expectation, cases_of, others_of
from rtf.robot_testing.proof.claims import Claims, ClaimsError, Reason, read_claims, read_reasons
from rtf.robot_testing.proof.judging import Finding, Judgement, judge
from rtf.robot_testing.proof.matrix import write_matrix
from rtf.robot_testing.proof.suites import read_suites, write_suites

__all__ = [
    "Case",
    "Claims",
    "ClaimsError",
    "Expectation",
    "Finding",
    "Judgement",
    "Reason",
    "cases_of",
    "judge",
    "others_of",
    "read_claims",
    "read_reasons",
    "read_suites",
    "write_matrix",
    "write_suites",
]
