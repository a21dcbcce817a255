// Which of several known keys signed a note that holds: keys of several devices may have one name. A
// function; pure and thread-safe.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "crypto/signed_note.h"

namespace kiroku::crypto {

/// Places in `keys`, in their order, of those by which a line of the note is. open_note() with these keys
/// tells whether their signatures hold.
std::vector<std::size_t> signers_among(std::string_view note, const std::vector<VerifierKey>& keys);

}  // namespace kiroku::crypto
