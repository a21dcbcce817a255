// An organ laid on the contours that surgeons drew in a picture of a real liver operation: the patient whose
// mesh, camera and contours the challenge P2ILF publishes (Ali et al., "An objective comparison of methods
// for augmented reality in laparoscopic liver resection by preoperative-to-intraoperative image fusion from
// the MICCAI2022 challenge", Medical Image Analysis 99, 2025; github.com/sharib-vision/P2ILF, MIT licence).
//
//   p2ilf_bench FOLDER [--show FOLDER]
//
// FOLDER: that repository's files. It has no picture of that patient, so nothing is told by colours that
// somebody filmed. --show draws each place as a PNG.
//
// The measure is the challenge's own (teamEvaluations/metric_reprejectionError.py): the Hausdorff distance in
// pixels between a contour and the polyline of its marked vertices, projected without distortion and cut to
// whole pixels; of both lines, only the places that are given are compared with the other line, as
// shapely's hausdorff_distance does. The mean over two ridges and a ligament is what the challenge ranks. It
// leaves the silhouette out. For that, the drawn contour's mean distance to the nearest outline is told.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <sstream>
#include <string>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/align/curve_fit.h"
#include "sim/align/deformed_fit.h"
#include "sim/align/polyline.h"
#include "sim/align/pose_search.h"
#include "sim/align/search_verdict.h"
#include "sim/meshing/organ_mesher.h"
#include "sim/render/lens.h"
#include "tests/bench/render_bench.h"
#include "viewer/compare/registration.h"

namespace {

using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file
using kiroku::bench::processor_seconds;
using nlohmann::json;
using Pixels = std::vector<Eigen::Vector2d>;

json read_json(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw kiroku::Error(file.string() + " cannot be read: is FOLDER the repository's?");
  return json::parse(in);
}

/// The patient as the repository has it: millimetres, the picture's own pixels.
struct Patient {
  OrganSurface surface;
  struct Contour {
    std::string name;
    Pixels pixels;
    std::vector<std::uint32_t> vertices;  // of the mesh; empty for the silhouette
  };
  std::vector<Contour> contours;
  LensCalibration lens;
  [[nodiscard]] std::vector<Vector3> line_m(const Contour& contour) const {
    std::vector<Vector3> line;
    for (const std::uint32_t vertex : contour.vertices) line.push_back(surface.nodes[vertex]);
    return line;
  }
};

OrganSurface read_obj(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw kiroku::Error(file.string() + " cannot be read: is FOLDER the repository's?");
  std::vector<Vector3> nodes;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string what;
    words >> what;
    if (what == "v") {
      Vector3 mm;
      words >> mm.x() >> mm.y() >> mm.z();
      nodes.emplace_back(mm / 1000);
    } else if (what == "f") {
      auto& face = faces.emplace_back();
      for (std::uint32_t& node : face) {
        std::string corner;
        words >> corner;  // "17/17/17"
        node = static_cast<std::uint32_t>(std::stoul(corner)) - 1;
      }
    }
  }
  return organ_surface(std::move(nodes), std::move(faces));
}

Patient read_patient(const std::filesystem::path& folder) {
  Patient patient;
  const std::filesystem::path truth = folder / "evaluation_GT";
  patient.surface = read_obj(truth / "3d-liver-model.obj");
  const json drawn = read_json(truth / "patient2_1_2D-contours.json"),
             marked = read_json(truth / "patient2_1_3D-contours.json"),
             camera = read_json(folder / "cameraparams" / "acquisition-camera-metadata.json");
  // Of those drawn, the silhouette is marked nowhere; all others are in the same order.
  std::size_t next = 0, ridges = 0;
  for (const json& each : drawn.at("contour")) {
    Patient::Contour contour;
    contour.name = each.at("contourType").get<std::string>();
    const auto xs = each.at("imagePoints").at("x").get<std::vector<double>>(),
               ys = each.at("imagePoints").at("y").get<std::vector<double>>();
    for (std::size_t i = 0; i < xs.size(); ++i) contour.pixels.emplace_back(xs[i], ys.at(i));
    if (contour.name != "Silhouette") {
      const json& line = marked.at("contour").at(next++);
      if (line.at("contourType") != contour.name)
        throw kiroku::Error("the contours on the mesh are in another order than those in the picture");
      contour.vertices = line.at("modelPoints").at("vertices").get<std::vector<std::uint32_t>>();
    }
    if (contour.name == "Ridge") contour.name += " " + std::to_string(++ridges);
    patient.contours.push_back(std::move(contour));
  }
  const auto number = [&](const char* key) { return std::stod(camera.at(key).get<std::string>()); };
  patient.lens.width = static_cast<int>(number("width"));
  patient.lens.height = static_cast<int>(number("height"));
  patient.lens.focal_px = {number("fx"), number("fy")};
  patient.lens.middle_px = {number("cx"), number("cy")};
  patient.lens.coefficients = {number("k1"), number("k2"), number("p1"), number("p2"), number("k3")};
  return patient;
}

