#include "tests/support/power_cut_file_system.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <random>
#include <set>
#include <stdexcept>
#include <utility>

namespace kiroku::test {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kBlockBytes = 4096;

/// The same numbers everywhere, which the distributions of the standard library do not promise.
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : random_(seed) {}
  /// One of [first, last].
  std::uint64_t between(std::uint64_t first, std::uint64_t last) {
    return first + random_() % (last - first + 1);
  }

 private:
  std::mt19937_64 random_;
};

Bytes bytes_in(const fs::path& file) {
  std::ifstream input(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(input), {}};
  return to_bytes(text);
}

}  // namespace

class PowerCutFileSystem::File final : public archive::WritableFile {
 public:
  File(PowerCutFileSystem& system, Node node, std::unique_ptr<archive::WritableFile> real)
      : system_(system), node_(node), real_(std::move(real)) {}

  void write(ByteView bytes) override {
    const std::lock_guard lock(system_.mutex_);
    real_->write(bytes);
    system_.history_.push_back(
        {Kind::kWrite, node_, system_.sizes_[node_], Bytes(bytes.begin(), bytes.end()), {}, 0, {}});
    system_.sizes_[node_] += bytes.size();
  }

  void truncate(std::uint64_t size) override {
    const std::lock_guard lock(system_.mutex_);
    real_->truncate(size);
    system_.history_.push_back({Kind::kTruncate, node_, size, {}, {}, 0, {}});
    system_.sizes_[node_] = size;
  }

  void sync() override {
    flush([&] { real_->sync(); });
  }
  void sync_all() override {
    flush([&] { real_->sync_all(); });
  }

  void reserve(std::uint64_t bytes) override { real_->reserve(bytes); }
  void write_behind() override { real_->write_behind(); }
  bool try_lock() override { return real_->try_lock(); }
  bool lock(std::chrono::milliseconds patience) override { return real_->lock(patience); }
  void unlock() noexcept override { real_->unlock(); }

 private:
  // Others may write while it flushes: what came before the call is safe, nothing else is promised.
  template <typename Flush>
  void flush(Flush do_it) {
    const std::size_t before = system_.all_steps();
    do_it();
    const std::lock_guard lock(system_.mutex_);
    system_.history_.push_back({Kind::kFlush, node_, before, {}, {}, 0, {}});
  }

  PowerCutFileSystem& system_;
  Node node_;
  std::unique_ptr<archive::WritableFile> real_;
};

/// What the disk gives back.
class PowerCutFileSystem::Disk {
 public:
  struct Contents {
    std::uint64_t size = 0;
    std::map<std::uint64_t, Bytes> blocks;  // by number; one that lacks is zeros
  };

  Disk(const PowerCutFileSystem& system, std::size_t steps, Names names, Chance chance)
      : system_(system), steps_(steps), names_(names), chance_(chance), safe_(system.is_folder_.size()) {
    for (std::size_t at = 0; at < steps_; ++at) {
      const Step& step = system_.history_[at];
      if (step.kind == Kind::kFlush || step.kind == Kind::kFlushFolder) {
        safe_[step.node] = std::max<std::size_t>(safe_[step.node], step.place);
        all_safe_ = std::max<std::size_t>(all_safe_, step.place);
      }
    }
  }

  /// The tree of names, each folder's with what is in it. `lucky`: also what was not flushed, by chance.
  std::map<Node, std::map<std::string, Node>> folders(bool lucky) {
    std::vector<std::size_t> until(system_.is_folder_.size());
    const auto reaches = [&](std::size_t safe) { return lucky ? chance_.between(safe, steps_) : safe; };
    const std::size_t journal = reaches(std::max(all_safe_, system_.imported_));
    for (Node folder = 0; folder < until.size(); ++folder) {
      const std::size_t safe = std::max(safe_[folder], system_.imported_);
      until[folder] = lucky && names_ == Names::kInOrder ? std::max(journal, safe) : reaches(safe);
    }
    std::map<Node, std::map<std::string, Node>> tree;
    for (std::size_t at = 0; at < steps_; ++at) {
      const Step& step = system_.history_[at];
      if (step.kind == Kind::kLink && at < until[step.node]) {
        tree[step.node][step.name] = step.other;
      } else if (step.kind == Kind::kUnlink && at < until[step.node]) {
        tree[step.node].erase(step.name);
      } else if (step.kind == Kind::kRename && at < std::max(until[step.node], until[step.other])) {
        const Node moved = node_before(at, step);
        tree[step.node].erase(step.name);
        tree[step.other][step.new_name] = moved;
      }
    }
    return tree;
  }

