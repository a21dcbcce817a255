// What a CaseWriter holds: shared by its parts (case_writer.cpp, case_creation.cpp, case_resumption.cpp), of
// no use to anybody else. One thread.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "archive/storage/file_system.h"
#include "archive/storage/space_reserve.h"
#include "archive/writing/case_writer.h"
#include "archive/writing/ledger.h"
#include "base/error.h"

namespace kiroku::archive {

struct CaseWriter::State {
  enum class Stage { kRecording, kClosed, kFinished };
  struct Stream {
    StreamInfo info;
    crypto::AgeRecipients recipients;
    std::optional<std::uint64_t> last_index;
    StreamTotal total;
  };

  State(FileSystem& the_files, const crypto::SigningKey* the_key, std::string device, ApplianceLog* the_log,
        const std::filesystem::path& archive)
      : files(the_files),
        key(the_key),
        device_name(std::move(device)),
        log(the_log),
        reserve(the_files, reserve_file(archive)) {}

  void refuse_unless_writable() const {
    if (!failure.empty()) {
      throw Error(failure);
    }
    if (stage == Stage::kFinished) {
      throw UsageError("case " + case_id + " is finished: nothing can be added to it");
    }
  }

  /// Runs a step that makes something durable; a failed flush is final for the whole case.
  template <typename Step>
  void durably(Step step) {
    try {
      step();
    } catch (const SyncError& error) {
      failure =
          "case " + case_id + " can no longer be written, since a flush to the disk failed: " + error.what();
      throw;
    }
  }

  Stream& stream(const std::string& name) {
    const auto found = std::find_if(streams.begin(), streams.end(),
                                    [&](const Stream& each) { return each.info.name == name; });
    if (found == streams.end()) {
      throw UsageError("case " + case_id + " has no stream \"" + name + "\"");
    }
    return *found;
  }

  /// What an entry says must be so before it is written.
  void check_segment(const SegmentEntry& segment, std::map<std::string, std::uint64_t>& last_in_batch);
  void check_authority(const std::string& authority) const;
  void check_all(const std::vector<CaseEntryBody>& bodies);
  void write_entries(const std::vector<CaseEntryBody>& bodies, Moment now);
  void enter_token(const TokenName& name, const crypto::Sha256Digest& sha256, const TokenEntry& facts,
                   Moment now);
  /// Keeps count of what is in the ledger, written just now or found there.
  void account_for(const CaseEntryBody& body);
  /// Of a ledger that is there already; throw kiroku::Error where it is not this device's, or damaged.
  [[nodiscard]] const OpenEntry& check_opening(const CaseEntry& entry, const std::string& device) const;
  /// `from_before`: whether the case is from before the device had that key, by its log.
  struct FromBefore {
    bool ml_dsa = false, hardware = false;
  };
  void take_newest_note(std::uint64_t size, const crypto::Sha256Digest& root, FromBefore from_before);
  /// Whether a note of one of these sizes, over this root, is by the device's hardware; where the key is not
  /// given, in the name of it.
  [[nodiscard]] bool is_by_hardware(const std::map<std::uint64_t, crypto::Sha256Digest>& roots) const;

  FileSystem& files;
  const crypto::SigningKey* key;
  std::string device_name;
  ApplianceLog* log;
  SpaceReserve reserve;
  std::string case_id;
  std::filesystem::path folder;
  std::vector<Stream> streams;
  std::unique_ptr<Ledger> ledger;
  std::uint64_t torn_bytes = 0, unsigned_bytes = 0;
  bool opening_vouched = true;
  std::int64_t last_mono_ns = 0;
  std::optional<StoredCheckpoint> last_checkpoint;
  std::optional<std::int64_t> last_logged_ns;
  std::optional<crypto::Sha256Digest> final_token;
  std::map<std::string, std::string> chains;  // by authority: its certificates, as they were written last
  crypto::AskHardware ask_hardware = crypto::AskHardware::kYes;
  bool rests_on_hardware = false;
  Stage stage = Stage::kRecording;
  std::string failure;  // once set, everything is refused with it
};

}  // namespace kiroku::archive
