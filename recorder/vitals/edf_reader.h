// European Data Format: EDF (Kemp 1992) and EDF+ (Kemp and Olivan 2003), continuous (EDF+C) and not (EDF+D).
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "crypto/byte_source.h"
#include "recorder/vitals/assumed_zone.h"
#include "recorder/vitals/signal_file.h"

namespace kiroku::recorder {

/// A record is a block: of every signal its values, in pieces of a second; annotations as texts of the code
/// KIROKU_ANNOTATION. A file that is shorter or longer than its header says is read as far as it goes, with a
/// notice. Refused by name: BDF, a header that is none, records longer than 16 MiB.
class EdfReader : public SignalReader {
 public:
  /// `name` stands in lines and errors; `zone` is that of the start in the header.
  EdfReader(std::unique_ptr<crypto::ByteSource> file, std::string name, const AssumedZone& zone);
  bool read_block(std::vector<VitalLine>& lines) override;
  /// The hospital's code of EDF+; EDF says nothing in a way that could be compared.
  [[nodiscard]] std::vector<PatientNumber> patient() const override;

 private:
  struct Signal {
    std::string label, dimension, digital_minimum, digital_maximum, physical_minimum, physical_maximum;
    VitalSample like;  // code, unit and source of its samples
    Scaling scaling;
    std::size_t values = 0, offset = 0;  // in a record; bytes from its beginning
    bool annotations = false;
  };

  [[noreturn]] void fail(const std::string& what) const;
  void notice(const std::string& name, const std::string& text);
  void read_header();
  void read_signals(std::string_view header);
  void finish_signal(Signal& signal);
  void read_annotations(std::string_view bytes, bool first_signal, std::vector<VitalLine>& texts);
  void read_values(const Signal& signal, std::vector<VitalLine>& lines);
  [[nodiscard]] std::optional<UtcTime> device_time(std::int64_t time_ns) const;

  std::unique_ptr<crypto::ByteSource> file_;
  std::string name_;
  AssumedZone zone_;
  std::string patient_;
  std::optional<UtcTime> start_;
  std::vector<Signal> signals_;
  std::vector<VitalLine> pending_;  // notices that stand before the next block
  bool discontinuous_ = false;
  double record_s_ = 0;
  std::uint64_t header_bytes_ = 0, record_bytes_ = 0, records_ = 0, next_record_ = 0;
  std::optional<double> zero_s_;  // of EDF+: onset of the first record
  double record_start_s_ = 0;     // of the record being read, from the first
  std::string record_;
};

}  // namespace kiroku::recorder