  /// Each block as of a moment of its own since it was flushed, or all of one moment; the size as of another.
  Contents contents(Node file) {
    const std::size_t safe = safe_[file];
    const auto flushed_only = [safe](std::uint64_t) { return safe; };
    const std::uint64_t flushed = after(file, safe, flushed_only).size;
    const std::uint64_t written = after(file, steps_, flushed_only).size;
    constexpr std::uint64_t kFewMoments = 3;  // of so many files one has all its blocks of one moment
    const bool one_moment = chance_.between(1, kFewMoments) == 1;
    const std::size_t moment = chance_.between(0, 1) == 0 ? steps_ : chance_.between(safe, steps_);
    std::map<std::uint64_t, std::size_t> moments;
    Contents given = after(file, steps_, [&](std::uint64_t block) {
      if (one_moment) return moment;
      const auto known = moments.find(block);
      return known != moments.end() ? known->second : (moments[block] = chance_.between(safe, steps_));
    });
    enum class Size { kFull, kOfAMoment, kWholeBlocks };
    switch (static_cast<Size>(chance_.between(0, 2))) {
      case Size::kFull:
        given.size = written;  // whatever blocks are there
        break;
      case Size::kOfAMoment:
        given.size = after(file, chance_.between(safe, steps_), flushed_only).size;
        break;
      case Size::kWholeBlocks: {
        const std::uint64_t least = std::min(flushed, written), most = std::max(flushed, written);
        given.size = std::max(least, chance_.between(least, most) / kBlockBytes * kBlockBytes);
        break;
      }
    }
    return given;
  }

  [[nodiscard]] std::uint64_t flushed_size(Node file) const {
    const std::size_t safe = safe_[file];
    return after(file, safe, [&](std::uint64_t) { return safe; }).size;
  }

 private:
  /// What a rename moved, whichever names are on the disk.
  [[nodiscard]] Node node_before(std::size_t at, const Step& rename) const {
    Node folder = rename.node;
    std::string name = rename.name;
    for (std::size_t earlier = at; earlier-- > 0;) {
      const Step& step = system_.history_[earlier];
      if (step.kind == Kind::kLink && step.node == folder && step.name == name) return step.other;
      if (step.kind == Kind::kRename && step.other == folder && step.new_name == name) {
        folder = step.node;
        name = step.name;
      }
    }
    throw std::logic_error("a name was given to nothing");
  }

  /// The file after `steps` steps, each block as far as `moment_of` its number says.
  template <typename MomentOf>
  [[nodiscard]] Contents after(Node file, std::size_t steps, MomentOf moment_of) const {
    Contents contents;
    for (std::size_t at = 0; at < steps; ++at) {
      const Step& step = system_.history_[at];
      if (step.node != file) continue;
      if (step.kind == Kind::kTruncate) {
        contents.size = step.place;
        for (auto& [number, block] : contents.blocks) {
          const std::uint64_t start = number * kBlockBytes;
          const std::uint64_t kept = std::clamp(step.place, start, start + kBlockBytes) - start;
          if (at < moment_of(number))
            std::fill(block.begin() + static_cast<std::ptrdiff_t>(kept), block.end(), std::byte{0});
        }
      } else if (step.kind == Kind::kWrite) {
        contents.size = std::max(contents.size, step.place + step.bytes.size());
        for (std::uint64_t done = 0; done < step.bytes.size();) {
          const std::uint64_t number = (step.place + done) / kBlockBytes;
          const std::uint64_t within = (step.place + done) % kBlockBytes;
          const std::uint64_t count = std::min(kBlockBytes - within, step.bytes.size() - done);
          if (at < moment_of(number)) {
            Bytes& block = contents.blocks[number];
            block.resize(kBlockBytes);
            std::copy_n(step.bytes.begin() + static_cast<std::ptrdiff_t>(done), count,
                        block.begin() + static_cast<std::ptrdiff_t>(within));
          }
          done += count;
        }
      }
    }
    return contents;
  }

