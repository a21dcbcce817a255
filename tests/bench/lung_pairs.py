#!/usr/bin/env python3
"""Fits lungs to the second CT of their pair, from masks alone and with correspondences, and tells the errors.

Usage: tests/bench/lung_pairs.py FOLDER [--kiroku PROGRAM] [--vertices NUMBER...]
  FOLDER              has a folder for each pair, with expiration_mask.nii.gz, inspiration_mask.nii.gz,
                      expiration_landmarks.txt, inspiration_landmarks.txt and correspondences_*.csv
  --kiroku PROGRAM    build/release/apps/kiroku if absent
  --vertices NUMBER   of the meshes, 5000 if absent; with several, how the errors depend on it

Each lung is meshed at expiration and brought to inspiration. Landmarks judge; nothing is fitted on them. A pair that is
refused keeps its error and is counted. Prints a line a pair, then what docs/results/record.py takes:

  docs/results/record.py respire-copd --machine NAME $(tests/bench/lung_pairs.py FOLDER | tail -1)

Exit status: 0 measured, 1 a command failed.
"""
import argparse
import json
import pathlib
import resource
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def run(command, refusal=False):
    """The standard output, whether it was refused, and the seconds of processor time."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0 and not (refusal and done.stdout):
        sys.exit(f"lung_pairs.py: {' '.join(map(str, command))}: {done.stderr.strip()}")
    return done.stdout, done.returncode != 0, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def fit(kiroku, pair, work, more):
    out, refused, seconds = run(
        [kiroku, "sim", "fit", work / "lung.json", "--shape", pair / "inspiration_mask.nii.gz", "--landmarks",
         pair / "expiration_landmarks.txt", pair / "inspiration_landmarks.txt", *more, "-o", work / "fitted.json",
         "--json"], refusal=True)
    found = json.loads(out)
    last = found["steps"][-1]
    return {"before": found["landmarks_before"]["mean_mm"], "error": last["landmarks"]["mean_mm"],
            "inside_out": last["inside_out"], "refused": refused, "landmarks": last["landmarks"]["count"],
            "volume": 100 * abs(last["volume_ml"] / found["second_volume_ml"] - 1), "seconds": seconds,
            "steps": ", ".join(f"{step['step']} {step['landmarks']['mean_mm']:.2f}" for step in found["steps"])}


def fit_pair(kiroku, pair, vertices):
    """From the mask alone, and with correspondences."""
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder)
        mask = pair / "expiration_mask.nii.gz"
        run([kiroku, "sim", "mesh", mask, "--labels", mask, "--pieces", "2", "--vertices", str(vertices), "-o",
             work / "lung.msh"])
        (work / "lung.json").write_text('{"mesh": "lung.msh", "length_unit": "mm"}', "utf-8")
        files = sorted(pair.glob("correspondences_*.csv"))
        return {"masks": fit(kiroku, pair, work, []),
                "points": fit(kiroku, pair, work, [word for file in files for word in ("--correspondences", file)])}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--kiroku", default=ROOT / "build/release/apps/kiroku")
    parser.add_argument("--vertices", type=int, nargs="+", default=[5000])
    given = parser.parse_args()
    pairs = sorted(p for p in given.folder.iterdir() if (p / "expiration_mask.nii.gz").exists())
    if not pairs:
        sys.exit(f"lung_pairs.py: {given.folder} has no pair")
    values = {}
    for vertices in given.vertices:
        found = [fit_pair(given.kiroku, pair, vertices) for pair in pairs]
        for pair, both in zip(pairs, found):
            for kind, one in both.items():
                print(f"{vertices} vertices, {pair.name}, {kind}: {one['landmarks']} landmarks, before "
                      f"{one['before']:.2f} mm; {one['steps']}; volume off by {one['volume']:.2f} %, "
                      f"{one['inside_out']} inside out; {one['seconds']:.1f} s{' REFUSED' if one['refused'] else ''}",
                      flush=True)
        suffix = f"_{vertices}" if len(given.vertices) > 1 else ""
        for kind in ("masks", "points"):
            all_of = [both[kind] for both in found]
            values |= {f"{kind}{suffix}": sum(one["error"] for one in all_of) / len(all_of),
                       f"{kind}_most{suffix}": max(one["error"] for one in all_of),
                       f"{kind}_volume{suffix}": max(one["volume"] for one in all_of),
                       f"{kind}_inside_out{suffix}": max(one["inside_out"] for one in all_of),
                       f"{kind}_worse{suffix}": sum(one["error"] > one["before"] for one in all_of),
                       f"{kind}_refused{suffix}": sum(one["refused"] for one in all_of),
                       f"{kind}_seconds{suffix}": max(one["seconds"] for one in all_of)}
        values["before"] = sum(both["masks"]["before"] for both in found) / len(found)
    print(" ".join(f"{key}={float(f'{value:.3g}'):g}" for key, value in values.items()))


if __name__ == "__main__":
    main()
