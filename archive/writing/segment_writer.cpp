#include "archive/writing/segment_writer.h"

#include <atomic>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/storage/file_system.h"
#include "archive/verify/found_files.h"
#include "crypto/age_file.h"
#include "crypto/hash.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kWriteBehindBytes = 8U << 20U;

fs::path part_of(fs::path file) {
  file += kPartSuffix;
  return file;
}

}  // namespace

struct SegmentWriter::State {
  enum class Stage { kWriting, kSealed, kFailed, kDone };

  State(FileSystem& the_files, fs::path final_path, std::string the_relative)
      : files(the_files),
        path(std::move(final_path)),
        part(part_of(path)),
        relative(std::move(the_relative)),
        file(files.create(part)) {}

  /// Where ciphertext leaves the sealer.
  void take(ByteView ciphertext) {
    file->write(ciphertext);
    hash.update(ciphertext);
    const std::uint64_t total = written.load(std::memory_order_relaxed) + ciphertext.size();
    written.store(total, std::memory_order_relaxed);
    if (total - written_behind >= kWriteBehindBytes) {
      written_behind = total;
      file->write_behind();
    }
  }

  void refuse_unless(Stage wanted) const {
    if (flush_failed.load()) {
      throw Error("an earlier flush of " + part.string() + " failed, so nothing more is done with it");
    }
    if (stage != wanted) {
      throw Error(stage == Stage::kFailed
                      ? "writing " + part.string() + " failed before: it can only be salvaged"
                      : part.string() + " is not in a state for this step");
    }
  }

  /// Runs a step that writes; its failure leaves the file good for salvage only.
  template <typename Step>
  void writing(Step step) {
    try {
      step();
    } catch (...) {
      stage = Stage::kFailed;
      throw;
    }
  }

  /// Runs a step that flushes; its failure is final.
  template <typename Step>
  void flushing(Step step) {
    try {
      step();
    } catch (const SyncError&) {
      flush_failed.store(true);
      throw;
    }
  }

  FileSystem& files;
  fs::path path;
  fs::path part;
  std::string relative;
  std::unique_ptr<WritableFile> file;
  crypto::Sha256 hash;
  std::optional<crypto::AgeSealer> sealer;
  std::uint64_t header_bytes = 0;  // age header and nonce: no picture is in them
  std::uint64_t plaintext = 0;
  std::uint64_t written_behind = 0;
  std::atomic<std::uint64_t> written{0};
  std::atomic<bool> flush_failed{false};
  bool name_durable = false;  // of the part; sync()'s own
  Stage stage = Stage::kWriting;
};

SegmentWriter::SegmentWriter(FileSystem& files, fs::path final_path, std::string relative,
                             const crypto::AgeRecipients& recipients)
    : state_(std::make_unique<State>(files, std::move(final_path), std::move(relative))) {
  State& state = *state_;
  try {
    state.sealer.emplace(recipients, [&state](ByteView ciphertext) { state.take(ciphertext); });
  } catch (const Error&) {
    state.file.reset();
    try {
      files.remove(state.part);  // holds part of a header at most
    } catch (const IoError&) {   // NOLINT(bugprone-empty-catch): the first error is the one to tell
    }
    throw;
  }
  state.header_bytes = state.written.load();
}

SegmentWriter::~SegmentWriter() = default;

void SegmentWriter::write(ByteView plaintext) {
  state_->refuse_unless(State::Stage::kWriting);
  state_->writing([&] { state_->sealer->write(plaintext); });
  state_->plaintext += plaintext.size();
}

void SegmentWriter::seal() {
  state_->refuse_unless(State::Stage::kWriting);
  state_->writing([&] { state_->sealer->finish(); });
  state_->stage = State::Stage::kSealed;
}

void SegmentWriter::sync() {
  if (state_->flush_failed.load()) {
    throw Error("an earlier flush of " + state_->part.string() + " failed, so it is not tried again");
  }
  state_->flushing([&] {
    state_->file->sync();
    // Bytes are of no use under a name that a power cut takes away.
    if (!state_->name_durable) {
      state_->files.sync_folder(state_->part.parent_path());
      state_->name_durable = true;
    }
  });
}

// The name changes only after fsync of the bytes, and counts only after fsync of the folder:
//
//   fsync(NAME.part)   rename(NAME.part, NAME)   fsync(folder)   close
//
FileReference SegmentWriter::commit() {
  State& state = *state_;
  state.refuse_unless(State::Stage::kSealed);
  state.flushing([&] {
    state.file->sync_all();
    state.writing([&] { state.files.rename(state.part, state.path); });
    state.files.sync_folder(state.path.parent_path());
  });
  state.stage = State::Stage::kDone;
  state.file.reset();
  return {state.relative, state.written.load(), state.hash.finish()};
}

std::optional<FileReference> SegmentWriter::salvage() {
  State& state = *state_;
  if (state.flush_failed.load() || state.stage == State::Stage::kDone) {
    throw Error(state.part.string() + " cannot be salvaged: it was flushed in vain or is done with");
  }
  state.stage = State::Stage::kDone;
  FileReference reference = measure_file(state.files, state.part);
  if (reference.bytes <= state.header_bytes) {
    state.file.reset();
    state.files.remove(state.part);
    return std::nullopt;
  }
  state.flushing([&] {
    state.file->sync_all();
    state.file.reset();
    state.files.sync_folder(state.part.parent_path());
  });
  reference.file = state.relative + std::string(kPartSuffix);
  return reference;
}

std::uint64_t SegmentWriter::bytes() const { return state_->written.load(std::memory_order_relaxed); }

std::uint64_t SegmentWriter::plaintext_bytes() const { return state_->plaintext; }

}  // namespace kiroku::archive
