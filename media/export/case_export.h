// Every stream of a case as plain media in one folder, with a manifest that says where each stands in time.
// A function; thread-safe.
//
// The folder holds, of a stream NAME:
//   NAME.mkv             pictures and sound, packets copied; NAME-2.mkv … where pictures changed their size
//   NAME.frames.csv      when each picture of the file beside it is shown: frame,time,case_time (seconds)
//   NAME.csv NAME.jsonl  vital signs and waves as a table, and every line as it was recorded (texts, alarms)
//   NAME.jsonl           events and pointing
//   manifest.json        docs/how-to/export.md
// All files have one time 0 (export_zero_ns()).
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"

namespace kiroku::media {

inline constexpr const char* kExportManifest = "manifest.json";

struct CaseExportOptions {
  std::int64_t from_ns = 0;
  std::int64_t to_ns = INT64_MAX;
  std::filesystem::path folder;
  /// Replace a folder that is there, if it is an earlier export and nothing else lies in it.
  bool overwrite = false;
  /// For the manifest: who makes it with what, and what a verification of the case found.
  std::string made_by, program;
  std::optional<std::string> purpose;  // what it is made for
  nlohmann::ordered_json verification;
  /// As ExportOptions::progress, over all files. May throw, which ends the export.
  std::function<void(std::uint64_t done_bytes, std::uint64_t total_bytes)> progress;
};

struct CaseExportResult {
  nlohmann::ordered_json manifest;
  std::vector<std::string> files;  // all but the manifest
  std::uint64_t bytes = 0;         // of them
};

/// Nothing is left behind on failure. Segments that retention erased are left out, and the manifest says so;
/// for everything else throws as export_stream(), and kiroku::UsageError where the folder is there and may
/// not be replaced, or nothing of any stream is there.
CaseExportResult export_case(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                             const CaseExportOptions& options);

}  // namespace kiroku::media
