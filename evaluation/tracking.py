# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate tracking`: finds a cube in images, and compares with the truth.

Robots, poses, fingers, light, colours, dust, noise, exposure and the error of the calibration
differ from scene to scene. Most images are from the simulation's renderer, as those are from which
the colours were learned. With `--traced`, others are from a ray tracer that shares nothing with it
(traced_scenes.py): they stand for photographs. Writes docs/results/tracking.md.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trifinger
from contradictions import VISIBLE
from traced_scenes import Studio
from tracking_scenes import VARIANTS, Scene, Scenes, angle, cameras_of, config_of
from trifinger.tracking import Tracker, tracked_object
from trifinger_camera_calibration import images as image_files
from wrong_pictures import KINDS, RIGHT, Answer, Judge, counts

SEED = 90210  # scenes that were not looked at while the tracker was written
WRONG_ANGLE = 20.0  # [degrees]: a pose this far off shows other faces
WRONG_DISTANCE = 0.02  # [m]
PER_TRACED = 5  # rendered scenes with wrong pictures for each traced one
AGAIN = 10  # images of each repeated scene
REPEATED = 10  # one of this many scenes is repeated
QUALITY: dict[str, Any] = {"detail": 1.0, "multisampling": 4, "shadows": True}
RESULTS = Path(__file__).parent.parent / "docs/results/tracking.md"
TITLE = """\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# Tracking the cube
"""
TRACED_TEXT = """
## In other light

Written by `./run evaluate tracking --traced {scenes}{first}`: {scenes} scenes of the same kind,
{contacts:.1f} fingers at the cube on average, drawn by a ray tracer (evaluation/traced_scenes.py)
that shares nothing with the simulation's renderer. It stands for photographs: up to three lamps of
different colours and sizes, soft shadows, light from one surface to the next, pigments and filters
with spectra, sheen, dirt and scratches, tables with grain, a hand in every third scene, blur,
vignetting, tone curves, a white balance that is off, noise that depends on the channel. No colour
was learned from it.

| measure | reach | is | held |
|---|---|---|---|
{rows}

The tracker was sure of {sure} of {scenes} scenes. All others it called unsure or not found, {good}
of them with a pose within 3 mm and 2.5 degrees. The error of a sure estimate is within twice its
standard deviations in {within:.0f} % of the scenes. Light unlike that of the rendered images needs
a second look, which takes as long again.
"""
TEXT = """
## In rendered images

Written by `./run evaluate tracking --scenes {scenes}{first}`: {scenes} scenes of three robots, the
cube anywhere in the arena up to 13 cm high, {contacts:.1f} fingers at it on average, three images
of 540 x 540 in Bayer mosaic. Light, colours, dust, noise and exposure differ; cameras differ from
their calibration by 0.5 pixel. The tracker knows nothing of earlier images. The first four rows
and the repeated scenes count what it was sure of.

| measure | reach | is | held |
|---|---|---|---|
{rows}

The tracker was sure of {sure} of {scenes} scenes. All others it called unsure or not found, {good}
of them with a pose within 3 mm and 2.5 degrees. With a guess a few millimetres off, an estimate
takes {guessed:.1f} ms (median). The error of a sure estimate is within twice its standard
deviations in {within:.0f} % of the scenes.
"""

WRONG_TEXT = """
## Faulty pictures

Written by `./run evaluate tracking --wrong {scenes}{first}{photographs}`: pictures of {scenes}
rendered scenes and {traced} traced ones{said}, and what becomes of them if cameras or the
configuration are wrong (evaluation/wrong_pictures.py). Each number says of how many pictures the
tracker was sure. It must be sure of no faulty one, even where its pose is right.

Pictures that show nothing wrong are left out: they are right ones for anybody who sees them. In
them, fewer than {visible} pixels contradict the cube that is believed, in the orientation that
explains them best (evaluation/contradictions.py). Which pixels show which face is known from the
scenes, fingers included, so the tracker has no part in it.{untold}

| pictures | {names} |
|---|{lines}
{rows}
| all faulty ones | {sums} |
"""


class Trial(NamedTuple):
    """What the tracker said of one scene."""

    is_sure: bool
    is_found: bool
    distance: float  # [m]
    turn: float  # [degrees]
    confidence: float
    seconds: float
    guessed_seconds: float
    deviations: float
    """The larger of both errors, in standard deviations."""
    contacts: int
    spread: Sequence[tuple[float, float]]
    """Differences of repeated estimates from their median [m], [degrees]."""


