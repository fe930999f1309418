# SPDX-License-Identifier: BSD-3-Clause
from pathlib import Path

import pytest
from fault_matrix import (
    LIST,
    PAGE,
    FaultTest,
    all_tests,
    find_tests,
    order_problems,
    page,
    problems,
    read_faults,
    results_in,
    worst,
)
from tracked_files import ROOT

# Another word stands for "fault" here; otherwise this file would seem to contain tests of faults.
CPP = """
TEST(Ring, ROW_34_NeverShowsATornElement) {
TEST_F(Other, ShowsNoFault) {
TYPED_TEST_P(
    Contract, ROW_05_AppendWaits) {
""".replace("ROW", "fault")
PYTHON = """
def test_ROW_64_a_child_is_refused(tmp_path: Path) -> None:
def test_something_else() -> None:
""".replace("ROW", "fault")
RING = FaultTest(34, Path("tests/ipc/ring_test.cpp"), "Ring", "fault_34_NeverShowsATornElement")
ONE_ROW = '[34]\nfault = "A slow reader"\nguarantee = "HistoryLost"\n'


def test_finds_the_tests_of_faults_in_the_sources() -> None:
    assert [(test.row, test.suite) for test in find_tests(Path("tests/a_test.cpp"), CPP)] == [
        (34, "Ring"),
        (5, "Contract"),
    ]
    (python,) = find_tests(Path("tests/python/test_fork.py"), PYTHON)
    assert (python.row, python.suite) == (64, "test_fork")


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("fault_34_NeverShowsATornElement", "Ring: never shows a torn element"),
        ("fault_06_NanOfPDGains", "Ring: nan of pd gains"),
        ("test_fault_64_a_child_is_refused", "Ring: a child is refused"),
    ],
)
def test_reads_names_as_sentences(name: str, sentence: str) -> None:
    assert FaultTest(34, RING.file, "Ring", name).sentence == sentence


@pytest.mark.parametrize(
    ("suite", "name", "is_it"),
    [
        ("Ring", "fault_34_NeverShowsATornElement", True),
        ("Shapes/Ring", "fault_34_NeverShowsATornElement/With", True),
        ("Fake/Ring/0", "fault_34_NeverShowsATornElement", True),
        ("Ring/Inline", "fault_34_NeverShowsATornElement", True),
        ("Ring", "fault_34_NeverShowsATornElementEver", False),
        ("OtherRing", "fault_34_NeverShowsATornElement", False),
    ],
)
def test_knows_a_result_whatever_its_parameters(suite: str, name: str, is_it: bool) -> None:
    assert RING.is_result(suite, name) == is_it


def test_knows_a_result_of_python_whatever_its_parameters() -> None:
    test = FaultTest(64, Path("tests/python/test_fork.py"), "test_fork", "test_fault_64_a_child")
    assert test.is_result("tests.python.test_fork", "test_fault_64_a_child[spawn-1.5]")
    assert not test.is_result("tests.python.test_fork", "test_fault_64_a_child_of_a_child")
    assert not test.is_result("tests.python.test_other", "test_fault_64_a_child")


def test_reads_what_came_of_a_test() -> None:
    xml = """<testsuites><testsuite>
      <testcase classname="a" name="fault_01_A" status="run"/>
      <testcase classname="a" name="fault_02_A"><skipped message="why"/></testcase>
      <testcase classname="a" name="fault_03_A"><failure>why</failure></testcase>
      <testcase classname="a" name="fault_04_A"><error>why</error></testcase>
      <testcase classname="a" name="DISABLED_fault_05_A" status="notrun"/>
      <testcase classname="a" name="other"/></testsuite></testsuites>"""
    results = [result for _, _, result in results_in(xml)]
    assert results == ["passed", "not run", "failed", "failed", "not run"]


def test_one_failure_is_a_failure_and_one_run_is_a_run() -> None:
    assert worst(["passed", "failed", "not run"]) == "failed"
    assert worst(["not run", "passed"]) == "passed"
    assert worst(["not run"]) == "not run"
    assert worst([]) == "not run"


def test_a_row_without_a_test_is_a_problem() -> None:
    assert list(problems(read_faults(ONE_ROW, [RING]), {RING: "passed"})) == []
    (sentence,) = problems(read_faults(ONE_ROW, []), {})
    assert "row 34 has no test: A slow reader" in sentence


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        (["01", "02", "03"], ""),
        (["01", "03"], "row 02 should be where row 03 is"),
        (["01", "03", "02"], "row 02 should be where row 03 is"),
        (["02"], "row 01 should be where row 02 is"),
    ],
)
def test_rows_that_are_missing_or_out_of_order_are_a_problem(
    rows: list[str], sentence: str
) -> None:
    found = list(order_problems("".join(f'[{row}]\nfault = "A slow reader"\n' for row in rows)))
    assert len(found) == bool(sentence)
    assert all(sentence in each for each in found)


def test_a_test_that_failed_is_a_problem() -> None:
    (sentence,) = problems(read_faults(ONE_ROW, [RING]), {RING: "failed"})
    assert "ring_test.cpp: Ring.fault_34_NeverShowsATornElement failed" in sentence


def test_a_test_without_a_row_is_a_problem() -> None:
    (sentence,) = problems(read_faults("", [RING]), {RING: "passed"})
    assert "row 34 does not exist" in sentence


def test_a_row_that_comes_later_has_no_test_yet() -> None:
    later = '[34]\nfault = "A slow reader"\nlater = "with readers"\n'
    assert list(problems(read_faults(later, []), {})) == []
    (sentence,) = problems(read_faults(later, [RING]), {RING: "passed"})
    assert "says 'with readers'" in sentence


def test_the_page_names_the_tests_of_each_row() -> None:
    other = FaultTest(34, Path("tests/python/test_log.py"), "test_log", "test_fault_34_is_said")
    assert page(read_faults(ONE_ROW, [RING, other])).splitlines()[-1] == (
        "| 34 | A slow reader | HistoryLost "
        "| [Ring: never shows a torn element](../tests/ipc/ring_test.cpp)"
        "<br>[log: is said](../tests/python/test_log.py) |"
    )


def test_the_page_is_of_the_tests_that_there_are() -> None:
    faults = read_faults((ROOT / LIST).read_text(), all_tests())
    assert (ROOT / PAGE).read_text() == page(faults), "run tools/fault_matrix.py --write"
