#!/usr/bin/env python3
"""Signs a case's changed ledger as whoever holds its device's key and may ask its authority can.

Usage: sign_anew.py CASE HOME

Of the tokens only those that the ledger still enters are kept, with their checkpoints. A checkpoint over all lines
follows, a token over it by the home's own authority, its entry, and the last checkpoint.
"""
import base64
import datetime
import hashlib
import json
import os
import re
import subprocess
import sys

case, home = sys.argv[1:]
with open(f'{case}/ledger.jsonl', 'rb') as ledger:
    lines = ledger.read().splitlines()
device, key_id = json.loads(lines[0])['device'].split('+')[:2]


def openssl(*arguments, given=b''):
    return subprocess.run(['openssl', *arguments], input=given, capture_output=True, check=True).stdout


def root(leaves):
    if len(leaves) == 1:
        return leaves[0]
    split = 1
    while 2 * split < len(leaves):
        split *= 2
    return hashlib.sha256(b'\1' + root(leaves[:split]) + root(leaves[split:])).digest()


def write_checkpoint():
    tree = base64.b64encode(root([hashlib.sha256(b'\0' + line).digest() for line in lines])).decode()
    text = f'kiroku/{device}/{json.loads(lines[0])["case"]}\n{len(lines)}\n{tree}\n'
    with open(f'{home}/signed', 'w', encoding='utf-8') as signed:
        signed.write(text)
    signature = openssl('pkeyutl', '-sign', '-rawin', '-inkey', f'{home}/device.key', '-in', f'{home}/signed')
    signature = base64.b64encode(bytes.fromhex(key_id) + signature).decode()
    name = f'{case}/checkpoints/{len(lines):08d}.note'
    with open(name, 'w', encoding='utf-8') as note:
        note.write(f'{text}\n\u2014 {device} {signature}\n')
    return name


def token_over(note, name):
    with open(f'{home}/tsa.conf', 'w', encoding='utf-8') as settings:
        settings.write(f'[ts]\nserial = {home}/tsa.serial\nsigner_cert = {home}/authority/tsa.pem\n'
                       f'signer_key = {home}/authority/tsa.key\ncerts = {home}/authority/ca.pem\nsigner_digest = sha256\n'
                       'default_policy = 1.2.3.4\ndigests = sha256\nclock_precision_digits = 6\n'
                       'ess_cert_id_alg = sha256\n')
    query = openssl('ts', '-query', '-data', note, '-sha256', '-cert')
    with open(f'{home}/query', 'wb') as asked:
        asked.write(query)
    token = openssl('ts', '-reply', '-config', f'{home}/tsa.conf', '-section', 'ts', '-queryfile', f'{home}/query')
    with open(f'{case}/{name}', 'wb') as response:
        response.write(token)
    told = openssl('ts', '-reply', '-in', f'{case}/{name}', '-text').decode()
    stated = re.search(r'Time stamp: (\w+ +\d+ [\d:]+)(\.\d+)? (\d+)', told)
    when = datetime.datetime.strptime(f'{stated[1]} {stated[3]}', '%b %d %H:%M:%S %Y')
    serial = re.search(r'Serial number: 0x([0-9A-F]+)', told)[1].lower().lstrip('0')
    return token, f'{when:%Y-%m-%dT%H:%M:%S}{(stated[2] or ".0").ljust(7, "0")}Z', serial


entries = [json.loads(line) for line in lines]
kept = {os.path.basename(each['file']) for each in entries if each['type'] == 'token'}
for folder in 'tokens', 'checkpoints':
    for found in os.listdir(f'{case}/{folder}'):
        if not any(name.startswith(found.split('.')[0]) for name in kept):
            os.remove(f'{case}/{folder}/{found}')
path = f'tokens/{len(lines):08d}.embedded.tsr'
response, gen_time, number = token_over(write_checkpoint(), path)
last = entries[-1]
lines.append(json.dumps({
    'type': 'token', 'seq': len(lines), 'utc': last['utc'], 'mono_ns': last['mono_ns'], 'checkpoint': len(lines),
    'authority': 'embedded', 'file': path, 'sha256': hashlib.sha256(response).hexdigest(), 'gen_time': gen_time,
    'accuracy_ns': 0, 'serial': number}, separators=(',', ':')).encode())
write_checkpoint()
with open(f'{case}/ledger.jsonl', 'wb') as ledger:
    ledger.write(b'\n'.join(lines) + b'\n')