class Row(NamedTuple):
    """A row of the table."""

    name: str
    limit: float
    value: float
    unit: str

    @property
    def holds(self) -> bool:
        """True if the value is within the limit."""
        return self.value <= self.limit

    def __str__(self) -> str:
        text = f"| {self.name} | {self.limit:g} {self.unit} | {self.value:.2f} {self.unit} |"
        return f"{text} {'yes' if self.holds else 'no'} |"


def perturbed(
    position: np.ndarray, orientation: np.ndarray, number: int
) -> tuple[np.ndarray, np.ndarray]:
    """A guess that is some millimetres and degrees off."""
    random = np.random.default_rng([SEED, number, 1])
    turned = orientation + random.normal(scale=0.02, size=4)
    return position + random.normal(scale=0.003, size=3), turned / np.linalg.norm(turned)


class TracedExperiment:
    """The scenes of one robot, as photographs."""

    def __init__(self, config: str) -> None:
        self.scenes = Scenes(config)
        self.studio = Studio(config)
        self.calibration = self.studio.calibration
        self.tracker = Tracker(self.calibration, tracked_object(config))

    def images(self, number: int) -> list[Any]:
        """Photographs of a scene."""
        return self.studio.take(self.scenes.draw(SEED, number), SEED, number)

    def faces(self, number: int) -> list[Any]:
        """The faces of the cube in the photographs of a scene."""
        return self.studio.faces(self.scenes.draw(SEED, number), SEED, number)

    def run(self, number: int) -> Trial:
        """Takes photographs of a scene and tracks it."""
        return judged(self.tracker, self.scenes.draw(SEED, number), number, self.images(number))


def judged(tracker: Tracker, scene: Scene, number: int, images: Sequence[Any]) -> Trial:
    """What the tracker says of these images, and what it should say."""
    begin = time.process_time()
    estimate = tracker.track(images)
    seconds = time.process_time() - begin
    guess = perturbed(scene.position, scene.orientation, number)
    begin = time.process_time()
    tracker.track(images, guess)
    guessed = time.process_time() - begin
    distance = float(np.linalg.norm(estimate.position - scene.position))
    turn = angle(estimate.orientation, scene.orientation)
    deviations = max(
        distance / max(1e-9, float(np.linalg.norm(estimate.position_deviation))),
        np.radians(turn) / max(1e-9, float(np.linalg.norm(estimate.rotation_deviation))),
    )
    return Trial(
        estimate.is_sure,
        estimate.is_found,
        distance,
        turn,
        estimate.confidence,
        seconds,
        guessed,
        float(deviations),
        scene.contacts,
        [],
    )


class Experiment:
    """The scenes of one robot, as the simulation's renderer draws them."""

    def __init__(self, config: str) -> None:
        self.scenes = Scenes(config)
        self.renderer = trifinger.CameraRenderer(config, **QUALITY)
        self.calibration = self.renderer.calibration
        self.tracker = Tracker(self.calibration, tracked_object(config))

    def images(self, number: int) -> list[Any]:
        """Pictures of a scene."""
        self.renderer.vary(SEED, number)
        self.renderer.set_options(**QUALITY)
        images = self.renderer.render(self.scenes.draw(SEED, number).configuration, 0)
        return [np.array(each) for each in images]

    def faces(self, number: int) -> list[Any]:
        """The faces of the cube in the pictures of a scene; call images(number) before."""
        cameras = cameras_of(self.renderer.true_calibration)
        return self.scenes.faces(self.scenes.draw(SEED, number), cameras)

    def run(self, number: int) -> Trial:
        """Draws a scene and tracks it."""
        scene = self.scenes.draw(SEED, number)
        trial = judged(self.tracker, scene, number, self.images(number))
        if number % REPEATED or not trial.is_sure:
            return trial
        return trial._replace(spread=self._repeat(scene))

    def _repeat(self, scene: Scene) -> list[tuple[float, float]]:
        poses = []
        for number in range(1, AGAIN + 1):
            estimate = self.tracker.track(self.renderer.render(scene.configuration, number))
            if estimate.is_sure:
                poses.append((estimate.position, estimate.orientation))
        if not poses:
            return []
        position = np.median([each for each, _ in poses], axis=0)
        signed = [each * np.sign(each @ poses[0][1]) for _, each in poses]
        middle = np.mean(signed, axis=0)
        middle /= np.linalg.norm(middle)
        return [
            (float(np.linalg.norm(place - position)), angle(turn, middle)) for place, turn in poses
        ]


