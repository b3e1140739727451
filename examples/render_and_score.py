"""Make camera images whose truth is known, and score the localiser on them: in good light and on a bad day.

Edit the condition to resemble your own hall before you trust a figure for it.
"""

import dataclasses
import shutil
from pathlib import Path

from field_models import load_field
from robocup_vision.evaluation.dataset import load_dataset
from robocup_vision.evaluation.run import evaluate
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.dataset import write_dataset
from sim2d.rendering.random_scenes import CONDITIONS, sample

OUT = Path("out") / "render_and_score"
FIELD, CAMERA = "ssl_2001", sekimori_camera()
COUNT, SEED = 12, 7

conditions = {
    "nominal": CONDITIONS["nominal"],
    "bad_day": CONDITIONS["bad_day"],
    "evening": dataclasses.replace(CONDITIONS["warm"], gain=0.5, noise_sigma=12.0, shadow=True),
}
for name, condition in conditions.items():
    folder = OUT / name
    shutil.rmtree(folder, ignore_errors=True)
    write_dataset(folder, FIELD, CAMERA, sample(load_field(FIELD), CAMERA, condition, SEED, COUNT), symmetry="point")
    summary = evaluate(load_dataset(folder), OUT / f"{name}_scores")
    figures = summary.figures
    median = "-" if figures.median_error_m is None else f"{1e3 * figures.median_error_m:.1f} mm"
    print(f"{name}: {figures.located}/{figures.images} located, median error {median}; {summary.report}")