/// As shapely has it of two lines: from the places of each to the other line.
double hausdorff_px(const Pixels& a, const Pixels& b) {
  const auto farthest = [](const Pixels& from, const Pixels& line) {
    double most = 0;
    for (const Eigen::Vector2d& place : from)
      most = std::max(most, std::sqrt(nearest_on_polyline(line, place).squared_px2));
    return most;
  };
  return std::max(farthest(a, b), farthest(b, a));
}

/// The picture of a camera whose axis is in its middle, as picked points need it: the recorded one with room
/// at two sides.
struct Canvas {
  explicit Canvas(const LensCalibration& lens)
      : width(static_cast<int>(
            std::ceil(2 * std::max(lens.middle_px.x() + 0.5, lens.width - 0.5 - lens.middle_px.x())))),
        height(static_cast<int>(
            std::ceil(2 * std::max(lens.middle_px.y() + 0.5, lens.height - 0.5 - lens.middle_px.y())))),
        field_deg(2 * std::atan(std::min(width, height) / 2.0 / lens.focal_px.x()) * 180 / std::numbers::pi),
        pinhole(pinhole_of(field_deg, width, height)),
        shift(Eigen::Vector2d(pinhole.middle_x, pinhole.middle_y) - lens.middle_px) {}
  [[nodiscard]] Pixels on(Pixels pixels) const {
    for (Eigen::Vector2d& pixel : pixels) pixel += shift;
    return pixels;
  }
  int width, height;
  double field_deg;
  Pinhole pinhole;
  Eigen::Vector2d shift;  // from a pixel of the recorded picture to that of the canvas
};

/// Where an organ was laid, and how far that is off.
struct Laid {
  std::string id, name;
  Camera camera;
  OrganSurface surface;
  std::vector<double> hausdorff_px;  // of each contour that has vertices
  double mean_px = 0, silhouette_px = 0;
  double seconds = 0;
};

void measure(const Patient& patient, const Canvas& canvas, Laid& laid) {
  laid.hausdorff_px.clear();
  laid.mean_px = 0;
  for (const Patient::Contour& contour : patient.contours) {
    if (contour.vertices.empty()) {
      const auto outline =
          outline_around(laid.surface, laid.camera, canvas.pinhole, canvas.width, canvas.height, 4, 4);
      const Pixels drawn = canvas.on(contour.pixels);
      laid.silhouette_px = std::numeric_limits<double>::quiet_NaN();
      if (!outline || outline->empty()) continue;
      laid.silhouette_px = 0;
      for (const Eigen::Vector2d& place : drawn) {
        double nearest = std::numeric_limits<double>::infinity();
        for (const OutlinePoint& point : *outline) nearest = std::min(nearest, (point.pixel - place).norm());
        laid.silhouette_px += nearest / double(drawn.size());
      }
      continue;
    }
    Pixels seen;
    for (const std::uint32_t vertex : contour.vertices) {
      const Eigen::Vector2d at =
          canvas.pinhole.pixel(laid.camera.view_m(laid.surface.nodes[vertex])) - canvas.shift;
      seen.emplace_back(std::trunc(at.x()), std::trunc(at.y()));
    }
    laid.hausdorff_px.push_back(hausdorff_px(seen, contour.pixels));
    laid.mean_px += laid.hausdorff_px.back();
  }
  laid.mean_px /= double(laid.hausdorff_px.size());
}

