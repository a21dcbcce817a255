#include "sim/respiration/series_pose.h"

#include <algorithm>
#include <utility>

#include <Eigen/Geometry>

#include "base/number_text.h"
#include "sim/drr/registration.h"

namespace kiroku::sim {
namespace {

/// The pose is found in so many pixels of the lesser side.
constexpr std::size_t kMeanPixels = 64;
constexpr double kClearlyBetter = 0.1;

class PoseSearch {
 public:
  PoseSearch(const BreathingScene& scene, const std::vector<ProjectionGeometry>& views,
             std::span<const SeriesPicture> pictures, const SeriesProgress& progress)
      : scene_(scene), views_(views), pictures_(pictures), progress_(progress) {}

  SeriesPose run() {
    search();
    if (pose_.similarity_after < kDoubtfulSimilarity) try_other_ways();
    return std::move(pose_);
  }

  /// Searches only where the pictures do not look like the CT as it lies.
  SeriesPose run_held() {
    const std::vector<RegistrationView> means = mean_pictures();
    for (const RegistrationView& mean : means) {
      pose_.similarity_before += gradient_correlation(mean.radiograph, scene_.at_rest(mean.geometry)) /
                                 static_cast<double>(means.size());
      ++pose_.projections;
    }
    const double before = pose_.similarity_before;
    if (before < kDoubtfulSimilarity) {
      search();
      if (pose_.similarity_after > before + kClearlyBetter) {
        pose_.findings.push_back(
            "the radiographs and the CT agree to " + number_text(before, 2) +
            " as the geometry has the patient, and to " + number_text(pose_.similarity_after, 2) +
            " where the patient lies " + number_text(kMmPerM * pose_.translation_m.norm(), 2) +
            " mm beside that, turned by " + number_text(kDegrees * Eigen::AngleAxisd(pose_.turn).angle(), 2) +
            " degrees: find that first, with kiroku sim fit-series --aligned-geometry");
      }
      if (pose_.similarity_after < kDoubtfulSimilarity) try_other_ways();
    }
    pose_.translation_m.setZero();
    pose_.turn.setIdentity();
    pose_.similarity_after = before;
    return std::move(pose_);
  }

 private:
  static constexpr double kMmPerM = 1000, kDegrees = 180 / 3.14159265358979;

  void search() {
    const Registration found = registered(mean_pictures(), "finding how the patient lies");
    pose_.similarity_before = found.similarity_before;
    pose_.similarity_after = found.similarity_after;
    pose_.translation_m = found.translation_m;
    const double angle = found.rotation_rad.norm();
    if (angle > 0) pose_.turn = Eigen::AngleAxisd(angle, found.rotation_rad / angle).toRotationMatrix();
  }

  [[nodiscard]] std::vector<RegistrationView> mean_pictures() const {
    std::vector<RegistrationView> means;
    for (std::size_t view = 0; view < views_.size(); ++view) {
      const std::size_t factor =
          std::max<std::size_t>(std::min(views_[view].columns(), views_[view].rows()) / kMeanPixels, 1);
      RegistrationView mean{{}, views_[view].binned(factor)};
      mean.radiograph = {mean.geometry.columns(), mean.geometry.rows(), {}};
      mean.radiograph.values.assign(mean.radiograph.columns * mean.radiograph.rows, 0.0F);
      for (const SeriesPicture& picture : pictures_) {
        if (picture.view != view) continue;
        const ProjectionImage image = binned(picture.image, factor);
        for (std::size_t i = 0; i < image.values.size(); ++i) mean.radiograph.values[i] += image.values[i];
      }
      means.push_back(std::move(mean));
    }
    return means;
  }

  Registration registered(std::span<const RegistrationView> means, const std::string& doing) {
    const Registration found = register_rigidly(
        means, scene_.middle_m(),
        [&](const ProjectionGeometry& geometry) { return scene_.at_rest(geometry); },
        [&](std::size_t done, std::size_t all) {
          if (progress_) progress_(doing, done, all);
        });
    pose_.projections += found.projections;
    return found;
  }

