#!/usr/bin/env python3
"""Renews the evidence records of two appliances' cases in a real Ceph store, with authorities of `openssl ts`, and fetches what counts.

Usage: tests/fleet/renew_test.py PROGRAMS
  PROGRAMS  the folder of kiroku and kiroku-fleet, such as build/release/apps

Exit status: 0 everything holds, 1 something does not, 77 Ceph or PostgreSQL is not installed.
"""
import datetime
import json
import shutil
import subprocess
import sys

from aggregate_test import CountingAuthority
from fleet_test import Fleet, verdicts, with_store_and_postgres
from mend_test import Disks, flipped
from ship_test import Appliance, Store, require

BUCKET = "recordings"
POLICY = """\
name = "Test"
renew_before_days = {days}
new_hash = "{new}"
[[algorithm]]
name = "sha256"
{end}
[[algorithm]]
name = "sha512"
[[algorithm]]
name = "ecdsa"
[[algorithm]]
name = "ed25519"
"""


class Renewing:
    """kiroku-fleet with a policy, authorities and a scratch folder."""

    def __init__(self, fleet, folder, authority):
        self.fleet, self.folder, self.scratch = fleet, folder, folder / "scratch"
        self.scratch.mkdir()
        self.policy = fleet.folder / "algorithms.toml"
        self.roots = []
        self.plain = fleet.configuration.read_text()
        self.ask_of(authority)

    def ask_of(self, authority):
        """From now on of this authority; the roots of those before stay."""
        self.authority = authority
        root = self.fleet.folder / f"root-{len(self.roots)}.pem"
        root.write_text(authority.authority.root)
        self.roots.append(root)
        trust = ", ".join(f'"{each}"' for each in self.roots)
        self.fleet.configuration.write_text(
            self.plain.replace("settle_minutes = 0\n", f"settle_minutes = 0\ntrust = [{trust}]\n") +
            f'[[authority]]\nname = "outside"\nurl = "{authority.url("fleet")}"\n[evidence]\npolicy = "algorithms.toml"\n')

    def set_policy(self, days=180, new="sha256", end=""):
        self.policy.write_text(POLICY.format(days=days, new=new, end=end))

    def words(self, *more):
        return ["renew", "--scratch", str(self.scratch), *more]

    def renew(self, *more, status=0):
        """{case: what}, and all that was told."""
        before = sum(self.authority.asked.values())
        told = self.fleet.tell(*self.words(*more), status=status)
        require(list(self.scratch.iterdir()) == [], f"the scratch folder holds {list(self.scratch.rglob('*'))}")
        self.asked = sum(self.authority.asked.values()) - before
        return {(each["appliance"], each["case"]): each["what"] for each in told["cases"]}, told["cases"]


class Stored:
    """One case as whoever fetches it sees it."""

    def __init__(self, store, renewing, appliance, name, case):
        self.store, self.renewing, self.appliance, self.name, self.case = store, renewing, appliance, name, case
        self.key = f"{name}/evidence/{case}.ers"

    def versions(self):
        return self.store.versions(BUCKET).get(self.key, [])

    def evidence(self):
        into = self.renewing.folder / "fetched"
        shutil.rmtree(into, ignore_errors=True)
        trust = [word for root in self.renewing.roots for word in ("--trust", str(root))]
        done = self.appliance.ask("fetch", self.case, "-o", str(into), "--device", str(self.appliance.home / "device.pub"), "--own-authority",
                                  str(self.appliance.home / "own-authority.pem"), *trust, "--policy", str(self.renewing.policy), "--json")
        require(done.returncode == 0, f"the fetched case is not intact: {done.stdout}{done.stderr}")
        return json.loads(done.stdout)["cases"][0]["report"]["evidence"]

    def headers(self, key, version):
        done = subprocess.run(["curl", "-sSI", "--aws-sigv4", "aws:amz:us-east-1:s3", "--user", "testaccess:testsecret0123456789", "-H",
                               "x-amz-content-sha256: e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
                               f"{self.store.endpoint}/{BUCKET}/{key}?versionId={version}"], check=True, capture_output=True, text=True)
        return {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in done.stdout.splitlines())}


