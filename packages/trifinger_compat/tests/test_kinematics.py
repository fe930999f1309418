# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics against the figures of the original's models."""

import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, strategies as st
from robot_properties_fingers import Kinematics, get_urdf_base_path, trifingerpro_ik
from trifinger_compat.urdf import FILES
from trifinger_simulation import SimFinger, finger_types_data
from trifinger_simulation.kinematics import Kinematics as SameKinematics

TIPS = ["finger_tip_link_0", "finger_tip_link_120", "finger_tip_link_240"]
MIXED = {
    "one": (
        [0.1, -0.8, -1.5, -0.2, -1.0, -1.9, 0.3, -0.5, -1.1],
        [
            -0.023346,
            0.051702,
            0.057320,
            0.024231,
            -0.056637,
            0.107800,
            0.017427,
            -0.082915,
            0.029702,
        ],
    ),
    "edu": (
        [0.1, 0.8, -1.5, -0.2, 1.0, -1.9, 0.3, 0.5, -1.1],
        [
            -0.082499,
            0.057202,
            0.056256,
            0.058126,
            -0.008928,
            0.088989,
            0.041061,
            -0.134850,
            0.040271,
        ],
    ),
    "pro": (
        [0.1, 0.8, -1.5, -0.2, 1.0, -1.9, 0.3, 0.5, -1.1],
        [
            0.062225,
            0.062202,
            0.048735,
            -0.008819,
            -0.134881,
            0.124885,
            -0.032746,
            -0.017013,
            0.004288,
        ],
    ),
}
PRO = "pro/trifingerpro.urdf"


def of_pro(path: Path | None = None) -> Kinematics:
    return Kinematics(path or get_urdf_base_path("_root_") / PRO, TIPS)


@pytest.mark.parametrize("variant", MIXED)
def test_tips_are_where_the_original_has_them(variant: str, tmp_path: Path) -> None:
    angles, expected = MIXED[variant]
    source = get_urdf_base_path("_root_") / FILES[f"trifinger{variant}"]
    # A copy is read as any description is.
    copied = tmp_path / "robot.urdf"
    copied.write_text(source.read_text())
    for path in (source, copied):
        tips = Kinematics(path, TIPS).forward_kinematics(angles)
        assert np.ravel(tips) == pytest.approx(expected, abs=1e-6)
    tips = SimFinger(f"trifinger{variant}").kinematics.forward_kinematics(angles)
    assert np.ravel(tips) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("finger_type", FILES)
def test_each_type_has_a_file_with_its_tips(finger_type: str) -> None:
    finger = SimFinger(finger_type)
    assert Path(finger.finger_urdf_path).is_file()
    assert finger.finger_urdf_path.endswith(finger_types_data.get_finger_urdf(finger_type))
    kinematics = Kinematics(finger.finger_urdf_path, finger.tip_link_names)
    zeros = np.zeros(3 * finger.number_of_fingers)
    expected = finger.kinematics.forward_kinematics(zeros)
    assert kinematics.forward_kinematics(zeros) == expected


def test_folders_of_descriptions() -> None:
    assert get_urdf_base_path("pro").name == "pro"
    assert (get_urdf_base_path("one") / "trifinger.urdf").is_file()
    for name in (
        "finger_with_stage",
        "trifinger_with_stage",
        "stage",
        "edu/trifingeredu_with_stage",
    ):
        assert (get_urdf_base_path("_root_") / f"{name}.urdf").is_file()
    with pytest.raises(ValueError, match="Invalid robot type"):
        get_urdf_base_path("two")


def test_the_jacobian_of_a_finger_is_that_of_the_sheet() -> None:
    jacobian = of_pro().compute_jacobian(0, [0, 0.9, -1.7] * 3)
    assert jacobian.shape == (6, 9)
    expected = [[-0.210931, 0, 0], [0, 0.210931, 0.111473], [-0.086, 0.010555, -0.114777]]
    assert jacobian[:3, :3] == pytest.approx(np.array(expected), abs=1e-6)
    assert np.all(jacobian[:, 3:] == 0)
    assert jacobian[3:, 0] == pytest.approx([0, 1, 0])


def test_inverse_kinematics_of_one_finger_moves_no_other() -> None:
    kinematics = of_pro()
    guess = np.array([0.1, 0.8, -1.5] * 3)
    kept = guess.copy()
    goal_angles = guess.copy()
    goal_angles[3:6] += [0.2, -0.1, 0.2]
    target = kinematics.forward_kinematics(goal_angles)[1]
    angles, error = kinematics.inverse_kinematics_one_finger(1, target, guess, tolerance=1e-4)
    assert np.array_equal(guess, kept)
    assert np.array_equal(angles[:3], guess[:3])
    assert np.linalg.norm(error) < 1e-4
    # The error is that before the last step, which removes a tenth of it.
    left = np.array(target) - kinematics.forward_kinematics(angles)[1]
    assert np.linalg.norm(left) == pytest.approx(0.9 * np.linalg.norm(error), rel=0.01)


