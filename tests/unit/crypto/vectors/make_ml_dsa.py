#!/usr/bin/env python3
"""Writes ml_dsa.txt, the compact form of published vectors that ml_dsa_vectors_test.cpp reads.

Usage: make_ml_dsa.py WYCHEPROOF ACVP > ml_dsa.txt
  WYCHEPROOF  folder with mldsa_44_sign_seed_test.json and its kin (C2SP/wycheproof, testvectors_v1)
  ACVP        folder with keygen.json, siggen.json, sigver.json: the files internalProjection.json of
              usnistgov/ACVP-Server, gen-val/json-files/ML-DSA-{keyGen,sigGen,sigVer}-FIPS204, at 65370b8

What an implementation computes stands as its SHA-256. What it gets stands whole, once: a signature that the
sign vectors make is named by its case, one that differs in few bytes from another by the difference.
"""
import base64
import hashlib
import json
import pathlib
import sys

FEW = 200  # bytes that differ, in what is written as a difference


def sha256(hex_text):
    return hashlib.sha256(bytes.fromhex(hex_text)).hexdigest()


class Blobs:
    """Byte strings that were written, and how later ones refer to them."""

    def __init__(self):
        self.known = []

    def reference(self, value):
        """A word for `value`; a line "blob" is written before if it is needed."""
        if not value:
            return "-"
        if len(value) <= 160:
            return value.hex()
        for number, other in enumerate(self.known):
            if len(other) != len(value):
                continue
            places = [i for i, (a, b) in enumerate(zip(other, value)) if a != b]
            if len(places) <= FEW:
                return "#" + str(number) + "".join(f",{i}:{value[i]:02x}" for i in places)
        self.known.append(value)
        print("blob", base64.b64encode(value).decode())
        return "#" + str(len(self.known) - 1)


def wycheproof(folder, blobs):
    for level in ("44", "65"):
        signed = {}  # by signature: the seed's case that makes it
        seeds = {}  # by public key
        files = [json.loads((folder / f"mldsa_{level}_{kind}_test.json").read_text()) for kind in ("sign_seed", "sign_noseed", "verify")]
        for group in files[0]["testGroups"]:
            for test in group["tests"]:
                seed = group["privateSeed"]
                if len(seed) == 64:
                    seeds[group["publicKey"]] = seed
                    if test["result"] == "valid" and "msg" in test and "rnd" not in test:
                        signed[test["sig"]] = test["tcId"]
                print("sign", level, test["tcId"], test["result"], "seed", blobs.reference(bytes.fromhex(seed)),
                      sha256(group["publicKey"] or ""), *signing(test, blobs))
        for group in files[1]["testGroups"]:
            key = bytes.fromhex(group["privateKey"])
            seed = seeds.get(group.get("publicKey"))
            for test in group["tests"]:
                # A key whose seed is known is expanded from it, and its hash shows that it is this one.
                word = "expand:" + seed if seed else blobs.reference(key)
                print("sign", level, test["tcId"], test["result"], "key", word, sha256(group["privateKey"]), *signing(test, blobs))
        for group in files[2]["testGroups"]:
            public = group["publicKey"]
            for test in group["tests"]:
                signature = "case:" + str(signed[test["sig"]]) if test["sig"] in signed else blobs.reference(bytes.fromhex(test["sig"]))
                print("verify", level, test["tcId"], test["result"],
                      "seed:" + seeds[public] if public in seeds else blobs.reference(bytes.fromhex(public)),
                      blobs.reference(bytes.fromhex(test["msg"])), blobs.reference(bytes.fromhex(test.get("ctx", ""))), signature)


def signing(test, blobs):
    """Randomness, what is signed, the context, and the signature's hash."""
    what = "mu:" + test["mu"] if "msg" not in test else blobs.reference(bytes.fromhex(test["msg"]))
    return (test.get("rnd") or "-", what, blobs.reference(bytes.fromhex(test.get("ctx", ""))),
            sha256(test["sig"]) if test["result"] == "valid" else "-")


def acvp(folder, blobs):
    # All keys; of signatures the two of each group that have the shortest messages; all that are verified.
    for group in json.loads((folder / "keygen.json").read_text())["testGroups"]:
        if group["parameterSet"] != "ML-DSA-87":
            for test in group["tests"]:
                print("acvp-key", group["parameterSet"][-2:], test["tcId"], test["seed"].lower(), sha256(test["pk"]), sha256(test["sk"]))
    for group in json.loads((folder / "siggen.json").read_text())["testGroups"]:
        if group["parameterSet"] != "ML-DSA-87":
            for test in sorted(group["tests"], key=lambda test: len(test["message"]))[:2]:
                print("acvp-sign", group["parameterSet"][-2:], test["tcId"], blobs.reference(bytes.fromhex(test["sk"])),
                      blobs.reference(bytes.fromhex(test["message"])), test.get("rnd", "-").lower(), sha256(test["signature"]))
    for group in json.loads((folder / "sigver.json").read_text())["testGroups"]:
        if group["parameterSet"] != "ML-DSA-87":
            for test in group["tests"]:
                print("acvp-verify", group["parameterSet"][-2:], test["tcId"], "valid" if test["testPassed"] else "invalid",
                      blobs.reference(bytes.fromhex(group["pk"])), blobs.reference(bytes.fromhex(test["message"])),
                      blobs.reference(bytes.fromhex(test["signature"])))


def main():
    blobs = Blobs()
    wycheproof(pathlib.Path(sys.argv[1]), blobs)
    acvp(pathlib.Path(sys.argv[2]), blobs)


if __name__ == "__main__":
    main()