def records_are_begun_with_one_time_stamp(renewing, cases):
    found, _ = renewing.renew("--dry-run", status=3)
    require(set(found.values()) == {"begun"} and len(found) == 3, f"a dry run says {found}")
    require(all(not each.versions() for each in cases) and renewing.asked == 0, "a dry run did something")
    found, _ = renewing.renew()
    require(set(found.values()) == {"begun"} and len(found) == 3, f"begun were {found}")
    require(renewing.asked == 1, f"the authority was asked {renewing.asked} times for three cases")
    for each in cases:
        (version,) = each.versions()
        lock = each.headers(each.key, version)
        ledger = f"{each.name}/{each.case}/ledger.jsonl"
        of_ledger = each.headers(ledger, each.store.versions(BUCKET)[ledger][0])
        require(lock["x-amz-object-lock-mode"] == "COMPLIANCE", f"nothing locks {each.key}: {lock}")
        require(lock["x-amz-object-lock-retain-until-date"] >= of_ledger["x-amz-object-lock-retain-until-date"], f"{each.key} is locked for less")
        require(each.store.ask("DELETE", f"/{BUCKET}/{each.key}?versionId={version}")[0] == 403, f"{each.key} could be removed")
        evidence = each.evidence()
        require(evidence["holds"] and evidence["time_stamps"] == 1 and evidence["time"] == "external", f"fetched: {evidence}")
    require(len({each.evidence()["since"] for each in cases}) == 1, "one time-stamp has several times")
    found, _ = renewing.renew()
    require(found == {} and renewing.asked == 0, f"nothing was due, and {found} were looked at")
    found, _ = renewing.renew("--all")
    require(set(found.values()) == {"nothing-due"} and len(found) == 3, f"nothing is due, and {found}")
    told = renewing.fleet.tell("verify", "--all")
    require(all(verdict.startswith("intact") for verdict in verdicts(told).values()), f"the fleet verifies {told}")


def a_time_stamp_is_renewed_before_it_ends(renewing, cases, folder):
    renewing.set_policy(days=3650)
    renewing.ask_of(CountingAuthority(folder / "second", name="Second", days=7300, digests="sha256, sha512"))
    found, _ = renewing.renew()
    require(set(found.values()) == {"time-stamp-renewed"} and len(found) == 3, f"renewed were {found}")
    require(renewing.asked == 1, f"the authority was asked {renewing.asked} times")
    for each in cases:
        require(len(each.versions()) == 2, f"{each.key} has the versions {each.versions()}")
        evidence = each.evidence()
        require(evidence["holds"] and evidence["time_stamps"] == 2, f"fetched: {evidence}")
    found, _ = renewing.renew("--all")
    require(set(found.values()) == {"nothing-due"}, f"nothing is due, and {found}")


def what_an_appliance_renews_stays_beside(renewing, cases, appliance):
    appliance.kiroku("renew")
    appliance.kiroku("ship")
    for each in (each for each in cases if each.appliance is appliance):
        require(len(each.versions()) == 3, f"{each.key} has the versions {each.versions()}")
        require(each.store.get(BUCKET, each.key) == (appliance.home / f"archive/evidence/{each.case}.ers").read_bytes(), "the appliance's is not the newest")
        evidence = each.evidence()
        require(evidence["holds"] and evidence["time_stamps"] == 2 and evidence["time"] == "external", f"the recorder's own word was taken: {evidence}")
    appliance.kiroku("ship")
    found, _ = renewing.renew("--all")
    require(set(found.values()) == {"nothing-due"}, f"the two fight: {found}")
    require(all(len(each.versions()) == 3 for each in cases if each.appliance is appliance), "the two put records in turns")


