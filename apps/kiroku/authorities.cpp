#include "apps/kiroku/authorities.h"

#include <algorithm>

#include "apps/common/command_line.h"
#include "base/error.h"
#include "crypto/hash.h"
#include "crypto/secret.h"
#include "fleet/reports/shared_stamp_client.h"
#include "timestamp/request.h"

namespace kiroku::apps {
namespace {

std::string names_of(const Configuration& configuration) {
  std::string out;
  for (const auto& authority : configuration.authorities) out += (out.empty() ? "" : ", ") + authority.name;
  return out;
}

/// In the place of one that cannot be opened: what it does not stamp is missed, and wanted later.
class UnusableAuthority final : public timestamp::StampSource {
 public:
  explicit UnusableAuthority(std::string why) : why_(std::move(why)) {}
  Bytes ask(ByteView /*query*/) override { throw timestamp::AuthorityError(why_); }

 private:
  std::string why_;
};

}  // namespace

Authorities::Authorities(const Home& home, const Configuration& configuration,
                         const std::vector<std::string>& wanted, const TellWithout& without) {
  const auto& all = configuration.authorities;
  if (all.empty()) {
    throw UsageError(
        home.configuration_file().string() +
        " names no time-stamping authority, so that nothing could prove when a case existed: add an "
        "[[authority]]");
  }
  for (const std::string& name : wanted) {
    if (std::none_of(all.begin(), all.end(), [&](const auto& authority) { return authority.name == name; })) {
      throw UsageError("no authority is named '" + name + "' in " + home.configuration_file().string() +
                       "; there are: " + names_of(configuration));
    }
  }
  for (const AuthorityConfiguration& authority : all) {
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), authority.name) == wanted.end()) continue;
    if (!authority.is_embedded()) {
      recorder::BackOffPolicy pauses;
      pauses.min_interval = authority.min_interval;
      named_.push_back({authority.name, timestamp::http_stamp_source(authority.paths), pauses});
      if (!authority.shared) continue;
      named_.back().shared =
          std::make_shared<fleet::SharedStampClient>(home.reporting_file(), authority.name);
      named_.back().shared_patience = authority.shared_patience;
      continue;
    }
    named_.push_back({authority.name, embedded_source(home, without)});
  }
}

std::shared_ptr<timestamp::StampSource> Authorities::embedded_source(const Home& home,
                                                                     const TellWithout& without) {
  try {
    if (!embedded_) {
      embedded_ = std::make_unique<timestamp::Authority>(timestamp::Authority::open(home.authority_folder()));
    }
    return timestamp::embedded_stamp_source(*embedded_);
  } catch (const Error& error) {
    if (!without) throw;
    const std::string why = std::string("the embedded authority cannot be used: ") + error.what();
    without(why);
    return std::make_shared<UnusableAuthority>(why);
  }
}

timestamp::TokenJudgement ask_for_time(const recorder::NamedAuthority& authority,
                                       const timestamp::TrustStore& trust) {
  Bytes imprint(crypto::hash_size(crypto::HashAlgorithm::kSha256));
  crypto::fill_random(imprint);
  const auto asked = timestamp::make_request(crypto::HashAlgorithm::kSha256, imprint);
  const Bytes answer = authority.source->ask(timestamp::encode_request(asked));
  timestamp::Expectation expectation;
  expectation.algorithm = asked.algorithm;
  expectation.imprint = asked.imprint;
  expectation.nonce = asked.nonce;
  return timestamp::judge_token(answer, expectation, trust);
}

std::unique_ptr<recorder::StampingQueue> open_stamping_queue(const Home& home) {
  try {
    return recorder::StampingQueue::open(home.stamping_file());
  } catch (const Error& error) {
    print_error(
        "kiroku",
        std::string("warning: time-stamps that do not come are not asked for again later: ") + error.what());
    return nullptr;
  }
}

}  // namespace kiroku::apps
