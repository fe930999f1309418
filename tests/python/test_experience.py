# SPDX-License-Identifier: BSD-3-Clause
"""What a learner makes of a robot's experience: transitions, each once, none across a gap."""

import itertools
import threading
from pathlib import Path

import numpy as np
import pytest
import trifinger
from trifinger.training.experience import (
    INTERVENTION,
    LATE,
    TERMINATED,
    TRUNCATED,
    Book,
    Episodes,
    compact,
    digest_of,
    of_logs,
)

KIND = [
    *((name, "i8") for name in ("session", "step", "seed", "episode", "actions", "flags")),
    ("reward", "f8"),
    ("observation", "f4", (2,)),
]


def elements_of(
    count: int, *, session: int = 1, seed: int = 0, episode: int = 0, last: int = TRUNCATED
) -> np.ndarray:
    """An episode of so many actions."""
    elements = np.zeros(count + 1, KIND)
    elements["session"], elements["seed"], elements["episode"] = session, seed, episode
    elements["actions"] = np.arange(count + 1)
    elements["step"] = 1000 * episode + 20 * np.arange(count + 1)
    elements["flags"][-1] = last
    return elements


def transitions(elements: np.ndarray, size: int = 1) -> list:
    episodes = Episodes()
    parts = [elements[i : i + size] for i in range(0, len(elements), size)]
    # What follows the last transition must be known.
    parts.append(elements_of(0, session=99))
    return [one for part in parts for one in episodes.add(part)]


@pytest.mark.parametrize("size", [1, 3, 100])
def test_each_action_of_an_episode_is_a_transition(size: int) -> None:
    stream = np.concatenate([elements_of(5, episode=i) for i in range(4)])
    made = transitions(stream, size)
    assert [one.after["actions"] for one in made] == 4 * [1, 2, 3, 4, 5]
    assert all(one.after["step"] - one.before["step"] == 20 for one in made)
    assert [one.ended for one in made] == 4 * [False, False, False, False, True]
    assert not any(one.is_cut or one.terminated for one in made)


def test_only_a_task_that_has_ended_terminates() -> None:
    made = transitions(elements_of(3, last=TERMINATED))
    assert [one.terminated for one in made] == [False, False, True]
    assert [one.terminated for one in transitions(elements_of(3))] == [False, False, False]


def test_nothing_is_made_across_what_is_missing() -> None:
    """Whatever is left out, each transition is one of the whole, and what it cuts is marked."""
    whole = np.concatenate([elements_of(6, episode=i, session=1 + i // 3) for i in range(6)])
    rng = np.random.default_rng(1)
    for _ in range(200):
        kept = whole[rng.random(len(whole)) < rng.uniform(0.3, 1.0)]
        made = transitions(kept)
        pairs = [
            (a, b)
            for a, b in itertools.pairwise(kept)
            if a["episode"] == b["episode"] and b["actions"] == a["actions"] + 1
        ]
        assert [(one.before, one.after) for one in made] == pairs
        for one, following in zip(made, [*made[1:], None], strict=True):
            goes_on = following is not None and following.before == one.after
            assert one.ended == (not goes_on)


def test_a_fault_and_a_new_session_cut_an_episode() -> None:
    stream = np.concatenate([elements_of(5)[:3], elements_of(5, session=2)])
    made = transitions(stream)
    assert len(made) == 2 + 5
    assert [one.is_cut for one in made] == [False, True, False, False, False, False, False]


def test_a_late_action_is_left_out() -> None:
    stream = elements_of(5)
    stream["flags"][3] |= LATE
    made = transitions(stream)
    assert [one.after["actions"] for one in made] == [1, 2, 4, 5]
    assert [one.ended for one in made] == [False, True, False, True]


def test_a_book_has_each_element_once_in_whatever_parts_it_comes() -> None:
    stream = np.concatenate([elements_of(9, episode=i, session=1 + i // 4) for i in range(9)])
    rng = np.random.default_rng(2)
    book = Book(10**6)
    done = 0
    while done < len(stream):
        # Logs and the session overlap.
        first = max(0, done - int(rng.integers(20)))
        done = min(len(stream), done + int(rng.integers(1, 15)))
        book.add(stream[first:done])
    elements, number = book.since(0)
    assert (elements == stream).all()
    assert number == len(stream)
    assert len(book.since(number)[0]) == 0
    assert (book.since(17)[0] == stream[17:]).all()


def test_a_book_keeps_the_newest_and_wakes_who_waits() -> None:
    book = Book(40)
    for i in range(40):
        book.add(elements_of(9, episode=i))
    elements, number = book.since(0)
    assert 40 <= len(elements) <= 50
    assert elements["episode"].max() == 39
    assert number == 400
    later = []
    waiter = threading.Thread(target=lambda: later.append(book.since(number, 60.0)[0]))
    waiter.start()
    book.add(elements_of(9, episode=40))
    waiter.join()
    assert later[0]["episode"][0] == 40


def test_a_book_spares_demonstrations() -> None:
    book = Book(40)
    book.add(elements_of(9, episode=0))
    assert book.keep() == 10
    helped = elements_of(9, episode=1)
    helped["flags"][4] |= INTERVENTION
    for stream in (helped, *(elements_of(9, episode=i) for i in range(2, 40))):
        book.add(stream)
    elements, number = book.since(0)
    assert elements["episode"][:12].tolist() == 10 * [0] + 2 * [1]
    assert elements["actions"][10:12].tolist() == [3, 4]  # what a person did, and from where
    assert 52 <= len(elements) <= 62
    assert number == 400
    # In parts it is the same.
    parts, at = [], 0
    while len(part := book.since(at, most=7)[0]):
        at = book.since(at, most=7)[1]
        parts.append(part)
    assert (np.concatenate(parts) == elements).all()


def test_experience_of_another_decision_process_is_left_out() -> None:
    kind = [
        ("process", "u8"),
        *((name, "i8") for name in ("session", "step", "seed", "episode", "actions", "policy")),
        ("reward", "f8"),
        *((name, "u4") for name in ("flags", "num_observed", "num_acted", "num_goal")),
        *((name, "f4", (8,)) for name in ("observation", "action", "achieved", "desired")),
    ]
    mine = digest_of({"task": "reach", "options": "{}"})
    elements = np.zeros(6, kind)
    elements["process"] = mine
    elements["process"][2] = digest_of({"task": "reach", "options": "{ }"})
    elements["process"][4] = digest_of({"task": "push", "options": "{}"})
    for name, length in (("num_observed", 4), ("num_acted", 3), ("num_goal", 2)):
        elements[name] = length
    elements["step"] = range(6)
    elements["action"][:, :3] = 1.0
    packed = compact(elements, mine)
    assert packed["step"].tolist() == [0, 1, 3, 5]
    assert packed["observation"].shape == (4, 4)
    assert (packed["action"] == 1.0).all()
    assert packed["desired"].shape == (4, 2)
    assert not len(compact(elements, 1))


def test_a_log_that_cannot_be_read_is_left_out_of_a_folder(tmp_path: Path) -> None:
    said: list[str] = []
    assert list(of_logs(tmp_path, 1, said.append)) == []
    killed = tmp_path / "a_000.mcap"
    killed.touch()
    assert list(of_logs(tmp_path, 1, said.append)) == []
    assert "a_000.mcap" in said[0]
    with pytest.raises(trifinger.Error):
        list(of_logs(killed, 1))
