// Where a case lies.
#pragma once

#include <filesystem>
#include <memory>
#include <utility>

#include "archive/reading/case_reader.h"
#include "archive/reading/sealed_source.h"

namespace kiroku::playback {

struct CasePlace {
  CasePlace(std::filesystem::path case_folder,  // NOLINT(google-explicit-constructor): a folder is a place
            std::shared_ptr<const archive::SealedSource> elsewhere = nullptr,
            std::shared_ptr<const archive::CaseReader> was_read = nullptr)
      : folder(std::move(case_folder)), segments(std::move(elsewhere)), ledger(std::move(was_read)) {}

  /// Its ledger, parsed. Throws as archive::CaseReader::open().
  [[nodiscard]] archive::CaseReader read() const {
    return ledger ? *ledger : archive::CaseReader::open(folder);
  }

  std::filesystem::path folder;
  /// Where its segments are instead of in `folder`; null: there.
  std::shared_ptr<const archive::SealedSource> segments;
  /// Where somebody has read it already: a ledger of ten hours takes half a second.
  std::shared_ptr<const archive::CaseReader> ledger;
};

}  // namespace kiroku::playback
