#include "sim/render/transfer_function.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "sim/model/body_model.h"
#include "sim/render/transfer_presets.h"

namespace kiroku::sim {
namespace {

struct Point {
  double hu = 0;
  std::array<double, 3> colour{};
  double opacity = 0;
};

std::array<double, 3> colour_of(const JsonField& field) {
  const std::string text = field.text();
  const auto is_digit = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F');
  };
  constexpr std::size_t kLength = 7;
  if (text.size() != kLength || text[0] != '#' || !std::all_of(text.begin() + 1, text.end(), is_digit))
    field.fail("is '" + text + "': a colour is written as \"#rrggbb\"");
  std::array<double, 3> colour{};
  constexpr int kHexadecimal = 16;
  for (std::size_t c = 0; c < colour.size(); ++c)
    colour[c] = std::stoi(text.substr(1 + 2 * c, 2), nullptr, kHexadecimal) / 255.0;
  return colour;
}

double number_within(const JsonField& field, double least, double greatest, const std::string& what) {
  const double number = field.number();
  if (!(number >= least && number <= greatest)) field.fail(what);
  return number;
}

std::vector<Point> read_points(const JsonField& list) {
  std::vector<Point> points;
  for (const JsonField& entry : list.elements()) {
    entry.expect_object({"hu", "color", "opacity_per_mm"});
    Point point;
    point.hu = number_within(entry.member("hu"), -100000, 100000, "is no number of Hounsfield units");
    if (!points.empty() && point.hu <= points.back().hu)
      entry.member("hu").fail("must be greater than that of the point before");
    point.colour = colour_of(entry.member("color"));
    point.opacity = number_within(entry.member("opacity_per_mm"), 0, 1, "must be from 0 to 1");
    points.push_back(point);
  }
  if (points.empty()) list.fail("must have at least one point");
  return points;
}

/// Straight lines between points, their values beyond the ends.
Point between(const std::vector<Point>& points, double hu) {
  const auto above = std::ranges::find_if(points, [&](const Point& point) { return point.hu >= hu; });
  if (above == points.begin()) return points.front();
  if (above == points.end()) return points.back();
  const Point& low = *(above - 1);
  const double part = (hu - low.hu) / (above->hu - low.hu);
  Point point{hu, {}, low.opacity + part * (above->opacity - low.opacity)};
  for (std::size_t c = 0; c < 3; ++c)
    point.colour[c] = low.colour[c] + part * (above->colour[c] - low.colour[c]);
  return point;
}

void read_light(const JsonField& light, TransferFunction& function) {
  light.expect_object({"ambient", "diffuse", "specular", "shininess", "edge_hu_per_mm"});
  const auto share = [&](const char* key, double& into) {
    if (const auto field = light.optional_member(key))
      into = number_within(*field, 0, 2, "must be from 0 to 2");
  };
  share("ambient", function.ambient);
  share("diffuse", function.diffuse);
  share("specular", function.specular);
  if (const auto field = light.optional_member("shininess"))
    function.shininess = number_within(*field, 1, 1000, "must be from 1 to 1000");
  if (const auto field = light.optional_member("edge_hu_per_mm")) {
    const std::vector<JsonField> ends = field->elements(2);
    function.edge_hu_per_mm = {ends[0].number(), ends[1].number()};
    if (!(function.edge_hu_per_mm[0] >= 0 && function.edge_hu_per_mm[1] > function.edge_hu_per_mm[0]))
      field->fail("must be two numbers, from 0 on, the second greater than the first");
  }
}

}  // namespace

std::array<int, 2> TransferFunction::visible_hu() const {
  std::array<int, 2> visible{kGreatestHu, kLeastHu};
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (!(entries[i].extinction_per_mm > 0)) continue;
    visible[0] = std::min(visible[0], kLeastHu + static_cast<int>(i));
    visible[1] = kLeastHu + static_cast<int>(i);
  }
  return visible;
}

bool TransferFunction::shows(double least_hu, double greatest_hu) const {
  const auto entry = [](double hu) {
    return static_cast<std::ptrdiff_t>(std::clamp(hu, double{kLeastHu}, double{kGreatestHu}) - kLeastHu);
  };
  // One more on each side: what is between whole numbers is rounded.
  const auto first = entries.begin() + std::max<std::ptrdiff_t>(entry(std::floor(least_hu)) - 1, 0);
  const auto last = entries.begin() + std::min<std::ptrdiff_t>(entry(std::ceil(greatest_hu)) + 2,
                                                               static_cast<std::ptrdiff_t>(entries.size()));
  return std::any_of(first, last, [](const Entry& shown) { return shown.extinction_per_mm > 0; });
}

TransferFunction parse_transfer_function(std::string_view text, const std::string& file) {
  const nlohmann::json parsed = JsonField::parse(text, file);
  const JsonField document(parsed, file);
  document.expect_object({"name", "points", "light"});
  TransferFunction function;
  function.name = document.member("name").text();
  function.ambient = 0.25;
  function.diffuse = 0.75;
  function.specular = 0.3;
  function.shininess = 30;
  function.edge_hu_per_mm = {5, 30};
  const JsonField list = document.member("points");
  const std::vector<Point> points = read_points(list);
  if (const auto light = document.optional_member("light")) read_light(*light, function);
  function.entries.resize(kHuEntries);
  bool any = false;
  // Nothing is wholly opaque: its extinction would be infinite.
  constexpr double kMostOpaque = 1 - 1e-4;
  for (std::size_t i = 0; i < kHuEntries; ++i) {
    const Point point = between(points, kLeastHu + double(i));
    TransferFunction::Entry& entry = function.entries[i];
    for (std::size_t c = 0; c < 3; ++c) entry.colour[c] = static_cast<float>(point.colour[c]);
    entry.extinction_per_mm = static_cast<float>(-std::log2(1 - std::min(point.opacity, kMostOpaque)));
    any = any || entry.extinction_per_mm > 0;
  }
  if (!any) {
    list.fail(
        "hides everything: opacity_per_mm is 0 from -1024 to 3071 HU; give what is to be seen some opacity");
  }
  return function;
}

std::vector<std::string> transfer_function_names() {
  std::vector<std::string> names;
  for (const TransferPreset& preset : transfer_presets()) names.emplace_back(preset.name);
  return names;
}

std::string transfer_function_text(const std::string& name) {
  for (const TransferPreset& preset : transfer_presets()) {
    if (name == preset.name) return preset.text;
  }
  std::string known;
  for (const TransferPreset& preset : transfer_presets())
    known += (known.empty() ? "" : ", ") + std::string(preset.name);
  throw UsageError("there is no transfer function '" + name + "'; there are " + known +
                   ", or give a file that ends in .json");
}

TransferFunction find_transfer_function(const std::string& name_or_file) {
  if (std::filesystem::path(name_or_file).extension() == ".json")
    return parse_transfer_function(read_document(name_or_file), name_or_file);
  return parse_transfer_function(transfer_function_text(name_or_file), name_or_file);
}

}  // namespace kiroku::sim
