# SPDX-License-Identifier: BSD-3-Clause
"""What the environments with the interface of the old Gym have in common."""

from typing import TYPE_CHECKING, Any

from trifinger_compat.spaces import gym_package

if TYPE_CHECKING:

    class Env:
        """Stands for gymnasium.Env."""
else:
    Env = gym_package().Env


class OldEnvironment(Env):
    """An environment whose step() gives four things and whose reset() gives the observation."""

    metadata: dict[str, Any] = {"render.modes": ["human"], "render_modes": ["human"]}  # noqa: RUF012
    render_mode: str | None = None

    def render(self, mode: str = "human") -> None:
        """Does nothing: the window of the simulation is always up to date."""

    def close(self) -> None:
        """Does nothing: the simulation goes with this object."""


def dict_space(**spaces: Any) -> Any:
    """A space of several spaces by name."""
    return gym_package().spaces.Dict(spaces)