/// How large the organ is, and how much of it is in the recorded picture.
void tell_size(const Patient& patient, const Canvas& canvas, const Laid& laid) {
  constexpr int kShrink = 8, kRoom = 4000;
  const int width = patient.lens.width, height = patient.lens.height;
  Pinhole wide = canvas.pinhole;
  wide.middle_x = patient.lens.middle_px.x() + kRoom;
  wide.middle_y = patient.lens.middle_px.y() + kRoom;
  const auto drawn =
      silhouette_of(laid.surface, laid.camera, wide, width + 2 * kRoom, height + 2 * kRoom, kShrink);
  if (!drawn) return;
  double all = 0, within = 0;
  for (int y = 0; y < drawn->height; ++y) {
    for (int x = 0; x < drawn->width; ++x) {
      if (!(drawn->at(x, y) > 0)) continue;
      const int left = kShrink * x - kRoom, top = kShrink * y - kRoom;
      all += 1;
      within += left >= 0 && top >= 0 && left < width && top < height ? 1 : 0;
    }
  }
  std::printf("  as large as %.1f pictures, %.0f %% of it in the picture, middle %.0f mm away\n",
              all * kShrink * kShrink / width / height, 100 * within / std::max(1.0, all),
              -1000 * laid.camera.view_m(laid.surface.middle_m).z());
}

void tell(const Laid& laid) {
  std::printf("%-46s", laid.name.c_str());
  for (const double each : laid.hausdorff_px) std::printf(" %7.1f", each);
  std::printf("  mean %7.1f  silhouette %7.1f px  %5.1f s\n", laid.mean_px, laid.silhouette_px, laid.seconds);
}

void show(const Patient& patient, const Canvas& canvas, const Laid& laid,
          const std::filesystem::path& folder) {
  Picture picture(canvas.width, canvas.height);
  cv::Mat image(picture.height, picture.width, CV_8UC3, picture.rgb.data());
  image.setTo(cv::Scalar(40, 40, 44));
  if (const auto drawn =
          silhouette_of(laid.surface, laid.camera, canvas.pinhole, canvas.width, canvas.height, 1)) {
    for (int y = 0; y < drawn->height; ++y) {
      for (int x = 0; x < drawn->width; ++x) {
        if (drawn->at(x, y) > 0) image.at<cv::Vec3b>(y, x) = {112, 62, 58};
      }
    }
  }
  const auto point_of = [](const Eigen::Vector2d& at) {
    return cv::Point(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())));
  };
  const auto draw_line = [&](const Pixels& line, const cv::Scalar& colour, int thickness) {
    for (std::size_t i = 0; i + 1 < line.size(); ++i)
      cv::line(image, point_of(line[i]), point_of(line[i + 1]), colour, thickness, cv::LINE_AA);
  };
  const Eigen::Vector2d corner = canvas.shift;
  cv::rectangle(image, point_of(corner),
                point_of(corner + Eigen::Vector2d(patient.lens.width - 1, patient.lens.height - 1)),
                cv::Scalar(120, 120, 120), 2);
  if (const auto outline =
          outline_around(laid.surface, laid.camera, canvas.pinhole, canvas.width, canvas.height, 4, 4)) {
    for (const OutlinePoint& point : *outline)
      cv::circle(image, point_of(point.pixel), 2, cv::Scalar(255, 255, 255), cv::FILLED, cv::LINE_AA);
  }
  for (const Patient::Contour& contour : patient.contours) {
    const bool ligament = contour.name == "Ligament", silhouette = contour.vertices.empty();
    draw_line(canvas.on(contour.pixels),
              silhouette ? cv::Scalar(90, 220, 255)
                         : (ligament ? cv::Scalar(120, 230, 90) : cv::Scalar(255, 210, 60)),
              5);
    Pixels seen;
    for (const std::uint32_t vertex : contour.vertices)
      seen.push_back(canvas.pinhole.pixel(laid.camera.view_m(laid.surface.nodes[vertex])));
    draw_line(seen, cv::Scalar(255, 90, 220), 3);
    for (const Eigen::Vector2d& at : seen) cv::circle(image, point_of(at), 6, cv::Scalar(255, 90, 220), 2);
  }
  kiroku::bench::write_png(folder / (laid.id + ".png"), picture);
}

