#include "tests/attack/attacked_case.h"

#include <algorithm>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "archive/format/case_layout.h"
#include "crypto/merkle_tree.h"

namespace kiroku::test {

namespace fs = std::filesystem;
using archive::CaseEntry;

SoundCases& SoundCases::get() {
  static SoundCases cases;
  return cases;
}

std::string read_file(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

void write_file(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
}

AttackedCase::AttackedCase() : AttackedCase(SoundCases::get().first) {}

AttackedCase::AttackedCase(const fs::path& source) : folder_(temporary_ / source.filename().string()) {
  fs::copy(source, folder_, fs::copy_options::recursive);
  fs::copy(source.parent_path() / "log", log(), fs::copy_options::recursive);
}

std::vector<std::string> AttackedCase::lines() const {
  std::vector<std::string> lines;
  std::istringstream text(read_file(folder_ / archive::kLedgerFile));
  for (std::string line; std::getline(text, line);) {
    lines.push_back(line);
  }
  return lines;
}

void AttackedCase::set_lines(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) {
    text += line + "\n";
  }
  write_file(folder_ / archive::kLedgerFile, text);
}

void AttackedCase::edit(std::uint64_t entry, const std::function<void(CaseEntry&)>& change) {
  std::vector<std::string> all = lines();
  CaseEntry parsed = archive::parse_case_entry(all.at(entry)).entry.value();
  change(parsed);
  all[entry] = archive::to_line(parsed);
  set_lines(all);
}

void AttackedCase::edit_text(std::uint64_t entry, const std::string& from, const std::string& to) {
  std::vector<std::string> all = lines();
  const std::size_t at = all.at(entry).find(from);
  if (at == std::string::npos) {
    throw std::logic_error("there is no " + from + " in " + all[entry]);
  }
  all[entry].replace(at, from.size(), to);
  set_lines(all);
}

void AttackedCase::remove_line(std::uint64_t entry) {
  std::vector<std::string> all = lines();
  all.erase(all.begin() + static_cast<std::ptrdiff_t>(entry));
  set_lines(all);
}

void AttackedCase::cut(std::uint64_t entry) {
  std::vector<std::string> all = lines();
  for (std::size_t number = entry; number < all.size(); ++number) {
    const CaseEntry parsed = archive::parse_case_entry(all[number]).entry.value();
    if (const auto* token = std::get_if<archive::TokenEntry>(&parsed.body)) {
      fs::remove(folder_ / token->file);
    } else if (const auto* segment = std::get_if<archive::SegmentEntry>(&parsed.body)) {
      fs::remove(folder_ / segment->file.file);
    }
  }
  for (std::size_t size = entry + 1; size <= all.size(); ++size) {
    fs::remove(folder_ / archive::note_path(size));
  }
  all.resize(entry);
  set_lines(all);
}

void AttackedCase::append(archive::CaseEntryBody body) {
  std::vector<std::string> all = lines();
  CaseEntry entry = archive::parse_case_entry(all.back()).entry.value();
  entry.seq = all.size();
  entry.body = std::move(body);
  all.push_back(archive::to_line(entry));
  set_lines(all);
}

void AttackedCase::renumber() {
  std::vector<std::string> all = lines();
  for (std::size_t number = 0; number < all.size(); ++number) {
    CaseEntry entry = archive::parse_case_entry(all[number]).entry.value();
    entry.seq = number;
    all[number] = archive::to_line(entry);
  }
  set_lines(all);
}

crypto::Sha256Digest AttackedCase::root(std::uint64_t size) const {
  crypto::MerkleFrontier tree;
  const std::vector<std::string> all = lines();
  for (std::size_t number = 0; number < size; ++number) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(all.at(number))));
  }
  return tree.root();
}

std::string AttackedCase::origin() const {
  return archive::case_origin(SampleArchive::kDeviceName, folder_.filename().string());
}

void AttackedCase::write_note(std::uint64_t size, const std::string& origin, std::uint64_t stated_size,
                              const crypto::Sha256Digest& root, const crypto::SigningKey& key,
                              const std::string& name) {
  const crypto::Checkpoint checkpoint{origin, stated_size, root};
  write_file(folder_ / archive::note_path(size), crypto::sign_note(checkpoint.to_text(), name, key));
}

void AttackedCase::forge(const crypto::SigningKey& key, bool stamp_again) {
  SampleArchive& archive = SoundCases::get().archive;
  std::vector<std::uint64_t> sizes;
  for (const auto& each : fs::directory_iterator(folder_ / archive::kCheckpointsFolder)) {
    sizes.push_back(archive::size_of_note_name(each.path().filename().string()).value());
  }
  std::sort(sizes.begin(), sizes.end());
  for (const std::uint64_t size : sizes) {
    const std::vector<std::string> all = lines();
    if (size > all.size()) {
      fs::remove(folder_ / archive::note_path(size));
      continue;
    }
    write_note(size, origin(), size, root(size), key, SampleArchive::kDeviceName);
    for (std::uint64_t number = size; stamp_again && number < all.size(); ++number) {
      const CaseEntry entry = archive::parse_case_entry(all[number]).entry.value();
      const auto* token = std::get_if<archive::TokenEntry>(&entry.body);
      if (token == nullptr || token->checkpoint != size) {
        continue;
      }
      const UtcTime old_time = token->gen_time;
      const auto clock = std::exchange(archive.authority_time, [old_time](std::int64_t) { return old_time; });
      const Bytes response = archive.stamp(read_file(folder_ / archive::note_path(size)));
      archive.authority_time = clock;
      const std::string file = token->file;
      write_file(folder_ / file, std::string(text_of(response)));
      edit(number, [&](CaseEntry& edited) {
        auto& facts = std::get<archive::TokenEntry>(edited.body);
        facts = SampleArchive::facts_of(response);
        facts.checkpoint = size;
        facts.authority = SampleArchive::kAuthorityName;
        facts.file = file;
        facts.sha256 = crypto::sha256(response);
      });
    }
  }
}

archive::VerificationReport AttackedCase::verify(bool with_log) const {
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log = with_log ? std::optional(log()) : std::nullopt;
  return archive::verify_case(folder_, options);
}

}  // namespace kiroku::test