def is_wrong(trial: Trial) -> bool:
    """True if the pose is another one altogether."""
    return trial.distance > WRONG_DISTANCE or trial.turn > WRONG_ANGLE


def rows(trials: Sequence[Trial]) -> list[Row]:
    """The rows of a table."""
    sure = [trial for trial in trials if trial.is_sure]
    found = [trial for trial in trials if trial.is_found]
    millimetres = 1e3 * np.array([trial.distance for trial in sure])
    degrees = np.array([trial.turn for trial in sure])
    spread = np.array([each for trial in trials for each in trial.spread]).reshape(-1, 2)
    wrong = [trial for trial in found if is_wrong(trial)]
    times = 1e3 * np.array([trial.seconds for trial in trials])
    table = [
        Row("distance, median", 1, _share(millimetres, 50), "mm"),
        Row("distance, 95 %", 3, _share(millimetres, 95), "mm"),
        Row("rotation, median", 0.8, _share(degrees, 50), "deg"),
        Row("rotation, 95 %", 2.5, _share(degrees, 95), "deg"),
        Row("wrong faces", 0.5, 100 * len(wrong) / len(trials), "%"),
        Row("wrong faces that were called sure", 0, sum(t.is_sure for t in wrong), "scenes"),
        Row("not sure", 10, 100 * (1 - len(sure) / len(trials)), "%"),
    ]
    if len(spread):
        table += [
            Row(
                "same scene, other noise: distance, 95 %", 0.5, 1e3 * _share(spread[:, 0], 95), "mm"
            ),
            Row("same scene, other noise: rotation, 95 %", 0.5, _share(spread[:, 1], 95), "deg"),
        ]
    return [*table, Row("time of one core, 95 %", 9, float(np.percentile(times, 95)), "ms")]


def _share(values: np.ndarray, percent: float) -> float:
    return float(np.percentile(values, percent)) if len(values) else float("nan")


def with_section(document: str, section: str) -> str:
    """The document with this section, which begins with its heading, added or replaced."""
    heading = section.lstrip().splitlines()[0]
    kept = [each for each in document.split("\n## ")[1:] if not f"## {each}".startswith(heading)]
    sections = sorted(["\n## " + each for each in kept] + [section], reverse=True)
    return TITLE + "".join(each.rstrip("\n") + "\n" for each in sections)


def report(trials: Sequence[Trial], text: str, first: int = 0) -> str:
    """A section of docs/results/tracking.md."""
    unsure = [trial for trial in trials if not trial.is_sure]
    good = [trial for trial in unsure if trial.distance < 0.003 and trial.turn < 2.5]
    sure = [trial for trial in trials if trial.is_sure]
    return text.format(
        scenes=len(trials),
        first=f" --first-scene {first}" if first else "",
        contacts=np.mean([trial.contacts for trial in trials]),
        rows="\n".join(map(str, rows(trials))),
        sure=len(sure),
        good=len(good),
        guessed=1e3 * np.median([trial.guessed_seconds for trial in trials]),
        within=100 * np.mean([trial.deviations < 2 for trial in sure] or [False]),
    )


def run(
    kind: type[Experiment] | type[TracedExperiment], scenes: int, first: int = 0
) -> list[Trial]:
    """Tracks the cube in so many scenes, from number `first` on."""
    trials = []
    with tempfile.TemporaryDirectory() as folder:
        experiments = [kind(config_of(variant, Path(folder))) for variant in VARIANTS]
        for number in range(first, first + scenes):
            trial = experiments[number % len(experiments)].run(number)
            trials.append(trial)
            if not trial.is_sure or is_wrong(trial) or trial.distance > 0.003 or trial.turn > 2.5:
                print(
                    f"scene {number}: {'sure' if trial.is_sure else 'not sure'},"
                    f" {1e3 * trial.distance:.1f} mm, {trial.turn:.1f} deg off,"
                    f" confidence {trial.confidence:.2f}",
                    flush=True,
                )
    return trials


def wrong_answers(
    kind: type[Experiment] | type[TracedExperiment], scenes: int, first: int
) -> list[Answer]:
    """The answers to right and wrong pictures of so many scenes."""
    answers = []
    with tempfile.TemporaryDirectory() as folder:
        experiments = [kind(config_of(variant, Path(folder))) for variant in VARIANTS]
        judges = [Judge(experiment.calibration) for experiment in experiments]
        for number in range(first, first + scenes):
            which = number % len(VARIANTS)
            images = experiments[which].images(number)
            faces = experiments[which].faces(number)
            answers += judges[which].judge(images, (SEED, number), faces)
    return answers


