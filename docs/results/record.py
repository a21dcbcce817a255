#!/usr/bin/env python3
"""Enters what a bench or a long test measured into its JSON below docs/results, then writes the tables anew.

Usage: docs/results/record.py RUN --machine NAME [--load TEXT] [--benchmark FILE] [ID=VALUE...]
  RUN               the name of the JSON: unseal for docs/results/unseal.json
  --machine NAME    a key of docs/results/machines.json
  --load TEXT       what else ran; without it, the load average of this moment
  --benchmark FILE  what a Google Benchmark wrote with --benchmark_out=FILE --benchmark_out_format=json;
                    figures with a "benchmark" in the JSON are taken from it, the median where there are repetitions
  --stages LOG      the output of .ci/run: figures with "stages" in the JSON are the minutes of these stages together
  ID=VALUE          the figure with this id; ID.peer=VALUE what its peer needed in the same run

For example:
  build/release/tests/bench/sim_respire_bench --benchmark_out=out.json --benchmark_out_format=json
  docs/results/record.py sim-respire --machine epyc --benchmark out.json
  .ci/run 2>&1 | tee ci.log
  docs/results/record.py ci --machine epyc --stages ci.log
  docs/results/record.py unseal --machine epyc ratio=1.9 unseal=0.70 unseal.peer=1.33 nowhere=0.19 copy=0.85

The figures of a run belong to one moment, so all of them are entered, or none. Date and commit are those of now.
Exit status: 0 entered, 1 something does not fit.
"""
import argparse
import datetime
import json
import os
import pathlib
import re
import subprocess
import sys

FOLDER = pathlib.Path(__file__).resolve().parent
SECONDS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "µs": 1e-6}


def give_up(sentence):
    sys.exit(f"record.py: {sentence}")


def benchmark_value(entry, counter, unit):
    """The time in the figure's unit, or the counter as it is; three digits, as a table needs them."""
    value = entry[counter]
    if counter in ("real_time", "cpu_time"):
        value *= SECONDS[entry["time_unit"]] / SECONDS[unit]
    return float(f"{value:.3g}")


def from_benchmark(run, file):
    entries = json.loads(pathlib.Path(file).read_text("utf-8"))["benchmarks"]
    found = {}
    for figure in run["figures"]:
        if "benchmark" not in figure:
            continue
        name, counter = figure["benchmark"]["name"], figure["benchmark"].get("counter", "real_time")
        fitting = [e for e in entries if e["run_name"] == name and e.get("aggregate_name", "median") == "median"]
        if not fitting:
            give_up(f"{file} has no benchmark '{name}'; was it filtered out?")
        # A median follows the repetitions that it is of.
        found[figure["id"]] = benchmark_value(fitting[-1], counter, figure["unit"])
    return found


def from_stages(run, file):
    """Minutes of each figure's stages; a log has every stage twice, with the same time."""
    lines = re.findall(r"^   (.+): (\d+) min (\d\d) s$", pathlib.Path(file).read_text("utf-8"), re.MULTILINE)
    took_s = {name: 60 * int(minutes) + int(seconds) for name, minutes, seconds in lines}
    found = {}
    for figure in run["figures"]:
        wanted = figure.get("stages", [])
        for name in wanted:
            if name not in took_s:
                give_up(f"{file} has no stage '{name}'; it has {', '.join(took_s) or 'none'}")
        if wanted:
            found[figure["id"]] = round(sum(took_s[name] for name in wanted) / 60, 1)
    return found


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0], description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run")
    parser.add_argument("--machine", required=True)
    parser.add_argument("--load")
    parser.add_argument("--benchmark")
    parser.add_argument("--stages")
    parser.add_argument("values", nargs="*")
    given = parser.parse_intermixed_args()
    if given.machine not in json.loads((FOLDER / "machines.json").read_text("utf-8")):
        give_up(f"docs/results/machines.json has no machine '{given.machine}'; describe it there first")
    path = FOLDER / f"{given.run}.json"
    if not path.exists():
        give_up(f"there is no docs/results/{given.run}.json; docs/results/make_tables.py says how one looks")
    run = json.loads(path.read_text("utf-8"))
    measured = from_benchmark(run, given.benchmark) if given.benchmark else {}
    if given.stages:
        measured |= from_stages(run, given.stages)
    for value in given.values:
        key, sign, text = value.partition("=")
        if not sign:
            give_up(f"'{value}' is not ID=VALUE")
        try:
            measured[key] = json.loads(text)
        except json.JSONDecodeError:
            measured[key] = text
    # What a paper needed stays what it was; a program beside ours was measured in the same run.
    peers = {f"{figure['id']}.peer": figure["peer"] for figure in run["figures"]
             if "peer" in figure and not figure["peer"]["name"].startswith("the paper")}
    known = [figure["id"] for figure in run["figures"]] + list(peers)
    for key in measured:
        if key not in known:
            give_up(f"docs/results/{given.run}.json has no figure '{key}'; it has {', '.join(known)}")
    missing = [key for key in known if key not in measured]
    if missing:
        give_up(f"the figures {', '.join(missing)} are missing; one run gives all of them")
    for figure in run["figures"]:
        figure["value"] = measured[figure["id"]]
    for key, peer in peers.items():
        peer["value"] = measured[key]
    run["machine"] = given.machine
    run["load"] = given.load or "%.1f" % os.getloadavg()[0]
    run["date"] = datetime.datetime.now(datetime.timezone.utc).date().isoformat()
    run["commit"] = subprocess.run(["git", "-C", str(FOLDER), "rev-parse", "--short", "HEAD"], check=True,
                                   capture_output=True, text=True).stdout.strip()
    run["stated"] = {"commit": run["commit"], "date": run["date"]}
    path.write_text(json.dumps(run, indent=2, ensure_ascii=False) + "\n", "utf-8")
    return subprocess.run([sys.executable, str(FOLDER / "make_tables.py")]).returncode


if __name__ == "__main__":
    sys.exit(main())
