#include "apps/kiroku/plan_seal.h"

#include <algorithm>
#include <variant>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/file_hash.h"

namespace kiroku::apps {
namespace {

constexpr const char* kFormat = "kiroku-plan-seal/1";

}  // namespace

std::string plan_seal_text(const PlanSeal& seal) {
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const SealedFile& file : seal.files) {
    files.push_back({{"role", file.role},
                     {"name", file.name},
                     {"bytes", file.bytes},
                     {"sha256", crypto::to_hex(file.sha256)}});
  }
  const nlohmann::ordered_json document{{"format", kFormat}, {"plan", seal.plan}, {"files", files}};
  return document.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

PlanSeal parse_plan_seal(std::string_view text, const std::string& name_for_errors) {
  const auto refuse = [&](const std::string& why) -> PlanSeal {
    throw UsageError(name_for_errors + " is no sealed plan: " + why + "; make one with kiroku plan seal");
  };
  try {
    const nlohmann::json document = nlohmann::json::parse(text);
    if (document.at("format") != kFormat) return refuse("its format is another");
    PlanSeal seal{document.at("plan").get<std::string>(), {}};
    for (const nlohmann::json& entry : document.at("files")) {
      SealedFile& file = seal.files.emplace_back();
      entry.at("role").get_to(file.role);
      entry.at("name").get_to(file.name);
      entry.at("bytes").get_to(file.bytes);
      const auto digest = crypto::from_hex(entry.at("sha256").get<std::string>());
      if (!digest || digest->size() != file.sha256.size()) return refuse("a hash of it is none");
      std::ranges::copy(*digest, file.sha256.begin());
    }
    if (seal.files.empty()) return refuse("it names no file");
    return seal;
  } catch (const nlohmann::json::exception&) {
    return refuse("it is no JSON of that kind");
  }
}

SealedFile hashed(const std::string& role, const std::string& name, const std::filesystem::path& path) {
  // Whoever wrote a seal chose its names.
  const crypto::FileHash found = crypto::hash_file(path);
  return {role, name, found.bytes, found.sha256};
}

std::function<bool(const archive::LogEntryBody&)> states_seal(const crypto::Sha256Digest& seal) {
  return [seal](const archive::LogEntryBody& body) {
    const auto* const entry = std::get_if<archive::PlanSealedEntry>(&body);
    return entry != nullptr && entry->sha256 == seal;
  };
}

crypto::Sha256Digest require_sealed(const Home& home, const std::filesystem::path& file) {
  const Bytes bytes = read_small_file(file, "the sealed plan");
  (void)parse_plan_seal(text_of(bytes), file.string());
  const crypto::Sha256Digest digest = crypto::sha256(bytes);
  const auto record = find_record(home, states_seal(digest));
  if (!record || !record->is_signed) {
    throw UsageError(file.string() +
                     " is not in the appliance log of this home, or nobody signed its entry: seal the plan "
                     "with it first, by kiroku plan "
                     "seal");
  }
  return digest;
}

}  // namespace kiroku::apps