  /// Pictures that were laid on the scanner the wrong way round, or whose grey means the opposite.
  void try_other_ways() {
    struct Way {
      const char* words;
      bool across, down, turned;
    };
    constexpr std::array<Way, 5> kWays{{{"mirrored left to right", true, false, false},
                                        {"upside down (mirrored)", false, true, false},
                                        {"turned by 180 degrees", true, true, false},
                                        {"turned by 90 degrees clockwise", true, false, true},
                                        {"turned by 90 degrees anticlockwise", false, true, true}}};
    const std::vector<RegistrationView> means = mean_pictures();
    std::string tried;
    double best = -1;
    const char* best_way = nullptr;
    for (const Way& way : kWays) {
      std::vector<RegistrationView> changed = means;
      bool fits = true;
      for (RegistrationView& view : changed) {
        ProjectionImage& image = view.radiograph;
        const ProjectionImage from = image;
        if (way.turned && image.columns != image.rows) fits = false;
        for (std::size_t row = 0; row < image.rows && fits; ++row) {
          for (std::size_t column = 0; column < image.columns; ++column) {
            std::size_t x = column, y = row;
            if (way.turned) std::swap(x, y);
            if (way.turned ? way.down : way.across) x = image.columns - 1 - x;
            if (way.turned ? way.across : way.down) y = image.rows - 1 - y;
            image.values[row * image.columns + column] = from.values[y * image.columns + x];
          }
        }
      }
      if (!fits) continue;
      const double similarity = registered(changed, "trying other ways round").similarity_after;
      tried += std::string(tried.empty() ? "" : ", ") + way.words + " " + number_text(similarity, 2);
      if (similarity > best) {
        best = similarity;
        best_way = way.words;
      }
    }
    // What is dark for light is as alike as what is light for light, the other way round.
    std::vector<RegistrationView> inverse = means;
    for (RegistrationView& view : inverse) {
      for (float& value : view.radiograph.values) value = -value;
    }
    const double inverted = registered(inverse, "trying other ways round").similarity_after;
    tried += ", with dark and light exchanged " + number_text(inverted, 2);
    const std::string agree = "the radiographs and the CT agree to " +
                              number_text(pose_.similarity_after, 2) +
                              " (gradient correlation of the mean pictures, at the best pose found)";
    const std::string all = "; tried: " + tried;
    if (best > pose_.similarity_after + kClearlyBetter && best >= inverted) {
      pose_.refusal = agree + ", but " + best_way + " to " + number_text(best, 2) +
                      ": the pictures are the other way round than the geometry says" + all;
    } else if (inverted > pose_.similarity_after + kClearlyBetter) {
      pose_.refusal = agree + ", but with dark and light exchanged to " + number_text(inverted, 2) +
                      ": give --polarity bone-black (or bone-white)" + all;
    } else if (pose_.similarity_after < kLeastSimilarity) {
      pose_.refusal =
          agree + ", and " + number_text(kLeastSimilarity, 2) +
          " at least is needed: another patient's series, another geometry, or a patient who lies "
          "further than some 20 mm or 10 degrees from where the geometry has them" +
          all;
    } else {
      pose_.findings.push_back(agree + all);
    }
  }

  const BreathingScene& scene_;
  const std::vector<ProjectionGeometry>& views_;
  const std::span<const SeriesPicture> pictures_;
  const SeriesProgress& progress_;
  SeriesPose pose_;
};

}  // namespace

SeriesPose find_series_pose(const BreathingScene& scene, const std::vector<ProjectionGeometry>& views,
                            std::span<const SeriesPicture> pictures, bool held,
                            const SeriesProgress& progress) {
  PoseSearch search(scene, views, pictures, progress);
  return held ? search.run_held() : search.run();
}

}  // namespace kiroku::sim
