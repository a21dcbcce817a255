// Anything that an authority, a client or a file may hand to the RFC 3161 code: parsing must end, and nothing
// may be found valid that nobody vouches for.
#include <cstdint>
#include <cstdlib>

#include "timestamp/request.h"
#include "timestamp/token.h"
#include "timestamp/token_verifier.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const ByteView bytes = std::as_bytes(std::span(data, size));

  const auto request = timestamp::parse_request(bytes);
  require(request.request.has_value() != request.failure.has_value());
  if (request.request) {
    const auto again = timestamp::parse_request(timestamp::encode_request(*request.request));
    require(again.request && again.request->imprint == request.request->imprint &&
            again.request->nonce == request.request->nonce &&
            again.request->policy == request.request->policy);
  }

  std::string why;
  const auto response = timestamp::parse_response(bytes, why);
  require(response || !why.empty());
  if (response && !response->token.empty()) timestamp::parse_token_info(response->token, why);

  static const timestamp::TrustStore kNobody;
  const auto judgement = timestamp::judge_token(bytes, {}, kNobody);
  require(judgement.code != timestamp::TokenCode::kValid && !judgement.explanation.empty());
  return 0;
}