  const PowerCutFileSystem& system_;
  std::size_t steps_;
  Names names_;
  Chance chance_;
  std::vector<std::size_t> safe_;  // by node: steps before it are on the disk
  std::size_t all_safe_ = 0;       // the newest of them
};

PowerCutFileSystem::PowerCutFileSystem(fs::path root)
    : root_(std::move(root)), real_(archive::real_file_system()) {
  now_["."] = new_node(true);
  import(root_, 0);
  imported_ = history_.size();
}

PowerCutFileSystem::Node PowerCutFileSystem::new_node(bool is_folder) {
  is_folder_.push_back(is_folder);
  sizes_.push_back(0);
  return is_folder_.size() - 1;
}

PowerCutFileSystem::Node PowerCutFileSystem::node_of(const fs::path& path) const {
  return now_.at(path.lexically_relative(root_));
}

void PowerCutFileSystem::import(const fs::path& folder, Node node) {
  std::set<fs::path> entries;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) entries.insert(entry.path());
  for (const fs::path& entry : entries) {
    const bool is_folder = fs::is_directory(entry);
    const Node its = new_node(is_folder);
    now_[entry.lexically_relative(root_)] = its;
    history_.push_back({Kind::kLink, node, 0, {}, entry.filename().string(), its, {}});
    if (is_folder) {
      import(entry, its);
      continue;
    }
    Bytes bytes = bytes_in(entry);
    sizes_[its] = bytes.size();
    history_.push_back({Kind::kWrite, its, 0, std::move(bytes), {}, 0, {}});
    history_.push_back({Kind::kFlush, its, history_.size(), {}, {}, 0, {}});
  }
}

std::size_t PowerCutFileSystem::all_steps() const {
  const std::lock_guard lock(mutex_);
  return history_.size();
}

std::size_t PowerCutFileSystem::steps() const { return all_steps() - imported_; }

std::vector<std::size_t> PowerCutFileSystem::steps_with_unflushed(std::uint64_t bytes) const {
  const std::lock_guard lock(mutex_);
  std::vector<std::size_t> found;
  std::map<Node, std::map<std::size_t, std::uint64_t>> unflushed;  // by file and step
  for (std::size_t at = imported_; at < history_.size(); ++at) {
    const Step& step = history_[at];
    if (step.kind == Kind::kWrite) unflushed[step.node][at] = step.bytes.size();
    if (step.kind == Kind::kFlush)
      std::erase_if(unflushed[step.node], [&](const auto& write) { return write.first < step.place; });
    const bool much = std::any_of(unflushed.begin(), unflushed.end(), [&](const auto& file) {
      std::uint64_t sum = 0;
      for (const auto& [number, count] : file.second) sum += count;
      return sum >= bytes;
    });
    if (much) found.push_back(at + 1 - imported_);
  }
  return found;
}

std::unique_ptr<archive::WritableFile> PowerCutFileSystem::create(const fs::path& file) {
  const std::lock_guard lock(mutex_);
  std::unique_ptr<archive::WritableFile> real = real_.create(file);
  const Node node = new_node(false);
  now_[file.lexically_relative(root_)] = node;
  history_.push_back({Kind::kLink, node_of(file.parent_path()), 0, {}, file.filename().string(), node, {}});
  return std::make_unique<File>(*this, node, std::move(real));
}

std::unique_ptr<archive::WritableFile> PowerCutFileSystem::append_to(const fs::path& file) {
  const std::lock_guard lock(mutex_);
  return std::make_unique<File>(*this, node_of(file), real_.append_to(file));
}

