// Records of PhysioNet's WFDB (header(5), signal(5)): a text header and the signal files that it names.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "crypto/byte_source.h"
#include "recorder/vitals/assumed_zone.h"
#include "recorder/vitals/signal_file.h"

namespace kiroku::recorder {

/// Formats 16, 24, 32, 61, 80 and 212, several values of a signal in a frame, skew between signals, a
/// prologue to be passed over. A second or so is a block. What does not agree with the header (length,
/// checksum) is said in a notice at the end. Refused by name: other formats, records of several segments,
/// files outside of the record's folder.
class WfdbReader : public SignalReader {
 public:
  using OpenFile = std::function<std::unique_ptr<crypto::ByteSource>(const std::string& name)>;
  /// `name` stands in lines and errors; `zone` is that of the header's time; `open` is called for each signal
  /// file, with a plain name.
  WfdbReader(const crypto::ByteSource& header, std::string name, const AssumedZone& zone,
             const OpenFile& open);
  bool read_block(std::vector<VitalLine>& lines) override;

 private:
  struct Signal {
    VitalSample like;  // code, unit and source of its samples
    Scaling scaling;
    std::size_t per_frame = 1, skew = 0, offset = 0;  // values; frames; values from a frame's beginning
    std::optional<std::int64_t> checksum;
    std::uint16_t sum = 0;
  };
  struct File {
    std::string name;
    int format = 0;
    std::unique_ptr<crypto::ByteSource> bytes;
    std::uint64_t prologue = 0, frames = 0;
    std::size_t per_frame = 0, longest_skew = 0;
    std::vector<Signal> signals;
  };

  [[noreturn]] void fail(const std::string& what) const;
  void notice(const std::string& name, const std::string& text);
  void read_header(std::string_view text, const OpenFile& open);
  void read_record_line(const std::vector<std::string_view>& words);
  void read_signal_line(const std::string& line, const std::vector<std::string_view>& words,
                        const OpenFile& open);
  void finish_file(File& file);
  [[nodiscard]] std::vector<std::int32_t> read_values(const File& file, std::uint64_t begin,
                                                      std::uint64_t end) const;
  void read_file(File& file, std::uint64_t begin, std::uint64_t end, std::vector<VitalLine>& lines);
  void check_sums();

  std::string name_;
  AssumedZone zone_;
  double frames_a_second_ = 250;
  std::size_t signals_stated_ = 0, signals_read_ = 0;
  std::optional<std::uint64_t> frames_stated_;
  std::optional<UtcTime> start_;
  std::uint64_t frames_ = 0, next_frame_ = 0;
  std::vector<File> files_;
  std::vector<VitalLine> pending_;
  bool checked_ = false;
};

}  // namespace kiroku::recorder
