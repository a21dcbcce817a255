#include "recorder/device_key/boot_approval.h"

#include <algorithm>
#include <charconv>
#include <fstream>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/encoding.h"

namespace kiroku::recorder {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kStateKind = "kiroku-boot-state";
constexpr const char* kApprovalKind = "kiroku-boot-approval";
constexpr const char* kSuffix = ".approval";
constexpr std::size_t kLargestFile = 64U << 10;
/// Far more than states that a machine has in its life; what is more is told of.
constexpr std::size_t kMostFiles = 1000;
constexpr std::size_t kNameDigits = 16;

ordered_json written_pcrs(const std::vector<crypto::PcrValue>& pcrs) {
  ordered_json written = ordered_json::array();
  for (const crypto::PcrValue& each : pcrs)
    written.push_back(std::to_string(each.index) + ":" + crypto::to_hex(each.value));
  return written;
}

/// Fields of a file of one kind; throws with `what` the file shall be.
class Fields {
 public:
  Fields(std::string_view json, const char* kind, std::string what)
      : read_(ordered_json::parse(json, nullptr, false)), what_(std::move(what)) {
    if (!read_.is_object()) throw refusal("it is no JSON object; it may have been cut off");
    if (text("kind") != kind) throw refusal("its \"kind\" is not " + std::string(kind));
  }
  [[nodiscard]] Error refusal(const std::string& why) const {
    return Error("it is no " + what_ + ": " + why);
  }
  [[nodiscard]] std::string text(const char* field) const {
    if (!read_.contains(field) || !read_.at(field).is_string())
      throw refusal(std::string("it has no text \"") + field + "\"");
    return read_.at(field).get<std::string>();
  }
  [[nodiscard]] Bytes base64(const char* field) const {
    auto bytes = crypto::from_base64(text(field), crypto::Base64Padding::kPadded);
    if (!bytes) throw refusal(std::string("its \"") + field + "\" is no base64");
    return std::move(*bytes);
  }
  [[nodiscard]] crypto::Sha256Digest digest(const char* field) const {
    return digest_of(text(field), std::string("its \"") + field + "\"");
  }
  [[nodiscard]] std::vector<crypto::PcrValue> pcrs() const {
    if (!read_.contains("pcrs") || !read_.at("pcrs").is_array() || read_.at("pcrs").empty())
      throw refusal("it has no list \"pcrs\"");
    std::vector<crypto::PcrValue> pcrs;
    for (const ordered_json& each : read_.at("pcrs")) {
      const std::string one = each.is_string() ? each.get<std::string>() : std::string();
      const std::size_t colon = one.find(':');
      crypto::PcrValue value;
      if (colon == std::string::npos || colon == 0)
        throw refusal("a register is not written as NUMBER:VALUE");
      const auto [end, failed] = std::from_chars(one.data(), one.data() + colon, value.index);
      const bool follows = pcrs.empty() || pcrs.back().index < value.index;
      if (failed != std::errc() || end != one.data() + colon || value.index >= crypto::kPcrs || !follows)
        throw refusal("its registers are not numbers of 0 to 23 in ascending order");
      value.value = digest_of(one.substr(colon + 1), "the value of register " + std::to_string(value.index));
      pcrs.push_back(value);
    }
    return pcrs;
  }

 private:
  [[nodiscard]] crypto::Sha256Digest digest_of(const std::string& hex, const std::string& what) const {
    const auto bytes = crypto::from_hex(hex);
    crypto::Sha256Digest digest{};
    if (!bytes || bytes->size() != digest.size()) throw refusal(what + " is not 64 hex digits");
    std::copy(bytes->begin(), bytes->end(), digest.begin());
    return digest;
  }
  ordered_json read_;
  std::string what_;
};

std::vector<unsigned> indices_of(const std::vector<crypto::PcrValue>& pcrs) {
  std::vector<unsigned> indices;
  for (const crypto::PcrValue& each : pcrs) indices.push_back(each.index);
  return indices;
}

/// A regular file's text; kiroku::Error for anything else: a pipe would be waited for.
std::string text_of_file(const fs::path& file) {
  std::error_code failed;
  if (!fs::is_regular_file(file, failed)) throw Error("it is no regular file");
  std::ifstream in(file, std::ios::binary);
  std::string text(kLargestFile + 1, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!in.is_open() || in.bad()) throw Error("it cannot be read");
  text.resize(static_cast<std::size_t>(in.gcount()));
  if (text.size() > kLargestFile) throw Error("it is larger than 64 KiB");
  return text;
}

}  // namespace

