#!/usr/bin/env python3
"""How well a tumour is followed by fitting a breathing lung to radiographs of one that breathes otherwise.

Usage: tests/bench/series_fit.py [--build FOLDER] [--moments N] [--seed N] [--keep DIR] DATA
  DATA             a folder with the CT (ct/, DICOM), its labels (totalsegmentator.nii.gz) and contours (069.xml)
  --build FOLDER   build/release if absent; needs apps/kiroku and tests/bench/breathing_truth
  --moments N      of the series, five a second; 60 if absent
  --seed N         of breaths, pose and quanta; 1 if absent
  --keep DIR       works there and keeps all; what is there already is used again

The truth is another model than the one that is fitted, another mesh, another density rule and another physics of
rays: breathing_truth.cpp says which. The fit is given the CT, its own mesh, a belt's trace with noise that knows
neither hysteresis nor drift, and radiographs of five numbers of quanta, from one side and from two. Errors are those
of the tumour's centre in space, mm: of all moments for which a place is told. Prints a line
a fit, then all figures as ID=VALUE.

Exit status: 0 measured, 1 a command failed.
"""
import argparse
import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
LEVELS = 5
FIT_VERTICES, TRUE_VERTICES = 4000, 2500


def call(words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        sys.exit(f"series_fit.py: {words[0]}: {done.stderr.strip()}")
    return done


def model(name, mesh, **more):
    return json.dumps({"name": name, "mesh": mesh, "length_unit": "mm", "labels": "labels.nii.gz",
                       "tumour": {"region": 2}, **more})


def prepare(work, data, build, options):
    kiroku, ct, labels = build / "apps/kiroku", data / "ct", data / "totalsegmentator.nii.gz"
    if not (work / "labels.nii.gz").exists():
        (work / "labels.nii.gz").symlink_to(labels.resolve())
    for name, vertices in (("fit.msh", FIT_VERTICES), ("true.msh", TRUE_VERTICES)):
        if not (work / name).exists():
            call([kiroku, "sim", "mesh", ct, "--labels", labels, "--organ", "lung", "--contours", data / "069.xml",
                  "--vertices", vertices, "-o", work / name])
    (work / "true.json").write_text(model("truth", "true.msh"), "utf-8")
    (work / "fit.json").write_text(model("fit", "fit.msh", breathing={"trace": "truth/trace.csv"}), "utf-8")
    if not (work / "truth/truth.csv").exists() or not (work / "truth/level5/side").exists():
        done = call([build / "tests/bench/breathing_truth", ct, work / "true.json", work / "truth", options.moments, 5,
                     options.seed])
        if done.returncode:
            sys.exit(f"series_fit.py: {done.stderr.strip()}")


def errors_of(found, truth):
    """In space and across the front view's ray, of each moment that a place is told for; and what was told of them."""
    errors, across, within = [], [], 0
    for place, true in zip(found["tumour"]["places"], truth):
        if place["place_mm"] is None:
            continue
        off = [a - float(true[axis]) for a, axis in zip(place["place_mm"], ("x_mm", "y_mm", "z_mm"))]
        errors.append(math.hypot(*off))
        across.append(math.hypot(off[0], off[2]))
        # 95 % of a normal deviation along each axis.
        within += sum(abs(a) <= 1.96 * e for a, e in zip(off, place["error_mm"])) / 3
    return errors, across, within / len(errors)


def percentile_95(values):
    return sorted(values)[max(math.ceil(0.95 * len(values)) - 1, 0)]


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0], description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA", type=pathlib.Path)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--moments", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=pathlib.Path)
    options = parser.parse_args()
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        work = options.keep or pathlib.Path(folder)
        work.mkdir(parents=True, exist_ok=True)
        prepare(work, options.data, options.build, options)
        truth = list(csv.DictReader((work / "truth/truth.csv").read_text("utf-8").splitlines()))
        print(f"the patient lay {(work / 'truth/pose.txt').read_text('utf-8').strip()}")
        for views in (("front", "side"), ("front",)):
            for level in range(1, LEVELS + 1):
                words = [options.build / "apps/kiroku", "sim", "fit-series", options.data / "ct", work / "fit.json",
                         "--rate", 5, "--json", "--force", "-o", work / f"fitted-{len(views)}-{level}.json"]
                for view in views:
                    words += ["--radiographs", work / f"truth/level{level}/{view}", "-g", work / f"truth/{view}.json"]
                done = call(words)
                found = json.loads(done.stdout)
                (work / f"found-{len(views)}-{level}.json").write_text(done.stdout, "utf-8")
                name = f"{'two' if len(views) == 2 else 'one'}_{level}"
                if found["refusal"]:
                    print(f"{len(views)} views, level {level}: refused: {found['refusal']}")
                    figures.update({f"{name}_mean": "refused", f"{name}_95": "refused"})
                    continue
                errors, across, within = errors_of(found, truth)
                tumour = found["tumour"]
                print(f"{len(views)} views, level {level}: {sum(errors) / len(errors):.2f} mm, 95 % "
                      f"{percentile_95(errors):.2f} mm, across the front's ray {sum(across) / len(across):.2f} mm; seen "
                      f"{tumour['seen']}, predicted {tumour['predicted']}, lost {tumour['lost']}; told 95 % holds "
                      f"{100 * within:.0f} %; correlation {found['gradient_correlation']['after']:.2f}, "
                      f"{found['took_s']:.0f} s", flush=True)
                figures[f"{name}_mean"] = f"{sum(errors) / len(errors):.2f}"
                figures[f"{name}_95"] = f"{percentile_95(errors):.2f}"
    print(" ".join(f"{name}={value}" for name, value in figures.items()))


if __name__ == "__main__":
    main()
