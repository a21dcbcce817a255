// Keeping a comparison in the home, where the viewer shows it (viewer/kept/kept_comparison.h). Belongs to one
// thread.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "apps/kiroku/home.h"
#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "viewer/kept/kept_comparison.h"

namespace kiroku::apps {

class Keeping {
 public:
  /// `asked`: its name; without, the plan file's. kiroku::UsageError: a case of another home, no name, or one
  /// that is there already and may not be replaced.
  Keeping(const Home& home, const archive::CaseReader& recording, const std::string& stream,
          const std::filesystem::path& plan_file, const std::optional<std::string>& asked, bool replace);
  /// Removes what was not sealed.
  ~Keeping();
  Keeping(const Keeping&) = delete;
  Keeping& operator=(const Keeping&) = delete;

  [[nodiscard]] const compare::KeptPlace& place() const { return place_; }
  /// Where the film of a role ("replay", "radiographs") is to be written, readable by its owner alone.
  [[nodiscard]] std::filesystem::path film_file(const std::string& role) const {
    return making_ / place_.film_name(role);
  }
  /// Seals the film that was written there; how the document names it.
  compare::NamedFile keep_film(const std::string& role);
  void keep_document(std::string_view text);
  /// Tokens of the plan's seal, which prove when it was sealed without the plan being there.
  void keep_tokens_of(const std::filesystem::path& seal_file);

 private:
  compare::KeptPlace place_;
  std::filesystem::path making_;
  crypto::AgeRecipients recipients_;
};

}  // namespace kiroku::apps