def test_inverse_kinematics_of_all_fingers() -> None:
    kinematics = of_pro()
    targets = kinematics.forward_kinematics([0.2, 0.7, -1.4] * 3)
    angles, errors = kinematics.inverse_kinematics(targets, [0.0, 0.9, -1.7] * 3)
    assert len(errors) == 3
    assert np.array(kinematics.forward_kinematics(angles)) == pytest.approx(
        np.array(targets), abs=0.005
    )
    old = kinematics.inverse_kinematics(0, targets[0], np.array([0.0, 0.9, -1.7] * 3))
    assert old[:3] == pytest.approx(angles[:3])


def test_targets_out_of_reach_are_no_exception() -> None:
    _, error = of_pro().inverse_kinematics_one_finger(0, [1, 1, 1], [0.0, 0.9, -1.7] * 3)
    assert np.linalg.norm(error) > 0.5


@given(st.tuples(st.floats(-0.33, 1.0), st.floats(0.05, 1.5), st.floats(-2.6, -0.2)))
def test_the_closed_form_inverts_forward_kinematics(angles: tuple[float, float, float]) -> None:
    tips = SimFinger.kinematics.func(_Pro()).forward_kinematics(list(angles) * 3)
    assert trifingerpro_ik.fingerpro_ik(tips[0]) == pytest.approx(angles, abs=1e-6)
    assert trifingerpro_ik.trifingerpro_ik(tips) == pytest.approx(list(angles) * 3, abs=1e-6)


class _Pro:
    finger_type = "trifingerpro"


def test_the_closed_form_refuses_what_is_too_near_and_has_no_number_for_what_is_too_far() -> None:
    with pytest.raises(ValueError, match=r"0\.086"):
        trifingerpro_ik.fingerpro_ik([0.01, 0.1, 0.29])
    assert np.isnan(trifingerpro_ik.fingerpro_ik([0.1, 1.0, 0.0])).all()


def test_old_names_are_the_same_class(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "trifinger_simulation.pinocchio_utils", raising=False)
    assert SameKinematics is Kinematics
    with pytest.warns(FutureWarning, match="old name"):
        import trifinger_simulation.pinocchio_utils as old
    assert old.Kinematics is Kinematics
    finger = SimFinger("trifingerpro")
    assert finger.pinocchio_utils is finger.kinematics


def test_types_of_robots() -> None:
    assert sorted(finger_types_data.get_valid_finger_types()) == sorted(FILES)
    assert finger_types_data.check_finger_type("fingerone") == "fingerone"
    assert finger_types_data.get_finger_urdf("tri") == "trifinger.urdf"
    assert finger_types_data.get_number_of_fingers("trifingeredu") == 3
    assert finger_types_data.get_initial_joint_positions("trifingerone") == [0, -0.9, -1.7] * 3
    for function in (
        finger_types_data.check_finger_type,
        finger_types_data.get_finger_urdf,
        finger_types_data.get_number_of_fingers,
        finger_types_data.get_initial_joint_positions,
    ):
        with pytest.raises(ValueError, match="Invalid finger type"):
            function("nothing")


def links_in_pybullets_order(path: str) -> list[str]:
    """The links below the root as PyBullet numbers them: each with all that hangs on it."""
    below: dict[str, list[str]] = {}
    children = set()
    for joint in ElementTree.parse(path).getroot().findall("joint"):  # noqa: S314  # our own file
        parent, child = joint.find("parent"), joint.find("child")
        assert parent is not None
        assert child is not None
        below.setdefault(parent.attrib["link"], []).append(child.attrib["link"])
        children.add(child.attrib["link"])
    (root,) = below.keys() - children

    def walk(link: str) -> Iterator[str]:
        for child in below.get(link, ()):
            yield child
            yield from walk(child)

    return list(walk(root))


@pytest.mark.parametrize("finger_type", FILES)
def test_links_of_the_files_have_the_numbers_that_programs_give_to_pybullet(
    finger_type: str,
) -> None:
    finger = SimFinger(finger_type)
    paths = [Path(finger.finger_urdf_path)]
    paths += filter(Path.is_file, [paths[0].with_stem(f"{paths[0].stem}_with_stage")])
    for path in paths:
        links = links_in_pybullets_order(str(path))
        assert [links[i] for i in finger.pybullet_link_indices] == finger.link_names
        assert [links[i] for i in finger.pybullet_tip_link_indices] == finger.tip_link_names
