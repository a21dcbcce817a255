#include "light/light_code.h"

#include <string>

#include "base/bytes.h"
#include "crypto/encoding.h"

namespace kiroku::light {

std::uint64_t light_code(std::uint64_t entries, const crypto::Sha256Digest& root, std::int64_t second) {
  const std::string text = "kiroku-light/1\n" + std::to_string(entries) + "\n" + crypto::to_hex(root) + "\n" +
                           std::to_string(second) + "\n";
  const crypto::Sha256Digest digest = crypto::sha256(bytes_of(text));
  std::uint64_t first = 0;
  for (std::size_t i = 0; i < sizeof first; ++i)
    first = first << 8U | std::to_integer<std::uint64_t>(digest[i]);
  return first >> (64U - kCodeBits);
}

bool is_bright(std::uint64_t code, int row, int column) {
  const int place = row * kColumns + column;
  const bool second_half = place >= kCodeBits;
  const int bit = second_half ? kCells - 1 - place : place;
  return ((code >> static_cast<unsigned>(kCodeBits - 1 - bit)) & 1U) != (second_half ? 1U : 0U);
}

}  // namespace kiroku::light
