// Files whose hash is entered into the appliance log and time-stamped, with the tokens beside them: sealed
// plans and comparisons. And what of such a file still holds. Not thread-safe.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/kiroku/home.h"
#include "apps/kiroku/named_roots.h"
#include "archive/format/log_entry.h"
#include "base/check.h"
#include "crypto/hash.h"
#include "recorder/authority_contact.h"

namespace kiroku::apps {

/// What an authority said to a file's hash.
struct Stamp {
  std::string authority;
  std::optional<UtcTime> gen_time;
  std::string problem;  // why there is no valid token
  /// Of a valid token: whose clock it tells. The authority's name says nothing of that.
  timestamp::TimeAuthority clock = timestamp::TimeAuthority::kOwn;
};

/// Asks for a token and writes it beside the file: liver.seal.json has liver.seal.AUTHORITY.tsr.
Stamp stamp_file(const recorder::NamedAuthority& authority, const std::filesystem::path& file,
                 const crypto::Sha256Digest& digest, const timestamp::TrustStore& trust);
/// Of a valid token `kind` is "external" or "self-issued".
nlohmann::ordered_json stamps_json(const std::vector<Stamp>& stamps);
/// A line for each valid token, which says of the recorder's own that no outside clock stands behind it.
std::string stamp_lines(const std::vector<Stamp>& stamps);
/// Warnings on standard error: about those without a token, and where every token is the recorder's own
/// authority's.
void warn_of_missing(const std::vector<Stamp>& stamps);
bool any_valid(const std::vector<Stamp>& stamps);
/// Whose clock stands behind them: "external" where one is an outside authority's, "self-issued", "none".
std::string_view time_of(const std::vector<Stamp>& stamps);

/// Durably, beside its name first.
void write_durably(const std::filesystem::path& file, ByteView bytes);

struct SealRecord {
  std::uint64_t seq = 0;   // of the entry
  UtcTime utc;             // the machine's opinion
  bool is_signed = false;  // by the home's device, when it was written
};
/// The first entry of the home's appliance log that `states` accepts and that is signed; without one that is,
/// the first of the others.
std::optional<SealRecord> find_record(const Home& home,
                                      const std::function<bool(const archive::LogEntryBody&)>& states);

/// What the tokens beside the file say of its hash, under these roots, under the home's if there are none.
std::vector<Check> check_tokens(const NamedRoots& roots, const std::optional<Home>& home,
                                const std::filesystem::path& file, const crypto::Sha256Digest& digest);
/// A log that does not know the file tells only that it is not this appliance's, or not as it was.
Check check_log(const std::optional<Home>& home, const std::string& what,
                const std::function<bool(const archive::LogEntryBody&)>& states);

/// Prints all of it, for people or as JSON with what `head` holds; the exit status of its verdict.
int tell_checks(const std::string& file, const std::string& title, const std::vector<Check>& checks,
                const nlohmann::ordered_json& head, bool json);

}  // namespace kiroku::apps
