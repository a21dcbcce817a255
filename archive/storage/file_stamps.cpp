#include "archive/storage/file_stamps.h"

#include <algorithm>

#include "base/error.h"
#include "crypto/byte_source.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kLargestToken = std::uint64_t{1} << 20;

Bytes read_token(const fs::path& token) {
  const auto source = crypto::open_file_source(token);
  if (source->size() > kLargestToken) throw Error(token.string() + " is too large for a time-stamp");
  Bytes bytes(source->size());
  bytes.resize(source->read_at(0, bytes));
  return bytes;
}

Check check_token(const fs::path& token, const std::string& authority, const crypto::Sha256Digest& digest,
                  const timestamp::TrustStore& trust) {
  using Answer = Check::Answer;
  const timestamp::TokenJudgement judgement =
      timestamp::judge_token(read_token(token), expectation_of(digest), trust);
  const std::string name = token.filename().string();
  Check check{"time", Answer::kUnknown, name + ": " + judgement.explanation};
  check.by = authority;
  switch (timestamp::verdict_of(judgement.code)) {
    case timestamp::TokenVerdict::kValid:
      check.answer = Answer::kHolds;
      check.time = judgement.info->gen_time;
      check.kind = timestamp::authority_kind_name(judgement.authority);
      check.text = "existed at " + format_utc(judgement.info->gen_time) + ", says " + name + " (" +
                   judgement.root_subject + ")";
      if (judgement.authority == timestamp::TimeAuthority::kOwn)
        check.text += "; self-issued: by the recorder's own authority, no outside clock stands behind it";
      break;
    case timestamp::TokenVerdict::kRefused:
      check.answer = Answer::kDiffers;
      break;
    case timestamp::TokenVerdict::kCouldNotCheck:
      break;
  }
  return check;
}

/// "liver.seal." of liver.seal.json.
std::string stem_of(const fs::path& file) { return file.stem().string() + "."; }

}  // namespace

timestamp::Expectation expectation_of(const crypto::Sha256Digest& digest) {
  timestamp::Expectation expectation;
  expectation.algorithm = crypto::HashAlgorithm::kSha256;
  expectation.imprint = Bytes(digest.begin(), digest.end());
  return expectation;
}

fs::path token_beside(const fs::path& file, const std::string& authority) {
  fs::path token = file;
  return token.replace_extension("." + authority + ".tsr");
}

std::vector<fs::path> tokens_beside(const fs::path& file) {
  const std::string stem = stem_of(file);
  std::vector<fs::path> tokens;
  std::error_code failed;
  for (const auto& entry :
       fs::directory_iterator(file.has_parent_path() ? file.parent_path() : ".", failed)) {
    // Names of authorities have no dots: liver.seal.embedded.tsr is not about liver.json.
    if (entry.path().extension() == ".tsr" && entry.path().filename().string().starts_with(stem) &&
        entry.path().stem().string().size() > stem.size() &&
        entry.path().stem().string().find('.', stem.size()) == std::string::npos)
      tokens.push_back(entry.path());
  }
  std::ranges::sort(tokens);
  return tokens;
}

std::vector<Check> check_tokens_beside(const fs::path& file, const crypto::Sha256Digest& digest,
                                       const timestamp::TrustStore& trust) {
  std::vector<Check> checks;
  for (const fs::path& token : tokens_beside(file))
    checks.push_back(check_token(token, token.stem().extension().string().substr(1), digest, trust));
  if (checks.empty()) {
    checks.push_back(
        {"time", Check::Answer::kUnknown, "there is no time-stamp beside " + file.filename().string()});
  }
  return checks;
}

}  // namespace kiroku::archive
