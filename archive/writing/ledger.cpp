#include "archive/writing/ledger.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <span>
#include <utility>

#include "archive/format/ledger_entry.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

/// Blocks are allocated this far ahead, so that lines find room on a disk that has filled up meanwhile.
constexpr std::uint64_t kAllocationStep = 1U << 20U;
constexpr std::uint64_t kAllocationMargin = kAllocationStep / 4;
constexpr std::size_t kReadBytes = 1U << 18U;
/// An entry that states how many bytes were cut off states no more: the format has no larger number. A hole
/// may be longer.
constexpr std::uint64_t kMostBytesStated = (std::uint64_t{1} << 53U) - 1;

std::uint64_t stated_sum(std::uint64_t before, std::uint64_t more) {
  return std::min(kMostBytesStated, before + std::min(kMostBytesStated, more));
}

std::unique_ptr<WritableFile> open_or_create(FileSystem& files, const fs::path& file) {
  if (files.exists(file)) {
    return files.append_to(file);
  }
  std::unique_ptr<WritableFile> created;
  try {
    created = files.create(file);
  } catch (const IoError& error) {
    if (error.error_number() != EEXIST) {
      throw;
    }
    return files.append_to(file);  // another process was quicker
  }
  files.sync_folder(file.parent_path());
  return created;
}

}  // namespace

Ledger::Turn::Turn(Ledger& ledger) : ledger_(ledger) {
  if (ledger_.sharing_ == Sharing::kShared && ledger_.turns_ == 0) {
    ledger_.take_lock();
  }
  ++ledger_.turns_;
}

Ledger::Turn::~Turn() {
  --ledger_.turns_;
  if (ledger_.sharing_ == Sharing::kShared && ledger_.turns_ == 0) {
    ledger_.written_->unlock();
  }
}

Ledger::Ledger(FileSystem& files, fs::path file, Sharing sharing, SpaceReserve* reserve, Visitor visitor)
    : files_(&files),
      file_(std::move(file)),
      sharing_(sharing),
      reserve_(reserve),
      visitor_(std::move(visitor)) {}

std::unique_ptr<Ledger> Ledger::open(FileSystem& files, fs::path file, Sharing sharing, SpaceReserve* reserve,
                                     Visitor visitor, Covered covered, NeedsSignature needs_signature,
                                     SetAside set_aside) {
  std::unique_ptr<Ledger> ledger(new Ledger(files, std::move(file), sharing, reserve, std::move(visitor)));
  ledger->written_ = open_or_create(files, ledger->file_);
  if (sharing == Sharing::kExclusive && !ledger->written_->try_lock()) {
    throw UsageError("another process is writing " + ledger->file_.string() +
                     ": wait until it has ended, or end it first");
  }
  ledger->covered_when_opened_ = covered;
  ledger->covered_ = std::move(covered);
  ledger->needs_signature_ = std::move(needs_signature);
  ledger->set_aside_ = std::move(set_aside);
  ledger->catch_up();
  ledger->covered_ = nullptr;
  ledger->needs_signature_ = nullptr;
  return ledger;
}

void Ledger::take_lock() {
  constexpr std::chrono::milliseconds kMoment{250};
  if (!failure_.empty()) {
    // An open file that failed once goes on telling of it.
    written_ = files_->append_to(file_);
    allocated_until_ = 0;
  }
  const std::chrono::milliseconds patience = is_held_up_ ? std::min(kMoment, patience_) : patience_;
  is_held_up_ = !written_->lock(patience);
  if (is_held_up_) {
    throw LedgerHeldError(
        "another process holds " + file_.string() +
        " locked, and nothing can be entered meanwhile: nothing was written. Whoever may read that file can "
        "lock it; 'lslocks' as root names the process: end it");
  }
  if (failure_.empty()) {
    return;
  }
  try {
    repair();
  } catch (...) {
    written_->unlock();
    throw;
  }
}

