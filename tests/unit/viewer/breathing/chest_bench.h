// A breathing workbench with a box-shaped lung in a made-up chest, and radiographs of it that breathe by a
// known motion.
#pragma once

#include <fstream>
#include <memory>

#include "sim/mesh/mesh_writer.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/sim/respiration/box_chest.h"
#include "viewer/breathing/breathing_bench.h"

namespace kiroku::test {

class ChestBench {
 public:
  ChestBench() {
    write("lung.msh", sim::msh_text(box_lung_model().mesh, sim::LengthUnit::kMillimetre));
    write("lung.json", document(R"("tumour": {"region": 2})"));
    truth_.motion.rib_cage = {0.002, 0.2, std::nullopt, 0, 0};
    truth_.motion.diaphragm = {0.009, 0.5, sim::Vector3(0, 0.28, -0.96), 0.001, 0};
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  [[nodiscard]] static std::string document(const std::string& rest) {
    return R"({"mesh": "lung.msh", "length_unit": "mm", "lung": "right", "phases": 12, )" + rest + "}";
  }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_.path(); }
  [[nodiscard]] const ChestTruth& truth() const { return truth_; }

  /// Without radiographs.
  [[nodiscard]] viewer::BenchInputs inputs() const {
    const std::filesystem::path file = folder_ / "lung.json";
    viewer::BenchInputs inputs{.file = file,
                               .model = sim::read_breathing_model(file),
                               .named = {},
                               .volume = box_chest(),
                               .geometry = chest_view(0),
                               .radiographs = {}};
    inputs.named = viewer::files_named_by(inputs.model, file);
    return inputs;
  }
  [[nodiscard]] viewer::BenchInputs inputs_with_radiographs(std::size_t moments = 6) const {
    viewer::BenchInputs inputs = this->inputs();
    ChestTruth truth = truth_;
    truth.moments = moments;
    // The truth goes by whole solves of its own directions.
    sim::BreathingModel model = inputs.model;
    model.motion = truth_.motion;
    const sim::BreathingScene scene(model, inputs.volume);
    for (sim::SeriesPicture& one : chest_radiographs(scene, {chest_view(0)}, truth))
      inputs.radiographs.push_back({one.time_s, std::move(one.image), std::move(one.name)});
    return inputs;
  }

 private:
  TemporaryFolder folder_;
  ChestTruth truth_;
};

}  // namespace kiroku::test
