// A case in a store as whoever renews evidence records takes it (archive/upkeep/evidence_renewal.h). Ledger,
// checkpoints and tokens come into a folder while the case is looked at. Segments stay in the store: each one
// comes when it is read, and goes once it was.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "archive/upkeep/evidence_renewal.h"
#include "fleet/fetcher.h"
#include "fleet/store_connections.h"

namespace kiroku::fleet {

/// Reads a case's folder, and segments out of the store where the folder has an empty file in their place.
/// Thread-safe, but for show() and hide().
class StreamedFiles final : public archive::FileReading {
 public:
  /// Segments come into nameless files in `scratch`. `store` must outlive the object.
  StreamedFiles(StoreConnections& store, std::filesystem::path scratch);
  /// From now on this case's are read; its folder is `fetched.folder`.
  void show(const FetchedCase& fetched);
  void hide() { segments_.clear(); }
  /// Why something could not be read that says nothing of the case: the store was away, or this machine's
  /// disk is full; "" where that was not so.
  [[nodiscard]] std::string away() const;
  /// Bytes that came out of the store so far.
  [[nodiscard]] std::uint64_t bytes() const;

  int open_at(int folder, const std::string& name, int flags,
              const std::filesystem::path& path) const override;
  int status_at(int folder, const std::string& name, struct stat& status,
                const std::filesystem::path& path) const override;

 private:
  /// A descriptor of the segment's bytes. Throws what the store and the disk do.
  [[nodiscard]] int bring(const SegmentInStore& segment) const;

  StoreConnections& store_;
  const std::filesystem::path scratch_;
  std::map<std::string, SegmentInStore> segments_;  // by their paths
  mutable std::mutex mutex_;                        // guards the two below
  mutable std::string away_;
  mutable std::uint64_t bytes_ = 0;
};

/// What the cases of one batch share. Not thread-safe.
struct RenewalBatch {
  StoreConnections& store;
  const std::filesystem::path scratch;  // a folder of the batch's own
  /// Asked before each look: once it says so, the cases that are left wait for another run.
  const std::function<bool()> is_ended;
  /// Why the store gives nothing; the cases that are left are not tried then. "" while it answers.
  std::string away = {};
};

class StoredRenewableCase final : public archive::RenewableCase {
 public:
  /// `batch` must outlive it. `known`: a record that held when all that it covers was last compared.
  StoredRenewableCase(RenewalBatch& batch, std::string appliance, std::string case_id,
                      std::optional<crypto::Sha256Digest> known);

  [[nodiscard]] std::string name() const override { return case_id_; }
  std::filesystem::path folder() override;
  const archive::FileReading& files() override { return files_; }
  [[nodiscard]] std::string record_place(const std::string& case_id) const override;
  std::vector<Bytes> read_records(const std::string& case_id) override;
  [[nodiscard]] bool is_known_to_hold(const crypto::Sha256Digest& record) const override;
  [[nodiscard]] bool keeps_all_records() const override { return true; }
  void write_record(const std::string& case_id, ByteView record) override;
  void let_go() override;

 private:
  template <typename Work>
  auto ask(const Work& work);
  void require_own(const std::string& case_id) const;

  RenewalBatch& batch_;
  const std::string appliance_, case_id_;
  const std::optional<crypto::Sha256Digest> known_;
  StreamedFiles files_;
};

}  // namespace kiroku::fleet