// After a flush that failed the kernel may take what never reached the disk for written. Cutting our lines
// off makes the end of the file, and the block in which it ends, new to it: the flush is then one of what
// stands there. Lines that others entered behind ours are theirs to have flushed, and are read as at a start.
void Ledger::repair() {
  if (!known_) {
    known_ = Known{tree_.size(), tree_.root()};
  }
  if (!unsure_.empty()) {
    std::vector<char> end(unsure_.size() + 1);
    std::size_t count = 0;
    const ReadableFile input = files_->open_to_read(file_);
    while (const std::size_t more = input.read_at(
               bytes_ + count, std::as_writable_bytes(std::span(end).subspan(count, end.size() - count)))) {
      count += more;
    }
    const bool is_ours = unsure_.starts_with(std::string_view(end.data(), count));
    if (is_ours && (!covered_when_opened_ || covered_when_opened_() <= tree_.size())) {
      written_->truncate(bytes_);
    }
  }
  written_->sync();
  unsure_.clear();
  forget_lines();
  covered_ = covered_when_opened_;
  try {
    read_new_lines();
  } catch (...) {
    covered_ = nullptr;
    throw;
  }
  covered_ = nullptr;
  if (known_ && tree_.size() < known_->size) {
    tell_or_refuse(file_.string() + " has " + std::to_string(tree_.size()) +
                   " lines after a failure of its disk, and " + std::to_string(known_->size) +
                   " had been flushed to it: verify it before writing to it");
  }
  known_.reset();
  failure_.clear();
  if (tell_read_anew_) tell_read_anew_();
}

void Ledger::refuse_if_failed() const {
  if (!failure_.empty()) {
    throw Error(failure_);
  }
}

void Ledger::catch_up() {
  const Turn turn(*this);
  refuse_if_failed();
  read_new_lines();
}

void Ledger::take_back(std::uint64_t size, bool another) {
  const Turn turn(*this);
  refuse_if_failed();
  const std::uint64_t before = bytes_;
  forget_lines();
  if (mine_ && mine_->size > size) {
    mine_.reset();
  }
  read_new_lines(size);
  torn_bytes_ = stated_sum(torn_bytes_, another ? before - bytes_ : 0);
}

void Ledger::forget_lines() {
  tree_ = {};
  bytes_ = 0;
  last_line_.clear();
}

void Ledger::read_again() {
  const Turn turn(*this);
  refuse_if_failed();
  forget_lines();
  mine_.reset();
  try {
    read_new_lines();
  } catch (const Error& error) {
    failure_ = error.what();
    throw;
  }
}

void Ledger::accept(std::string_view line) {
  const std::uint64_t seq = tree_.size();
  tree_.append(crypto::merkle_leaf_hash(bytes_of(line)));
  bytes_ += line.size() + 1;
  if (known_ && tree_.size() == known_->size && tree_.root() != known_->root) {
    tell_or_refuse(file_.string() +
                   " is not as it was before its disk failed: verify it before writing to it");
  }
  if (sharing_ == Sharing::kShared) {
    last_line_ = line;
  }
  if (visitor_) {
    visitor_(seq, line);
  }
}

bool Ledger::still_stands(const ReadableFile& input) const {
  if (last_line_.empty()) {
    return true;
  }
  std::string there(last_line_.size() + 1, '\0');
  std::size_t count = 0;
  const std::uint64_t begin = bytes_ - there.size();
  while (count < there.size()) {
    const std::size_t more =
        input.read_at(begin + count, std::as_writable_bytes(std::span(there).subspan(count)));
    if (more == 0) {
      return false;
    }
    count += more;
  }
  return there.ends_with('\n') && there.starts_with(last_line_);
}

void Ledger::read_anew() {
  known_ = mine_;
  forget_lines();
  try {
    read_new_lines();
    if (known_ && tree_.size() < known_->size) {
      tell_or_refuse(file_.string() + " lacks lines that were entered: verify it before writing to it");
    }
  } catch (const Error& error) {
    failure_ = error.what();
    throw;
  }
  known_.reset();
  if (tell_read_anew_) tell_read_anew_();
}

// Whoever is told compares the lines with what was signed, and says so in the ledger.
void Ledger::tell_or_refuse(const std::string& problem) {
  if (!tell_read_anew_) throw Error(problem);
  known_.reset();
  mine_.reset();
}

