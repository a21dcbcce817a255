#include "recorder/control/plan_patient.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <optional>
#include <string_view>
#include <system_error>

#include "base/foreign_json.h"
#include "base/trimmed.h"

namespace kiroku::recorder {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kLargestSeal = 1U << 20;
/// A CT's pictures are of one patient: the first ones tell whose, and nobody who begins a case waits for a
/// slow disk.
constexpr std::size_t kMostPictures = 256;
constexpr int kMostElements = 10'000;
constexpr std::size_t kMostLevels = 64;
constexpr std::uint32_t kUndefined = 0xFFFFFFFF;
constexpr std::uint32_t kItem = 0xFFFEE000, kItemEnd = 0xFFFEE00D, kSequenceEnd = 0xFFFEE0DD;
constexpr std::uint32_t kTransferSyntax = 0x00020010, kPatientId = 0x00100020;

/// Of blanks, and of the zeros by which a file pads (PS3.5 6.2).
std::string without_padding(const std::string& text) {
  return std::string(trimmed(text, std::string_view(" \t\r\n\0", 5)));
}

/// In which no character depends on the file's character set (PS3.5 6.1.2): of others the bytes say nothing.
bool is_plain(const std::string& text) {
  return std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; });
}

/// Elements of a DICOM file up to the patient's number (PS3.5 7.1, 7.5; PS3.10 7.1), in little endian and not
/// deflated, as nearly every one is. What is another, or damaged, says nothing.
class PatientReader {
 public:
  explicit PatientReader(const fs::path& file) : in_(file, std::ios::binary) {}

  std::string patient_id() {
    std::array<char, 132> begin{};
    if (!in_.read(begin.data(), begin.size()) || std::string_view(begin.data() + 128, 4) != "DICM") return {};
    std::string syntax;
    std::vector<bool> levels{
        true};  // whether VRs are written; the first is the file's, others those of sequences
    bool is_meta = true;
    for (int count = 0; count < kMostElements; ++count) {
      const auto at = in_.tellg();
      auto element = next(levels.back());
      if (!element) return {};
      if (is_meta && element->tag >> 16U != 2) {
        constexpr std::string_view kImplicit = "1.2.840.10008.1.2", kBigEndian = "1.2.840.10008.1.2.2";
        constexpr std::array<std::string_view, 3> kDeflated{
            "1.2.840.10008.1.2.1.99", "1.2.840.10008.1.2.4.95", "1.2.840.10008.1.2.4.205"};
        if (syntax == kBigEndian || std::ranges::find(kDeflated, syntax) != kDeflated.end()) return {};
        is_meta = false;
        levels.front() = syntax != kImplicit;
        in_.seekg(at);
        continue;
      }
      const bool is_outside = levels.size() == 1;
      if (element->tag == kSequenceEnd) {
        if (is_outside) return {};
        levels.pop_back();
      } else if (element->tag == kItem || element->tag == kItemEnd) {
        if (is_outside) return {};
      } else if (element->length == kUndefined) {
        if (levels.size() == kMostLevels) return {};
        levels.push_back(levels.back() && element->vr != "UN");  // PS3.5 6.2.2: implicit within UN
      } else if (is_outside && element->tag >= kPatientId) {
        return element->tag == kPatientId ? without_padding(text(element->length)) : "";
      } else if (is_meta && element->tag == kTransferSyntax) {
        syntax = without_padding(text(element->length));
      } else {
        in_.seekg(element->length, std::ios::cur);
      }
    }
    return {};
  }

 private:
  struct Element {
    std::uint32_t tag = 0, length = 0;
    std::string vr;  // "" where none is written
  };

  std::optional<Element> next(bool explicit_vr) {
    const auto group = number(2), element = number(2);
    if (!group || !element) return {};
    Element found{*group << 16U | *element, 0, ""};
    std::optional<std::uint32_t> length;
    if (!explicit_vr || *group == 0xFFFE) {
      length = number(4);
    } else {
      std::array<char, 2> vr{};
      if (!in_.read(vr.data(), vr.size())) return {};
      found.vr.assign(vr.data(), vr.size());
      constexpr std::array<std::string_view, 13> kLong{"OB", "OD", "OF", "OL", "OV", "OW", "SQ",
                                                       "SV", "UC", "UN", "UR", "UT", "UV"};
      const bool is_long = std::ranges::find(kLong, found.vr) != kLong.end();
      if (is_long && !number(2)) return {};
      length = number(is_long ? 4 : 2);
    }
    if (!length) return {};
    found.length = *length;
    return found;
  }

  std::optional<std::uint32_t> number(int bytes) {
    std::array<char, 4> read{};
    if (!in_.read(read.data(), bytes)) return {};
    std::uint32_t value = 0;
    for (int i = bytes; i-- > 0;)
      value = value << 8U | static_cast<unsigned char>(read.at(static_cast<std::size_t>(i)));
    return value;
  }

  std::string text(std::uint32_t length) {
    if (length > kLongestPlanPatient) return {};
    std::string read(length, '\0');
    if (!in_.read(read.data(), static_cast<std::streamsize>(length))) return {};
    return read;
  }

  std::ifstream in_;
};

}  // namespace

std::vector<std::string> patients_of_plan(const fs::path& seal) {
  std::vector<std::string> patients;
  std::error_code failed;
  if (!fs::is_regular_file(seal, failed) || fs::file_size(seal, failed) > kLargestSeal || failed) return {};
  std::ifstream in(seal, std::ios::binary);
  const auto document = parse_foreign_json(std::string(std::istreambuf_iterator<char>(in), {}));
  if (!document.is_object() || !document.contains("files") || !document["files"].is_array()) return {};
  std::size_t pictures = 0;
  for (const auto& file : document["files"]) {
    const auto text = [&](const char* key) {
      const auto found = file.is_object() ? file.find(key) : file.end();
      return found != file.end() && found->is_string() ? found->template get<std::string>() : std::string();
    };
    if (text("role") != "volume" || text("name").empty()) continue;
    if (++pictures > kMostPictures || patients.size() == kMostPlanPatients) break;
    const fs::path picture = seal.parent_path() / text("name");
    if (!fs::is_regular_file(picture, failed)) continue;
    const std::string patient = PatientReader(picture).patient_id();
    if (!patient.empty() && is_plain(patient) && std::ranges::find(patients, patient) == patients.end())
      patients.push_back(patient);
  }
  return patients;
}

}  // namespace kiroku::recorder
