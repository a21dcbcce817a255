// VegaFEM's volumetric meshes (.veg), tetrahedra only: https://viterbi-web.usc.edu/~jbarbic/vega/
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "sim/mesh/mesh_builder.h"

namespace kiroku::sim {
namespace {

constexpr std::string_view kSpace = " \t\r\n,";

/// Statements are lines; spaces and commas separate, '#' begins a comment.
class VegReader {
 public:
  VegReader(std::string_view file, const std::string& name, LengthUnit unit)
      : cursor_(file, name), builder_(cursor_, unit) {}

  MeshFile read() {
    next_line();
    if (words_.empty()) cursor_.fail("it is empty");
    while (!words_.empty()) {
      const std::string section(words_[0]);
      if (section == "*VERTICES") {
        read_vertices();
      } else if (section == "*ELEMENTS") {
        read_elements();
      } else if (section == "*SET") {
        read_set();
      } else if (section == "*REGION") {
        read_region();
      } else if (section == "*MATERIAL") {
        next_line();  // what a body is made of is the model's business
        next_line();
      } else {
        cursor_.fail("a section was expected, such as *VERTICES, and not '" + section.substr(0, 24) + "'");
      }
    }
    return builder_.finish();
  }

 private:
  /// The words of the next line that has any; none at the end.
  void next_line() {
    words_.clear();
    while (words_.empty() && cursor_.more()) {
      std::string_view line = cursor_.line();
      line = line.substr(0, line.find('#'));
      while (true) {
        line.remove_prefix(std::min(line.find_first_not_of(kSpace), line.size()));
        if (line.empty()) break;
        const std::size_t end = std::min(line.find_first_of(kSpace), line.size());
        words_.push_back(line.substr(0, end));
        line.remove_prefix(end);
      }
    }
  }

  template <typename Number>
  Number number(std::size_t word, const char* what) const {
    Number value{};
    const std::string_view text = word < words_.size() ? words_[word] : std::string_view();
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (failure != std::errc() || end != text.data() + text.size() ||
        !std::isfinite(static_cast<double>(value))) {
      cursor_.fail(std::string(what) +
                   (text.empty() ? " is missing"
                                 : " is '" + std::string(text.substr(0, 24)) + "', which is no such number"));
    }
    return value;
  }

  void read_vertices() {
    next_line();
    const auto count = number<std::uint64_t>(0, "the number of vertices");
    if (number<int>(1, "the dimension") != 3) cursor_.fail("the dimension is not 3");
    builder_.reserve_nodes(count);
    for (std::uint64_t i = 0; i < count; ++i) {
      next_line();
      const Vector3 position(number<double>(1, "a coordinate"), number<double>(2, "a coordinate"),
                             number<double>(3, "a coordinate"));
      builder_.add_node(number<std::int64_t>(0, "the number of a vertex"), position);
    }
    next_line();
  }

  void read_elements() {
    next_line();
    if (words_.empty() || !words_[0].starts_with("TET")) {
      cursor_.fail("its elements are no tetrahedra (TET), and others are not read");
    }
    next_line();
    const auto count = number<std::uint64_t>(0, "the number of elements");
    if (number<int>(1, "the number of vertices of an element") != 4)
      cursor_.fail("its elements have not 4 vertices");
    builder_.reserve_tetrahedra(count);
    for (std::uint64_t i = 0; i < count; ++i) {
      next_line();
      const auto element = number<std::int64_t>(0, "the number of an element");
      if (i == 0) first_element_ = element;
      if (distance(first_element_, element) != i) cursor_.fail("elements are not numbered one by one");
      std::array<std::int64_t, 4> corners{};
      for (std::size_t corner = 0; corner < corners.size(); ++corner) {
        corners[corner] = number<std::int64_t>(corner + 1, "a vertex of an element");
      }
      builder_.add_tetrahedron(corners, 0);
    }
    next_line();
  }

  void read_set() {
    if (words_.size() < 2) cursor_.fail("a *SET has no name");
    std::vector<std::size_t>& elements = sets_[std::string(words_[1])];
    for (next_line(); !words_.empty() && words_[0][0] != '*'; next_line()) {
      for (std::size_t word = 0; word < words_.size(); ++word) {
        const std::uint64_t element =
            distance(first_element_, number<std::int64_t>(word, "an element of a *SET"));
        if (element >= builder_.tetrahedra()) {
          cursor_.fail("a *SET names the element " + std::string(words_[word].substr(0, 24)) +
                       ", which is not there");
        }
        elements.push_back(element);
      }
    }
  }

  void read_region() {
    next_line();
    const std::string set(words_.empty() ? std::string_view() : words_[0]);
    ++region_statements_;
    if (set == "allElements") {
      std::ranges::fill(builder_.regions(), region_statements_);
    } else if (const auto found = sets_.find(set); found != sets_.end()) {
      for (const std::size_t element : found->second) builder_.regions()[element] = region_statements_;
    } else {
      cursor_.fail("a *REGION is of the set '" + set.substr(0, 24) + "', which is not there");
    }
    next_line();
  }

  MeshCursor cursor_;
  MeshBuilder builder_;
  std::vector<std::string_view> words_;  // of the line being read
  std::int64_t first_element_ = 0;
  std::map<std::string, std::vector<std::size_t>> sets_;
  std::int32_t region_statements_ = 0;
};

}  // namespace

MeshFile parse_veg(std::string_view file, const std::string& name, LengthUnit unit) {
  return VegReader(file, name, unit).read();
}

}  // namespace kiroku::sim