// Whoever reads has the lock, so that the file does not grow meanwhile. What stands behind its last line is
// cut off: only once all of it was read.
void Ledger::read_new_lines(std::optional<std::uint64_t> most) {
  const ReadableFile input = files_->open_to_read(file_);
  if (!still_stands(input)) {
    read_anew();
    return;
  }
  covered_size_.reset();
  replaced_ = 0;
  std::vector<char> buffer(kReadBytes);
  std::string rest;         // of a line that goes on in the next buffer
  std::uint64_t zeros = 0;  // bytes of lines that hold one, and stay
  std::uint64_t read_until = bytes_;
  // Whatever stands there from the next line on may be replaced, and is read again then.
  const auto read_on = [&] {
    rest.clear();
    read_until = bytes_;
  };
  for (;;) {
    const std::size_t count =
        input.read_at(read_until, std::as_writable_bytes(std::span(buffer.data(), buffer.size())));
    if (count == 0) {
      // Somebody cut off the end of a line that was signed: what is left of it stays.
      if (rest.empty() || tree_.size() == most || !is_surely_covered() || !is_put_aside(read_until)) break;
      read_on();
      continue;
    }
    read_until += count;
    std::string_view piece(buffer.data(), count);
    bool is_replaced = false;
    for (std::size_t end = piece.find('\n'); end != std::string_view::npos; end = piece.find('\n')) {
      std::string_view line = piece.substr(0, end);
      if (!rest.empty()) {
        line = rest.append(line);
      }
      if (tree_.size() == most) {
        cut_end();
        return;
      }
      if (const bool has_zero = line.find('\0') != std::string_view::npos; has_zero) {
        if (is_cut_off_for_zeros()) {
          cut_torn_line(input.size());
          return;
        }
        zeros += line.size() + 1;
        if (zeros > kMostBytesOfLine) {
          if (!is_put_aside(input.size())) refuse_endless_zeros();
          is_replaced = true;
          break;
        }
      }
      // Readers hash no more of a longer one than its beginning.
      if (set_aside_ && line.size() > kMaximumLineBytes) {
        if (!is_put_aside(input.size())) refuse_long_line();
        is_replaced = true;
        break;
      }
      if (lacks_signature(line)) {
        unsigned_bytes_ = stated_sum(unsigned_bytes_, input.size() - bytes_);
        cut_end();
        return;
      }
      accept(line);
      rest.clear();
      piece.remove_prefix(end + 1);
    }
    if (!is_replaced) rest.append(piece);
    if (!is_replaced && rest.size() > kMaximumLineBytes) {
      if (tree_.size() == most) {
        cut_end();
        return;
      }
      const bool has_zero = rest.find('\0') != std::string::npos;
      if (has_zero && is_cut_off_for_zeros()) {
        cut_torn_line(input.size());
        return;
      }
      if (!is_put_aside(input.size())) refuse_long_line();
      is_replaced = true;
    }
    if (is_replaced) read_on();
  }
  input.require_read_to_end(read_until);
  if (!rest.empty()) {
    cut_torn_line(read_until);
  }
}

bool Ledger::is_put_aside(std::uint64_t end) {
  if (!set_aside_) return false;
  // Lines that take the place of others are of the format: whatever else comes, somebody writes meanwhile.
  constexpr int kMostReplaced = 16;
  switch (set_aside_(tree_.size(), bytes_, [this](const ReadableFile& lines) { replace_end(lines); })) {
    case Aside::kStays:
      return false;
    case Aside::kMayGo:
      cut_torn_line(end);
      return true;
    case Aside::kReplaced:
      return ++replaced_ <= kMostReplaced;
  }
  return false;
}

// Whoever calls has the rest of the file elsewhere.
void Ledger::replace_end(const ReadableFile& lines) {
  cut_end();
  allocated_until_ = 0;
  std::vector<std::byte> buffer(kReadBytes);
  for (std::uint64_t at = 0; const std::size_t count = lines.read_at(at, buffer); at += count) {
    written_->write(std::span(buffer).first(count));
  }
  written_->sync();
}

void Ledger::refuse_long_line() const {
  throw Error("line " + std::to_string(tree_.size() + 1) + " of " + file_.string() +
              " is longer than any entry may be: the file is damaged, verify it before writing to it");
}

// Files that take no room on a disk read as zeros. LineReader, too, reads no further than that.
void Ledger::refuse_endless_zeros() const {
  throw Error("line " + std::to_string(tree_.size() + 1) + " of " + file_.string() +
              " and lines before it hold more zeros than are read: the file is damaged, verify it before "
              "writing to it");
}

