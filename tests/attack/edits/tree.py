"""A folder held in memory, so that an edit is a change of a dictionary and two folders can be compared node by node."""
import contextlib
import os
import pathlib
import shutil
import socket
import stat


class Tree(dict):
    """Paths below the folder to bytes, or to one of the nodes below. A path may begin with `../`."""

    def copy(self):
        return Tree(self)

    def files(self):
        return sorted(path for path, node in self.items() if isinstance(node, bytes))

    def folders(self):
        above = {str(parent) for path in self for parent in pathlib.PurePosixPath(path).parents}
        return sorted((above | {path for path, node in self.items() if node is FOLDER}) - {".", ".."})

    def below(self, folder):
        return sorted(path for path in self if path.startswith(folder + "/"))

    def remove(self, path):
        """A file, or a folder with what is in it."""
        for each in [path, *self.below(path)]:
            self.pop(each, None)


class _Kind:
    def __init__(self, name):
        self.name = name

    def __repr__(self):
        return self.name


FOLDER, FIFO, SOCKET = _Kind("a folder"), _Kind("a FIFO"), _Kind("a socket")


class Link(str):
    """A symbolic link to this text."""


class Second(str):
    """A second name of the file at this path."""


class Hole(int):
    """A file of so many bytes that takes no room."""


def read(folder, beside=()):
    """The Tree of a folder on the disk; `beside` are paths of files that begin with `../`."""
    folder, tree = pathlib.Path(folder), Tree()
    for path in sorted(folder.rglob("*")):
        tree[str(path.relative_to(folder))] = path.read_bytes() if path.is_file() else FOLDER
    for path in beside:
        tree[path] = (folder / path).read_bytes()
    return tree


def write(tree, folder):
    """Makes the folder; what is in the way was removed by remove()."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    later = []
    for path, node in tree.items():
        at = folder / path
        if node is FOLDER:
            at.mkdir(parents=True, exist_ok=True)
            continue
        at.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(node, bytes):
            at.write_bytes(node)
        elif isinstance(node, Link):
            at.symlink_to(node)
        elif isinstance(node, Second):
            later.append((folder / node, at))
        elif isinstance(node, Hole):
            with open(at, "wb") as file:
                file.truncate(node)
        elif node is FIFO:
            os.mkfifo(at)
        elif node is SOCKET:
            where = os.getcwd()
            os.chdir(at.parent)  # a socket's path has 108 bytes at most
            with contextlib.closing(socket.socket(socket.AF_UNIX)) as made:
                made.bind(at.name)
            os.chdir(where)
    for first, second in later:
        if first.is_file():
            os.link(first, second)


def remove(folder):
    """All of it, whatever was put there; no link is followed."""
    if not os.path.lexists(folder):
        return
    if stat.S_ISDIR(os.lstat(folder).st_mode):
        shutil.rmtree(folder)
    else:
        os.unlink(folder)
