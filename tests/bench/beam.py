#!/usr/bin/env python3
"""What a beam that follows a tumour is worth: errors by latency, and fields by motion, margin and tumour.

Usage: tests/bench/beam.py [--kiroku PROGRAM] [-o DIR]
  --kiroku PROGRAM    build/release/apps/kiroku if absent
  -o DIR              keeps the tables of 'kiroku sim beam' there

The path is four minutes of breaths of cos^4 shape (Lujan et al., Medical Physics 26(5), 1999): a mean of 4 s and 10 mm
feet to head, each breath 20 % longer or shorter and deeper or flatter at random (normal, seed 7), 2 mm front to back
a tenth of a second later, and a drift of 1 mm a minute. No noise of detection. Prints the tables, then what
docs/results/record.py takes:

  docs/results/record.py beam --machine NAME $(tests/bench/beam.py | tail -1)

Exit status: 0 measured, 1 the command failed.
"""
import argparse
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
SECONDS, STEP = 240, 0.02


def path():
    """Lines of a CSV: time in s, places in mm."""
    chance = random.Random(7)
    breaths, begins = [], 0.0
    while begins < SECONDS + 10:
        length = 4 * min(max(chance.gauss(1, 0.2), 0.5), 1.5)
        breaths.append((begins, length, 10 * min(max(chance.gauss(1, 0.2), 0.4), 1.6)))
        begins += length

    def depth(time):
        begin, length, deep = next(breath for breath in reversed(breaths) if breath[0] <= max(time, 0))
        return deep * (1 - math.cos(math.pi * (time - begin) / length) ** 4)

    lines = ["time_s,x_mm,y_mm,z_mm"]
    for i in range(round(SECONDS / STEP) + 1):
        time = i * STEP
        lines.append(f"{time:.2f},0,{0.2 * depth(time - 0.1):.4f},{time / 60 - depth(time):.4f}")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0], description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kiroku", default=ROOT / "build/release/apps/kiroku")
    parser.add_argument("-o", dest="output")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder)
        (work / "path.csv").write_text(path(), "utf-8")
        done = subprocess.run([options.kiroku, "sim", "beam", work / "path.csv", "--excursion", "2,5,10,15,20", "-o",
                               options.output or work / "beam", "--force", "--json"], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"beam.py: {done.stderr.strip()}")
    found = json.loads(done.stdout)
    figures = {}
    print(f"{found['excursion_mm']:.1f} mm between the places furthest apart")
    for latency in found["latencies"]:
        ms, late, seen = round(latency["latency_ms"]), latency["delayed_mm"], latency["predicted_mm"]
        print(f"{ms} ms: late {late['mean']:.2f} mm (95 % {late['percentile_95']:.2f}), predicted {seen['mean']:.2f} mm "
              f"(95 % {seen['percentile_95']:.2f})")
        figures[f"error_{ms}"] = f"{seen['percentile_95']:.2f}"
        figures[f"error_{ms}.peer"] = f"{late['percentile_95']:.2f}"
    parts = {(field["excursion_mm"], field["margin_mm"], field["tumour_ml"]): field for field in found["fields"]}
    for (excursion, margin, volume), field in parts.items():
        print(f"{excursion:4.0f} mm, margin {margin:.0f} mm, {volume:4.0f} ml: {100 * field['following_of_covering']:3.0f} % "
              f"(gate {100 * field['gating_ml'] / field['covering_ml']:3.0f} %, open {100 * field['duty']:3.0f} %); met "
              f"{100 * field['following_covered']:.1f} %, {100 * field['gating_covered']:.1f} %, "
              f"{100 * field['covering_covered']:.1f} %")
    shares = [100 * field["following_of_covering"] for field in parts.values()]
    figures["least"], figures["greatest"] = f"{min(shares):.0f}", f"{max(shares):.0f}"
    nearest = min(parts, key=lambda key: abs(parts[key]["following_of_covering"] - 0.48))
    print("nearest to 48 %: " + " mm, ".join(f"{number:g}" for number in nearest[:2]) + f" mm margin, {nearest[2]:g} ml")
    for (excursion, margin, volume), field in parts.items():
        if margin == 4:
            figures[f"at_{excursion:g}_4_{volume:g}"] = f"{100 * field['following_of_covering']:.0f}"
    figures["covered"] = f"{100 * min(field['following_covered'] for field in parts.values()):.1f}"
    print(" ".join(f"{name}={value}" for name, value in figures.items()))


if __name__ == "__main__":
    main()
