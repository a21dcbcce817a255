// Remembers which files were found to be what a ledger says, so that who reads a segment again and again does
// not hash it again and again. Thread-safe.
#pragma once

#include <mutex>
#include <set>
#include <utility>

#include "archive/case_folder.h"
#include "crypto/hash.h"

namespace kiroku::media {

class CheckedFiles {
 public:
  /// Whether this very file, untouched since, was found to have this hash.
  [[nodiscard]] bool contains(const archive::FileIdentity& file, const crypto::Sha256Digest& sha256) const {
    const std::lock_guard guard(mutex_);
    return files_.contains({file, sha256});
  }
  void add(const archive::FileIdentity& file, const crypto::Sha256Digest& sha256) {
    const std::lock_guard guard(mutex_);
    files_.insert({file, sha256});
  }

 private:
  mutable std::mutex mutex_;
  std::set<std::pair<archive::FileIdentity, crypto::Sha256Digest>> files_;
};

}  // namespace kiroku::media
