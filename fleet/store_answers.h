// What an S3 store answers, read (Amazon S3 API Reference: "Error Responses", "HeadObject",
// "ListObjectVersions"). Whoever answers may be anybody: what makes no sense is refused with a sentence. Pure
// functions; thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/utc_time.h"

namespace kiroku::fleet {

/// Names in lower case.
using AnswerHeaders = std::map<std::string, std::string>;

/// Takes one line of an answer's header, with its end or without. A status line begins anew, as behind "100
/// Continue". Of more than 100 the rest is left out.
void take_header(std::string_view line, AnswerHeaders& headers);

/// The store's own word for what is wrong, such as "NoSuchBucket"; "" where it gave none.
std::string error_code_of(std::string_view body);

/// One version of an object as the store tells of it.
struct StoredObject {
  std::uint64_t bytes = 0;
  std::string version;
  std::string sha256;                // hexadecimal, as it was put by this program; "" of other objects
  bool compliance = false;           // locked in COMPLIANCE mode
  std::optional<UtcTime> lock_ends;  // whichever the mode
  bool legal_hold = false;
};
/// From the headers of an answer to HEAD or GET. Throws kiroku::Error.
StoredObject object_of(const std::string& key, const AnswerHeaders& headers);

struct ListedVersion {
  std::string key, version;
  std::uint64_t bytes = 0;
  bool newest = false;
  /// When it was put, by the store; nothing where it does not tell.
  std::optional<UtcTime> put = std::nullopt;
};
/// One answer to a listing of versions; marks of removed objects are left out.
struct VersionPage {
  std::vector<ListedVersion> versions;
  std::vector<std::string> folders;  // beginnings of keys up to the delimiter that was asked for
  bool more = false;
  std::string next_key, next_version;  // where the next page begins, if there is more
};
/// What the store's clock said when it answered (RFC 9110, "Date"); nothing where it does not tell.
std::optional<UtcTime> time_of_answer(const AnswerHeaders& headers);
/// Throws kiroku::Error.
VersionPage version_page_of(std::string_view body);

}  // namespace kiroku::fleet
