// Copies packets from one container to another, never touching a picture. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "media/media_ticks.h"
#include "media/output_io.h"
#include "media/segment_input.h"

namespace kiroku::media {

enum class Container { kMatroska, kMp4 };

/// Time stamps are moved by what the caller says, and stand in the file as they are then: nothing is shifted
/// so that the file begins with zero, gaps are kept. Sound before zero is left out. The same packets give the
/// same bytes: nothing of the day, the machine or chance is written.
class Remuxer {
 public:
  /// `output` must outlive the object; `name` stands in errors. `on_picture`, where there is one, hears when
  /// each picture is shown.
  Remuxer(OutputBytes& output, Container container, std::string name,
          std::function<void(Ticks time)> on_picture);
  Remuxer(const Remuxer&) = delete;
  Remuxer& operator=(const Remuxer&) = delete;

  /// What an input holds that cannot be joined to those before, as a sentence without an end: "" where it
  /// can.
  [[nodiscard]] std::string change(SegmentInput& input) const;
  /// Copies all packets, their time stamps moved by `shift`. The first input decides the streams; later ones
  /// must hold the same (change()), with time stamps that go on. Throws kiroku::Error: a codec that the
  /// container cannot hold. `tolerate_cut`: media that ends in mid-packet is copied up to there.
  void copy(SegmentInput& input, Ticks shift, bool tolerate_cut = false);
  /// Writes what stands at the end of the container.
  void finish();
  /// Pictures copied.
  [[nodiscard]] std::uint64_t frames() const { return frames_; }

 private:
  void open(SegmentInput& input);
  void check(int result, const std::string& what) const;
  /// Whether a stream of the output had a packet of this time stamp, or a later one.
  [[nodiscard]] bool goes_back(int stream, std::int64_t stamp) const;

  std::string name_;
  Container container_;
  OutputIo io_;
  OutputContext context_;
  std::function<void(Ticks time)> on_picture_;
  std::uint64_t frames_ = 0;
  std::map<int, std::int64_t> latest_;  // time stamps of packets, by stream of the output
};

}  // namespace kiroku::media
