// Recordings of Vital Recorder (VitalDB, `.vital`): gzip around a stream of packets, as its format document
// lays it out.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "crypto/byte_source.h"
#include "recorder/vitals/signal_file.h"

namespace kiroku::recorder {

/// Tracks of numbers, waveforms and texts, each from its device (the source of its lines: "FILE/DEVICE"). The
/// packets of a file need not be in order of time: all of it is read and sorted first, at most kMostBytes
/// unpacked. A file that ends within a packet, or whose compression is damaged, is read up to there, with a
/// notice. Refused by name: what is no such file, or too large.
class VitalFileReader : public SignalReader {
 public:
  static constexpr std::size_t kMostBytes = 512U << 20;

  VitalFileReader(const crypto::ByteSource& file, std::string name);
  bool read_block(std::vector<VitalLine>& lines) override;

 private:
  enum class Kind : std::uint8_t { kWave = 1, kNumber = 2, kText = 5 };
  struct Track {
    Kind kind = Kind::kNumber;
    int format = 0;
    double rate_hz = 0, gain = 1, offset = 0;
    std::string code, unit, source;
    std::uint32_t mdc = 0;
  };
  struct Record {
    std::int64_t end_us = 0;                      // since 1970
    std::size_t track = 0, begin = 0, count = 0;  // of tracks_; of bytes_; values (of a text: bytes)
  };
  class Cursor;

  [[noreturn]] void fail(const std::string& what) const;
  void notice(const std::string& name, const std::string& text);
  void unpack(const crypto::ByteSource& file);
  void read_packets();
  void read_device(Cursor packet);
  void read_track(Cursor packet);
  void read_record(Cursor packet, std::size_t begin);
  void add_wave(const Track& track, std::size_t index, double start_s, std::size_t begin, std::size_t count);
  [[nodiscard]] double value_at(const Track& track, std::size_t at) const;
  [[nodiscard]] VitalLine line_of(const Record& record) const;

  std::string name_;
  std::string bytes_;  // unpacked
  std::map<std::uint32_t, std::string> devices_;
  std::map<std::uint16_t, std::size_t> by_id_;
  std::map<std::pair<std::string, std::string>, std::string> names_;  // source and code to the track's name
  std::vector<Track> tracks_;
  std::vector<Record> records_;
  std::uint64_t left_out_ = 0;
  std::size_t next_ = 0;
  std::vector<VitalLine> pending_;
};

}  // namespace kiroku::recorder
