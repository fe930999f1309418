# SPDX-License-Identifier: BSD-3-Clause
"""Learns the colours that ship, config/colours/standard.yml, from rendered images.

The scenes are of the kind of `./run evaluate tracking`, but others.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
import trifinger
from tracking_scenes import CONFIG, VARIANTS, Scenes, config_of
from trifinger.tracking import tracked_object
from trifinger_camera_calibration.colours import Samples

import tracking

SEED = 2311
ORIGIN = "Learned from rendered\n# images by evaluation/standard_colours.py."


def main() -> int:
    """Writes the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=240, help="number of scenes (default 240)")
    parser.add_argument("--output", type=Path, default=CONFIG / "colours/standard.yml")
    options = parser.parse_args()
    samples = Samples(SEED)
    with tempfile.TemporaryDirectory() as folder:
        configs = [config_of(variant, Path(folder)) for variant in VARIANTS]
        scenes = [Scenes(config) for config in configs]
        renderers = [trifinger.CameraRenderer(config, **tracking.QUALITY) for config in configs]
        for number in range(options.scenes):
            kind = number % len(VARIANTS)
            renderer = renderers[kind]
            scene = scenes[kind].draw(SEED, number)
            renderer.vary(SEED, number)
            # Sharp knowledge of what is seen: no error of the calibration.
            renderer.set_options(**tracking.QUALITY, calibration_error=0.0)
            images = [np.asarray(image) for image in renderer.render(scene.configuration, 0)]
            cube = tracked_object(configs[kind])
            samples.add(images, renderer.calibration, cube, scene.position, scene.orientation)
    options.output.write_text(samples.learn(ORIGIN))
    return 0


if __name__ == "__main__":
    sys.exit(main())