def two_workers_share_the_cases(renewing, recorded):
    words = [str(renewing.fleet.program), *renewing.words("--all", "--json", "--config", str(renewing.fleet.configuration))]
    workers = [subprocess.Popen(words, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    told = [json.loads(worker.communicate(timeout=300)[0])["cases"] for worker in workers]
    require([worker.returncode for worker in workers] == [0, 0], f"the workers told {told}")
    looked = {(each["appliance"], each["case"]) for part in told for each in part}
    require(looked == recorded, f"looked at were {looked}")


def a_store_that_is_away_is_waited_for(renewing, store):
    whole = renewing.fleet.configuration.read_text()
    renewing.fleet.configuration.write_text(whole.replace(store.endpoint, "http://127.0.0.2:1"))
    found, told = renewing.renew("--all", status=3)
    require(set(found.values()) == {"waits"} and all("does not answer" in each["reason"] for each in told), f"a store that is away: {told}")
    renewing.fleet.configuration.write_text(whole)
    found, _ = renewing.renew()
    require(set(found.values()) == {"nothing-due"} and len(found) == 3, f"what waited was not looked at again: {found}")


def a_new_hash_reads_all_data_again(renewing, cases, disks):
    *sound, lost = cases
    segment = f"{lost.name}/{lost.case}/segments/endoscope/00000000.ts.age"
    (version,) = lost.store.versions(BUCKET)[segment]
    disks.rot(segment, version, flipped)
    soon = datetime.date.today() + datetime.timedelta(days=100)
    renewing.set_policy(new="sha512", end=f"until = {soon}")
    before = {each.key: each.versions() for each in cases}
    found, told = renewing.renew(status=1)
    require(found.pop((lost.name, lost.case)) == "refused", f"a case that is not as recorded: {told}")
    (refused,) = [each for each in told if each["what"] == "refused"]
    require(refused["unread"] == ["segments/endoscope/00000000.ts.age"], f"which file it is: {refused}")
    require(lost.versions() == before[lost.key], "something was renewed for it")
    # The list, its exit status and the next verification know of it: it had been verified, and is as it was by the store's list.
    (row,) = renewing.fleet.tell("cases", "--attention")["cases"]
    require(row["case"] == lost.case and row["verdict"] is None and "was not renewed" in row["unchecked"], f"the list goes on saying {row}")
    require(renewing.fleet.tell("status", status=3)["not_renewed"] == 1, "the status does not tell")
    (verified,) = renewing.fleet.tell("verify", status=1)["cases"]
    require((verified["case"], verified["verdict"]) == (lost.case, "tampered"), f"verified at once was {verified}")
    require(set(found.values()) == {"hash-tree-renewed"} and len(found) == 2 and renewing.asked == 1, f"renewed were {found}")
    for each in sound:
        require(len(each.versions()) == len(before[each.key]) + 1, f"{each.key} has the versions {each.versions()}")
        evidence = each.evidence()
        require(evidence["holds"] and evidence["hashes"] == ["sha256", "sha512"] and evidence["time_stamps"] == 3, f"fetched: {evidence}")


def nothing_is_kept_from_renewal(renewing, cases, database):
    """Rows that look as if they changed just now, or were open again, and such as nobody can look at."""
    one = cases[0]

    def change(columns, table="cases"):
        subprocess.run([*database, "-c", f"UPDATE kiroku.{table} SET {columns} WHERE appliance = '{one.name}' AND case_id = '{one.case}'"], check=True)

    whole = renewing.fleet.configuration.read_text()
    renewing.fleet.configuration.write_text(whole.replace("settle_minutes = 0", "settle_minutes = 60"))
    change("changed_at = now(), not_renewed_since = now()")
    found, _ = renewing.renew("--all")
    require((one.name, one.case) not in found, f"what may be on its way is looked at: {found}")
    change("not_renewed_since = now() - interval '3 days'")
    found, _ = renewing.renew()
    require(found == {(one.name, one.case): "nothing-due"}, f"what changes each hour is never looked at: {found}")
    renewing.fleet.configuration.write_text(whole)
    # A newest ledger without its end, by whoever may put.
    key = f"{one.name}/{one.case}/ledger.jsonl"
    recorded, other = one.store.get(BUCKET, key), renewing.folder / "other-ledger"
    other.write_bytes(recorded[:recorded.index(b'"type":"close"')].rpartition(b"\n")[0] + b"\n")
    one.store.put(BUCKET, key, other)
    renewing.fleet.tell("index")
    (row,) = [each for each in renewing.fleet.tell("cases")["cases"] if each["case"] == one.case]
    require(row["state"] == "open", f"the ledger without its end: {row}")
    found, _ = renewing.renew()
    require(found == {(one.name, one.case): "nothing-due"}, f"what looks open again is looked at no more: {found}")
    other.write_bytes(recorded)
    one.store.put(BUCKET, key, other)
    renewing.fleet.tell("index")
    change("state = 'missing'")
    found, _ = renewing.renew("--all", status=3)
    require((one.name, one.case) not in found, f"what is missing is looked at: {found}")
    change("state = 'closed'")
    renewing.renew()
    renewing.fleet.tell("verify")


def try_everything(programs, folder, store, connection):
    appliances = {}
    for name in ("or-1", "or-2"):
        appliances[name] = Appliance(programs, folder / name, store.endpoint, BUCKET)
        toml = appliances[name].home / "kiroku.toml"
        toml.write_text(toml.read_text().replace('appliance = "or-1"', f'appliance = "{name}"'))
    recorded = [("or-1", appliances["or-1"].recorded(2)), ("or-1", appliances["or-1"].recorded(1)), ("or-2", appliances["or-2"].recorded(1))]
    for appliance in appliances.values():
        appliance.kiroku("ship")
    fleet = Fleet(programs, folder / "fleet", store.endpoint, connection, appliances)
    require(fleet.ask("init").returncode == 0, "init failed")
    fleet.tell("index")
    refused = fleet.ask("renew")
    require(refused.returncode == 2 and "names no [[authority]]" in refused.stderr, f"without an authority: {refused.stderr}")
    renewing = Renewing(fleet, folder, CountingAuthority(folder / "outside"))
    renewing.set_policy()
    cases = [Stored(store, renewing, appliances[name], name, case) for name, case in recorded]
    records_are_begun_with_one_time_stamp(renewing, cases)
    a_time_stamp_is_renewed_before_it_ends(renewing, cases, folder)
    what_an_appliance_renews_stays_beside(renewing, cases, appliances["or-1"])
    two_workers_share_the_cases(renewing, set(recorded))
    a_store_that_is_away_is_waited_for(renewing, store)
    nothing_is_kept_from_renewal(renewing, cases, [*"psql -qtA -v ON_ERROR_STOP=1 -d".split(), connection])
    a_new_hash_reads_all_data_again(renewing, cases, Disks(folder / "ceph"))


def main():
    def run(programs, folder, endpoint, connection):
        store = Store(endpoint)
        store.make_bucket(BUCKET)
        try_everything(programs, folder, store, connection)

    if shutil.which("rados") is None:
        print("SKIPPED: rados is not installed")
        sys.exit(77)
    with_store_and_postgres(run)
    print("Records of stored cases are renewed, and whoever fetches a case gets the one that counts.")


if __name__ == "__main__":
    main()
