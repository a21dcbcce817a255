// What a log may have as a quote of the boot by a TPM, and as its attestation key, as a stranger may have
// written them. What is accepted is small, and names each register once.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "crypto/tpm_quote.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const ByteView bytes = std::as_bytes(std::span(data, size));
  std::string problem;
  const auto quote = crypto::parse_tpm_quote(bytes, problem);
  require(quote.has_value() == problem.empty());
  if (quote) {
    require(quote->qualified_signer.size() <= 66 && quote->qualifying_data.size() <= 66);
    for (std::size_t i = 0; i < quote->pcrs.size(); ++i) {
      require(quote->pcrs[i] < crypto::kPcrs && (i == 0 || quote->pcrs[i - 1] < quote->pcrs[i]));
    }
  }
  problem.clear();
  const auto key = crypto::parse_attestation_key(bytes, problem);
  require(key.has_value() == problem.empty());
  require(!key || crypto::is_p256_public_key(key->key));
  // A quote and its key in one: behind the first byte, which says where the key begins.
  if (size > 0) {
    const std::size_t at = std::min<std::size_t>(1U + data[0], size);
    crypto::BootAttester::Quote asked{to_bytes(bytes.subspan(at)), to_bytes(bytes.first(at)), {{4, {}}}};
    require(!crypto::why_no_quote(asked, bytes.subspan(1, at - 1), {}).empty());
  }
  return 0;
}
