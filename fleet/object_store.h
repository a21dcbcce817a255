// One bucket of an S3 store with Object Lock, spoken to by libcurl, which signs each request (AWS Signature
// Version 4). What is put is locked in COMPLIANCE mode, which no user of the store can shorten (Amazon S3 API
// Reference, "Object Lock"). Objects are put whole, never in parts: stores ignore a lock that is asked for
// with a multipart upload.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/bytes.h"
#include "base/error.h"
#include "base/utc_time.h"
#include "crypto/byte_source.h"
#include "crypto/hash.h"
#include "crypto/secret.h"
#include "fleet/store_answers.h"

namespace kiroku::fleet {

struct StoreAddress {
  std::string endpoint;           // "https://store.hospital.example", with a port or without, no path
  std::string bucket;             // [a-z0-9.-], 3 to 63
  std::string region;             // as the store is configured; Ceph's default is "us-east-1"
  std::filesystem::path ca_file;  // PEM, the roots that sign the store's certificate; empty: the system's
};

struct StoreCredentials {
  std::string access_key;
  crypto::Secret secret_key;
};

struct StoreTerms {
  /// Most that is sent, asked before each object; 0, and where it is empty: no limit.
  std::function<std::uint64_t()> bytes_per_second = {};
  std::chrono::seconds connecting{10};
  /// An answer or a transfer that stands still for so long has failed.
  std::chrono::seconds silence{60};
};

/// The store did not do what it was asked. what() says what that means and what to do about it.
class StoreError : public Error {
 public:
  StoreError(const std::string& sentence, long status, std::string code, std::chrono::seconds wait = {})
      : Error(sentence), status_(status), code_(std::move(code)), wait_(wait) {}
  /// HTTP status; 0 where no answer came.
  [[nodiscard]] long status() const { return status_; }
  /// The store's own word, such as "NoSuchBucket"; "" where it gave none.
  [[nodiscard]] const std::string& code() const { return code_; }
  /// How long the store asked to be left alone (Retry-After, RFC 9110 section 10.2.3): 0 where it did not,
  /// and never more than kLongestAskedWait, as a store that is set wrong must not end shipping.
  [[nodiscard]] std::chrono::seconds wait() const { return wait_; }
  static constexpr std::chrono::seconds kLongestAskedWait = std::chrono::minutes(15);
  /// Whether the same request may succeed later with nothing else changed.
  [[nodiscard]] bool passes() const;
  /// Whether it says something of the one object alone (too large, other bytes than were announced), and
  /// others may go.
  [[nodiscard]] bool is_of_one_object() const;

 private:
  long status_;
  std::string code_;
  std::chrono::seconds wait_;
};

/// What is to lock a version that is put.
struct PutLock {
  std::optional<UtcTime> ends =
      {};  // in COMPLIANCE mode; nothing: by nothing but what the bucket's own rule is
  bool legal_hold = false;
};

/// Not thread-safe: one connection, which is kept open.
class ObjectStore {
 public:
  /// Reaches nothing yet. Throws kiroku::UsageError for an address that is none.
  ObjectStore(StoreAddress address, StoreCredentials credentials, StoreTerms terms = {});
  ~ObjectStore();
  ObjectStore(ObjectStore&& other) noexcept;
  ObjectStore& operator=(ObjectStore&&) = delete;
  ObjectStore(const ObjectStore&) = delete;
  ObjectStore& operator=(const ObjectStore&) = delete;

  [[nodiscard]] const StoreAddress& address() const;
  /// What the store's clock said when it answered last; nothing where it did not tell.
  [[nodiscard]] std::optional<UtcTime> told_time() const;

  /// Throws StoreError where the bucket is not there, cannot be seen, or has no Object Lock.
  void require_lockable();
  /// Puts a version of `key` ([A-Za-z0-9._/-]) that `lock` locks. `sha256` is that of all of `body`: the
  /// store refuses a body of another hash. Returns the version. Throws StoreError, kiroku::IoError of `body`.
  std::string put(const std::string& key, const crypto::ByteSource& body, const crypto::Sha256Digest& sha256,
                  const PutLock& lock);
  /// A version of `key`, the newest where `version` is empty; nothing where there is none.
  std::optional<StoredObject> look(const std::string& key, const std::string& version = {});
  /// Every version of every object whose key begins with `prefix`. Throws StoreError, kiroku::Error where the
  /// answer makes no sense; what `visit` throws.
  void for_each_version(const std::string& prefix, const std::function<void(const ListedVersion&)>& visit);
  /// The same of those whose keys come after `key` in the store's order, all of them where it is empty, until
  /// `visit` returns false.
  void for_each_version_after(const std::string& prefix, const std::string& key,
                              const std::function<bool(const ListedVersion&)>& visit);
  /// What follows `prefix` in keys, up to the next '/' and without it, each once. Throws as
  /// for_each_version().
  std::vector<std::string> folders(const std::string& prefix);
  /// Sets or lifts the legal hold of a version. Whether the store did is for look() to tell. Throws
  /// StoreError.
  void set_legal_hold(const std::string& key, const std::string& version, bool on);
  /// Locks a version in COMPLIANCE mode until `ends`. Whether the store did is for look() to tell. Throws
  /// StoreError.
  void set_retention(const std::string& key, const std::string& version, UtcTime ends);
  /// All of a version's bytes. Throws kiroku::Error where there are more than `most`.
  Bytes get(const std::string& key, const std::string& version, std::size_t most);
  /// The same, piece by piece as it comes; what the store tells of it beside. More than `most` bytes are not
  /// taken. Throws what `take` throws, too.
  StoredObject get(const std::string& key, const std::string& version, std::uint64_t most,
                   const std::function<void(ByteView)>& take);
  /// `size` bytes of a version from `offset` on, as a range (RFC 9110, section 14.2); fewer only at its end.
  /// Throws kiroku::Error where the store sends anything else.
  Bytes get_range(const std::string& key, const std::string& version, std::uint64_t offset, std::size_t size);
  /// Asks the store to remove a version; whether it did. Throws StoreError where it did not answer.
  bool remove(const std::string& key, const std::string& version);

 private:
  struct State;
  void for_each_page(const std::string& prefix, const std::string& after, bool by_folders,
                     const std::function<bool(const VersionPage&)>& visit);
  std::unique_ptr<State> state_;
};

/// More objects than a case of days has, in all their versions.
inline constexpr std::size_t kMostVersions = 1'000'000;
/// So many versions of one object are fetched, to find the one that a ledger names: anybody who may put can
/// put more.
inline constexpr std::size_t kMostVersionsTried = 100;

/// Of an object's versions, the newest in front, those that are tried: of many the newest and the oldest.
/// Nobody can put one that is older than what a recorder put first.
std::vector<ListedVersion> versions_to_try(std::vector<ListedVersion> versions);

/// Whether stores of every make take the key as it is.
bool is_plain_key(std::string_view key);

}  // namespace kiroku::fleet
