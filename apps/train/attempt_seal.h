// An attempt of the trainer as a case of a home: as provable as an operation. One thread.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "apps/kiroku/home.h"

namespace kiroku::apps {

/// The files of an attempt that a case is made of, in its folder; vitals.csv is forces.csv as a recorder
/// reads vital signs (recorder/vitals/csv_source.h).
inline constexpr const char* kAttemptFilm = "film.mp4";
inline constexpr const char* kAttemptVitals = "vitals.csv";

/// Records `film` and numbers of `folder` into a new case of `home`. Its sealed subject holds `facts` and the
/// SHA-256 of every file there; `summary` is marked at its beginning. `begun` is told the case's identifier
/// before anything is recorded; what it throws closes the case as it is. Returns the case's folder. Throws
/// kiroku::Error where the home cannot be recorded into, or not all was taken in; the files stay as they are.
std::filesystem::path seal_attempt(const Home& home, const std::filesystem::path& folder,
                                   const std::string& film, const nlohmann::ordered_json& facts,
                                   const std::string& summary,
                                   const std::function<void(const std::string& case_id)>& begun = {});

/// Whether a case that seal_attempt() began holds the whole attempt. kiroku::Error as read_case_facts().
bool holds_whole_attempt(const std::filesystem::path& case_folder);

}  // namespace kiroku::apps
