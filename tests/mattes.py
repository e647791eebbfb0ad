#!/usr/bin/env python3
"""Decodes the Cryptomattes of an EXR file without any of our code: tests/mattes.py FILE.exr

Needs numpy and OpenEXR 3.3 or newer (pip install numpy OpenEXR). Hashes every name of the manifests again, looks for ids that no
manifest knows, and compares the sum of all mattes with alpha. Exit code 1 when something does not agree."""

import json
import sys

import numpy as np
import OpenEXR


def murmur3(data):
    """MurmurHash3_x86_32, seed 0."""
    mask = 0xFFFFFFFF

    def scramble(k):
        k = k * 0xCC9E2D51 & mask
        return ((k << 15 | k >> 17) & mask) * 0x1B873593 & mask

    h = 0
    whole = len(data) // 4 * 4
    for at in range(0, whole, 4):
        h ^= scramble(int.from_bytes(data[at : at + 4], "little"))
        h = ((h << 13 | h >> 19) & mask) * 5 + 0xE6546B64 & mask
    h ^= scramble(int.from_bytes(data[whole:], "little")) ^ len(data)
    h = (h ^ h >> 16) * 0x85EBCA6B & mask
    h = (h ^ h >> 13) * 0xC2B2AE35 & mask
    return h ^ h >> 16


def bits(name):
    """The id of a name, as the bits of a float."""
    h = murmur3(name.encode())
    return h ^ 1 << 23 if h >> 23 & 255 in (0, 255) else h


file = OpenEXR.File(sys.argv[1], separate_channels=True)
header, channels = file.header(), file.channels()
alpha = channels["A"].pixels
wrong = 0
for attribute, layer in header.items():
    if not (attribute.startswith("cryptomatte/") and attribute.endswith("/name")):
        continue
    key = attribute.split("/")[1]
    manifest = json.loads(header[f"cryptomatte/{key}/manifest"])
    misnamed = [name for name, value in manifest.items() if int(value, 16) != bits(name)]
    total, mattes = np.zeros_like(alpha), {}
    for pair in range(3):
        for first, second in ("rg", "ba"):
            ids = channels[f"{layer}{pair:02}.{first}"].pixels.astype(np.float32).view(np.uint32)
            share = channels[f"{layer}{pair:02}.{second}"].pixels
            total += share
            for one in np.unique(ids[share > 0]):
                mattes[one] = mattes.get(one, 0) + np.where(ids == one, share, 0)
    names = {int(value, 16): name for name, value in manifest.items()}
    unknown = [one for one in mattes if int(one) not in names]
    off = float(np.abs(total - alpha).max())
    print(f"{layer}: {len(manifest)} names, {len(unknown)} unknown ids, {len(misnamed)} wrong hashes, max |sum - alpha| {off:.1e}")
    for share, name in sorted(((m.mean(), names.get(int(one), "?")) for one, m in mattes.items()), reverse=True)[:5]:
        print(f"    {100 * share:5.1f} %  {name}")
    wrong += len(unknown) + len(misnamed) + (off > 1e-5)
sys.exit(1 if wrong else 0)
