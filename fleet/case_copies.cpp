#include "fleet/case_copies.h"

#include <cerrno>
#include <fcntl.h>
#include <unistd.h>
#include <utility>
#include <vector>

#include "archive/format/case_folder.h"
#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

/// A file that is written anew.
class Written {
 public:
  explicit Written(const fs::path& path)
      : path_(path),
        file_(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0600)) {
    if (!file_) throw IoError("create", path_, errno);
  }
  void add(ByteView bytes) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(file_.number(), bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) throw IoError("write", path_, errno);
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
  }

 private:
  const fs::path path_;
  Descriptor file_;
};

class InStore final : public CaseCopy {
 public:
  InStore(std::string name, std::shared_ptr<ObjectStore> store)
      : name_(std::move(name)), store_(std::move(store)) {}
  [[nodiscard]] std::string name() const override { return name_; }
  bool bring(const FileOfCase& file, const fs::path& into, const std::function<bool()>& fits) override {
    const std::string key = file.appliance + "/" + file.case_id + "/" + file.path;
    if (!is_plain_key(key)) return false;
    std::vector<ListedVersion> versions;
    store_->for_each_version(key, [&](const ListedVersion& each) {
      if (each.key != key || each.bytes > file.most_bytes || (file.bytes && each.bytes != *file.bytes))
        return;
      versions.push_back(each);
    });
    for (const ListedVersion& each : versions_to_try(std::move(versions))) {
      try {
        Written written(into);
        store_->get(key, each.version, each.bytes, [&](ByteView bytes) { written.add(bytes); });
      } catch (const IoError&) {
        throw;
      } catch (const Error&) {
        // One that cannot be read says nothing of the others; a store that is away does not answer this.
        store_->look(key, each.version);
        continue;
      }
      if (fits()) return true;
    }
    return false;
  }

 private:
  const std::string name_;
  const std::shared_ptr<ObjectStore> store_;
};

class InFolder final : public CaseCopy {
 public:
  InFolder(std::string name, fs::path folder, bool of_one)
      : name_(std::move(name)), folder_(std::move(folder)), is_of_one_(of_one) {}
  [[nodiscard]] std::string name() const override { return name_; }
  bool bring(const FileOfCase& file, const fs::path& into, const std::function<bool()>& fits) override {
    // What is not mounted has no files, which would read as if the copy had none.
    if (!archive::real_reading().exists(folder_)) throw Error(folder_.string() + " is not there");
    const fs::path place = (is_of_one_ ? folder_ : folder_ / file.appliance) / file.case_id;
    if (!archive::real_reading().is_folder(place)) return false;
    const archive::CaseFolder of_case = archive::CaseFolder::open(place);
    const archive::FileOpening opening = of_case.open_file(file.path);
    if (!opening.file) {
      if (opening.problem == archive::FileProblem::kMissing) return false;
      throw Error((place / file.path).string() + " " + opening.explanation);
    }
    const std::uint64_t size = opening.file->size();
    if (size > file.most_bytes || (file.bytes && size != *file.bytes)) return false;
    Written written(into);
    Bytes buffer(std::size_t{1} << 18);
    for (std::uint64_t offset = 0; offset < size;) {
      const std::size_t read = opening.file->read_at(offset, buffer);
      if (read == 0) return false;
      written.add(ByteView(buffer).first(read));
      offset += read;
    }
    return fits();
  }

 private:
  const std::string name_;
  const fs::path folder_;
  const bool is_of_one_;  // appliance
};

}  // namespace

std::unique_ptr<CaseCopy> copy_in_store(std::string name, std::shared_ptr<ObjectStore> store) {
  return std::make_unique<InStore>(std::move(name), std::move(store));
}

std::unique_ptr<CaseCopy> copy_in_folder(std::string name, fs::path folder) {
  return std::make_unique<InFolder>(std::move(name), std::move(folder), false);
}

std::unique_ptr<CaseCopy> copy_in_archive(std::string name, fs::path archive) {
  return std::make_unique<InFolder>(std::move(name), std::move(archive), true);
}

}  // namespace kiroku::fleet