def photographs_in(folder: Path) -> list[Answer]:
    """The answers to photographs, and to wrong ones that are made of them."""
    judge = Judge((folder / "cameras.yml").read_text())
    files = image_files.ImageSet.of_folder(folder)
    answers = []
    for number, name in enumerate(files.names):
        images = [image_files.read(files.paths[camera][name]) for camera in files.cameras]
        answers += judge.judge(images, (SEED, number))
    return answers


def wrong_report(found: dict[str, list[Answer]], scenes: int, first: int, folder: str) -> str:
    """The section of docs/results/tracking.md about wrong pictures."""

    def cell(counted: Sequence[int]) -> str:
        sure, faulty, left_out = counted
        return f"{sure} of {faulty}" + (f", {left_out} left out" if left_out else "")

    def row(kind: str) -> str:
        return f"| {kind} | {' | '.join(cell(counts(each, kind)) for each in found.values())} |"

    def total(answers: list[Answer]) -> str:
        return cell(np.sum([counts(answers, kind) for kind in KINDS if kind != RIGHT], axis=0))

    return WRONG_TEXT.format(
        scenes=scenes,
        first=f" --first-scene {first}" if first else "",
        photographs=f" --photographs {folder}" if folder else "",
        traced=scenes // PER_TRACED,
        said=", and photographs" if folder else "",
        names=" | ".join(found),
        lines="---|" * len(found),
        rows="\n".join(row(kind) for kind in KINDS),
        sums=" | ".join(map(total, found.values())),
        visible=VISIBLE,
        untold=" Of photographs it is not known: all are counted." if folder else "",
    )


def report_wrong(scenes: int, first: int, folder: Path | None, output: Path) -> bool:
    """Writes the section about wrong pictures; true if none was called sure."""
    found = {
        "rendered": wrong_answers(Experiment, scenes, first),
        "traced": wrong_answers(TracedExperiment, scenes // PER_TRACED, first),
    }
    if folder is not None:
        found["photographs"] = photographs_in(folder)
    section = wrong_report(found, scenes, first, folder.name if folder else "")
    document = output.read_text() if output.exists() else TITLE
    output.write_text(with_section(document, section))
    print(section)
    return not any(
        counts(answers, kind)[0] for answers in found.values() for kind in KINDS if kind != RIGHT
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns 0 if every row of the tables holds, otherwise 1."""
    parser = argparse.ArgumentParser(prog="./run evaluate tracking", description=__doc__)
    parser.add_argument("--scenes", type=int, help="number of rendered scenes (default 600)")
    parser.add_argument(
        "--traced", type=int, default=0, help="number of ray-traced scenes, 5 s each (default 0)"
    )
    parser.add_argument(
        "--wrong", type=int, default=0, help="rendered scenes of which wrong pictures are made"
    )
    parser.add_argument(
        "--photographs",
        type=Path,
        help="with --wrong: a folder with cameras.yml and images of 'trifinger look --raw'",
    )
    parser.add_argument("--output", type=Path, default=RESULTS, help="the document that is written")
    parser.add_argument(
        "--first-scene", type=int, default=0, help="number of the first scene (default 0)"
    )
    options = parser.parse_args(arguments)
    others = options.traced + options.wrong
    scenes = options.scenes if options.scenes is not None else 0 if others else 600
    if min(scenes, options.traced, options.wrong, options.first_scene) < 0 or scenes + others == 0:
        parser.error(
            "--scenes, --traced and --wrong are numbers of scenes; one must be at least 1. "
            "--first-scene is 0 or more"
        )
    holds = options.wrong == 0 or report_wrong(
        options.wrong, options.first_scene, options.photographs, options.output
    )
    for kind, count, text in (
        (Experiment, scenes, TEXT),
        (TracedExperiment, options.traced, TRACED_TEXT),
    ):
        if count == 0:
            continue
        trials = run(kind, count, options.first_scene)
        document = options.output.read_text() if options.output.exists() else TITLE
        options.output.write_text(with_section(document, report(trials, text, options.first_scene)))
        for row in rows(trials):
            print(row)
        holds = holds and all(row.holds for row in rows(trials))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
