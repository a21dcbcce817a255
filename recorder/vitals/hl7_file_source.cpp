#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

#include "base/error.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/block_source.h"
#include "recorder/vitals/hl7_vitals.h"
#include "recorder/vitals/mllp_address.h"
#include "recorder/vitals/mllp_source.h"

namespace kiroku::recorder {
namespace {

constexpr std::uintmax_t kLongestFile = 1U << 30;
constexpr std::int64_t kLongestRecordingUs = std::int64_t{100} * 24 * 3600 * 1'000'000;

std::string read_file(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) {
    throw IoError("open", path, error.value());
  }
  if (size > kLongestFile) {
    throw Error("cannot read " + path + ": it is longer than 1 GiB; split it");
  }
  std::ifstream input(path, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(input)), std::istreambuf_iterator<char>());
  if (!input || bytes.size() != size) {
    throw IoError("read", path, errno);
  }
  return bytes;
}

class Hl7FileSource : public BlockSource {
 public:
  explicit Hl7FileSource(const SourceAddress& address)
      : zone_(parse_assumed_zone(address.option("zone", "local"), address.stated)),
        bytes_(read_file(address.location)),
        messages_(split_hl7_messages(bytes_)),
        vitals_(zone_, {}, hl7_places(address)) {
    address.require_options("speed,zone,locations");
    const bool any = std::ranges::any_of(
        messages_, [](std::string_view message) { return parse_hl7_message(message).message != nullptr; });
    if (!any) {
      throw Error("cannot read " + address.location + ": it holds no HL7 message" +
                  (messages_.empty() ? "" : " (" + parse_hl7_message(messages_.front()).problem + ")"));
    }
  }

  [[nodiscard]] std::uint64_t elsewhere() const override { return vitals_.elsewhere(); }
  void hear_patients(std::shared_ptr<PatientWatch> watch) override {
    vitals_.hear_patients(std::move(watch));
  }

 private:
  bool read_block(std::vector<VitalLine>& lines) override {
    if (next_message_ == messages_.size()) {
      return false;
    }
    const std::string_view message = messages_[next_message_++];
    Hl7Vitals::Taken taken = vitals_.take(message, time_of(message), utc_now(), "");
    for (VitalLine& line : taken.lines) {
      if (auto* const kept = std::get_if<media::DeviceMessage>(&line)) {
        kept->answer.clear();  // nobody is there to hear it
      }
    }
    lines = std::move(taken.lines);
    return true;
  }

  std::int64_t time_of(std::string_view message) {
    const Hl7Parse parsed = parse_hl7_message(message);
    const auto time =
        parsed.message ? parse_hl7_time(parsed.message->header().field(7).component(1).text()) : std::nullopt;
    if (time && time->is_instant()) {
      const UtcTime utc = time->utc(zone_);
      if (!first_) {
        first_ = utc;
      }
      const std::int64_t elapsed_us = (utc - *first_).count();
      if (elapsed_us <= kLongestRecordingUs) {
        last_ns_ = std::max(last_ns_, elapsed_us * 1000);
      }
    }
    return last_ns_;
  }

  AssumedZone zone_;
  std::string bytes_;
  std::vector<std::string_view> messages_;  // of bytes_
  std::size_t next_message_ = 0;
  Hl7Vitals vitals_;
  std::optional<UtcTime> first_;
  std::int64_t last_ns_ = 0;
};

}  // namespace

std::unique_ptr<VitalSource> open_hl7_file_source(const SourceAddress& address) {
  return std::make_unique<Hl7FileSource>(address);
}

}  // namespace kiroku::recorder