// No entry has a zero byte. Of a line that was flushed none appears by itself, and what a checkpoint covers
// was flushed: zeros there are damage, which is not cut off but found by whoever verifies. A power cut leaves
// others. While the ledger is open, somebody else wrote them.
bool Ledger::is_cut_off_for_zeros() {
  if (!covered_when_opened_ || is_covered()) return false;
  return covered_ || (set_aside_ && set_aside_(tree_.size(), bytes_, {}) == Aside::kMayGo);
}

// Whoever made a line of zeros out of each of thousands has the checkpoints looked at once.
bool Ledger::is_covered() {
  if (!covered_size_) covered_size_ = covered_when_opened_();
  return *covered_size_ > tree_.size();
}

bool Ledger::is_surely_covered() {
  return set_aside_ && covered_when_opened_ && is_covered() && *covered_size_ != kNobodyKnows;
}

bool Ledger::lacks_signature(std::string_view line) const {
  return needs_signature_ && covered_ && covered_() <= tree_.size() && needs_signature_(line);
}

void Ledger::cut_end() {
  try {
    written_->truncate(bytes_);
    written_->sync();
  } catch (const IoError& error) {
    failure_ = std::string("the end of the ledger could not be cut off: ") + error.what();
    throw;
  }
}

// Whoever holds the lock finds a torn line only if its writer died: a living one holds the lock until its
// line is whole.
void Ledger::cut_torn_line(std::uint64_t end) {
  cut_end();
  torn_bytes_ = stated_sum(torn_bytes_, end - bytes_);
}

void Ledger::append(const MakeLines& make_lines) {
  const Turn turn(*this);
  refuse_if_failed();
  if (sharing_ == Sharing::kShared) {
    read_new_lines();
  }
  const std::vector<std::string> lines = make_lines(size());
  std::string text;
  for (const std::string& line : lines) {
    if (line.empty() || line.size() > kMaximumLineBytes || line.find('\n') != std::string::npos) {
      throw Error("a ledger line is empty, too long or has a line end inside: nothing was written to " +
                  file_.string());
    }
    text += line;
    text += '\n';
  }
  if (text.empty()) {
    return;
  }
  allocate_ahead(text.size());
  write_durably(text);
  for (const std::string& line : lines) {
    accept(line);
  }
  if (sharing_ == Sharing::kShared) {
    mine_ = Known{tree_.size(), tree_.root()};
  }
  torn_bytes_ = 0;
}

void Ledger::allocate_ahead(std::uint64_t coming) {
  if (bytes_ + coming + kAllocationMargin <= allocated_until_) {
    return;
  }
  try {
    written_->reserve(coming + kAllocationStep);
    allocated_until_ = bytes_ + coming + kAllocationStep;
  } catch (const IoError&) {
    // The margin allocated before is still there, and after it the reserve; a broken disk shows in write().
    allocated_until_ = 0;
  }
}

// One append, step by step:
//
//   fallocate(KEEP_SIZE)        now and then, 1 MiB ahead
//   write(all lines)            one call; a short one leaves a last line without LF, which open() cuts off
//   fdatasync                   only now the lines count
//
// If write() fails, what it left is cut off again before anything else is tried, so that the file never holds
// half a line with more behind it.
void Ledger::write_durably(std::string_view text) {
  const auto write = [&] {
    try {
      written_->write(bytes_of(text));
    } catch (const IoError&) {
      undo_write(text);
      throw;
    }
  };
  try {
    if (reserve_ != nullptr) {
      reserve_->support(write);
    } else {
      write();
    }
    written_->sync();
  } catch (const SyncError& error) {
    unsure_ = text;
    failure_ = std::string(error.what()) +
               "; what was last written may be lost, so nothing more is written to " + file_.string();
    throw;
  } catch (const IoError& error) {
    if (!error.disk_full()) {
      failure_ = error.what();
    }
    throw;
  }
}

void Ledger::undo_write(std::string_view text) {
  try {
    written_->truncate(bytes_);
    allocated_until_ = bytes_;
  } catch (const IoError& error) {
    unsure_ = text;
    failure_ = std::string("part of a line may stand at the end of the ledger: ") + error.what();
    throw Error(failure_);
  }
}

void Ledger::trim() {
  refuse_if_failed();
  written_->truncate(bytes_);
  allocated_until_ = bytes_;
}

}  // namespace kiroku::archive
