# SPDX-License-Identifier: BSD-3-Clause
"""MuJoCo Warp, which moves all simulations of an environment at once."""

from typing import Any

import numpy as np
from trifinger import _trifinger
from trifinger.arrays import Array
from trifinger.errors import Error, InvalidArgument

try:
    import mujoco
    import mujoco_warp
    import warp
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        f"{error.name} is missing: pip install mujoco-warp==4.0.0 warp-lang==1.19.0",
        name=error.name,
    ) from error

READ = ("qpos", "qvel", "qacc_warmstart", "ctrl")  # before the physics
WRITTEN = ("qpos", "qvel", "qacc_warmstart")  # after them
# What MuJoCo takes from a model and Warp does not: boxes around bodies, and a scale of its solver.
UNKNOWN = ("bvh_aabb", "dof_M0")


class WarpPhysics:
    """The physics of the simulations of `core`, on a device of Warp: "cpu" or "cuda:0".

    `core` calls it once for each step of the robots. Before, it copies the state of all simulations
    and their torques to the device; afterwards it copies the state of those that moved back.
    Numbers have single precision on the device.
    """

    def __init__(
        self,
        core: _trifinger.EnvironmentBatch,
        device: str,
        *,
        contacts: int | None = None,
        constraints: int | None = None,
    ) -> None:
        """`contacts` and `constraints` are the room of each simulation; None: as Warp guesses."""
        warp.init()
        try:
            self._device = warp.get_device(device)
        except ValueError as error:
            known = ", ".join(map(str, warp.get_devices()))
            raise InvalidArgument(f"Warp has no device '{device}', only {known}") from error
        self._core = core
        memory = core.memory
        self._rows: dict[str, Array] = {name: memory[name] for name in READ}
        self._substeps = core.substeps
        model = model_of(core.model_file)
        self._varied = [name for name in core.varied_fields if name not in UNKNOWN]
        count = len(core)
        with warp.ScopedDevice(self._device):
            sizes = dict.fromkeys(self._varied, count)
            self._model = mujoco_warp.put_model(model, batch_sizes=sizes)
            self._data = mujoco_warp.make_data(
                model, nworld=count, nconmax=contacts, njmax=constraints
            )
        # On a GPU all steps are recorded once, when their code has been compiled.
        self._graph: Any = None

    def __call__(self, moves: Array, models_changed: bool) -> None:
        """Moves the simulations that `moves` marks.

        Raises:
            Error: if a simulation has more contacts than there is room for
        """
        with warp.ScopedDevice(self._device):
            if models_changed:
                for name in self._varied:
                    _put(getattr(self._model, name), self._core.varied_field(name))
            for name in READ:
                _put(getattr(self._data, name), self._rows[name])
            self._step()
            for name in WRITTEN:
                self._rows[name][moves] = getattr(self._data, name).numpy()[moves]
            if self._data.overflow.numpy()[moves].any():
                raise Error(
                    "a simulation has more contacts or constraints than Warp has room for, "
                    f"{self._data.naconmax} in all and {self._data.njmax} each: give more, "
                    "by contacts and constraints"
                )

    def _step(self) -> None:
        if self._graph is not None:
            warp.capture_launch(self._graph)
            return
        self._take_steps()
        if self._device.is_cuda:
            with warp.ScopedCapture() as capture:
                self._take_steps()
            self._graph = capture.graph

    def _take_steps(self) -> None:
        for _ in range(self._substeps):
            mujoco_warp.step(self._model, self._data)


def model_of(file: bytes) -> Any:
    """The model in the bytes of a file of MuJoCo, as Warp can take it."""
    model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": file})
    # Warp never resets by itself, and refuses models that say so.
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


# Copies numbers to an array of the device, which stays where it is.
def _put(target: Any, numbers: Array) -> None:
    # Vectors and matrices are single elements for Warp.
    shape = (*target.shape, *getattr(target.dtype, "_shape_", ()))
    source = np.ascontiguousarray(numbers, np.float32).reshape(shape)
    warp.copy(target, warp.array(source, dtype=target.dtype, device="cpu"))
