// Where a case lies.
#pragma once

#include <filesystem>
#include <memory>
#include <utility>

#include "archive/reading/sealed_source.h"

namespace kiroku::playback {

struct CasePlace {
  CasePlace(std::filesystem::path case_folder,  // NOLINT(google-explicit-constructor): a folder is a place
            std::shared_ptr<const archive::SealedSource> elsewhere = nullptr)
      : folder(std::move(case_folder)), segments(std::move(elsewhere)) {}

  std::filesystem::path folder;
  /// Where its segments are instead of in `folder`; null: there.
  std::shared_ptr<const archive::SealedSource> segments;
};

}  // namespace kiroku::playback
