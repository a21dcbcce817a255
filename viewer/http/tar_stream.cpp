#include "viewer/http/tar_stream.h"

#include <algorithm>
#include <archive.h>
#include <archive_entry.h>
#include <fstream>
#include <vector>

#include "base/error.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kUnit = 256U << 10;
constexpr int kFileMode = 0644;

struct ArchiveDeleter {
  void operator()(::archive* handle) const { archive_write_free(handle); }
  void operator()(::archive_entry* entry) const { archive_entry_free(entry); }
};

class TarWriter {
 public:
  TarWriter(const fs::path& parent, const std::string& name, std::shared_ptr<const void> keep)
      : keep_(std::move(keep)), parent_(parent), archive_(archive_write_new()) {
    for (const auto& each : fs::recursive_directory_iterator(parent / name)) {
      if (!each.is_directory()) files_.push_back(each.path().lexically_relative(parent));
    }
    std::ranges::sort(files_);
    check(archive_write_set_format_pax_restricted(archive_.get()));
    check(archive_write_set_bytes_per_block(archive_.get(), 0));
    check(archive_write_open(archive_.get(), this, nullptr, &TarWriter::take, nullptr));
  }
  /// libarchive writes an end when it is freed, which nobody hears.
  ~TarWriter() { into_ = &unheard_; }
  TarWriter(const TarWriter&) = delete;
  TarWriter& operator=(const TarWriter&) = delete;

  bool more(Bytes& into) {
    into_ = &into;
    if (is_closed_) return false;
    if (!file_.is_open() && next_ == files_.size()) {
      check(archive_write_close(archive_.get()));
      is_closed_ = true;
    } else if (!file_.is_open()) {
      begin(files_[next_++]);
    } else {
      go_on();
    }
    return true;
  }

 private:
  void begin(const fs::path& relative) {
    const fs::path path = parent_ / relative;
    if (!fs::is_regular_file(fs::symlink_status(path))) throw Error(path.string() + " is no regular file");
    name_ = relative.generic_string();
    left_ = fs::file_size(path);
    file_.open(path, std::ios::binary);
    if (!file_) throw Error("cannot read " + path.string());
    const std::unique_ptr<::archive_entry, ArchiveDeleter> entry(archive_entry_new());
    archive_entry_set_pathname(entry.get(), name_.c_str());
    archive_entry_set_size(entry.get(), static_cast<la_int64_t>(left_));
    archive_entry_set_filetype(entry.get(), AE_IFREG);
    archive_entry_set_perm(entry.get(), kFileMode);
    archive_entry_set_mtime(entry.get(), 0, 0);
    check(archive_write_header(archive_.get(), entry.get()));
    if (left_ == 0) file_.close();
  }

  void go_on() {
    buffer_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(left_, kUnit)));
    file_.read(reinterpret_cast<char*>(buffer_.data()), static_cast<std::streamsize>(buffer_.size()));
    if (static_cast<std::size_t>(file_.gcount()) != buffer_.size()) {
      throw Error(name_ + " became shorter while it was sent");
    }
    if (archive_write_data(archive_.get(), buffer_.data(), buffer_.size()) < 0) check(ARCHIVE_FATAL);
    left_ -= buffer_.size();
    if (left_ == 0) file_.close();
  }

  static la_ssize_t take(::archive* /*archive*/, void* self, const void* data, std::size_t size) {
    append(*static_cast<TarWriter*>(self)->into_, ByteView(static_cast<const std::byte*>(data), size));
    return static_cast<la_ssize_t>(size);
  }

  void check(int result) const {
    if (result != ARCHIVE_OK) {
      throw Error(std::string("cannot write the tar archive: ") + archive_error_string(archive_.get()));
    }
  }

  std::shared_ptr<const void> keep_;
  const fs::path parent_;
  Bytes* into_ = nullptr;
  Bytes unheard_;
  std::unique_ptr<::archive, ArchiveDeleter> archive_;
  std::vector<fs::path> files_;
  std::size_t next_ = 0;
  std::string name_;
  std::ifstream file_;
  std::uint64_t left_ = 0;
  Bytes buffer_;
  bool is_closed_ = false;
};

}  // namespace

StreamBody tar_stream(const fs::path& parent, const std::string& name, std::shared_ptr<const void> keep) {
  const auto writer = std::make_shared<TarWriter>(parent, name, std::move(keep));
  return [writer](Bytes& into) { return writer->more(into); };
}

}  // namespace kiroku::viewer