/// (a) A person clicks `count` corresponding places of each line, both ends among them.
Laid clicked(const Patient& patient, const Canvas& canvas, std::size_t count) {
  std::vector<kiroku::compare::PickedPoint> picked;
  for (const Patient::Contour& contour : patient.contours) {
    if (contour.vertices.empty()) continue;
    const std::vector<Vector3> places = spread_over_polyline(patient.line_m(contour), count);
    const Pixels pixels = spread_over_polyline(canvas.on(contour.pixels), count);
    for (std::size_t i = 0; i < count; ++i) picked.push_back({places[i], pixels[i]});
  }
  const double begun = processor_seconds();
  const auto registration =
      kiroku::compare::register_camera(picked, canvas.width, canvas.height, canvas.field_deg);
  Laid laid;
  laid.surface = patient.surface;
  laid.camera = registration.camera;
  laid.seconds = processor_seconds() - begun;
  return laid;
}

/// A picture of which only a band along each contour of the organ's outline is seen, the organ's colour on
/// the organ's side: towards the middle of all contours. Scaled as pictures are for the search.
struct Bands {
  Picture picture;
  Cover cover;
  ColourCells cells;
  Pinhole pinhole;
};
Bands bands_of(const Patient& patient, const Canvas& canvas) {
  constexpr int kLesserSide = 480;
  const double scale = double(kLesserSide) / std::min(canvas.width, canvas.height);
  Bands made;
  made.picture = Picture(static_cast<int>(std::lround(canvas.width * scale)),
                         static_cast<int>(std::lround(canvas.height * scale)));
  made.pinhole = pinhole_of(canvas.field_deg, made.picture.width, made.picture.height);
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Patient::Contour& contour : patient.contours) {
    for (const Eigen::Vector2d& pixel : canvas.on(contour.pixels))
      middle += scale * pixel / double(contour.pixels.size() * patient.contours.size());
  }
  cv::Mat image(made.picture.height, made.picture.width, CV_8UC3, made.picture.rgb.data());
  image.setTo(cv::Scalar(128, 128, 128));  // grey is covered
  constexpr double kBandPx = 24;
  for (const Patient::Contour& contour : patient.contours) {
    if (contour.name == "Ligament") continue;
    Pixels line = canvas.on(contour.pixels);
    for (Eigen::Vector2d& pixel : line) pixel *= scale;
    const Eigen::Vector2d along = (line.back() - line.front()).normalized();
    Eigen::Vector2d inwards(-along.y(), along.x());
    if (inwards.dot(middle - line[line.size() / 2]) < 0) inwards = -inwards;
    const auto fill = [&](const Eigen::Vector2d& across, const cv::Scalar& colour) {
      std::vector<cv::Point> border;
      for (const Eigen::Vector2d& at : line)
        border.emplace_back(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())));
      for (auto at = line.rbegin(); at != line.rend(); ++at)
        border.emplace_back(static_cast<int>(std::lround(at->x() + across.x())),
                            static_cast<int>(std::lround(at->y() + across.y())));
      cv::fillPoly(image, std::vector<std::vector<cv::Point>>{border}, colour);
    };
    fill(-kBandPx * inwards, cv::Scalar(205, 165, 120));
    fill(kBandPx * inwards, cv::Scalar(150, 62, 52));
  }
  made.cover = cover_of(made.picture);
  made.cells = colour_cells(made.picture, made.cover);
  return made;
}

/// (b) What --align auto does of the first picture: the place that it holds for the best, whatever its
/// verdict.
std::optional<Laid> by_outline(const Patient& patient, const Bands& bands, const SearchRange& range) {
  const double begun = processor_seconds();
  const PoseSearch search(patient.surface, range);
  const Picture mirror = mirrored(bands.picture);
  const Cover mirror_cover = cover_of(mirror);
  const std::vector<OutlineFit> fits = search.find(bands.picture, bands.cover, bands.cells, bands.pinhole);
  const SearchVerdict verdict =
      verdict_of(fits, search.find(mirror, mirror_cover, colour_cells(mirror, mirror_cover), bands.pinhole));
  std::printf("by the outline: %s, %zu places\n", name_of(verdict.why), fits.size());
  if (fits.empty()) return {};
  const OutlineFit& best = fits.front();
  std::printf("  the best: misfit %.2f, supported %.2f, seen %.2f, agreement %.2f, in the picture %.2f\n",
              best.misfit_px, best.supported, best.seen, best.agreement, best.share_in_picture);
  Laid laid;
  laid.surface = patient.surface;
  laid.camera = best.camera;
  laid.seconds = processor_seconds() - begun;
  return laid;
}

