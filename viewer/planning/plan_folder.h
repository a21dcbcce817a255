// The plans that a server may open, and where it saves new ones: documents in one folder and in the folders
// directly below it, each of which may hold a patient's CT and meshes. Thread-safe but for files that others
// change meanwhile.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/plan/plan.h"
#include "sim/render/shaded_volume.h"

namespace kiroku::viewer {

/// A plan with all that planning on it needs.
struct OpenedPlan {
  std::string file;               // as listed
  nlohmann::ordered_json own;     // its document
  nlohmann::ordered_json tooled;  // with the tools of sim::with_tools()
  sim::Plan plan;                 // of `tooled`
  std::shared_ptr<const sim::ShadedVolume> volume;
};

class PlanFolder {
 public:
  /// So many plans are saved; each is read whenever they are listed.
  static constexpr std::size_t kMost = 1000;

  /// kiroku::UsageError where there is no such folder.
  explicit PlanFolder(std::filesystem::path folder);

  struct Listed {
    std::string file;  // from the folder on: "liver/plan.json"
    std::string name;  // the plan's own; may be empty
    std::size_t steps = 0;
    bool has_volume = false;  // names a CT: others cannot be shown
  };
  /// By their files' names. What is no plan's document is left out.
  [[nodiscard]] std::vector<Listed> plans() const;

  /// One that is listed; Refusal 404 for another, 422 with all errors of a plan, and for one without CT.
  /// `step` hears what is done next: meshing takes seconds.
  [[nodiscard]] OpenedPlan open(const std::string& file,
                                const std::function<void(const std::string& step)>& step) const;

  /// Writes a new file, `name` with ".json", beside the plan, durably; returns it as it is listed then.
  /// Refusal 400 for a name that is no file's, 409 where there is such a file or kMost plans, 422 where the
  /// document could not be read back as a plan of so many steps, 507 where the disk has no room for it.
  [[nodiscard]] std::string save(const OpenedPlan& beside, const std::string& name,
                                 const nlohmann::ordered_json& document) const;

 private:
  [[nodiscard]] std::filesystem::path path_among(const std::vector<Listed>& all,
                                                 const std::string& file) const;

  std::filesystem::path folder_;
};

}  // namespace kiroku::viewer
