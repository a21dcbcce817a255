#!/usr/bin/env python3
"""Who cosigned a checkpoint (C2SP tlog-cosignature), by Ed25519 or ML-DSA-44.

Usage: cosignature.py NOTE POLICY
  NOTE    a checkpoint that witnesses cosigned, such as witnessed/log.note of a home
  POLICY  a policy of witnesses (C2SP tlog-policy); only its lines "witness NAME KEY" are read

Prints a line for each witness: "NAME cosigned TIME", in seconds since 1970, "NAME invalid" or "NAME absent".
"""
import base64
import hashlib
import pathlib
import struct
import sys

import ml_dsa
import note

ED25519, ML_DSA_44 = 0x04, 0x06


def parse_key(text):
    """The name, the key's hash, the algorithm and the key; raises note.Malformed."""
    parts = text.split("+", 2)
    if len(parts) != 3:
        raise note.Malformed("no witness's key")
    data = note.from_base64(parts[2])
    if (data[:1], len(data)) not in ((bytes([ED25519]), 33), (bytes([ML_DSA_44]), 1 + ml_dsa.ML_DSA_44.key_bytes)):
        raise note.Malformed("no key of a known algorithm")
    identifier = hashlib.sha256(parts[0].encode() + b"\n" + data).digest()[:4]
    if identifier.hex() != parts[1]:
        raise note.Malformed("the key's hash is another")
    return parts[0], identifier, data[0], data[1:]


def check(checkpoint, key):
    """The time of a cosignature that holds; 0 where it does not; None where there is none."""
    name, identifier, algorithm, public = key
    for signer, signer_identifier, timed in checkpoint.signatures:
        if (signer, signer_identifier) != (name, identifier):
            continue
        time, signature = int.from_bytes(timed[:8], "big"), timed[8:]
        if not 0 < time < 1 << 63:
            return 0
        if algorithm == ED25519:
            holds = len(signature) == 64 and note.holds(public, b"cosignature/v1\ntime %d\n" % time + checkpoint.text, signature)
        else:
            origin, cosigner = checkpoint.origin.encode(), name.encode()
            if len(origin) > 255 or len(cosigner) > 255:
                return 0
            message = b"".join((b"subtree/v1\n\x00", bytes([len(cosigner)]), cosigner, struct.pack(">Q", time), bytes([len(origin)]), origin,
                                struct.pack(">QQ", 0, checkpoint.size), checkpoint.root))
            holds = ml_dsa.verify(ml_dsa.ML_DSA_44, public, message, signature)
        return time if holds else 0
    return None


def key_of(witness):
    """The line of a policy that names a witness's Ed25519 key."""
    data = bytes([ED25519]) + witness.key.public
    identifier = hashlib.sha256(witness.name.encode() + b"\n" + data).digest()[:4]
    return f"{witness.name}+{identifier.hex()}+{base64.b64encode(data).decode()}"


def cosigned(signed, witness, time):
    """A signed checkpoint with the cosignature of a witness, a note.Signer, by its Ed25519 key."""
    identifier = parse_key(key_of(witness))[1]
    signature = witness.sign(b"cosignature/v1\ntime %d\n" % time + signed.partition(b"\n\n")[0] + b"\n")
    return signed + f"\u2014 {witness.name} {base64.b64encode(identifier + struct.pack('>Q', time) + signature).decode()}\n".encode()


def main():
    checkpoint = note.parse_checkpoint(pathlib.Path(sys.argv[1]).read_bytes())
    for line in pathlib.Path(sys.argv[2]).read_text(encoding="utf-8").splitlines():
        words = line.split()
        if words[:1] == ["witness"]:
            key = parse_key(words[2])
            time = check(checkpoint, key)
            print(key[0], "absent" if time is None else f"cosigned {time}" if time else "invalid")


if __name__ == "__main__":
    main()