std::vector<DrawnCurve> curves_of(const Patient& patient, const Canvas& canvas, bool silhouette) {
  std::vector<DrawnCurve> curves;
  for (const Patient::Contour& contour : patient.contours) {
    if (contour.vertices.empty() && !silhouette) continue;
    curves.push_back({canvas.on(contour.pixels), patient.line_m(contour)});
  }
  return curves;
}

/// (c) From any place, by curves alone.
std::optional<Laid> by_curves(const Patient& patient, const Canvas& canvas, const SearchRange& range,
                              bool silhouette, CurveFit& best) {
  const double begun = processor_seconds();
  const auto fits = find_curves(patient.surface, range, canvas.pinhole, canvas.width, canvas.height,
                                curves_of(patient, canvas, silhouette));
  if (fits.empty()) return {};
  best = fits.front();
  Laid laid;
  laid.surface = patient.surface;
  laid.camera = best.camera;
  laid.seconds = processor_seconds() - begun;
  std::printf("by curves: %zu places, misfit", fits.size());
  for (const CurveFit& fit : fits) std::printf(" %.1f", fit.misfit_px);
  std::printf(" px, standard error %.1f mm\n",
              1000 * standard_error_m(patient.surface, best.camera, best.covariance_m2));
  return laid;
}

/// Voxels of `cell_m` whose middle is within the surface: an odd number of faces lies above.
LabelMap voxels_of(const OrganSurface& surface, double cell_m) {
  Vector3 low = surface.nodes.front(), high = low;
  for (const Vector3& node : surface.nodes) {
    low = low.cwiseMin(node);
    high = high.cwiseMax(node);
  }
  LabelMap map;
  map.grid.spacing_m.setConstant(cell_m);
  // Off any node, so that no line of voxels meets an edge.
  map.grid.origin_m = low - Vector3(2.0137, 2.0291, 2) * cell_m;
  for (Eigen::Index i = 0; i < 3; ++i)
    map.grid.size[static_cast<std::size_t>(i)] = static_cast<std::size_t>((high - low)[i] / cell_m) + 5;
  map.labels.assign(map.grid.voxels(), 0);
  const auto [wide, deep, tall] = map.grid.size;
  std::vector<std::vector<double>> crossings(wide * deep);
  for (const auto& face : surface.faces) {
    const Vector3 &a = surface.nodes[face[0]], &b = surface.nodes[face[1]], &c = surface.nodes[face[2]];
    const auto cell_of = [&](double at, Eigen::Index axis) {
      return std::max(0.0, std::floor((at - map.grid.origin_m[axis]) / cell_m));
    };
    const double whole = (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
    if (whole == 0) continue;
    const auto x_to = static_cast<std::size_t>(cell_of(std::max({a.x(), b.x(), c.x()}), 0)),
               y_to = static_cast<std::size_t>(cell_of(std::max({a.y(), b.y(), c.y()}), 1));
    for (auto i = static_cast<std::size_t>(cell_of(std::min({a.x(), b.x(), c.x()}), 0)); i <= x_to; ++i) {
      for (auto j = static_cast<std::size_t>(cell_of(std::min({a.y(), b.y(), c.y()}), 1)); j <= y_to; ++j) {
        const double x = map.grid.origin_m.x() + double(i) * cell_m,
                     y = map.grid.origin_m.y() + double(j) * cell_m;
        const double u = ((x - a.x()) * (c.y() - a.y()) - (y - a.y()) * (c.x() - a.x())) / whole,
                     v = ((b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x())) / whole;
        if (u < 0 || v < 0 || u + v > 1) continue;
        crossings[i + wide * j].push_back(a.z() + u * (b.z() - a.z()) + v * (c.z() - a.z()));
      }
    }
  }
  for (std::size_t j = 0; j < deep; ++j) {
    for (std::size_t i = 0; i < wide; ++i) {
      for (std::size_t k = 0; k < tall; ++k) {
        const double z = map.grid.origin_m.z() + double(k) * cell_m;
        const auto above = std::ranges::count_if(crossings[i + wide * j], [&](double at) { return at > z; });
        map.labels[map.grid.offset(i, j, k)] = above % 2 == 1 ? 1 : 0;
      }
    }
  }
  return map;
}

/// (d) The organ deformed from a rigid place, the marked lines taken for tissue that was followed to the
/// nearest place of its contour, again and again.
std::optional<Laid> deformed(const Patient& patient, const Canvas& canvas, const Bands& bands,
                             const CurveFit& rigid) {
  const double begun = processor_seconds();
  constexpr double kVoxelM = 0.003, kHeldM = 0.03;
  const OrganMesh made = make_organ_mesh(voxels_of(patient.surface, kVoxelM), {3000});
  double back = -std::numeric_limits<double>::infinity();
  for (const Vector3& node : made.mesh.nodes) back = std::max(back, node.y());
  Constraints constraints(made.mesh.nodes.size());
  for (std::size_t i = 0; i < made.mesh.nodes.size(); ++i) {
    if (made.mesh.nodes[i].y() > back - kHeldM) constraints.prescribe(i, Vector3::Zero(), "held");
  }
  const DeformableOrgan organ(ElasticBody(made.mesh, {{1, {3000, 0.4, 1000}}}, constraints));
  struct Marked {
    SurfacePlace place;
    const Patient::Contour* contour;
  };
  std::vector<Marked> marked;
  constexpr int kBetween = 8;
  for (const Patient::Contour& contour : patient.contours) {
    const std::vector<Vector3> line = patient.line_m(contour);
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
      for (int part = 0; part < kBetween; ++part)
        marked.push_back(
            {nearest_place(organ.surface(), line[i] + (line[i + 1] - line[i]) * part / kBetween), &contour});
    }
    if (!line.empty()) marked.push_back({nearest_place(organ.surface(), line.back()), &contour});
  }
  const double scale = double(bands.picture.height) / canvas.height;
  DeformedFit fit;
  fit.camera = rigid.camera;
  fit.shape = organ.shape(Eigen::VectorXd::Zero(organ.unknowns()));
  Eigen::VectorXd coefficients;
  constexpr int kRounds = 12;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<TrackedTissue> tissue;
    for (const auto& [place, contour] : marked) {
      const Eigen::Vector2d seen = canvas.pinhole.pixel(fit.camera.view_m(place_m(fit.shape.surface, place)));
      const Pixels drawn = canvas.on(contour->pixels);
      const auto nearest = std::ranges::min_element(
          drawn, {}, [&](const Eigen::Vector2d& at) { return (at - seen).squaredNorm(); });
      tissue.push_back({place, scale * *nearest});
    }
    // And from the contours to the lines, or a line would shrink into its contour.
    for (const Patient::Contour& contour : patient.contours) {
      if (contour.vertices.empty()) continue;
      const Pixels drawn = canvas.on(contour.pixels);
      constexpr std::size_t kEach = 16;
      for (std::size_t i = 0; i < drawn.size(); i += kEach) {
        const Marked* nearest = nullptr;
        double least = std::numeric_limits<double>::infinity();
        for (const Marked& each : marked) {
          if (each.contour != &contour) continue;
          const double here =
              (canvas.pinhole.pixel(fit.camera.view_m(place_m(fit.shape.surface, each.place))) - drawn[i])
                  .squaredNorm();
          if (here >= least) continue;
          least = here;
          nearest = &each;
        }
        tissue.push_back({nearest->place, scale * drawn[i]});
      }
    }
    // The camera stays, as the lines alone leave it open.
    constexpr double kStillM = 1e-4;
    const MotionCovariance still = kStillM * kStillM * MotionCovariance::Identity();
    fit =
        fit_deformed(bands.cells, organ, bands.pinhole, {rigid.camera, still}, coefficients, tissue, nullptr);
    coefficients = fit.coefficients;
  }
  double farthest = 0;
  for (const Vector3& each : fit.shape.displacement_m) farthest = std::max(farthest, each.norm());
  std::printf("deformed: %s, %zu nodes, tissue explained %.0f %%, largest displacement %.1f mm\n",
              name_of(fit.why), made.mesh.nodes.size(), 100 * fit.points_agree, 1000 * farthest);
  Laid laid;
  laid.surface = patient.surface;
  for (Vector3& node : laid.surface.nodes) {
    const SurfacePlace place = nearest_place(organ.surface(), node);
    for (std::size_t i = 0; i < 3; ++i)
      node += place.weights[static_cast<Eigen::Index>(i)] *
              fit.shape.displacement_m[organ.surface().faces[place.face][i]];
  }
  laid.camera = fit.camera;
  laid.seconds = processor_seconds() - begun;
  return laid;
}