std::string BootState::to_json() const {
  const ordered_json written{
      {"kind", kStateKind},
      {"device", device},
      {"approval_key", crypto::to_base64(seal.approver, crypto::Base64Padding::kPadded)},
      {"tag", crypto::to_hex(seal.tag)},
      {"pcrs", written_pcrs(pcrs)}};
  return written.dump(2) + "\n";
}

BootState BootState::parse(std::string_view json) {
  const Fields fields(json, kStateKind, "state of a boot");
  BootState state{
      fields.text("device"), {fields.base64("approval_key"), {}, fields.digest("tag")}, fields.pcrs()};
  if (!crypto::is_p256_public_key(state.seal.approver))
    throw fields.refusal("its \"approval_key\" is no key on P-256");
  state.seal.pcrs = indices_of(state.pcrs);
  return state;
}

std::string BootApproval::to_json() const {
  const ordered_json written{{"kind", kApprovalKind},
                             {"tag", crypto::to_hex(tag)},
                             {"pcrs", written_pcrs(pcrs)},
                             {"signature", crypto::to_base64(signature, crypto::Base64Padding::kPadded)}};
  return written.dump(2) + "\n";
}

BootApproval BootApproval::parse(std::string_view json) {
  const Fields fields(json, kApprovalKind, "approval of a boot");
  return {fields.digest("tag"), fields.pcrs(), fields.base64("signature")};
}

BootApproval approve(const BootState& state, const crypto::ApprovalKey& key) {
  if (key.public_key() != state.seal.approver) {
    throw Error("the device " + state.device +
                " is sealed to another approval key: its TPM would not take what this one signs");
  }
  return {state.seal.tag, state.pcrs, key.sign(crypto::approval_message(state.seal, state.pcrs))};
}

std::string why_no_approval(const BootApproval& approval, const crypto::BootSeal& seal) {
  if (approval.tag != seal.tag) return "it is for the key of another device";
  if (indices_of(approval.pcrs) != seal.pcrs) {
    return "it is of the registers " + crypto::pcr_list(indices_of(approval.pcrs)) +
           ", and the key is sealed to " + crypto::pcr_list(seal.pcrs);
  }
  if (!crypto::verify_ecdsa_p256(seal.approver, crypto::approval_message(seal, approval.pcrs),
                                 approval.signature)) {
    return "its signature is not by the approval key to which this device is sealed, or it was changed";
  }
  return "";
}

std::string approval_file_name(const BootApproval& approval) {
  return crypto::to_hex(crypto::state_policy(approval.pcrs)).substr(0, kNameDigits) + kSuffix;
}

BootApprovals read_approvals(const fs::path& folder, const crypto::BootSeal& seal) {
  BootApprovals read;
  std::error_code failed;
  std::vector<fs::path> files;
  for (fs::directory_iterator at(folder, failed), end; !failed && at != end; at.increment(failed)) {
    if (at->path().extension() == kSuffix) files.push_back(at->path());
    if (files.size() > kMostFiles) break;
  }
  if (failed && failed != std::errc::no_such_file_or_directory)
    read.problems.push_back(folder.string() + " cannot be read: " + failed.message());
  if (files.size() > kMostFiles) {
    files.resize(kMostFiles);
    read.problems.push_back(folder.string() + " holds more than " + std::to_string(kMostFiles) +
                            " approvals, and the others are not looked at: remove those of former states");
  }
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    std::string why;
    try {
      BootApproval approval = BootApproval::parse(text_of_file(file));
      why = why_no_approval(approval, seal);
      if (why.empty()) read.counting.push_back(std::move(approval));
    } catch (const Error& error) {
      why = error.what();
    }
    if (!why.empty()) read.problems.push_back(file.string() + " does not count: " + why);
  }
  return read;
}

std::optional<std::vector<unsigned>> differing_registers(const std::vector<crypto::PcrValue>& state,
                                                         const std::vector<BootApproval>& approvals) {
  std::optional<std::vector<unsigned>> fewest;
  for (const BootApproval& approval : approvals) {
    std::vector<unsigned> differing;
    for (const crypto::PcrValue& each : state) {
      if (std::find(approval.pcrs.begin(), approval.pcrs.end(), each) == approval.pcrs.end())
        differing.push_back(each.index);
    }
    if (!fewest || differing.size() < fewest->size()) fewest = std::move(differing);
  }
  return fewest;
}

}  // namespace kiroku::recorder
