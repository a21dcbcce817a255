#include "apps/kiroku/plan_seal.h"

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <variant>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "base/error.h"
#include "crypto/encoding.h"

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
  constexpr std::size_t kPiece = std::size_t{1} << 20;
  // A pipe or a device may give no end of bytes, or none at all; whoever wrote a seal chose its names.
  std::error_code unknown;
  if (std::filesystem::exists(path, unknown) && !std::filesystem::is_regular_file(path, unknown) &&
      !std::filesystem::is_directory(path, unknown)) {
    throw Error("cannot read " + path.string() + ": it is a pipe, a socket or a device and no file");
  }
  std::ifstream in(path, std::ios::binary);
  if (!in || std::filesystem::is_directory(path)) {
    const int error_number = std::filesystem::is_directory(path) ? EISDIR : errno;
    throw IoError("read", path, error_number);
  }
  SealedFile file{role, name, 0, {}};
  crypto::Sha256 hash;
  Bytes piece(kPiece);
  while (in) {
    in.read(reinterpret_cast<char*>(piece.data()), static_cast<std::streamsize>(piece.size()));
    const auto read = static_cast<std::size_t>(in.gcount());
    hash.update(ByteView(piece).first(read));
    file.bytes += read;
  }
  if (in.bad()) throw IoError("read", path, EIO);
  file.sha256 = hash.finish();
  return file;
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
