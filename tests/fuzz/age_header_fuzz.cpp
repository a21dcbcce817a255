// Whatever calls itself an age file: parsing must end in an answer or an AgeError, and what was parsed must
// be exactly what was there.
#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "crypto/age_file.h"
#include "crypto/age_header.h"

namespace {

using namespace kiroku;          // NOLINT(google-build-using-namespace)
using namespace kiroku::crypto;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

void check_header(ByteView bytes) {
  try {
    const auto header = parse_age_header(bytes);
    if (!header) return;
    require(header->size <= bytes.size() && !header->stanzas.empty());
    // There is one way to write these stanzas, and this was it.
    const Bytes again = write_age_header(header->stanzas, Secret(kFileKeySize));
    require(again.size() == header->size);
    require(std::ranges::equal(header->authenticated_text,
                               ByteView(again).first(header->authenticated_text.size())));
    require(std::ranges::equal(header->authenticated_text, bytes.first(header->authenticated_text.size())));
    require(!parse_age_header(bytes.first(header->size - 1)));
  } catch (const AgeError&) {
  }
}

// Opening never succeeds: the key is new in each run, so nothing was sealed to it.
void check_opening(ByteView bytes) {
  static const AgeKeyPair kStranger = generate_age_key();
  static const AgeIdentities kIdentities = {parse_identity(kStranger.identity_text.text()),
                                            passphrase_identity(Secret::copy_of("not the one"), 4)};
  const auto source = memory_source(bytes);
  for (const auto truncation : {Truncation::kRefuse, Truncation::kTolerate}) {
    try {
      static_cast<void>(AgeFile::open(*source, kIdentities, truncation));
      require(false);
    } catch (const AgeError&) {
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const ByteView bytes = std::as_bytes(std::span(data, size));
  check_header(bytes);
  check_opening(bytes);
  return 0;
}
