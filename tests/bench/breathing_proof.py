#!/usr/bin/env python3
"""How well a tumour is followed by fitting a breathing lung to radiographs of one that breathes otherwise.

Usage: tests/bench/breathing_proof.py [--build FOLDER] [--moments N] [--seed N] [--keep DIR] [--only NAME...] DATA
  DATA             a folder with the CT (ct/, DICOM), its labels (totalsegmentator.nii.gz) and contours (069.xml)
  --build FOLDER   build/release if absent; needs apps/kiroku and tests/bench/breathing_truth
  --moments N      of the series, five a second; 60 if absent
  --seed N         of breaths, pose and quanta; 1 if absent
  --keep DIR       works there and keeps all; what is there already is used again
  --only NAME      of the fits, as two_1 (two views, the most quanta) to one_5; may be given again

The truth is another model than the one that is fitted, another mesh, another density rule and another physics of
rays; breathing_truth.cpp says where it stands. The fit is given the CT, its own mesh, a belt's trace with noise that
knows neither hysteresis nor drift, and radiographs of five numbers of quanta, from one side and from two. It is not
told that one moment in twenty was not exposed.

Errors are those of the tumour's centre in space, mm, of all exposed moments for which a place is told. "across" is
that part of them which the front view can show. "told" counts exposed moments with a place; "dark_told" moments that
were not exposed and were given a place all the same (0 is right). "beyond_2" and "beyond_3" are the parts of all
coordinates that lie beyond two and three of the standard deviations told with them, % (4.6 and 0.3 of a normal
deviation). Prints a line a fit, then all figures as ID=VALUE.

Exit status: 0 measured, 1 a command failed, 77 DATA is not there: nothing was measured.
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
FIT_VERTICES, TRUE_VERTICES = 3000, 5000


def call(words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        sys.exit(f"breathing_proof.py: {words[0]}: {done.stderr.strip()}")
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
    if not (work / "truth/level5/side").exists():
        done = call([build / "tests/bench/breathing_truth", ct, work / "true.json", work / "truth", options.moments, 5,
                     options.seed])
        if done.returncode:
            sys.exit(f"breathing_proof.py: {done.stderr.strip()}")


def percentile_95(values):
    return sorted(values)[max(math.ceil(0.95 * len(values)) - 1, 0)]


def figures_of(found, truth):
    errors, across, ratios = [], [], []
    exposed = dark_told = 0
    for place, true in zip(found["tumour"]["places"], truth):
        told = place["place_mm"] is not None
        if true["exposed"] != "yes":
            dark_told += told
            continue
        exposed += 1
        if not told:
            continue
        off = [a - float(true[axis]) for a, axis in zip(place["place_mm"], ("x_mm", "y_mm", "z_mm"))]
        errors.append(math.hypot(*off))
        across.append(math.hypot(off[0], off[2]))
        ratios += [abs(a) / e for a, e in zip(off, place["error_mm"])]

    def beyond(times):
        return f"{100 * sum(ratio > times for ratio in ratios) / len(ratios):.1f}"

    return {"mean": f"{sum(errors) / len(errors):.2f}", "95": f"{percentile_95(errors):.2f}", "most": f"{max(errors):.2f}",
            "across": f"{sum(across) / len(across):.2f}", "across_95": f"{percentile_95(across):.2f}",
            "beyond_2": beyond(2), "beyond_3": beyond(3),
            "lost": str(exposed - len(errors)), "dark_told": str(dark_told), "seen": str(found["tumour"]["seen"])}


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0], description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA", type=pathlib.Path)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--moments", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=pathlib.Path)
    parser.add_argument("--only", action="append")
    options = parser.parse_args()
    for name in ("ct", "totalsegmentator.nii.gz", "069.xml"):
        if not (options.data / name).exists():
            print(f"breathing_proof.py: {options.data / name} is not there: nothing was measured", file=sys.stderr)
            sys.exit(77)
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        work = options.keep or pathlib.Path(folder)
        work.mkdir(parents=True, exist_ok=True)
        prepare(work, options.data, options.build, options)
        truth = list(csv.DictReader((work / "truth/truth.csv").read_text("utf-8").splitlines()))
        print(f"the patient lay {(work / 'truth/pose.txt').read_text('utf-8').strip()}")
        for count, views in (("two", ("front", "side")), ("one", ("front",))):
            for level in range(1, LEVELS + 1):
                name = f"{count}_{level}"
                if options.only and name not in options.only:
                    continue
                words = [options.build / "apps/kiroku", "sim", "fit-series", options.data / "ct", work / "fit.json",
                         "--rate", 5, "--json", "--force", "-o", work / f"fitted-{name}.json"]
                for view in views:
                    words += ["--radiographs", work / f"truth/level{level}/{view}", "-g", work / f"truth/{view}.json"]
                done = call(words)
                (work / f"found-{name}.json").write_text(done.stdout, "utf-8")
                found = json.loads(done.stdout)
                if found["refusal"]:
                    print(f"{name}: refused: {found['refusal']}", flush=True)
                    figures[f"{name}_mean"] = "refused"
                    continue
                measured = figures_of(found, truth)
                tumour = found["tumour"]
                print(f"{name}: mean {measured['mean']}, 95 % {measured['95']}, most {measured['most']} mm; across "
                      f"{measured['across']}, 95 % {measured['across_95']} mm; seen {tumour['seen']}, predicted "
                      f"{tumour['predicted']}, lost {tumour['lost']} ({measured['lost']} exposed; dark and told "
                      f"{measured['dark_told']}); beyond 2: {measured['beyond_2']} %, 3: {measured['beyond_3']} %; "
                      f"correlation {found['gradient_correlation']['after']:.2f}, {found['took_s']:.0f} s", flush=True)
                figures.update({f"{name}_{key}": value for key, value in measured.items()})
    print(" ".join(f"{name}={value}" for name, value in figures.items()))


if __name__ == "__main__":
    main()
