# SPDX-License-Identifier: BSD-3-Clause
import pytest
import write_docstrings
from write_docstrings import to_python


def test_the_committed_docstrings_are_the_comments_of_the_headers() -> None:
    written = write_docstrings.docstrings()
    if any(path.read_text() != text for path, text in written.items()):
        pytest.fail("comments have changed; write them again: python tools/write_docstrings.py")


def test_paragraphs_of_a_comment_are_wrapped_for_python() -> None:
    assert to_python("///< Force [N].") == "Force [N]."
    assert to_python("/// One\n/// sentence.\n  ///\n  /// Next.") == "One sentence.\n\nNext."


def test_equations_keep_their_lines() -> None:
    comment = "/// It is\n///\n///     a = b\n///       + c\n///\n/// here."
    assert to_python(comment) == "It is\n\n    a = b\n      + c\n\nhere."


def test_errors_are_raised_in_python() -> None:
    comment = "/// Waits. @throws SystemError,\n/// TimedOut\n/// @throws NotInLog if it is gone."
    assert (
        to_python(comment)
        == "Waits.\n\nRaises OSError, TimedOut.\n\nRaises NotInLog if it is gone."
    )


def test_words_of_cpp_become_those_of_python() -> None:
    assert to_python("/// Nothing before the end; `kNone` is true.") == (
        "None before the end; `None` is True."
    )
    assert to_python("/// See `log::Log::size` and `Reach::kTooFar`.") == (
        "See `Log.size` and `Reach.TOO_FAR`."
    )
