"""The Merkle tree of RFC 6962 (SHA-256) and its proofs."""
import hashlib


def leaf(data):
    return hashlib.sha256(b"\0" + data).digest()


def node(left, right):
    return hashlib.sha256(b"\1" + left + right).digest()


def root(leaves):
    """The root over hashes of leaves."""
    if not leaves:
        return hashlib.sha256(b"").digest()
    level = list(leaves)
    while len(level) > 1:  # pairs are joined, an odd last one goes up as it is: the same tree as RFC 6962's split
        level = [node(level[i], level[i + 1]) if i + 1 < len(level) else level[i] for i in range(0, len(level), 2)]
    return level[0]


def _split(size):
    """The largest power of two below `size`."""
    return 1 << (size - 1).bit_length() - 1


def inclusion(leaves, index):
    """RFC 6962, 2.1.1: the audit path of one leaf, the lowest sibling first."""
    if len(leaves) == 1:
        return []
    k = _split(len(leaves))
    if index < k:
        return inclusion(leaves[:k], index) + [root(leaves[k:])]
    return inclusion(leaves[k:], index - k) + [root(leaves[:k])]


def root_by_inclusion(leaf_hash, index, size, path):
    """The root that an audit path leads to; None where the path has another length than it must have."""
    if size == 1:
        return leaf_hash if not path and index == 0 else None
    if not path or index >= size:
        return None
    k = _split(size)
    if index < k:
        below = root_by_inclusion(leaf_hash, index, k, path[:-1])
        return below and node(below, path[-1])
    below = root_by_inclusion(leaf_hash, index - k, size - k, path[:-1])
    return below and node(path[-1], below)


def root_behind(left, first, leaves):
    """The root over `first` leaves, of which the complete subtrees `left` are known (the largest first), and `leaves`."""
    stack = list(zip([1 << bit for bit in range(first.bit_length() - 1, -1, -1) if first >> bit & 1], left))
    for each in leaves:
        stack.append((1, each))
        while len(stack) > 1 and stack[-1][0] == stack[-2][0]:
            size, right = stack.pop()
            stack[-1] = (2 * size, node(stack[-1][1], right))
    made = stack.pop()[1]
    while stack:
        made = node(stack.pop()[1], made)
    return made


def consistent(old, old_root, new, new_root, proof):
    """RFC 9162, 2.1.4.2: whether a consistency proof holds from a tree of `old` leaves to one of `new`."""
    if old == new:
        return not proof and old_root == new_root
    path = ([old_root] if old & (old - 1) == 0 else []) + list(proof)
    if not 0 < old < new or not path:
        return False
    low, high = old - 1, new - 1
    while low & 1:
        low, high = low >> 1, high >> 1
    made_old = made_new = path[0]
    for each in path[1:]:
        if high == 0:
            return False
        if low & 1 or low == high:
            made_old, made_new = node(each, made_old), node(each, made_new)
            while low and not low & 1:
                low, high = low >> 1, high >> 1
        else:
            made_new = node(made_new, each)
        low, high = low >> 1, high >> 1
    return high == 0 and made_old == old_root and made_new == new_root


def consistency(leaves, old):
    """RFC 9162, 2.1.4.1: the proof from the tree of the first `old` leaves to that of all."""
    def proof(size, part, whole):
        if size == len(part):
            return [] if whole else [root(part)]
        k = _split(len(part))
        if size <= k:
            return proof(size, part[:k], whole) + [root(part[k:])]
        return proof(size - k, part[k:], False) + [root(part[:k])]
    return proof(old, leaves, True)


def subtrees(leaves):
    """The roots of the largest complete subtrees over the leaves, left to right."""
    found, at = [], 0
    for bit in range(len(leaves).bit_length() - 1, -1, -1):
        if len(leaves) >> bit & 1:
            found.append(root(leaves[at:at + (1 << bit)]))
            at += 1 << bit
    return found
