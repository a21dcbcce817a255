// The code that a display in the room shows in one second (docs/reference/light.md). It is made of the ledger
// alone, so that it cannot be known before the newest entry is, and anybody can make it again later. Pure
// functions, thread-safe.
#pragma once

#include <cstdint>

#include "crypto/hash.h"

namespace kiroku::light {

/// Cells between the bright frame of the picture: kRows x kColumns, of which a half carries kCodeBits.
inline constexpr int kRows = 7, kColumns = 14;
inline constexpr int kCells = kRows * kColumns, kCodeBits = kCells / 2;
inline constexpr std::uint64_t kCodeMask = (std::uint64_t{1} << kCodeBits) - 1;

/// Of the second `second` (Unix time) while the ledger has `entries` lines, whose tree (RFC 6962) has the
/// root `root`: the first 49 bits of SHA-256 over "kiroku-light/1\n<entries>\n<root in hex>\n<second>\n", the
/// first bit highest.
std::uint64_t light_code(std::uint64_t entries, const crypto::Sha256Digest& root, std::int64_t second);

/// Whether a cell is bright. Cell (row, column) of the first kCodeBits in reading order carries the bit of
/// that number; the cell at the other side of the picture's centre carries its opposite. So whatever covers
/// one side of a line through the centre leaves each bit once, and a code upside down reads as its
/// complement.
bool is_bright(std::uint64_t code, int row, int column);

}  // namespace kiroku::light
