// Evidence records that anybody may lay beside a case: reading ends, what is read is written back byte for
// byte, and nothing that nobody vouches for holds.
#include <cstdint>
#include <cstdlib>

#include "evidence/record_verifier.h"
#include "evidence/shared_token.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const ByteView bytes = std::as_bytes(std::span(data, size));
  const evidence::SharedTokenParse shared = evidence::parse_shared_token(bytes);
  require(shared.shared.has_value() == shared.explanation.empty());
  if (shared.shared) {
    require(evidence::begins_as_record(bytes));
    constexpr auto kHash = crypto::HashAlgorithm::kSha256;
    const auto imprint = shared.shared->imprint_for(crypto::digest(kHash, bytes_of("a note")));
    require(!imprint || imprint->size() == crypto::digest(kHash, {}).size());
  }
  const evidence::RecordParse parse = evidence::parse_record(bytes);
  require(parse.record.has_value() == parse.explanation.empty());
  if (!parse.record) return 0;
  require(evidence::encode_record(*parse.record) == to_bytes(bytes));

  static const std::vector<evidence::DataObject> kObjects{
      {"data", [](crypto::HashAlgorithm algorithm) {
         return std::optional(crypto::digest(algorithm, bytes_of("content of data object DO-01")));
       }}};
  const evidence::RecordJudgement judgement =
      evidence::judge_record(*parse.record, kObjects, {.now = UtcTime(std::chrono::hours(500'000))});
  require(judgement.standing() != evidence::Standing::kHolds && !judgement.outside());
  for (const evidence::Problem& problem : judgement.problems) {
    require(!problem.code.empty() && !problem.text.empty());
  }
  return 0;
}
