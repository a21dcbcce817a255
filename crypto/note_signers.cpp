#include "crypto/note_signers.h"

#include <algorithm>

#include "crypto/note_format.h"

namespace kiroku::crypto {

std::vector<std::size_t> signers_among(std::string_view note, const std::vector<VerifierKey>& keys) {
  const std::vector<SignatureLine> lines = parse_note(note).lines;
  std::vector<std::size_t> signers;
  for (std::size_t place = 0; place < keys.size(); ++place) {
    const bool has_line = std::ranges::any_of(lines, [&](const SignatureLine& line) {
      return line.name == keys[place].name() && line.key_id == keys[place].key_id();
    });
    if (has_line) signers.push_back(place);
  }
  return signers;
}

}  // namespace kiroku::crypto