void run(const std::filesystem::path& folder, const std::filesystem::path& shown) {
  const Patient patient = read_patient(folder);
  const Canvas canvas(patient.lens);
  std::printf("%zu nodes, %zu faces, radius %.0f mm; a canvas of %dx%d, %.1f degrees\n",
              patient.surface.nodes.size(), patient.surface.faces.size(), 1000 * patient.surface.radius_m,
              canvas.width, canvas.height, canvas.field_deg);
  try {
    const Lens lens(patient.lens);
    std::printf("the calibration is a lens of ours: %.1f degrees\n", lens.field_deg());
  } catch (const kiroku::UsageError& error) {
    std::printf("the calibration is refused: %s\n", error.what());
  }
  std::printf("%-46s", "pixels");
  for (const Patient::Contour& contour : patient.contours) {
    if (!contour.vertices.empty()) std::printf(" %7.7s", contour.name.c_str());
  }
  std::printf("\n");
  std::string figures;
  const auto add = [&](std::optional<Laid> laid, const std::string& id, const std::string& name) {
    if (!laid) {
      std::printf("%-46s nothing\n", name.c_str());
      return;
    }
    laid->id = id;
    laid->name = name;
    measure(patient, canvas, *laid);
    tell(*laid);
    tell_size(patient, canvas, *laid);
    if (!shown.empty()) show(patient, canvas, *laid, shown);
    constexpr std::array<const char*, 3> kOf{"ridge1", "ridge2", "ligament"};
    std::ostringstream text;
    text.precision(3);
    for (std::size_t i = 0; i < kOf.size() && i < laid->hausdorff_px.size(); ++i)
      text << " " << id << "_" << kOf[i] << "=" << laid->hausdorff_px[i];
    text << " " << id << "_mean=" << laid->mean_px << " " << id << "_silhouette=" << laid->silhouette_px;
    figures += text.str();
  };
  add(clicked(patient, canvas, 2), "clicked_ends", "clicked: both ends of each line");
  add(clicked(patient, canvas, 4), "clicked_even", "clicked: four places of each line");
  SearchRange anywhere;
  anywhere.spread_deg = 180;
  const Bands bands = bands_of(patient, canvas);
  if (!shown.empty()) kiroku::bench::write_png(shown / "bands.png", bands.picture);
  CurveFit lines, with_silhouette;
  add(by_curves(patient, canvas, anywhere, false, lines), "lines", "ridges and ligament as curves");
  add(by_curves(patient, canvas, anywhere, true, with_silhouette), "curves", "the same with the silhouette");
  add(by_outline(patient, bands, anywhere), "outline", "the outline alone");
  if (!lines.curve_px.empty())
    add(deformed(patient, canvas, bands, lines), "deformed", "deformed, from ridges and ligament");
  std::printf("docs/results/record.py align-p2ilf --machine NAME%s\n", figures.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 2 && !(argc == 4 && std::string(argv[2]) == "--show"))
      throw kiroku::UsageError("p2ilf_bench FOLDER [--show FOLDER]");
    run(argv[1], argc == 4 ? argv[3] : "");
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "p2ilf_bench: " << error.what() << '\n';
    return 1;
  }
}