void PowerCutFileSystem::rename(const fs::path& from, const fs::path& to) {
  const std::lock_guard lock(mutex_);
  real_.rename(from, to);
  history_.push_back({Kind::kRename,
                      node_of(from.parent_path()),
                      0,
                      {},
                      from.filename().string(),
                      node_of(to.parent_path()),
                      to.filename().string()});
  const fs::path old_name = from.lexically_relative(root_), new_name = to.lexically_relative(root_);
  std::map<fs::path, Node> renamed;
  for (const auto& [path, node] : now_) {
    const fs::path below = path.lexically_relative(old_name);
    const bool moves = !below.empty() && *below.begin() != "..";
    if (moves) renamed[below == "." ? new_name : new_name / below] = node;
  }
  std::erase_if(now_, [&](const auto& each) {
    const fs::path below = each.first.lexically_relative(old_name);
    return !below.empty() && *below.begin() != "..";
  });
  for (const auto& [path, node] : renamed) now_[path] = node;
}

void PowerCutFileSystem::remove(const fs::path& file) {
  const std::lock_guard lock(mutex_);
  real_.remove(file);
  history_.push_back({Kind::kUnlink, node_of(file.parent_path()), 0, {}, file.filename().string(), 0, {}});
  now_.erase(file.lexically_relative(root_));
}

void PowerCutFileSystem::make_folder(const fs::path& folder) {
  const std::lock_guard lock(mutex_);
  real_.make_folder(folder);
  const Node node = new_node(true);
  now_[folder.lexically_relative(root_)] = node;
  history_.push_back(
      {Kind::kLink, node_of(folder.parent_path()), 0, {}, folder.filename().string(), node, {}});
}

void PowerCutFileSystem::sync_folder(const fs::path& folder) {
  const std::size_t before = all_steps();
  real_.sync_folder(folder);
  const std::lock_guard lock(mutex_);
  history_.push_back({Kind::kFlushFolder, node_of(folder), before, {}, {}, 0, {}});
}

void PowerCutFileSystem::cut_power(std::size_t steps, std::uint64_t seed, Names names,
                                   const fs::path& target) const {
  Disk disk(*this, imported_ + steps, names, Chance(seed));
  const auto folders = disk.folders(true);
  const auto make = [&](const auto& self, Node folder, const fs::path& path) -> void {
    const auto entries = folders.find(folder);
    if (entries == folders.end()) return;
    for (const auto& [name, node] : entries->second) {
      const fs::path made = path / name;
      if (is_folder_[node]) {
        fs::create_directory(made);
        self(self, node, made);
        continue;
      }
      const Disk::Contents contents = disk.contents(node);
      std::ofstream output(made, std::ios::binary);
      for (const auto& [number, block] : contents.blocks) {
        const std::uint64_t start = number * kBlockBytes;
        if (start >= contents.size) continue;
        output.seekp(static_cast<std::streamoff>(start));
        output << text_of(ByteView(block).first(
            static_cast<std::size_t>(std::min<std::uint64_t>(kBlockBytes, contents.size - start))));
      }
      output.close();
      fs::resize_file(made, contents.size);
    }
  };
  make(make, 0, target);
}

std::map<fs::path, std::uint64_t> PowerCutFileSystem::flushed(std::size_t steps) const {
  Disk disk(*this, imported_ + steps, Names::kEachForItself, Chance(0));
  const auto folders = disk.folders(false);
  std::map<fs::path, std::uint64_t> found;
  const auto look = [&](const auto& self, Node folder, const fs::path& path) -> void {
    const auto entries = folders.find(folder);
    if (entries == folders.end()) return;
    for (const auto& [name, node] : entries->second) {
      if (is_folder_[node]) {
        self(self, node, path / name);
      } else {
        found[path / name] = disk.flushed_size(node);
      }
    }
  };
  look(look, 0, {});
  return found;
}

}  // namespace kiroku::test
