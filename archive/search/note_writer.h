// Search notes of cases while they are recorded: what makes them, where they lie until they are shipped.
#pragma once

#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "archive/search/search_note.h"
#include "archive/storage/file_system.h"

namespace kiroku::search {

/// In a store, below the appliance's name.
inline constexpr std::string_view kStoreFolder = "search";

/// <folder>/<case>.json.
std::filesystem::path note_file(const std::filesystem::path& folder, const std::string& case_id);
/// The case of "<case>.json"; "" of any other name.
std::string case_of_note(const std::string& name);

/// Thread-safe. Functions throw kiroku::Error; the case itself is not in question then.
class NoteWriter {
 public:
  /// `key` is the appliance's (ApplianceKey), which goes on by a step with each note; notes come into
  /// `folder`, which is made where it lacks.
  NoteWriter(std::filesystem::path key, std::filesystem::path folder,
             archive::FileSystem& files = archive::real_file_system())
      : key_(std::move(key)), folder_(std::move(folder)), files_(files) {}

  /// The case is about whom `words` say, from now on.
  void write(const std::string& case_id, const SearchWords& words);
  /// The case has the subject of `earlier`. Nothing where that has no note.
  void carry_over(const std::string& case_id, const std::string& earlier);

 private:
  void keep(const SearchNote& note);
  const std::filesystem::path key_, folder_;
  archive::FileSystem& files_;
  std::mutex mutex_;
};

}  // namespace kiroku::search
